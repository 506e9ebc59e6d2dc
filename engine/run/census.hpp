// Grains born and grains that have left, with their masses and energies: inside + left = born.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "comm/world.hpp"
#include "kernels/base/exact_sum.hpp"

namespace moraine {

/// Counts and masses [kg] of the grains ever born and of those that have left.
struct Census {
  double n_born = 0.0, n_left = 0.0;
  double mass_born = 0.0, mass_left = 0.0;
};

/// What one rank has counted; sums are exact, so that they come to the same however the grains are shared out.
struct CensusTaker {
  std::uint64_t n_born = 0, n_left = 0;
  ExactSum mass_born, mass_left;  // [kg]
  ExactSum energy_left;           // [J] carried out through outlets

  /// That of all ranks. All of them call it.
  CensusTaker total(const World& world) const;
  Census census() const;

  /// To and from the accumulators of a checkpoint, which keep sums whole. Throws SceneError where one is missing.
  void keep(std::map<std::string, std::vector<double>>& accumulators) const;
  static CensusTaker from(const std::map<std::string, std::vector<double>>& accumulators);
};

/// One value of a checkpoint's accumulators. Throws SceneError where it is missing.
double kept_number(const std::map<std::string, std::vector<double>>& accumulators, const std::string& name);

}  // namespace moraine
