#include "io/cli/watch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace moraine {

namespace {

/// Times gas.tolerance. A gas step is solved in several parts, whose imbalances add up.
constexpr double much_imbalance = 20.0;
/// So many gas steps together, with so large a share of all cells at the floor, are more than a grain that squeezes by.
constexpr std::uint64_t long_time = 200;  // [gas steps]
constexpr double many_cells = 0.01;
/// Of the energy that has been turned over. The ledger's own error is that of the time step, a few per cent in dense beds.
constexpr double much_energy = 0.2;

}  // namespace

Watch::Watch(const Scene& scene) {
  if (!scene.gas) return;
  tolerance_ = scene.gas->tolerance;
  least_void_fraction_ = scene.gas->least_void_fraction;
  n_cells_ = 1.0;
  for (const int n : scene.gas->cells) n_cells_ *= n;
}

std::vector<Warning> Watch::look(const GasTotals& gas, double time) {
  std::vector<Warning> found;
  if (!has_told_imbalance_ && gas.imbalance > much_imbalance * tolerance_) {
    has_told_imbalance_ = true;
    found.push_back(
        {Concern::gas_balance, fmt::format("at {:.6g} s: a cell has gained or lost {:.2g} of its gas in one gas step, "
                                           "and gas.tolerance is {:.2g}: the "
                                           "pressure equation was not solved well; a smaller gas.step may help",
                                           time, gas.imbalance, tolerance_)});
  }
  const std::uint64_t n_steps = gas.n_steps - n_steps_seen_;
  if (n_steps < long_time) return found;
  const double share = static_cast<double>(gas.n_floored - n_floored_seen_) / static_cast<double>(n_steps) / n_cells_;
  n_steps_seen_ = gas.n_steps;
  n_floored_seen_ = gas.n_floored;
  if (has_told_floor_ || share < many_cells) return found;
  has_told_floor_ = true;
  found.push_back(
      {Concern::void_fraction,
       fmt::format("at {:.6g} s: {:.2g} of all gas cells have been denser than gas.least_void_fraction = {:.3g} for {} "
                   "gas steps, and "
                   "were taken as that: their drag is too small; use larger cells, or weights = \"smoothed\"",
                   time, share, least_void_fraction_, n_steps)});
  return found;
}

std::vector<Warning> Watch::look(const EnergyLedger& ledger, double time) {
  const double turned_over = std::abs(ledger.kinetic) + std::abs(ledger.rotational) + std::abs(ledger.elastic_normal) +
                             std::abs(ledger.elastic_tangential) + std::abs(ledger.lost_normal) +
                             std::abs(ledger.lost_tangential) + std::abs(ledger.lost_friction) +
                             std::abs(ledger.lost_drag) + std::abs(ledger.total() - ledger.initial);
  if (has_told_energy_ || !(std::abs(ledger.error()) > much_energy * turned_over)) return {};
  has_told_energy_ = true;
  return {{Concern::energy,
           fmt::format("at {:.6g} s: the energy ledger is open by {:.3g} J, {:.2g} of the {:.3g} J that were turned "
                       "over: the time step "
                       "is too long for the contacts, or something drives the grains that the ledger does not know",
                       time, ledger.error(), std::abs(ledger.error()) / turned_over, turned_over)}};
}

}  // namespace moraine
