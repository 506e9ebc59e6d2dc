// What the hard cases have in common: a few grains in a box, their state, and runs that are broken off and gone on with.
#pragma once

#include <algorithm>
#include <catch2/catch.hpp>
#include <string>
#include <vector>

#include "engine/run/simulation.hpp"
#include "tests/support/flow_scenes.hpp"

namespace moraine::hard {

inline constexpr double radius = 0.005;    // [m] of a common grain
inline constexpr double density = 2500.0;  // [kg/m3]

struct Grain {
  Vec3 position, velocity, angular_velocity;
  double radius = 0.0;  // 0: the common one
};

/// Grains of glass, friction 0.4, restitution 0.8, k = 1e4 N/m, in a box of 2 m without walls.
inline Scene scene_of(const std::vector<Grain>& grains) {
  Scene s;
  s.time.end = 100.0;
  s.materials = {{"glass", density, 5e6, 0.3}};
  PairLaw p;
  p.between = {"glass", "glass"};
  p.normal_stiffness = 1e4;
  p.restitution = 0.8;
  p.friction = 0.4;
  s.contact.pairs = {p};
  s.domain.low = {-1, -1, -1};
  s.domain.high = {1, 1, 1};
  ListedGrains list;
  for (const Grain& grain : grains)
    list.grains.push_back(
        {grain.position, grain.velocity, grain.angular_velocity, grain.radius > 0.0 ? grain.radius : radius, 0});
  list.has_velocity = list.has_radius = true;
  ParticleGroup group;
  group.material = "glass";
  group.fill = list;
  s.particles = {group};
  return s;
}

inline Vec3 vector_of(const Image& image, Field field, std::size_t grain) {
  const std::vector<double>& v = image.find(field)->reals;
  return {v[3 * grain], v[3 * grain + 1], v[3 * grain + 2]};
}
inline Vec3 position(const Simulation& simulation, std::size_t grain) {
  return vector_of(simulation.snapshot(), Field::position, grain);
}
inline Vec3 velocity(const Simulation& simulation, std::size_t grain) {
  return vector_of(simulation.snapshot(), Field::velocity, grain);
}

inline void advance(Simulation& simulation, std::int64_t n_steps) {
  for (std::int64_t i = 0; i < n_steps; ++i) simulation.step();
}

/// Takes so many steps, and the second half of them once more from a checkpoint: both must end in the same state.
inline void advance_through_restart(Simulation& simulation, const Scene& scene, std::int64_t n_steps) {
  advance(simulation, n_steps / 2);
  Simulation again(scene, 2, simulation.checkpoint());
  advance(simulation, n_steps - n_steps / 2);
  advance(again, n_steps - n_steps / 2);
  CHECK(simulation.state_hash() == again.state_hash());
}

inline double largest_speed(const Simulation& simulation) {
  const Image image = simulation.snapshot();
  double most = 0.0;
  for (std::size_t i = 0; i < image.n_grains; ++i) most = std::max(most, length(vector_of(image, Field::velocity, i)));
  return most;
}

inline std::vector<double> positions(const Simulation& simulation) {
  return simulation.snapshot().find(Field::position)->reals;
}
inline double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double most = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) most = std::max(most, std::abs(a[k] - b[k]));
  return most;
}

inline double mass_of(double r) { return density * 4.0 / 3.0 * 3.14159265358979323846 * r * r * r; }

}  // namespace moraine::hard
