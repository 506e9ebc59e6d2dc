// What hard cases share: grains at given places, states by gid, runs that are broken and restored on their way.
#pragma once

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "engine/run/simulation.hpp"
#include "tests/support/flow_scenes.hpp"
#include "tests/support/measured.hpp"

namespace moraine::cases {

using scenes::add_probe;
using testing::report;

inline Vec3 vector_of(const Image& image, Field field, std::size_t grain) {
  const std::vector<double>& v = image.find(field)->reals;
  return {v[3 * grain], v[3 * grain + 1], v[3 * grain + 2]};
}

/// A box without walls, and one material "grain" that touches itself by linear springs.
inline Scene empty_scene(Vec3 low, Vec3 high, double density, double stiffness, double restitution, double friction) {
  Scene s;
  s.time.end = 1e6;
  s.domain.low = low;
  s.domain.high = high;
  s.materials = {{"grain", density, 0.0, 0.3}};
  PairLaw law;
  law.between = {"grain", "grain"};
  law.normal_stiffness = stiffness;
  law.restitution = restitution;
  law.friction = friction;
  s.contact.pairs = {law};
  return s;
}

inline void add_grains(Scene& scene, double diameter, std::vector<GrainSeed> grains,
                       const std::string& material = "grain") {
  scene.particles.push_back(scenes::listed(std::move(grains), diameter, material));
}

inline void add_lattice(Scene& scene, double diameter, LatticeFill::Kind kind, Box box, double spacing) {
  LatticeFill fill;
  fill.kind = kind;
  fill.region = BoxRegion{box};
  fill.spacing = spacing;
  ParticleGroup group;
  group.material = "grain";
  group.diameter.value = diameter;
  group.fill = fill;
  scene.particles.push_back(group);
}

/// Layers of a face-centred cubic lattice, `n` x `n` cells wide with two grains a layer and cell, the first layer's centres at height `low`.
inline std::vector<GrainSeed> cubic_layers(double cell, int n, int n_layers, double low) {
  std::vector<GrainSeed> grains;
  for (int layer = 0; layer < n_layers; ++layer)
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i)
        for (const double shift : {0.0, 0.5}) {
          GrainSeed grain;
          const double across = layer % 2 == 0 ? shift : 0.5 - shift;
          grain.position = {(i + shift + 0.1) * cell, (j + across + 0.1) * cell, low + 0.5 * layer * cell};
          grains.push_back(grain);
        }
  return grains;
}

inline void add_plane(Scene& scene, const std::string& name, Vec3 point, Vec3 normal) {
  scenes::add_wall(scene, name, PlaneShape{point, normal}, "grain");
}

inline double largest_speed(const Simulation& run) {
  const Image image = run.snapshot({"velocity"});
  double most = 0.0;
  for (std::size_t i = 0; i < image.n_grains; ++i) most = std::max(most, length(vector_of(image, Field::velocity, i)));
  return most;
}

inline void advance(Simulation& run, std::int64_t n_steps) {
  for (std::int64_t i = 0; i < n_steps; ++i) run.step();
}

/// What ends the run within so many steps; empty where nothing does.
inline std::string error_of(Simulation& run, std::int64_t n_steps) {
  try {
    advance(run, n_steps);
  } catch (const RunError& error) {
    return error.what();
  }
  return "";
}

/// Advances a run; in the middle of the way a second one goes on from its checkpoint, on more threads, and for as many of the steps left as
/// `n_beside` (0: there is none) it must be the same to the bit.
inline void advance_past_restart(Simulation& run, const Scene& scene, std::int64_t n_steps,
                                 std::int64_t n_beside = 300) {
  if (n_beside == 0) return advance(run, n_steps);
  advance(run, n_steps / 2);
  Simulation restored(scene, 2, run.checkpoint());
  const std::int64_t left = n_steps - n_steps / 2, beside = std::min(left, n_beside);
  advance(run, beside);
  advance(restored, beside);
  CHECK(restored.state_hash() == run.state_hash());
  advance(run, left - beside);
}

}  // namespace moraine::cases
