// The gas grid: uniform cells over the whole domain, and the part of them that a rank has.
#pragma once

#include <array>

#include "comm/grid_share.hpp"
#include "comm/world.hpp"
#include "engine/scene/scene.hpp"
#include "kernels/base/box.hpp"
#include "kernels/base/grid.hpp"

namespace moraine {

/// Ghost layers of gas fields: advection looks two cells ahead.
inline constexpr int gas_ghosts = 2;

struct GasGrid {
  std::array<int, 3> n{};  // cells
  Vec3 low;                // [m] corner of the domain
  Vec3 spacing;            // [m]
  std::array<bool, 3> periodic{};
  bool is_flat = false;  // two dimensions: one cell along z, and nothing moves along it

  double cell_volume() const { return spacing.x * spacing.y * spacing.z; }
};

inline GasGrid gas_grid(const Domain& domain, const Gas& gas) {
  GasGrid grid;
  grid.n = gas.cells;
  grid.low = domain.low;
  const Vec3 size = domain.high - domain.low;
  grid.spacing = {size.x / gas.cells[0], size.y / gas.cells[1], size.z / gas.cells[2]};
  grid.periodic = domain.periodic;
  grid.is_flat = domain.dimensions == 2;
  return grid;
}

/// Who solves the gas, and on how many threads. Only ranks with a block make calls to what is built on it.
struct GasRanks {
  World world;      // of share.n_ranks() ranks
  GridShare share;  // of the grid's cells
  int n_threads = 1;
  CellBlock block() const { return share.block(world.rank()); }
};

}  // namespace moraine
