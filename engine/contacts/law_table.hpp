// From the materials and pair laws of a scene to the tables that the sweeps read.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/scene/scene.hpp"
#include "kernels/contact/parameters.hpp"
#include "kernels/contact/sweep.hpp"

namespace moraine {

/// Contact parameters of two materials [SI], in either order. Throws SceneError where the scene gives none.
PairParameters pair_parameters(const Scene& scene, const std::string& a, const std::string& b);

/// The laws of a scene, as its kernels are chosen by.
LawChoice law_choice(const Scene& scene);

/// Tables of a scene: grains with grains, and grains with walls.
struct SceneLaws {
  LawTable pairs;
  LawTable walls;
  std::vector<std::uint8_t> pair_species;  // row of `pairs` by material x material
  std::vector<std::uint8_t> wall_species;  // row of `walls` by material x wall
  int n_materials = 0;
  int n_walls = 0;
  int n_pair_species = 0, n_wall_species = 0;

  explicit SceneLaws(const Scene& scene);
  /// Gap [m] beyond which no grains of up to that radius attract each other, or walls. The list of pairs must reach as far.
  double attraction_range(CohesionLaw law, double largest_radius) const;
};

}  // namespace moraine
