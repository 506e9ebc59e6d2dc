// Scenes and checks that the tests of fills share.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "engine/particles/fill.hpp"
#include "kernels/base/exact_sum.hpp"

namespace moraine::fill_tests {

inline Scene box_scene(Vec3 size, std::array<bool, 3> periodic = {false, false, false}) {
  Scene scene;
  scene.domain.high = size;
  scene.domain.periodic = periodic;
  scene.materials.push_back({"glass", 2500.0, 0.0, 0.3});
  return scene;
}

inline ParticleGroup group_of(double diameter) {
  ParticleGroup group;
  group.material = "glass";
  group.diameter.value = diameter;
  return group;
}

inline RandomFill random_fraction(const Region& region, double fraction) {
  RandomFill fill;
  fill.region = region;
  fill.solid_fraction = fraction;
  return fill;
}

inline RandomFill random_count(const Region& region, std::int64_t count) {
  RandomFill fill;
  fill.region = region;
  fill.count = count;
  return fill;
}

/// Shortest vector from b to any image of a.
inline Vec3 nearest(const Domain& domain, Vec3 a, Vec3 b) {
  Vec3 d = a - b;
  for (int k = 0; k < 3; ++k)
    if (domain.periodic[static_cast<std::size_t>(k)]) {
      const double size = domain.high[k] - domain.low[k];
      d[k] -= size * std::round(d[k] / size);
    }
  return d;
}

/// Pairs that overlap at all, by looking at every pair.
inline int overlapping_pairs(const Scene& scene, const std::vector<GrainSeed>& grains) {
  int n = 0;
  for (std::size_t i = 0; i < grains.size(); ++i)
    for (std::size_t j = i + 1; j < grains.size(); ++j) {
      const double reach = grains[i].radius + grains[j].radius;
      n += squared_length(nearest(scene.domain, grains[i].position, grains[j].position)) < reach * reach;
    }
  return n;
}

inline double solid_volume(const std::vector<GrainSeed>& grains) {
  double sum = 0.0;
  for (const GrainSeed& grain : grains) sum += 4.0 / 3.0 * std::numbers::pi * std::pow(grain.radius, 3);
  return sum;
}

inline bool same_bits(const std::vector<GrainSeed>& a, const std::vector<GrainSeed>& b) {
  if (a.size() != b.size()) return false;
  for (std::size_t i = 0; i < a.size(); ++i)
    if (!(a[i].position == b[i].position && a[i].velocity == b[i].velocity && a[i].radius == b[i].radius &&
          a[i].angular_velocity == b[i].angular_velocity && a[i].material == b[i].material))
      return false;
  return true;
}

}  // namespace moraine::fill_tests
