#include "engine/contacts/law_table.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/scene/lists.hpp"
#include "kernels/contact/reference/reference.hpp"

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

LawChoice law_choice(const Scene& scene) {
  LawChoice choice;
  choice.normal = scene.contact.normal;
  choice.tangential = scene.contact.tangential;
  choice.has_rotation = scene.contact.rotation;
  choice.has_ledger = scene.output.energy;
  choice.rolling = scene.contact.rolling;
  choice.cohesion = scene.contact.cohesion;
  choice.is_mixed = scene.run.precision == Precision::mixed;
  return choice;
}

namespace {

/// Those of the scene's law of cohesion; the others stay zero, so that they make no difference between pairs.
void put_cohesion(CohesionLaw law, const PairLaw& from, PairParameters& p) {
  switch (law) {
    case CohesionLaw::none: break;
    case CohesionLaw::jkr: p[Parameter::cohesion] = from.work_of_adhesion; break;
    case CohesionLaw::sjkr: p[Parameter::cohesion] = from.cohesion_energy_density; break;
    case CohesionLaw::linear:
      p[Parameter::cohesion] = from.cohesion_force;
      p[Parameter::cohesion_range] = from.cohesion_range;
      break;
    case CohesionLaw::liquid_bridge:
      if (!(from.liquid_volume > 0.0)) break;  // no liquid, no bridge
      p[Parameter::cohesion] = from.surface_tension * std::cos(from.contact_angle);
      p[Parameter::liquid_volume] = from.liquid_volume;
      // Lian, Thornton & Adams (1993)
      p[Parameter::cohesion_range] = (1.0 + 0.5 * from.contact_angle) * std::cbrt(from.liquid_volume);
      break;
  }
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
  if (scene.contact.rolling != RollingLaw::none) p[Parameter::rolling_friction] = law->rolling_friction;
  if (scene.contact.rolling == RollingLaw::spring) {
    p[Parameter::rolling_stiffness] = law->rolling_stiffness.value_or(0.0);
    p[Parameter::rolling_damping] = law->rolling_damping;
  }
  put_cohesion(scene.contact.cohesion, *law, p);
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
      if (wall.frictionless) {
        p[Parameter::rolling_friction] = 0.0;
      }
      wall_species[i * scene.walls.size() + w] = row_of(wall_rows, p);
    }
  }
  for (std::size_t row = 0; row < pair_rows.size(); ++row) pairs.set(row, pair_rows[row]);
  for (std::size_t row = 0; row < wall_rows.size(); ++row) walls.set(row, wall_rows[row]);
  n_pair_species = static_cast<int>(pair_rows.size());
  n_wall_species = static_cast<int>(wall_rows.size());
}

double SceneLaws::attraction_range(CohesionLaw law, double largest_radius) const {
  double range = 0.0;  // it grows with the reduced radius: half the radius of two grains, the radius at a wall
  for (int row = 0; row < n_pair_species; ++row)
    range =
        std::max(range, moraine::attraction_range(law, pairs.at(static_cast<std::size_t>(row)), 0.5 * largest_radius));
  for (int row = 0; row < n_wall_species; ++row)
    range = std::max(range, moraine::attraction_range(law, walls.at(static_cast<std::size_t>(row)), largest_radius));
  return range;
}

}  // namespace moraine
