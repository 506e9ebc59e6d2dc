#include "engine/contacts/ghosts.hpp"

#include <algorithm>
#include <cstring>

#include "engine/contacts/ghost_rule.hpp"
#include "engine/particles/parcel.hpp"

namespace moraine {

namespace {

std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

}  // namespace

Ghosts::Link& Ghosts::link_with(int rank) {
  const auto found =
      std::lower_bound(links_.begin(), links_.end(), rank, [](const Link& link, int r) { return link.rank < r; });
  if (found != links_.end() && found->rank == rank) return *found;
  Link link;
  link.rank = rank;
  return *links_.insert(found, std::move(link));
}

void Ghosts::make(const World& world, const Subdomains& subdomains, Particles& particles, const SizeClasses& classes,
                  const SizeGrids& grids, double skin) {
  links_.clear();
  copies_.clear();
  are_fresh_ = true;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    periodic_[axis] = subdomains.is_periodic(static_cast<int>(axis));
    period_[static_cast<int>(axis)] = subdomains.period()[static_cast<int>(axis)];
  }
  records_ = HaloRecords(particles, periodic_, period_);

  const int rank = world.rank();
  const double largest = classes.largest();
  const std::vector<Subdomains::Near> near = subdomains.near(rank, ghost_reach(largest, largest, skin));
  for (std::int32_t i = 0; i < particles.size(); ++i) {
    const double radius = particles.radius(i);
    for_each_needing(subdomains, rank, near, particles.position(i),
                     ghost_reach(radius, classes.limit(classes.of(radius)), skin),
                     [&](int other) { link_with(other).sent.push_back(i); });
  }
  std::vector<std::vector<Parcel>> rounds;
  rounds.push_back(send_new(world, particles, true));
  receive(particles, rounds);
  find_copies(subdomains, rank, particles, largest, skin);
  if (classes.size() > 1) {
    add_smaller(particles, classes, grids, skin);
    rounds.push_back(send_new(world, particles, false));
    receive(particles, rounds);
    find_copies(subdomains, rank, particles, largest, skin);
  }

  open_messages(world, subdomains, near);
}

/// Ranks whose boxes share a face always hear of each other, so that news comes to all.
void Ghosts::open_messages(const World& world, const Subdomains& subdomains, std::span<const Subdomains::Near> near) {
  for (const int other : subdomains.linked(world.rank())) link_with(other).is_kept = true;
  std::vector<Halo::Link> messages;
  const auto bytes = [&](std::size_t n_grains) { return sizeof(HaloNews) + n_grains * records_.bytes(); };
  for (const Link& link : links_)
    messages.push_back(
        {link.rank, sends(link) ? bytes(link.sent.size()) : 0, receives(link) ? bytes(at(link.n_ghosts)) : 0});
  halo_.open(world, std::move(messages));
  heard_ = {std::numeric_limits<std::uint64_t>::max(), 0.0, heard_.max_speed};  // all lists are new
  hears_all_near_ = std::all_of(near.begin(), near.end(), [&](const Subdomains::Near& other) {
    const auto link = std::find_if(links_.begin(), links_.end(), [&](const Link& l) { return l.rank == other.part; });
    return link != links_.end() && receives(*link);
  });
}

/// Sends the grains that others need, first or besides, and returns those that come.
std::vector<Parcel> Ghosts::send_new(const World& world, const Particles& particles, bool is_first) const {
  std::vector<Parcel> parcels;
  for (const Link& link : links_) {
    const std::size_t begin = is_first ? 0 : link.n_first;
    if (begin == link.sent.size()) continue;
    ParcelWriter parcel;
    parcel.put(static_cast<std::uint64_t>(link.sent.size() - begin));
    for (std::size_t k = begin; k < link.sent.size(); ++k) put_grain(particles, link.sent[k], true, parcel);
    parcels.push_back({link.rank, parcel.take()});
  }
  return world.exchange(std::move(parcels));
}

/// Puts what has come in all rounds so far behind the grains: of each rank what came first, and then the rest.
void Ghosts::receive(Particles& particles, std::span<const std::vector<Parcel>> rounds) {
  for (Link& link : links_) link.n_ghosts = 0;
  for (const std::vector<Parcel>& round : rounds)
    for (const Parcel& parcel : round)
      link_with(parcel.rank).n_ghosts += static_cast<std::int32_t>(ParcelReader(parcel.bytes).get<std::uint64_t>());
  std::int32_t n_ghosts = 0;
  for (Link& link : links_) {
    link.first_ghost = particles.size() + n_ghosts;
    n_ghosts += link.n_ghosts;
  }
  particles.set_ghosts(n_ghosts);
  std::vector<std::int32_t> next;
  for (const Link& link : links_) next.push_back(link.first_ghost);
  for (const std::vector<Parcel>& round : rounds)
    for (const Parcel& parcel : round) {
      const auto link = static_cast<std::size_t>(&link_with(parcel.rank) - links_.data());
      ParcelReader reader(parcel.bytes);
      for (auto n = reader.get<std::uint64_t>(); n > 0; --n) get_grain(reader, true, particles, next[link]++);
    }
}

/// Finds the grains that are smaller than a ghost, and a pair with it: its owner needs them.
void Ghosts::add_smaller(const Particles& particles, const SizeClasses& classes, const SizeGrids& grids, double skin) {
  for (Link& link : links_) link.n_first = link.sent.size();
  SizeGrids::Scratch scratch;
  for (const GhostCopy& copy : copies_) {
    const auto link = std::upper_bound(links_.begin(), links_.end(), copy.ghost,
                                       [](std::int32_t ghost, const Link& l) { return ghost < l.first_ghost; }) -
                      1;
    const double radius = particles.radius(copy.ghost);
    grids.for_each_near(copy.position, (radius + skin) * (1.0 + 1e-12), classes.of(radius), scratch,
                        [&](std::int32_t j, std::uint8_t) { link->sent.push_back(j); });
  }
  for (Link& link : links_) {
    const auto first_end = link.sent.begin() + static_cast<std::ptrdiff_t>(link.n_first);
    std::sort(first_end, link.sent.end());
    const auto is_known = [&](std::int32_t i) { return std::binary_search(link.sent.begin(), first_end, i); };
    link.sent.erase(std::unique(first_end, link.sent.end()), link.sent.end());
    link.sent.erase(std::remove_if(first_end, link.sent.end(), is_known), link.sent.end());
  }
}

void Ghosts::find_copies(const Subdomains& subdomains, int rank, const Particles& particles, double largest_radius,
                         double skin) {
  copies_.clear();
  std::array<int, 3> most{};
  for (int axis = 0; axis < 3; ++axis) most[at(axis)] = periodic_[at(axis)] && !subdomains.spans(rank, axis) ? 1 : 0;
  const Box& own = subdomains.box(rank);
  for (std::int32_t g = particles.size(); g < particles.dummy(); ++g) {
    const double reach = ghost_reach(particles.radius(g), largest_radius, skin);
    for (int x = -most[0]; x <= most[0]; ++x)
      for (int y = -most[1]; y <= most[1]; ++y)
        for (int z = -most[2]; z <= most[2]; ++z) {
          Vec3 position = particles.position(g);
          const std::array<int, 3> steps = {x, y, z};
          for (int axis = 0; axis < 3; ++axis)
            if (steps[at(axis)] != 0) position[axis] += steps[at(axis)] * period_[axis];
          if (squared_distance(position, own) < reach * reach) copies_.push_back({g, image::code(x, y, z), position});
        }
  }
}

void Ghosts::start_refresh(const Particles& particles) {
  for (std::size_t k = 0; k < links_.size(); ++k) {
    if (!sends(links_[k])) continue;
    std::byte* const to = halo_.outgoing(k).data();
    std::memcpy(to, &own_, sizeof own_);
    records_.pack(particles, links_[k].sent, to + sizeof own_);
  }
  halo_.start();
}

std::span<const GhostEvent> Ghosts::finish_refresh(Particles& particles) {
  halo_.finish();
  events_.clear();
  heard_ = {};
  // Links are in order of rank, and so are the places of their ghosts.
  for (std::size_t k = 0; k < links_.size(); ++k) {
    if (!receives(links_[k])) continue;
    const std::byte* const from = halo_.incoming(k).data();
    HaloNews news;
    std::memcpy(&news, from, sizeof news);
    heard_.next_look = std::min(heard_.next_look, news.next_look);
    heard_.travelled = std::max(heard_.travelled, news.travelled);
    heard_.max_speed = std::max(heard_.max_speed, news.max_speed);
    records_.unpack(from + sizeof news, links_[k].first_ghost, links_[k].n_ghosts, particles, events_);
  }
  own_.next_look = std::min(own_.next_look, heard_.next_look);
  are_fresh_ = true;
  return events_;
}

HaloCounts Ghosts::counts() const {
  HaloCounts counts;
  for (const Link& link : links_) {
    counts.n_ghosts += at(link.n_ghosts);
    counts.n_sent += link.sent.size();
    const bool sends_grains = !link.sent.empty(), receives_grains = link.n_ghosts > 0;
    counts.n_neighbours += sends_grains || receives_grains ? 1 : 0;
    counts.n_messages += sends_grains ? 1 : 0;
    counts.n_received += receives_grains ? 1 : 0;
    counts.n_news += (sends(link) && !sends_grains ? 1 : 0) + (receives(link) && !receives_grains ? 1 : 0);
    counts.n_bytes += link.sent.size() * records_.bytes();
  }
  return counts;
}

std::size_t Ghosts::memory() const {
  std::size_t bytes = copies_.capacity() * sizeof(GhostCopy);
  for (const Link& link : links_)
    bytes += link.sent.capacity() * sizeof(std::int32_t) + (link.sent.size() + at(link.n_ghosts)) * records_.bytes();
  return bytes;
}

}  // namespace moraine
