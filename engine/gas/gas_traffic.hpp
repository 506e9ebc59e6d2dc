// What the ranks of the gas say to each other, known without any of them: for projections. Written down as GasFlow and PressureSolver do
// it; tests/ranks/calls.cpp counts both.
#pragma once

#include "comm/grid_share.hpp"
#include "engine/gas/grid.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

/// Messages of a rank, and how often all ranks agree on a sum or a maximum.
struct Talk {
  GridTraffic messages;
  int n_reductions = 0;
};

/// Of each gas step, each part of one, each iteration of the pressure equation.
struct GasTraffic {
  Talk step, part, iteration;
};

/// Of a rank of share.n_ranks(), once the gas has started.
GasTraffic gas_traffic(const Gas& gas, const GasGrid& grid, const GridShare& share, int rank);

/// Cells of the grids that the first rank solves alone in each cycle, while the others wait.
std::int64_t cells_of_root(const GasGrid& grid, const GridShare& share);

}  // namespace moraine
