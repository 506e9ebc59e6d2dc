// What a run survives but whoever reads its results must know: each is told once, when it is first seen.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/run/ledger.hpp"
#include "engine/run/simulation.hpp"

namespace moraine {

struct Warning {
  Concern concern;
  std::string text;
};

class Watch {
 public:
  explicit Watch(const Scene& scene);

  /// New warnings about the gas: it does not balance to gas.tolerance, or many cells are at their least void fraction for long.
  std::vector<Warning> look(const GasTotals& gas, double time);
  /// A new warning about the energy ledger: what it leaves open has become too large to be the error of the time step.
  std::vector<Warning> look(const EnergyLedger& ledger, double time);

 private:
  double tolerance_ = 0.0, n_cells_ = 0.0, least_void_fraction_ = 0.0;
  bool has_told_imbalance_ = false, has_told_floor_ = false, has_told_energy_ = false;
  std::uint64_t n_steps_seen_ = 0, n_floored_seen_ = 0;
};

}  // namespace moraine
