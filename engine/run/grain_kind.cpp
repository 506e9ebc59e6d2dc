#include "engine/run/grain_kind.hpp"

#include <algorithm>
#include <array>
#include <span>

#include "engine/contacts/size_classes.hpp"
#include "engine/particles/sizes.hpp"
#include "kernels/base/sphere.hpp"

namespace moraine {

namespace {

/// Calls f(radius, material) for the smallest and largest grains that inlets may give.
template <typename Function>
void for_each_kind_to_come(const Scene& scene, Function f) {
  for (const Inlet& inlet : scene.inlets) {
    const auto material = static_cast<std::uint16_t>(std::max(0, scene.material_index(inlet.material)));
    if (inlet.list && inlet.list->has_radius) {
      for (const GrainSeed& grain : inlet.list->grains)
        f(grain.radius, inlet.material.empty() ? grain.material : material);
      continue;
    }
    const DiameterSampler sampler(inlet.diameter);
    for (const double diameter : {sampler.smallest(), sampler.largest()}) f(0.5 * diameter, material);
  }
}

}  // namespace

GrainKind kind_of(const World& world, const Scene& scene, const Particles& particles) {
  // Largest radius, inverse mass and material, then the largest of the negative ones, which gives the smallest.
  std::array<double, 6> most;
  most.fill(-infinity);
  const auto include = [&](const std::array<double, 3>& values) {
    for (std::size_t k = 0; k < 3; ++k) {
      most[k] = std::max(most[k], values[k]);
      most[k + 3] = std::max(most[k + 3], -values[k]);
    }
  };
  SizeClasses::Census radii;
  for (std::int32_t i = 0; i < particles.size(); ++i)
    include({particles.radius(i), particles.inverse_mass(i), static_cast<double>(particles.material(i))});
  for_each_kind_to_come(scene, [&](double radius, std::uint16_t material) {
    const double mass = scene.materials[material].density * sphere_volume(radius);
    include({radius, 1.0 / mass, static_cast<double>(material)});
    radii.add(radius);
  });
  world.max(most);
  for (std::int32_t i = 0; i < particles.size(); ++i) radii.add(particles.radius(i));
  world.max(std::span<double>(radii.values()));
  GrainKind kind;
  if (most[0] < 0.0) return kind;  // there are no grains
  kind.largest_radius = most[0];
  radii.add(kind.largest_radius);
  kind.sizes = SizeClasses(radii);
  kind.smallest_radius = -most[3];
  kind.inverse_mass = most[1];
  kind.largest_mass = -1.0 / most[4];
  kind.mass_ratio = most[1] / -most[4];
  kind.is_uniform = most[0] == -most[3] && most[1] == -most[4] && most[2] == -most[5];
  return kind;
}

}  // namespace moraine
