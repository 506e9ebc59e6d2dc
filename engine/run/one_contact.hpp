// One contact on its own, in the very law and time step of a run: what the step makes of an impact.
#pragma once

#include <string>
#include <vector>

#include "engine/scene/scene.hpp"
#include "kernels/contact/parameters.hpp"

namespace moraine {

/// Two bodies of a scene that may meet: the smallest grains of two materials, or one of them and a wall.
struct ContactCase {
  PairParameters parameters;
  double inverse_mass_a = 0.0, inverse_mass_b = 0.0;  // [1/kg]; 0: a wall
  double curvature_a = 0.0, curvature_b = 0.0;        // [1/m]; 0: a wall
  std::string words;                                  // "glass (d 0.004 m) with wall "floor" (steel)"
  double reduced_mass() const { return 1.0 / (inverse_mass_a + inverse_mass_b); }
  double reduced_radius() const { return 1.0 / (curvature_a + curvature_b); }
};

/// Every case of a scene; mirrors as two grains of one kind.
std::vector<ContactCase> contact_cases(const Scene& scene);

/// Restitution of a head-on impact at `speed` [m/s] with steps of `dt` [s]: speed after it over speed before. `phase`
/// (0 to 1): at which part of a step the bodies touch first.
double restitution_of_impact(const Scene& scene, const ContactCase& bodies, double speed, double dt, double phase);

/// What a time step makes of impacts of a scene at the speed expected, against steps a hundred times as short; the worst
/// of all its cases and of all phases.
struct ImpactError {
  double restitution = 0.0;  // [-] largest difference
  double exact = 0.0;        // [-] the restitution that it should be
  std::string pair;          // whose it is
  double energy = 0.0;       // [-] largest change of the kinetic energy in an impact without dashpot
  std::string energy_pair;
};
ImpactError impact_error(const Scene& scene, double dt);

}  // namespace moraine
