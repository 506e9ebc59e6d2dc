#include "engine/gas/gas_traffic.hpp"

#include <algorithm>

#include "comm/grid_halo.hpp"
#include "engine/gas/multigrid.hpp"

namespace moraine {

GasTraffic gas_traffic(const Gas& gas, const GasGrid& grid, const GridShare& share, int rank) {
  GasTraffic traffic;
  if (share.n_ranks() == 1) return traffic;
  const std::vector<LevelPlan> levels = plan_levels(share, GridCells::uniform(grid.n, grid.spacing));
  const GridShare rows = share_of_rows(share);
  const int n_axes = grid.is_flat ? 2 : 3;
  const auto fields = [&](int n) { return halo_traffic(share, rank, gas_ghosts, n, sizeof(double)); };

  // The load, with its least void fraction.
  traffic.step = {fields(5), 1};
  // The fastest gas; velocities before and after the pressure equation, then with the drift, and the pressure.
  traffic.part = {fields(n_axes), 1};
  traffic.part.messages += fields(n_axes + 1);
  traffic.part.messages += fields(1);
  // Coefficients: their scale, whether there is an outlet, how many cells are open; then the first residual.
  traffic.part.messages += halo_traffic(rows, rank, 1, 3, sizeof(double));
  traffic.part.messages += weights_traffic(levels, rank);
  traffic.part.messages += halo_traffic(rows, rank, 1, 1, sizeof(double));
  const bool has_outlet = std::any_of(gas.boundaries.begin(), gas.boundaries.end(), [](const GasBoundary& boundary) {
    return boundary.kind == GasBoundary::Kind::pressure;
  });
  traffic.part.n_reductions += 3 + 1 + (has_outlet ? 0 : 2);
  // A cycle, a direction; and two products and the residual.
  traffic.iteration = {cycle_traffic(levels, rank), 3};
  traffic.iteration.messages += halo_traffic(rows, rank, 1, 1, sizeof(float));
  return traffic;
}

std::int64_t cells_of_root(const GasGrid& grid, const GridShare& share) {
  if (share.n_ranks() == 1) return 0;
  const LevelPlan last = plan_levels(share, GridCells::uniform(grid.n, grid.spacing)).back();
  return cells_of_all(plan_levels(last.share.undivided(), last.cells));
}

}  // namespace moraine
