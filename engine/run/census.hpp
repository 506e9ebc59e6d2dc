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
  struct OfMaterial {
    double n_born = 0.0, n_left = 0.0;
    double mass_born = 0.0, mass_left = 0.0;
  };
  double n_born = 0.0, n_left = 0.0;
  double mass_born = 0.0, mass_left = 0.0;
  std::vector<OfMaterial> of_material;  // by index into Scene::materials
  std::vector<double> n_left_through;   // of each outlet
};

/// What one rank has counted; sums are exact, so that they come to the same however the grains are shared out.
struct CensusTaker {
  CensusTaker(std::size_t n_materials, std::size_t n_outlets) : of_material(n_materials), n_left_through(n_outlets) {}

  struct OfMaterial {
    std::uint64_t n_born = 0, n_left = 0;
    ExactSum mass_born, mass_left;  // [kg]
  };
  std::vector<OfMaterial> of_material;
  std::vector<std::uint64_t> n_left_through;
  ExactSum energy_left;  // [J] carried out through outlets, less what newborns have brought
  ExactSum wall_work;    // [J] that moving walls have done on grains

  std::uint64_t n_born() const;
  std::uint64_t n_left() const;
  void count_born(std::uint16_t material, double mass);
  void count_left(std::uint16_t material, double mass, std::size_t outlet);

  /// That of all ranks. All of them call it.
  CensusTaker total(const World& world) const;
  Census census() const;

  /// To and from the accumulators of a checkpoint, which keep sums whole. Throws SceneError where one is missing.
  void keep(std::map<std::string, std::vector<double>>& accumulators) const;
  /// `inside`: the grains inside, by material; from these follow the counts by material that older checkpoints lack, with all that have
  /// left before among those of the first.
  static CensusTaker from(const std::map<std::string, std::vector<double>>& accumulators, const CensusTaker& inside);
};

/// One value of a checkpoint's accumulators. Throws SceneError where it is missing.
double kept_number(const std::map<std::string, std::vector<double>>& accumulators, const std::string& name);

}  // namespace moraine
