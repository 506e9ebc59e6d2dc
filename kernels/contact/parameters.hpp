// Parameters of the contact laws, per pair of materials, in the layout that the sweeps read.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "kernels/contact/law_kinds.hpp"

namespace moraine {

/// One number of a contact law. Units as noted; those that a law does not use stay zero.
enum class Parameter : std::uint8_t {
  normal_stiffness,      // k_n [N/m] (linear)
  young,                 // E* [Pa] (Hertz): 1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2
  shear,                 // G* [Pa] (Mindlin, power): 1/G* = (2 - nu1)/G1 + (2 - nu2)/G2
  damping,               // beta = -ln e / sqrt(pi^2 + ln^2 e) [-]
  tangential_stiffness,  // k_t [N/m] (spring; power with a linear normal law)
  tangential_damping,  // ratio of the tangential dashpot to the normal one (linear) or to its Mindlin match (Hertz) [-]
  friction,            // mu [-]
  viscosity,           // gamma_t [N s/m] (viscous)
  displacement,        // delta_max [m] (power); 0: 3/2 mu F_N / k_t
  rolling_friction,    // mu_r [-] (rolling)
  rolling_stiffness,   // k_r [N m/rad] (rolling spring); 0: 2.25 k_n mu_r^2 R*^2
  rolling_damping,     // [-] of the critical damping (rolling spring)
  cohesion,            // JKR: work of adhesion W [J/m2]. Simplified JKR: energy density [J/m3]. Linear: force F_0 [N].
                       //     Liquid bridge: surface tension times cosine of the contact angle [N/m]
  cohesion_range,      // [m] linear: reach beyond contact. Liquid bridge: gap at which it breaks
  liquid_volume,       // V [m3] of a liquid bridge
  count_
};
inline constexpr std::size_t n_parameters = static_cast<std::size_t>(Parameter::count_);

/// Most material pairs that a scene can tell apart; a pair's index fits in a byte.
inline constexpr std::size_t max_species_pairs = 256;

/// Parameters of one pair of materials.
struct PairParameters {
  std::array<double, n_parameters> values{};
  double operator[](Parameter p) const { return values[static_cast<std::size_t>(p)]; }
  double& operator[](Parameter p) { return values[static_cast<std::size_t>(p)]; }
  bool operator==(const PairParameters&) const = default;
};

/// One column per parameter, indexed by the pair's species index.
struct LawTable {
  std::array<std::array<double, max_species_pairs>, n_parameters> columns{};

  const double* column(Parameter p) const { return columns[static_cast<std::size_t>(p)].data(); }
  void set(std::size_t species, const PairParameters& parameters) {
    for (std::size_t p = 0; p < n_parameters; ++p) columns[p][species] = parameters.values[p];
  }
  PairParameters at(std::size_t species) const {
    PairParameters parameters;
    for (std::size_t p = 0; p < n_parameters; ++p) parameters.values[p] = columns[p][species];
    return parameters;
  }
};

/// The table for masses, forces and energies in other units: those of which the kilogram is a part, divided by `unit` [kg]. A
/// power of two leaves their digits as they are.
LawTable in_units_of_mass(const LawTable& table, double unit);

/// Which compiled combination of laws a scene uses.
struct LawChoice {
  NormalLaw normal = NormalLaw::linear;
  TangentialLaw tangential = TangentialLaw::spring;
  bool has_rotation = true;
  bool is_uniform = false;  // all grains have the same radius, mass and material
  bool has_ledger = false;  // the energy lost in each contact is wanted
  RollingLaw rolling = RollingLaw::none;
  CohesionLaw cohesion = CohesionLaw::none;
  bool is_mixed = false;  // contact arithmetic, memory and slots in float; else in double

  /// True where there is more to a contact than its normal and tangential law.
  constexpr bool has_further() const { return rolling != RollingLaw::none || cohesion != CohesionLaw::none; }
};

}  // namespace moraine
