#include "engine/contacts/law_table.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/scene/lists.hpp"

namespace moraine {

namespace {

double shear_modulus(const Material& m) { return m.young / (2.0 * (1.0 + m.poisson)); }

/// beta = -ln e / sqrt(pi^2 + ln^2 e), the share of critical damping that gives the restitution e.
double damping_of(double restitution) {
  const double log = std::log(restitution);
  return -log / std::sqrt(std::numbers::pi * std::numbers::pi + log * log);
}

/// Row of the table that holds `parameters`, added if it is new.
std::uint8_t row_of(std::vector<PairParameters>& rows, const PairParameters& parameters) {
  const auto found = std::find(rows.begin(), rows.end(), parameters);
  if (found != rows.end()) return static_cast<std::uint8_t>(found - rows.begin());
  if (rows.size() == max_species_pairs)
    throw SceneError({{"contact.pair", "more than 256 different pairs of materials meet; use fewer materials", false}});
  rows.push_back(parameters);
  return static_cast<std::uint8_t>(rows.size() - 1);
}

}  // namespace

PairParameters pair_parameters(const Scene& scene, const std::string& a, const std::string& b) {
  const PairLaw* const law = scene.pair_law(a, b);
  const int ia = scene.material_index(a), ib = scene.material_index(b);
  if (!law || ia < 0 || ib < 0)
    throw SceneError(
        {{"contact.pair", "no contact parameters for the materials \"" + a + "\" and \"" + b + "\"", false}});
  const Material& ma = scene.materials[static_cast<std::size_t>(ia)];
  const Material& mb = scene.materials[static_cast<std::size_t>(ib)];
  const bool is_linear = scene.contact.normal == NormalLaw::linear;
  PairParameters p;
  p[Parameter::normal_stiffness] = law->normal_stiffness;
  if (ma.young > 0.0 && mb.young > 0.0) {
    p[Parameter::young] =
        1.0 / ((1.0 - ma.poisson * ma.poisson) / ma.young + (1.0 - mb.poisson * mb.poisson) / mb.young);
    p[Parameter::shear] = 1.0 / ((2.0 - ma.poisson) / shear_modulus(ma) + (2.0 - mb.poisson) / shear_modulus(mb));
  }
  p[Parameter::damping] = damping_of(law->restitution);
  p[Parameter::tangential_stiffness] = law->tangential_stiffness.value_or(2.0 / 7.0 * law->normal_stiffness);
  p[Parameter::tangential_damping] = law->tangential_damping.value_or(is_linear ? 0.5 : 1.0);
  p[Parameter::friction] = law->friction;
  p[Parameter::viscosity] = law->tangential_viscosity;
  p[Parameter::displacement] = law->tangential_displacement.value_or(0.0);
  return p;
}

SceneLaws::SceneLaws(const Scene& scene)
    : n_materials(static_cast<int>(scene.materials.size())), n_walls(static_cast<int>(scene.walls.size())) {
  const std::vector<bool> is_grain = grain_materials(scene);
  std::vector<PairParameters> pair_rows, wall_rows;
  pair_species.assign(scene.materials.size() * scene.materials.size(), 0);
  wall_species.assign(scene.materials.size() * scene.walls.size(), 0);
  for (std::size_t i = 0; i < scene.materials.size(); ++i) {
    if (!is_grain[i]) continue;
    for (std::size_t j = 0; j < scene.materials.size(); ++j)
      if (is_grain[j])
        pair_species[i * scene.materials.size() + j] =
            row_of(pair_rows, pair_parameters(scene, scene.materials[i].name, scene.materials[j].name));
    for (std::size_t w = 0; w < scene.walls.size(); ++w) {
      const WallDefinition& wall = scene.walls[w];
      // A mirror shows the grain itself: the law of the grain with its own kind, and nothing to slide along.
      PairParameters p =
          pair_parameters(scene, scene.materials[i].name, wall.symmetry ? scene.materials[i].name : wall.material);
      if (wall.symmetry || wall.frictionless) {
        p[Parameter::friction] = 0.0;
        p[Parameter::viscosity] = 0.0;
      }
      wall_species[i * scene.walls.size() + w] = row_of(wall_rows, p);
    }
  }
  for (std::size_t row = 0; row < pair_rows.size(); ++row) pairs.set(row, pair_rows[row]);
  for (std::size_t row = 0; row < wall_rows.size(); ++row) walls.set(row, wall_rows[row]);
  n_pair_species = static_cast<int>(pair_rows.size());
}

}  // namespace moraine
