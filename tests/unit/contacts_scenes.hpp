// Grains at random places for tests of the contact search, and pairs found by comparing everything with everything.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <numeric>
#include <span>
#include <tuple>
#include <vector>

#include "engine/contacts/pair_list.hpp"
#include "engine/particles/particles.hpp"
#include "tests/support/surface_shapes.hpp"

namespace moraine::contacts_test {

struct Setting {
  Box domain;
  std::array<bool, 3> periodic{};
  double smallest = 0.0, largest = 0.0;  // radii [m]
  double skin = 0.0;                     // [m]
  int n = 0;
  bool is_by_factors = false;  // as many grains from one radius to its double as from that to its double
};

/// Grains of a setting, gids in an order that has nothing to do with place; they may overlap at will.
inline Particles random_particles(const Setting& setting, std::uint64_t seed) {
  shapes::Dice dice(seed);
  Particles particles(FieldNeeds{});
  particles.resize(setting.n);
  std::vector<std::uint64_t> gids(static_cast<std::size_t>(setting.n));
  std::iota(gids.begin(), gids.end(), std::uint64_t{1000});
  for (std::size_t i = gids.size(); i > 1; --i)
    std::swap(gids[i - 1], gids[static_cast<std::size_t>(dice.index(static_cast<int>(i)))]);
  for (std::int32_t i = 0; i < setting.n; ++i) {
    const Vec3 p = dice.point(setting.domain.low, setting.domain.high);
    for (int c = 0; c < 3; ++c) {
      particles.set_real(Field::position, i, c, p[c]);
      particles.set_real(Field::velocity, i, c, 0.0);
      particles.set_real(Field::angular_velocity, i, c, 0.0);
    }
    const auto radius = [&] {
      return setting.is_by_factors
                 ? setting.smallest * std::pow(setting.largest / setting.smallest, dice.uniform(0.0, 1.0))
                 : dice.uniform(setting.smallest, setting.largest);
    };
    particles.set_real(Field::radius, i, 0, i == 0 ? setting.largest : radius());  // the largest is there for sure
    particles.set_real(Field::inverse_mass, i, 0, 1.0);
    particles.set_real(Field::inverse_inertia, i, 0, 1.0);
    particles.set_gid(i, gids[static_cast<std::size_t>(i)]);
    particles.set_material(i, 0);
  }
  return particles;
}

inline std::vector<Vec3> image_shifts(const Box& domain) {
  std::vector<Vec3> shifts(image::n_codes);
  for (std::uint8_t code = 0; code < image::n_codes; ++code) {
    const auto steps = image::steps(code);
    const Vec3 period = domain.size();
    shifts[code] = {steps[0] * period.x, steps[1] * period.y, steps[2] * period.z};
  }
  return shifts;
}

/// (lower gid, higher gid, image code seen from the lower) of a pair, and how often it is there.
using PairKey = std::tuple<std::uint64_t, std::uint64_t, int>;
using PairCount = std::map<PairKey, int>;

/// Every pair of grains and images, two periods to either side, nearer than their radii and `skin`; of a grain and its own
/// images, one of the two that are the same contact.
inline PairCount pairs_by_brute_force(const Particles& particles, const Setting& setting, double skin) {
  PairCount pairs;
  const Vec3 period = setting.domain.size();
  const auto most = [&](int axis) { return setting.periodic[static_cast<std::size_t>(axis)] ? 2 : 0; };
  for (std::int32_t i = 0; i < particles.size(); ++i)
    for (std::int32_t j = 0; j < particles.size(); ++j) {
      if (particles.gid(i) > particles.gid(j)) continue;
      for (int x = -most(0); x <= most(0); ++x)
        for (int y = -most(1); y <= most(1); ++y)
          for (int z = -most(2); z <= most(2); ++z) {
            const std::uint8_t code = image::code(x, y, z);
            if (i == j && !image::is_positive(code)) continue;
            const Vec3 separation =
                particles.position(i) - particles.position(j) + Vec3{x * period.x, y * period.y, z * period.z};
            const double reach = particles.radius(i) + particles.radius(j) + skin;
            if (squared_length(separation) < reach * reach) ++pairs[{particles.gid(i), particles.gid(j), code}];
          }
    }
  return pairs;
}

inline PairCount pairs_of(const PairList& list, const Particles& particles) {
  PairCount pairs;
  list.for_each(particles.dummy(), [&](std::int32_t a, std::int32_t b, std::uint8_t code, const PairMemory*) {
    ++pairs[{particles.gid(a), particles.gid(b), code}];
  });
  return pairs;
}

/// The first pair that is not in both as often, in words; empty where there is none.
inline std::string difference(const PairCount& expected, const PairCount& found) {
  const auto text = [](const PairKey& key, int n_expected, int n_found) {
    const auto steps = image::steps(static_cast<std::uint8_t>(std::get<2>(key)));
    return "grains " + std::to_string(std::get<0>(key)) + " and " + std::to_string(std::get<1>(key)) + ", image (" +
           std::to_string(steps[0]) + ", " + std::to_string(steps[1]) + ", " + std::to_string(steps[2]) +
           "): expected " + std::to_string(n_expected) + " times, found " + std::to_string(n_found);
  };
  for (const auto& [key, n] : expected) {
    const auto other = found.find(key);
    if (other == found.end() || other->second != n) return text(key, n, other == found.end() ? 0 : other->second);
  }
  for (const auto& [key, n] : found)
    if (!expected.contains(key)) return text(key, 0, n);
  return "";
}

struct Built {
  Cells cells;
  PairList list;
};

/// Sorts the grains and makes the list, as a rebuild does. `rooms_of(cells)`: the room of each grain, of the sorted ones.
template <typename RoomsOf>
void build(Built& built, Particles& particles, const Setting& setting, const PairNeeds& needs, PairCarry carry,
           int n_threads, RoomsOf rooms_of) {
  SizeClasses::Census radii;
  for (std::int32_t i = 0; i < particles.size(); ++i) radii.add(particles.radius(i));
  const SizeClasses classes(radii);
  const std::vector<Vec3> shifts = image_shifts(setting.domain);
  built.cells.sort(Centres::of(particles), setting.domain, setting.periodic,
                   2.0 * classes.smallest_limit() + setting.skin, n_threads);
  particles.reorder(built.cells.order(), n_threads);
  SizeGrids sizes;
  if (classes.size() > 1)
    sizes.build(particles, classes, setting.domain, setting.periodic, shifts, setting.skin, n_threads);
  const std::vector<double> rooms = rooms_of(built.cells);
  built.list.build(particles, built.cells, sizes, {}, shifts, setting.skin, rooms, needs, built.cells.order(), carry,
                   n_threads);
}
inline void build(Built& built, Particles& particles, const Setting& setting, const PairNeeds& needs, PairCarry carry,
                  int n_threads) {
  build(built, particles, setting, needs, std::move(carry), n_threads,
        [](const Cells&) { return std::vector<double>(); });
}

/// Displaces the grains, and brings back over periodic faces those that cross: follow(i, shift) is told.
template <typename Follow>
void move(Particles& particles, std::span<const Vec3> by, double scale, const Setting& setting, PairList* list,
          Follow follow) {
  for (std::int32_t i = 0; i < particles.size(); ++i) {
    std::array<int, 3> steps{};
    for (int axis = 0; axis < 3; ++axis) {
      const double low = setting.domain.low[axis], high = setting.domain.high[axis], period = high - low;
      double x = particles.position(i)[axis] + scale * by[static_cast<std::size_t>(i)][axis];
      if (setting.periodic[static_cast<std::size_t>(axis)])
        steps[static_cast<std::size_t>(axis)] = x < low ? 1 : x >= high ? -1 : 0;
      x += steps[static_cast<std::size_t>(axis)] * period;
      particles.set_real(Field::position, i, axis, x);
    }
    const Vec3 period = setting.domain.size();
    follow(i, Vec3{steps[0] * period.x, steps[1] * period.y, steps[2] * period.z});
    if (list && (steps[0] || steps[1] || steps[2])) list->shift_images(i, steps);
  }
}

/// Grains of half to all of a radius in domains of many shapes, periodic in all ways.
inline std::vector<Setting> settings_of_all_shapes() {
  std::vector<Setting> all;
  for (const Vec3 size : {Vec3{1.0, 1.1, 1.2}, Vec3{0.9, 0.31, 0.3}, Vec3{2.0, 0.25, 0.45}, Vec3{0.33, 0.34, 0.35}})
    for (int mask = 0; mask < 8; ++mask) {
      Setting setting;
      setting.domain = {{-0.3, 0.1, 7.0}, Vec3{-0.3, 0.1, 7.0} + size};
      setting.periodic = {(mask & 1) != 0, (mask & 2) != 0, (mask & 4) != 0};
      setting.largest = size.y > 0.5 ? 0.05 : 0.03;
      setting.smallest = 0.5 * setting.largest;
      setting.skin = 0.2 * setting.largest;
      setting.n = 220;
      all.push_back(setting);
    }
  return all;
}

/// How grains move: all alike, as a body that shears and turns, each by itself, each as others do but a few, one half towards the other.
enum class Flow { together, sheared, apart, few, halves };
inline constexpr Flow all_flows[] = {Flow::together, Flow::sheared, Flow::apart, Flow::few, Flow::halves};

inline Vec3 moved(Flow flow, Vec3 place, const Setting& setting, const std::array<Vec3, 4>& chosen,
                  shapes::Dice& dice) {
  const Vec3 noise = dice.point({-1, -1, -1}, {1, 1, 1});
  const Vec3 from_middle = place - 0.5 * (setting.domain.low + setting.domain.high);
  switch (flow) {
    case Flow::together: return chosen[0];
    case Flow::sheared:
      return chosen[0] +
             10.0 * Vec3{dot(chosen[1], from_middle), dot(chosen[2], from_middle), dot(chosen[3], from_middle)};
    case Flow::apart: return noise;
    case Flow::few: return dice.uniform(0, 1) < 0.1 ? 3.0 * noise : chosen[0];
    case Flow::halves: return {from_middle.x < 0.0 ? 1.0 : -1.0, 0.0, 0.0};
  }
  return {};
}

inline PairNeeds needs_of(const Setting& setting) {
  PairNeeds needs;
  needs.has_images = setting.periodic[0] || setting.periodic[1] || setting.periodic[2];
  needs.slot_size = 8;
  return needs;
}

}  // namespace moraine::contacts_test
