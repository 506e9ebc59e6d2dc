#include "engine/contacts/wall_contacts.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <utility>

#include "engine/threads.hpp"

namespace moraine {

namespace {

/// Touches of one mesh go on as the same contact while their normals stay this near.
constexpr double same_contact_cosine = 0.7;

std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

void turn(const Pose& pose, double (&v)[3]) {
  const Vec3 turned = pose.turn({v[0], v[1], v[2]});
  for (int axis = 0; axis < 3; ++axis) v[axis] = turned[axis];
}

void turn_back(const Pose& pose, double (&v)[3]) {
  const Vec3 home = pose.turn_back({v[0], v[1], v[2]});
  for (int axis = 0; axis < 3; ++axis) v[axis] = home[axis];
}

/// Walls that move are looked for further away, so that they may come nearer by half a skin before the next search, while grains use up
/// theirs.
double reach_of(const Walls& walls, double skin) { return walls.is_any_moving() ? 1.5 * skin : skin; }

/// Places of memory that a candidate may need.
std::int64_t capacity_of(const WallCandidate& c) {
  return c.n_triangles == 0 ? 1 : std::min(c.n_triangles, max_touches);
}

}  // namespace

PairMemory WallContacts::Memory::at(std::size_t slot) const {
  const Place& place = places[slot];
  return {{place.displacement[0], place.displacement[1], place.displacement[2]},
          place.energy,
          further.empty() ? FurtherMemory{} : further[slot]};
}

void WallContacts::Memory::set(std::size_t slot, const WallMemory& memory) {
  const PairMemory& m = memory.memory;
  places[slot] = {{m.displacement[0], m.displacement[1], m.displacement[2]}, m.energy, memory.normal};
  if (!further.empty()) further[slot] = m.further;
}

WallContacts::WallContacts(const Walls& walls, const Domain& domain, const MemoryColumns& columns, bool has_further,
                           int slot_size, double reach)
    : walls_(&walls),
      domain_(domain),
      columns_(columns),
      has_further_(has_further),
      slot_size_(slot_size),
      reach_(reach) {}

/// A grain that crosses a periodic face before the next rebuild comes to the walls on the other side: what it may touch there is
/// added to its candidates.
void WallContacts::find_across_faces(const Particles& particles, std::int32_t begin, std::int32_t end, double skin,
                                     double time, WallCandidates& found) const {
  if (!domain_.periodic[0] && !domain_.periodic[1] && !domain_.periodic[2]) return;
  const Box box = domain_.box();
  std::vector<std::int32_t> grains;
  std::vector<double> seen;  // position and radius of each, brought over the face
  for (std::int32_t i = begin; i < end; ++i) {
    std::array<int, 3> most{};  // periods by which it may be brought back
    for (int axis = 0; axis < 3; ++axis) {
      if (!domain_.periodic[at(axis)]) continue;
      const double x = particles.position(i)[axis];
      most[at(axis)] = x - box.low[axis] < skin ? 1 : box.high[axis] - x < skin ? -1 : 0;
    }
    if (most == std::array<int, 3>{}) continue;
    for (int choice = 1; choice < 8; ++choice) {
      Vec3 position = particles.position(i);
      bool is_possible = true;
      for (int axis = 0; axis < 3; ++axis) {
        if (!(choice >> axis & 1)) continue;
        is_possible = is_possible && most[at(axis)] != 0;
        position[axis] += most[at(axis)] * (box.high[axis] - box.low[axis]);
      }
      if (!is_possible) continue;
      grains.push_back(i);
      seen.insert(seen.end(), {position.x, position.y, position.z, particles.radius(i)});
    }
  }
  if (grains.empty()) return;
  WallCandidates beyond;
  walls_->find_candidates(seen.data(), 4, 0, static_cast<std::int32_t>(grains.size()), skin + reach_, time, beyond);
  if (beyond.list.empty()) return;
  // Triangles that a grain may touch on this side and beyond become one list.
  for (WallCandidate& candidate : beyond.list) {
    candidate.grain = grains[at(candidate.grain)];
    candidate.triangles += static_cast<std::int32_t>(found.triangles.size());
  }
  found.triangles.insert(found.triangles.end(), beyond.triangles.begin(), beyond.triangles.end());
  std::vector<WallCandidate> all = std::move(found.list);
  all.insert(all.end(), beyond.list.begin(), beyond.list.end());
  std::stable_sort(all.begin(), all.end(), [](const WallCandidate& x, const WallCandidate& y) {
    return std::pair(x.grain, x.surface) < std::pair(y.grain, y.surface);
  });
  found.list.clear();
  for (const WallCandidate& candidate : all) {
    WallCandidate* const last = found.list.empty() ? nullptr : &found.list.back();
    if (!last || last->grain != candidate.grain || last->surface != candidate.surface) {
      found.list.push_back(candidate);
      continue;
    }
    std::vector<std::int32_t> both(found.triangles.begin() + last->triangles,
                                   found.triangles.begin() + last->triangles + last->n_triangles);
    both.insert(both.end(), found.triangles.begin() + candidate.triangles,
                found.triangles.begin() + candidate.triangles + candidate.n_triangles);
    std::sort(both.begin(), both.end());
    both.erase(std::unique(both.begin(), both.end()), both.end());
    last->triangles = static_cast<std::int32_t>(found.triangles.size());
    last->n_triangles = static_cast<std::int32_t>(both.size());
    found.triangles.insert(found.triangles.end(), both.begin(), both.end());
  }
}

void WallContacts::build(const Particles& particles, const PairList& pairs, double skin, double time,
                         std::span<const std::int32_t> was_at, const WallCarry& carry, int n_threads) {
  const std::vector<ThreadPairs>& threads = pairs.threads();
  shares_.resize(threads.size());
  if (empty()) {
    for (std::size_t t = 0; t < threads.size(); ++t) shares_[t].tile_begin.assign(threads[t].tiles.size() + 1, 0);
    return;
  }
  parallel(std::min(n_threads, static_cast<int>(threads.size())), [&](int thread) {
    const ThreadPairs& mine = threads[index(thread)];
    Share& share = shares_[index(thread)];
    WallCandidates found;
    const double wide = reach_of(*walls_, skin);
    walls_->find_candidates(particles.records(), particles.stride(), mine.grain_begin, mine.grain_end, wide + reach_,
                            time, found);
    find_across_faces(particles, mine.grain_begin, mine.grain_end, wide, time, found);
    share.list.clear();
    share.tile_begin.clear();
    std::vector<WallCandidate> deferred;
    auto candidate = found.list.begin();
    auto next_deferred = mine.deferred.begin();
    for (const Tile& tile : mine.tiles) {
      share.tile_begin.push_back(static_cast<std::int64_t>(share.list.size()));
      for (; candidate != found.list.end() && candidate->grain < tile.grain_end; ++candidate) {
        while (next_deferred != mine.deferred.end() && *next_deferred < candidate->grain) ++next_deferred;
        const bool is_deferred = next_deferred != mine.deferred.end() && *next_deferred == candidate->grain;
        (is_deferred ? deferred : share.list).push_back(*candidate);
      }
    }
    share.tile_begin.push_back(static_cast<std::int64_t>(share.list.size()));
    share.list.insert(share.list.end(), deferred.begin(), deferred.end());
    share.triangles = std::move(found.triangles);
    share.slot_begin.assign(1, 0);
    for (const WallCandidate& c : share.list) share.slot_begin.push_back(share.slot_begin.back() + capacity_of(c));
    share.memory.places.assign(at(share.slot_begin.back()), {});
    share.memory.further.assign(columns_.has_further() ? at(share.slot_begin.back()) : 0, {});
    for (std::size_t c = 0; c < share.list.size() && !carry.items.empty(); ++c) {
      const std::int32_t was = was_at[at(share.list[c].grain)];
      auto item = std::lower_bound(carry.items.begin(), carry.items.end(), was,
                                   [](const WallCarry::Item& x, std::int32_t grain) { return x.grain < grain; });
      std::int64_t slot = share.slot_begin[c];
      for (; item != carry.items.end() && item->grain == was; ++item)
        if (item->surface == share.list[c].surface && slot < share.slot_begin[c + 1])
          share.memory.set(at(slot++), item->memory);
    }
    make_room(share);
  });
}

void WallContacts::search(const Particles& particles, const PairList& pairs, double skin, double time, int n_threads) {
  if (empty()) return;
  std::vector<std::int32_t> same_place(at(particles.size()));
  std::iota(same_place.begin(), same_place.end(), 0);
  const WallCarry carried = carry();
  build(particles, pairs, skin, time, same_place, carried, n_threads);
}

void WallContacts::make_room(Share& share) const {
  std::int64_t most = 0;
  for (std::size_t t = 0; t + 1 < share.tile_begin.size(); ++t)
    most = std::max(most, share.slot_begin[at(share.tile_begin[t + 1])] - share.slot_begin[at(share.tile_begin[t])]);
  most = std::max(most, share.slot_begin.back() - share.slot_begin[at(share.tile_begin.back())]);
  const std::size_t room = at(most + pair_group);
  share.grain.resize_discarding(room);
  share.columns.resize_discarding(8 * room);
  share.species.resize_discarding(room);
  share.history.resize_discarding(memory_doubles() * room);
  share.slots.resize_discarding(at(slot_size_) * room);
  double* const c = share.columns.data();
  share.view = {share.grain.data(),
                c,
                c + room,
                c + 2 * room,
                c + 3 * room,
                c + 4 * room,
                c + 5 * room,
                c + 6 * room,
                c + 7 * room,
                share.species.data(),
                share.history.data(),
                share.slots.data()};
}

int WallContacts::touch_one(const Particles& particles, const Share& share, const WallCandidate& candidate,
                            Touch* touches) const {
  const Surface& surface = walls_->surfaces()[at(candidate.surface)];
  const Vec3 centre = particles.position(candidate.grain);
  const double radius = particles.radius(candidate.grain) + reach_;
  if (surface.kind != SurfaceKind::mesh) return touch_analytic(surface, centre, radius, touches[0]) ? 1 : 0;
  const std::span<const std::int32_t> triangles(share.triangles.data() + candidate.triangles,
                                                at(candidate.n_triangles));
  if (!walls_->is_moving(candidate.surface))
    return touch_mesh(walls_->mesh(surface.mesh), triangles, centre, radius, touches);
  const Pose& pose = pose_of(candidate.surface);  // the mesh is at home
  const int n = touch_mesh(walls_->mesh(surface.mesh), triangles, pose.to_home(centre), radius, touches);
  for (int t = 0; t < n; ++t) touches[t].normal = pose.turn(touches[t].normal);
  return n;
}

Vec3 WallContacts::wall_velocity(std::int32_t surface, Vec3 centre, const Touch& touch) const {
  if (!walls_->is_moving(surface)) return {};
  return walls_->velocity(surface).at(centre - touch.distance * touch.normal);
}

/// What a touch remembers, in the scene's frame.
PairMemory WallContacts::in_scene(std::int32_t surface, PairMemory memory) const {
  const Pose& pose = pose_of(surface);
  if (!pose.is_turned) return memory;
  turn(pose, memory.displacement);
  turn(pose, memory.further.angle);
  return memory;
}

std::int64_t WallContacts::match(const Share& share, std::int64_t candidate, const Touch& touch,
                                 unsigned& taken) const {
  if (!columns_.has_history) return -1;
  const std::int64_t begin = share.slot_begin[at(candidate)], end = share.slot_begin[at(candidate) + 1];
  const bool is_mesh = share.list[at(candidate)].n_triangles != 0;
  const Vec3 normal = pose_of(share.list[at(candidate)].surface).turn_back(touch.normal);
  double best = is_mesh ? same_contact_cosine : -2.0;
  std::int64_t found = -1;
  for (std::int64_t slot = begin; slot < end; ++slot) {
    const Memory::Place& memory = share.memory.places[at(slot)];
    if (!memory.is_used() || (taken >> (slot - begin) & 1u)) continue;
    const double cosine = dot(memory.normal, normal);
    if (cosine > best) {
      best = cosine;
      found = slot;
    }
  }
  if (found >= 0) taken |= 1u << (found - begin);
  return found;
}

/// What the springs of touches hold [J] that no touch of this step goes on with.
double WallContacts::energy_of_ended(const Share& share, std::int64_t candidate, unsigned taken) const {
  double energy = 0.0;
  const std::int64_t begin = share.slot_begin[at(candidate)], end = share.slot_begin[at(candidate) + 1];
  for (std::int64_t slot = begin; slot < end; ++slot)
    if (!(taken >> (slot - begin) & 1u)) energy += share.memory.places[at(slot)].energy;
  return energy;
}

std::int64_t WallContacts::touch(const Particles& particles, int thread, Range candidates, const std::uint8_t* species,
                                 int n_walls, double* dissipated) {
  Share& share = shares_[index(thread)];
  double* const columns = share.columns.data();
  const std::size_t room = share.columns.size() / 8;
  share.touch_begin.resize(at(candidates.size()) + 1);
  std::size_t n = 0;
  const auto put = [&](std::int32_t grain, const Touch& touch, Vec3 velocity, double mirror) {
    share.grain[n] = grain;
    const double row[8] = {touch.normal.x, touch.normal.y, touch.normal.z, touch.distance,
                           velocity.x,     velocity.y,     velocity.z,     mirror};
    for (std::size_t k = 0; k < 8; ++k) columns[k * room + n] = row[k];
  };
  for (std::int64_t c = candidates.begin; c < candidates.end; ++c) {
    share.touch_begin[at(c - candidates.begin)] = static_cast<std::int64_t>(n);
    const WallCandidate& candidate = share.list[at(c)];
    const Surface& surface = walls_->surfaces()[at(candidate.surface)];
    Touch touches[max_touches];
    const int n_touches = touch_one(particles, share, candidate, touches);
    unsigned taken = 0;
    for (int t = 0; t < n_touches; ++t, ++n) {
      put(candidate.grain, touches[t],
          wall_velocity(candidate.surface, particles.position(candidate.grain), touches[t]),
          surface.kind == SurfaceKind::mirror ? 2.0 : 1.0);
      share.species[n] = species[particles.material(candidate.grain) * n_walls + surface.wall];
      const std::int64_t place = match(share, c, touches[t], taken);
      double* const history = share.history.data() + memory_doubles() * n;
      const PairMemory value = place < 0 ? PairMemory{} : in_scene(candidate.surface, share.memory.at(at(place)));
      std::memcpy(history, &value, 4 * sizeof(double));
      if (has_further_) std::memcpy(history + 4, &value.further, sizeof(value.further));
    }
    if (dissipated && columns_.has_history)
      dissipated[4 * std::ptrdiff_t{candidate.grain} + 2] += energy_of_ended(share, c, taken);
  }
  share.touch_begin[at(candidates.size())] = static_cast<std::int64_t>(n);
  const auto n_found = static_cast<std::int64_t>(n);
  const Touch nowhere{{1, 0, 0}, std::numeric_limits<double>::infinity()};
  for (; n % at(pair_group) != 0; ++n) {
    put(particles.dummy(), nowhere, {}, 1.0);
    share.species[n] = 0;
    std::fill_n(share.history.data() + memory_doubles() * n, memory_doubles(), 0.0);
  }
  return n_found;
}

void WallContacts::remember(int thread, Range candidates) {
  if (!columns_.has_history) return;
  Share& share = shares_[index(thread)];
  const std::size_t room = share.columns.size() / 8;
  for (std::int64_t c = candidates.begin; c < candidates.end; ++c) {
    std::int64_t slot = share.slot_begin[at(c)];
    const Pose& pose = pose_of(share.list[at(c)].surface);
    for (std::int64_t t = share.touch_begin[at(c - candidates.begin)];
         t < share.touch_begin[at(c - candidates.begin) + 1]; ++t) {
      if (slot == share.slot_begin[at(c) + 1]) break;
      const double* const history = share.history.data() + memory_doubles() * at(t);
      if (has_further_ && std::all_of(history, history + memory_doubles(), [](double x) { return x == 0.0; }))
        continue;  // near, but without a force
      Memory::Place& place = share.memory.places[at(slot)];
      std::copy_n(history, 3, place.displacement);
      place.energy = history[3];
      const double* const normal = share.columns.data() + t;
      place.normal = {normal[0], normal[room], normal[2 * room]};
      if (columns_.has_further()) std::memcpy(&share.memory.further[at(slot)], history + 4, sizeof(FurtherMemory));
      if (pose.is_turned) {
        turn_back(pose, place.displacement);
        if (columns_.has_further()) turn_back(pose, share.memory.further[at(slot)].angle);
        place.normal = pose.turn_back(place.normal);
      }
      ++slot;
    }
    for (; slot < share.slot_begin[at(c) + 1]; ++slot) share.memory.clear(at(slot));
  }
}

void WallContacts::measure(const Particles& particles, int thread, Range candidates, double dt, double counted,
                           bool has_work, WallSums& sums) const {
  const Share& share = shares_[index(thread)];
  const std::size_t room = share.columns.size() / 8;
  for (std::int64_t c = candidates.begin; c < candidates.end; ++c) {
    const WallCandidate& candidate = share.list[at(c)];
    if (!walls_->is_moving(candidate.surface)) continue;
    const int servo = walls_->servo_of(candidate.surface);
    for (std::int64_t t = share.touch_begin[at(c - candidates.begin)];
         t < share.touch_begin[at(c - candidates.begin) + 1]; ++t) {
      const double* const slot = share.slots.data() + t * slot_size_;
      const double* const column = share.columns.data() + t;
      const Vec3 force{slot[0], slot[1], slot[2]};  // on the grain
      const Vec3 normal{column[0], column[room], column[2 * room]};
      const Vec3 point = particles.position(candidate.grain) - column[3 * room] * normal;
      if (has_work) sums.work.add(counted * dt * dot(force, walls_->velocity_now(candidate.surface).at(point)));
      if (servo < 0) continue;
      const WallMotion& motion = walls_->servo(at(servo));
      const Vec3 pushed = motion.torque ? cross(point - motion.origin, -force) : -force;
      sums.pushes[at(servo)].add(dot(normalized(motion.axis), pushed));
    }
  }
}

/// The triangle nearest to a point of a touch, of those that the grain could touch: any list of candidates has all of these, so that the
/// choice does not depend on the skin. At an edge or a corner that of the lowest number. Points are at home.
std::int32_t WallContacts::touched_triangle(const Share& share, const WallCandidate& candidate, Vec3 centre,
                                            double reach, Vec3 point) const {
  const MeshView mesh = walls_->mesh(walls_->surfaces()[at(candidate.surface)].mesh);
  std::int32_t nearest = share.triangles[at(candidate.triangles)];  // where a touch is one by rounding only
  double least = std::numeric_limits<double>::infinity();
  for (std::int32_t n = candidate.triangles; n < candidate.triangles + candidate.n_triangles; ++n) {
    const std::int32_t triangle = share.triangles[at(n)];
    const Vec3* const corners = mesh.corners + 3 * std::ptrdiff_t{triangle};
    const Vec3 normal = mesh.normals[triangle];
    if (!(squared_distance_to_triangle(centre, corners, normal) < reach * reach)) continue;
    const double squared = squared_distance_to_triangle(point, corners, normal);
    if (!(squared < least)) continue;
    least = squared;
    nearest = triangle;
  }
  return nearest;
}

void WallContacts::note_forces(const Particles& particles, int thread, Range candidates,
                               const std::vector<bool>& is_wanted, std::vector<TriangleForce>& forces) const {
  const Share& share = shares_[index(thread)];
  const std::size_t room = share.columns.size() / 8;
  for (std::int64_t c = candidates.begin; c < candidates.end; ++c) {
    const WallCandidate& candidate = share.list[at(c)];
    if (!is_wanted[at(candidate.surface)]) continue;
    const Pose& pose = pose_of(candidate.surface);
    const Vec3 centre = particles.position(candidate.grain), home = pose.to_home(centre);
    for (std::int64_t t = share.touch_begin[at(c - candidates.begin)];
         t < share.touch_begin[at(c - candidates.begin) + 1]; ++t) {
      const double* const slot = share.slots.data() + t * slot_size_;
      const Vec3 force{-slot[0], -slot[1], -slot[2]};
      if (force == Vec3{}) continue;
      const double* const column = share.columns.data() + t;
      const Vec3 normal{column[0], column[room], column[2 * room]};
      const Vec3 point = pose.to_home(centre - column[3 * room] * normal);
      const std::int32_t triangle =
          touched_triangle(share, candidate, home, particles.radius(candidate.grain) + reach_, point);
      const double pushed = -dot(force, normal);
      forces.push_back({candidate.surface, triangle, force, pushed, length(force + pushed * normal)});
    }
  }
}

void WallContacts::clear_memory(std::int32_t i, ExactSum& energy) {
  if (!columns_.has_history) return;
  for (Share& share : shares_)
    for (std::size_t c = 0; c < share.list.size(); ++c) {
      if (share.list[c].grain != i) continue;
      for (std::int64_t slot = share.slot_begin[c]; slot < share.slot_begin[c + 1]; ++slot) {
        energy.add(share.memory.places[at(slot)].energy);
        share.memory.clear(at(slot));
      }
    }
}

WallCarry WallContacts::carry() const {
  WallCarry carry;
  if (!columns_.has_history) return carry;
  for (const Share& share : shares_)
    for (std::size_t c = 0; c < share.list.size(); ++c)
      for (std::int64_t slot = share.slot_begin[c]; slot < share.slot_begin[c + 1]; ++slot)
        if (share.memory.places[at(slot)].is_used())
          carry.items.push_back({share.list[c].grain,
                                 share.list[c].surface,
                                 {share.memory.at(at(slot)), share.memory.places[at(slot)].normal}});
  std::stable_sort(carry.items.begin(), carry.items.end(),
                   [](const auto& x, const auto& y) { return x.grain < y.grain; });
  return carry;
}

std::vector<WallContacts::Memory> WallContacts::save() const {
  std::vector<Memory> saved;
  for (const Share& share : shares_) saved.push_back(share.memory);
  return saved;
}

void WallContacts::put_back(const std::vector<Memory>& saved) {
  for (std::size_t t = 0; t < shares_.size(); ++t) shares_[t].memory = saved[t];
}

std::size_t WallContacts::memory() const {
  std::size_t bytes = 0;
  for (const Share& s : shares_)
    bytes += s.list.capacity() * sizeof(WallCandidate) + s.triangles.capacity() * 4 + s.slot_begin.capacity() * 8 +
             s.memory.places.capacity() * sizeof(Memory::Place) + s.memory.further.capacity() * sizeof(FurtherMemory) +
             s.columns.capacity_bytes() + s.slots.capacity_bytes() + s.history.capacity_bytes();
  return bytes;
}

}  // namespace moraine
