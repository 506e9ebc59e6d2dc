// A gas flow in which everything happens: inlets on parts of faces with ramps, an outlet, a moving wall, a free-slip
// wall, grains that come and go and drag. For tests of layouts, restarts and balances.
#pragma once

#include <cmath>

#include "engine/gas/gas_flow.hpp"

namespace moraine::scenes {

struct BusyGas {
  GasGrid grid;
  Gas gas;

  explicit BusyGas(std::array<int, 3> n, bool is_flat, bool is_periodic_y = false) {
    grid = {n, {}, {0.01, 0.011, 0.012}, {false, is_periodic_y, false}, is_flat};
    gas.cells = n;
    gas.density = 1.2;
    gas.viscosity = 2e-4;
    gas.velocity = {0.1, 0.0, 0.0};
    const double width = n[0] * 0.01, depth = n[1] * 0.011;
    const auto add = [&](GasBoundary::Kind kind, int face, Vec3 velocity) -> GasBoundary& {
      GasBoundary made;
      made.kind = kind;
      made.face = face;
      made.velocity = velocity;
      gas.boundaries.push_back(made);
      return gas.boundaries.back();
    };
    if (is_flat) {
      add(GasBoundary::Kind::velocity, 2, {0, 0.4, 0});
      GasBoundary& jet = add(GasBoundary::Kind::velocity, 2, {0.3, 2.0, 0});
      jet.part = Box{{0.3 * width, -1, -1}, {0.7 * width, 1, 1}};
      jet.profile = GasBoundary::Profile::parabolic;
      jet.ramp = {{0.0, 0.2}, {0.01, 1.0}};
      add(GasBoundary::Kind::pressure, 3, {}).pressure = 3.0;
      add(GasBoundary::Kind::no_slip, 0, {0, 0.5, 0});
      add(GasBoundary::Kind::free_slip, 1, {});
    } else {
      add(GasBoundary::Kind::velocity, 4, {0, 0, 0.4});
      GasBoundary& jet = add(GasBoundary::Kind::velocity, 4, {0.3, 0.2, 2.0});
      jet.part = Box{{0.3 * width, 0.3 * depth, -1}, {0.7 * width, 0.7 * depth, 1}};
      jet.profile = GasBoundary::Profile::parabolic;
      jet.ramp = {{0.0, 0.2}, {0.01, 1.0}};
      add(GasBoundary::Kind::pressure, 5, {}).pressure = 3.0;
      add(GasBoundary::Kind::no_slip, 0, {0, 0.5, 0.2});
      add(GasBoundary::Kind::free_slip, 1, {});
    }
  }

  /// Grains at a time, for the block's cells: a bed with a surface that moves, and waves in it.
  void load(const CellBlock& block, double time, GasLoad& load) const {
    for (int k = 0; k < block.size(2); ++k)
      for (int j = 0; j < block.size(1); ++j)
        for (int i = 0; i < block.size(0); ++i) {
          const double x = i + block.low[0], y = j + block.low[1], z = k + block.low[2];
          const double up = grid.is_flat ? y : z, top = 0.4 * grid.n[grid.is_flat ? 1 : 2];
          const double solids = up < top + std::sin(x + 60.0 * time)
                                    ? 0.5 + 0.1 * std::sin(0.9 * x + 0.7 * y + 0.5 * z + 80.0 * time)
                                    : 0.0;
          load.void_fraction(i, j, k) = 1.0 - solids;
          load.exchange(i, j, k) = 4000.0 * solids * solids;
          const double speeds[3] = {0.05 * std::cos(y + 30.0 * time), 0.1 * std::sin(x + 50.0 * time), 0.02};
          for (std::size_t a = 0; a < (grid.is_flat ? 2U : 3U); ++a)
            load.exchange_velocity[a](i, j, k) = load.exchange(i, j, k) * speeds[a];
        }
  }
};

}  // namespace moraine::scenes
