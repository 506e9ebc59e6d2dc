#include "engine/openings/inlets.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <utility>

#include "comm/totals.hpp"
#include "engine/openings/places.hpp"
#include "engine/particles/pack_occupied.hpp"
#include "engine/particles/sizes.hpp"
#include "engine/scene/kept_count.hpp"
#include "kernels/base/random.hpp"
#include "kernels/base/sphere.hpp"

namespace moraine {

namespace {

constexpr int n_rounds = 6;                    // of looking for room at one birth ...
constexpr std::size_t attempts_a_grain = 24;   // in a round, at least ...
constexpr std::size_t attempts_a_round = 480;  // ... and together, so that the last few look longer
constexpr std::uint64_t steps_between_fills = 100;
constexpr std::uint64_t steps_between_tries = 25;  // of an inlet that has found no room
/// Far above round-off, far below a grain: 1000 grains a second for 0.1 s are 100.
constexpr double count_tolerance = 1e-9;

std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

std::vector<double> words_of(const ExactSum& sum) {
  const auto words = sum.words();
  return {words.begin(), words.end()};
}

ExactSum sum_of(std::span<const double> words) {
  std::array<std::int64_t, ExactSum::n_words> integers;
  std::transform(words.begin(), words.end(), integers.begin(), [](double v) { return static_cast<std::int64_t>(v); });
  return ExactSum::from_words(integers);
}

bool needs_looking_inside(const Inlet& inlet) {
  return inlet.fill_count || inlet.fill_mass || inlet.fill_solid_fraction;
}

/// Distance of a coordinate from an interval, over the faces of a period where there is one.
double gap(double x, double low, double high, double period) {
  const auto plain = [&](double at) { return std::max({0.0, low - at, at - high}); };
  return period > 0.0 ? std::min({plain(x), plain(x - period), plain(x + period)}) : plain(x);
}

}  // namespace

Inlets::Inlets(const Scene& scene, double dt) : materials_(scene.materials), dt_(dt) {
  space_.box = scene.domain.box();
  space_.periodic = scene.domain.periodic;
  space_.is_flat = scene.domain.dimensions == 2;
  space_.plane = 0.5 * (scene.domain.low.z + scene.domain.high.z);
  for (std::size_t k = 0; k < scene.inlets.size(); ++k) {
    One one;
    one.scene = scene.inlets[k];
    // inlets of one seed are not to give the same grains
    one.seed = mix64(one.scene.seed + 0x9e3779b97f4a7c15ULL * (k + 1));
    one.material = static_cast<std::uint16_t>(std::max(0, scene.material_index(one.scene.material)));
    one.is_recycling = std::any_of(scene.outlets.begin(), scene.outlets.end(),
                                   [&](const Outlet& outlet) { return outlet.recycles == one.scene.name; });
    const bool comes_by_itself = one.scene.number_rate || one.scene.mass_rate || one.scene.list;
    if (one.scene.interval > 0.0)
      one.every = static_cast<std::uint64_t>(std::max(1.0, std::round(one.scene.interval / dt)));
    else if (!comes_by_itself || one.is_recycling)
      one.every = steps_between_fills;
    foresee(one);
    inlets_.push_back(std::move(one));
  }
}

int Inlets::find(const std::string& name) const {
  for (std::size_t k = 0; k < inlets_.size(); ++k)
    if (inlets_[k].scene.name == name) return static_cast<int>(k);
  return -1;
}

double Inlets::mass_of(const Owed& grain) const {
  return materials_[grain.material].density * sphere_volume(grain.radius);
}

/// The grain that the inlet owes next, by its own numbers.
Inlets::Owed Inlets::next_grain(const One& inlet) const {
  Owed grain{inlet.n_numbers, 0.0, inlet.material, false};
  if (inlet.scene.list) {
    const GrainSeed& seed = inlet.scene.list->grains[inlet.n_drawn];
    grain.material = inlet.scene.material.empty() ? seed.material : inlet.material;
    if (inlet.scene.list->has_radius) {
      grain.radius = seed.radius;
      return grain;
    }
  }
  grain.radius =
      0.5 * DiameterSampler(inlet.scene.diameter)(random_uniform(inlet.seed, grain.number, RandomPurpose::radius));
  return grain;
}

/// Whether the inlet owes another grain by the rule of its rate or list.
bool Inlets::has_more(const One& inlet, double time) const {
  const Inlet& scene = inlet.scene;
  const double elapsed = std::min(time, scene.until) - scene.from;
  if (elapsed < 0.0) return false;
  if (scene.total_count && inlet.n_drawn >= static_cast<std::uint64_t>(*scene.total_count)) return false;
  if (scene.list) return inlet.n_drawn < scene.list->grains.size();
  if (scene.total_mass && inlet.mass_after_next > *scene.total_mass * (1.0 + count_tolerance)) return false;
  if (scene.number_rate)
    return static_cast<double>(inlet.n_drawn) + 1.0 <= *scene.number_rate * elapsed + count_tolerance;
  if (!scene.mass_rate) return false;
  return inlet.mass_after_next <= *scene.mass_rate * elapsed * (1.0 + count_tolerance);
}

/// What the inlet will have given once it has given the next grain too.
void Inlets::foresee(One& inlet) const {
  if (inlet.scene.list && inlet.n_drawn >= inlet.scene.list->grains.size()) return;
  if (!inlet.scene.mass_rate && !inlet.scene.total_mass) return;
  ExactSum sum = inlet.mass_drawn;
  sum.add(mass_of(next_grain(inlet)));
  inlet.mass_after_next = sum.value();
}

bool Inlets::is_due(std::uint64_t step) const {
  const double time = static_cast<double>(step) * dt_;
  return std::any_of(inlets_.begin(), inlets_.end(), [&](const One& inlet) {
    if (step % inlet.every != 0 || step < inlet.next_try) return false;
    if (!inlet.owed.empty() || has_more(inlet, time)) return true;
    const bool is_open = inlet.scene.from <= time && time < inlet.scene.until;
    return inlet.is_recycling || (is_open && needs_looking_inside(inlet.scene));
  });
}

/// Adds to what the inlet owes.
void Inlets::draw(One& inlet, double time, double n_inside, double mass_inside, double volume_inside) {
  const auto owe = [&](Owed grain) {
    grain.number = inlet.n_numbers++;
    if (!grain.is_back) {
      ++inlet.n_drawn;
      inlet.mass_drawn.add(mass_of(grain));
    }
    inlet.owed.push_back(grain);
    foresee(inlet);
  };
  // In order of gid, whether they were gathered in one go or (for a checkpoint) in several.
  std::sort(inlet.returning.begin(), inlet.returning.end(),
            [](const Departed& a, const Departed& b) { return a.gid < b.gid; });
  for (const Departed& back : inlet.returning) owe({0, back.radius, static_cast<std::uint16_t>(back.material), true});
  inlet.returning.clear();
  while (has_more(inlet, time)) owe(next_grain(inlet));
  const Inlet& scene = inlet.scene;
  if (!needs_looking_inside(scene)) return;
  // What is owed from before counts as inside; what has come in by other ways makes it no longer owed.
  double count = n_inside, mass = mass_inside, volume = volume_inside;
  const auto is_wanted = [&](const Owed& grain) {
    if (scene.fill_count) return count + 1.0 <= static_cast<double>(*scene.fill_count);
    if (scene.fill_mass) return mass + mass_of(grain) <= *scene.fill_mass * (1.0 + count_tolerance);
    return volume + sphere_volume(grain.radius) <= *scene.fill_solid_fraction * volume_of(scene.where);
  };
  const auto count_in = [&](const Owed& grain) {
    count += 1.0;
    mass += mass_of(grain);
    volume += sphere_volume(grain.radius);
  };
  std::erase_if(inlet.owed, [&](const Owed& grain) {
    if (grain.is_back) return false;
    if (!is_wanted(grain)) return true;
    count_in(grain);
    return false;
  });
  const bool is_open = scene.from <= time && time < scene.until;
  while (is_open && !(scene.total_count && inlet.n_drawn >= static_cast<std::uint64_t>(*scene.total_count))) {
    const Owed grain = next_grain(inlet);
    if (scene.total_mass && inlet.mass_after_next > *scene.total_mass * (1.0 + count_tolerance)) break;
    if (!is_wanted(grain)) break;
    owe(grain);
    count_in(grain);
  }
}

/// What has left on any rank.
void Inlets::gather_departed(One& inlet, const World& world) const {
  std::vector<Departed> all = std::move(inlet.departed);
  inlet.departed.clear();
  if (!world.is_alone()) {
    std::string own(all.size() * sizeof(Departed), '\0');
    if (!all.empty()) std::memcpy(own.data(), all.data(), own.size());
    std::string together;
    for (const std::string& part : world.gather_at_root(own)) together += part;
    world.broadcast(together);
    all.resize(together.size() / sizeof(Departed));
    if (!all.empty()) std::memcpy(all.data(), together.data(), together.size());
  }
  inlet.returning.insert(inlet.returning.end(), all.begin(), all.end());
}

/// Number, mass and volume of the grains inside the regions of the inlets that are filled; three numbers each.
void Inlets::measure(std::span<const std::size_t> due, const Surroundings& around, std::vector<double>& inside) const {
  inside.assign(3 * due.size(), 0.0);
  if (std::none_of(due.begin(), due.end(), [&](std::size_t k) { return needs_looking_inside(inlets_[k].scene); }))
    return;
  std::vector<ExactSum> sums(inside.size());
  const Particles& p = around.particles;
  for (std::int32_t i = 0; i < p.size(); ++i) {
    if (!p.is_here(i)) continue;
    for (std::size_t n = 0; n < due.size(); ++n) {
      if (!needs_looking_inside(inlets_[due[n]].scene) || !contains(inlets_[due[n]].scene.where, p.position(i)))
        continue;
      sums[3 * n].add(1.0);
      sums[3 * n + 1].add(1.0 / p.inverse_mass(i));
      sums[3 * n + 2].add(sphere_volume(p.radius(i)));
    }
  }
  total(around.world, sums);
  for (std::size_t k = 0; k < sums.size(); ++k) inside[k] = sums[k].value();
}

/// So many places for each grain that is owed.
std::vector<Inlets::Candidate> Inlets::candidates(std::span<const std::size_t> due, std::size_t n_each) {
  std::vector<Candidate> all;
  for (const std::size_t k : due) {
    One& inlet = inlets_[k];
    for (std::size_t n = 0; n < inlet.owed.size(); ++n) {
      const Owed& grain = inlet.owed[n];
      if (inlet.scene.list && !grain.is_back) {
        all.push_back({k, n, space_.wrapped(inlet.scene.list->grains[grain.number].position), grain.radius});
        continue;
      }
      for (std::size_t attempt = 0; attempt < n_each; ++attempt) {
        std::array<double, 3> numbers;
        for (std::size_t c = 0; c < 3; ++c)
          numbers[c] = random_uniform(inlet.seed, inlet.n_attempts, RandomPurpose::position, c);
        ++inlet.n_attempts;
        std::optional<Vec3> place = place_in(inlet.scene.where, grain.radius, numbers);
        if (!place) continue;
        if (space_.is_flat) place->z = space_.plane;
        const Vec3 position = space_.wrapped(*place);
        if (space_.box.contains(position)) all.push_back({k, n, position, grain.radius});
      }
    }
  }
  return all;
}

/// One bit for each candidate: whether a grain or a wall is in its way. Each rank looks at those in its own box.
std::vector<std::uint64_t> Inlets::blocked(std::span<const Candidate> all, const Surroundings& around) const {
  std::vector<std::uint64_t> bits((all.size() + 63) / 64, 0);
  std::vector<std::size_t> own;
  std::vector<double> records;  // position and radius of each
  Box extent = Box::empty();
  double largest = 0.0;
  for (std::size_t n = 0; n < all.size(); ++n) {
    if (!around.world.is_alone() && around.subdomains.owner(all[n].position) != around.world.rank()) continue;
    own.push_back(n);
    const Vec3 x = all[n].position;
    records.insert(records.end(), {x.x, x.y, x.z, all[n].radius});
    extent.include(x);
    largest = std::max(largest, all[n].radius);
  }
  const auto block = [&](std::size_t n) { bits[n / 64] |= std::uint64_t{1} << (n % 64); };
  if (!own.empty()) {
    const Particles& p = around.particles;
    std::vector<PackGrain> near;
    std::vector<double> radii;
    for (std::int32_t i = 0; i < p.dummy(); ++i) {  // ghosts too
      if (!p.is_here(i)) continue;
      const double reach = (p.radius(i) + largest) * (1.0 + 1e-6);
      const Vec3 x = p.position(i);
      bool is_near = true;
      for (int axis = 0; axis < 3 && is_near; ++axis) {
        const double period = space_.periodic[at(axis)] ? space_.box.size()[axis] : 0.0;
        is_near = gap(x[axis], extent.low[axis], extent.high[axis], period) <= reach;
      }
      if (!is_near) continue;
      near.push_back({x, p.radius(i)});
      radii.push_back(p.radius(i));
    }
    if (!near.empty()) {
      OccupiedSpace occupied(space_, extent.grown(largest), radii);
      for (const PackGrain& grain : near) occupied.insert(grain);
      for (const std::size_t n : own)
        if (occupied.overlaps({all[n].position, all[n].radius})) block(n);
    }
    WallCandidates walls;
    around.walls.find_candidates(records.data(), 4, 0, static_cast<std::int32_t>(own.size()), 0.0, around.time, walls);
    for (const WallCandidate& touched : walls.list) block(own[at(touched.grain)]);
  }
  if (!around.world.is_alone() && !bits.empty()) around.world.sum(std::span<std::uint64_t>(bits));
  return bits;
}

Newborn Inlets::clothe(const Candidate& candidate, std::uint64_t gid) const {
  const One& inlet = inlets_[candidate.inlet];
  const Owed& grain = inlet.owed[candidate.owed];
  Newborn born;
  born.gid = gid;
  born.inlet = candidate.inlet;
  const bool is_listed = inlet.scene.list && !grain.is_back;
  if (is_listed && inlet.scene.list->has_velocity) {
    born.seed = inlet.scene.list->grains[grain.number];
  } else {
    born.seed.velocity = inlet.scene.velocity;
    born.seed.angular_velocity = inlet.scene.angular_velocity;
    for (int axis = 0; axis < (space_.is_flat ? 2 : 3) && inlet.scene.velocity_deviation > 0.0; ++axis)
      born.seed.velocity[axis] +=
          inlet.scene.velocity_deviation *
          random_normal(inlet.seed, grain.number, RandomPurpose::velocity, static_cast<std::uint64_t>(axis));
  }
  born.seed.position = candidate.position;
  born.seed.radius = grain.radius;
  born.seed.material = grain.material;
  return born;
}

std::vector<Newborn> Inlets::bear(std::uint64_t step, const Surroundings& around, std::uint64_t first_gid) {
  std::vector<std::size_t> due;
  for (std::size_t k = 0; k < inlets_.size(); ++k)
    if (step % inlets_[k].every == 0 && step >= inlets_[k].next_try) due.push_back(k);
  std::vector<double> inside;
  measure(due, around, inside);
  for (std::size_t n = 0; n < due.size(); ++n) {
    if (inlets_[due[n]].is_recycling) gather_departed(inlets_[due[n]], around.world);
    draw(inlets_[due[n]], around.time, inside[3 * n], inside[3 * n + 1], inside[3 * n + 2]);
  }
  std::vector<Newborn> born;
  for (int round = 0; round < n_rounds; ++round) {
    std::size_t n_owed = 0;
    for (const std::size_t k : due) n_owed += inlets_[k].owed.size();
    if (n_owed == 0) break;
    const std::vector<Candidate> all = candidates(due, std::max(attempts_a_grain, attempts_a_round / n_owed));
    const std::vector<std::uint64_t> bits = blocked(all, around);
    std::vector<double> radii;
    Box extent = Box::empty();
    for (const Newborn& grain : born) radii.push_back(grain.seed.radius), extent.include(grain.seed.position);
    for (const Candidate& candidate : all) radii.push_back(candidate.radius), extent.include(candidate.position);
    if (all.empty()) break;
    OccupiedSpace newly(space_, extent, radii);
    for (const Newborn& grain : born) newly.insert({grain.seed.position, grain.seed.radius});
    std::vector<std::vector<bool>> is_placed(inlets_.size());
    for (const std::size_t k : due) is_placed[k].assign(inlets_[k].owed.size(), false);
    const std::size_t n_before = born.size();
    for (std::size_t n = 0; n < all.size(); ++n) {
      const Candidate& candidate = all[n];
      if (is_placed[candidate.inlet][candidate.owed] || (bits[n / 64] >> (n % 64) & 1U)) continue;
      const PackGrain sphere{candidate.position, candidate.radius};
      if (newly.overlaps(sphere)) continue;
      newly.insert(sphere);
      is_placed[candidate.inlet][candidate.owed] = true;
      born.push_back(clothe(candidate, first_gid + born.size()));
      One& inlet = inlets_[candidate.inlet];
      ++inlet.n_born;
      inlet.mass_born.add(mass_of(inlet.owed[candidate.owed]));
    }
    for (const std::size_t k : due) {
      std::vector<Owed> left;
      for (std::size_t n = 0; n < inlets_[k].owed.size(); ++n)
        if (!is_placed[k][n]) left.push_back(inlets_[k].owed[n]);
      inlets_[k].owed = std::move(left);
    }
    if (born.size() == n_before) break;
  }
  for (const std::size_t k : due) {
    One& inlet = inlets_[k];
    if (!inlet.owed.empty()) inlet.next_try = step + std::max(steps_between_tries, inlet.every);
    complain(inlet, around.time);
  }
  return born;
}

/// Once for each inlet: a user must know, but not again and again.
void Inlets::complain(One& inlet, double time) {
  if (inlet.owed.empty() || inlet.has_complained) return;
  inlet.has_complained = true;
  double mass = 0.0;
  for (const Owed& grain : inlet.owed) mass += mass_of(grain);
  notes_.push_back(fmt::format(
      "inlet \"{}\" finds no room for {} grain{} ({:.4g} kg) at {:.6g} s: it owes them and goes on trying; a "
      "wider opening or a higher velocity makes room",
      inlet.scene.name, inlet.owed.size(), inlet.owed.size() == 1 ? "" : "s", mass, time));
}

Inlets::Account Inlets::account(std::size_t k) const {
  const One& inlet = inlets_[k];
  Account account{inlet.n_born, inlet.mass_born.value(), inlet.owed.size(), 0.0};
  ExactSum owed;
  for (const Owed& grain : inlet.owed) owed.add(mass_of(grain));
  account.mass_owed = owed.value();
  return account;
}

std::map<std::string, std::vector<double>> Inlets::remembered(const World& world) {
  std::map<std::string, std::vector<double>> all;
  for (One& inlet : inlets_) {
    if (inlet.is_recycling) gather_departed(inlet, world);
    std::vector<double> numbers = {static_cast<double>(inlet.n_numbers),       static_cast<double>(inlet.n_drawn),
                                   static_cast<double>(inlet.n_attempts),      static_cast<double>(inlet.n_born),
                                   static_cast<double>(inlet.next_try),        static_cast<double>(inlet.owed.size()),
                                   static_cast<double>(inlet.returning.size())};
    for (const Owed& grain : inlet.owed)
      numbers.insert(numbers.end(), {static_cast<double>(grain.number), grain.radius,
                                     static_cast<double>(grain.material), grain.is_back ? 1.0 : 0.0});
    for (const Departed& grain : inlet.returning)
      numbers.insert(numbers.end(),
                     {static_cast<double>(grain.gid), grain.radius, static_cast<double>(grain.material)});
    for (const ExactSum* sum : {&inlet.mass_drawn, &inlet.mass_born}) {
      const std::vector<double> words = words_of(*sum);
      numbers.insert(numbers.end(), words.begin(), words.end());
    }
    all["inlet_" + inlet.scene.name] = std::move(numbers);
  }
  return all;
}

void Inlets::restore(const std::map<std::string, std::vector<double>>& accumulators) {
  for (One& inlet : inlets_) {
    const std::string name = "inlet_" + inlet.scene.name;
    const auto found = accumulators.find(name);
    const std::size_t head = 7, tail = 2 * ExactSum::n_words;
    const auto fail = [&] {
      throw SceneError(
          {{"inlet", "the checkpoint holds no \"" + name + "\"; it is of a scene without this inlet", false}});
    };
    if (found == accumulators.end() || found->second.size() < head + tail) fail();
    const std::vector<double>& numbers = found->second;
    const auto whole = [&](std::size_t k) { return kept_count(numbers[k], name); };
    const auto radius = [&](std::size_t k) {
      if (!(numbers[k] > 0.0) || !std::isfinite(numbers[k])) fail();
      return numbers[k];
    };
    const auto material = [&](std::size_t k) {
      if (whole(k) >= materials_.size()) fail();
      return whole(k);
    };
    inlet.n_numbers = whole(0);
    inlet.n_drawn = whole(1);
    inlet.n_attempts = whole(2);
    inlet.n_born = whole(3);
    inlet.next_try = whole(4);
    const std::size_t n_owed = whole(5), n_returning = whole(6);
    const std::size_t room = numbers.size() - head - tail;
    if (n_owed > room || n_returning > room || room != 4 * n_owed + 3 * n_returning) fail();
    std::size_t k = head;
    inlet.owed.clear();
    for (std::size_t n = 0; n < n_owed; ++n, k += 4)
      inlet.owed.push_back(
          {whole(k), radius(k + 1), static_cast<std::uint16_t>(material(k + 2)), numbers[k + 3] != 0.0});
    inlet.returning.clear();
    for (std::size_t n = 0; n < n_returning; ++n, k += 3)
      inlet.returning.push_back({whole(k), radius(k + 1), material(k + 2)});
    inlet.mass_drawn = sum_of(std::span(numbers).subspan(k, ExactSum::n_words));
    inlet.mass_born = sum_of(std::span(numbers).subspan(k + ExactSum::n_words, ExactSum::n_words));
    foresee(inlet);
  }
}

std::vector<double> Inlets::hashed() const {
  std::vector<double> all;
  for (const One& inlet : inlets_)
    all.insert(all.end(), {static_cast<double>(inlet.n_numbers), static_cast<double>(inlet.n_attempts),
                           static_cast<double>(inlet.n_born), inlet.mass_born.value()});
  return all;
}

}  // namespace moraine
