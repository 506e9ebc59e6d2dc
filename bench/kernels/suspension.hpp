// Grains in a gas: what deposits, interpolation and halos are timed on. A fluidised bed of half the density of a packed one, in the
// engine's order, in cells of two and a half diameters (some ten grains each).
#pragma once

#include <array>
#include <cstdint>

#include "bench/kernels/meter.hpp"
#include "engine/gas/grid.hpp"
#include "engine/particles/particles.hpp"
#include "kernels/drag/cells.hpp"

namespace moraine::bench {

struct Suspension {
  Suspension(std::int32_t n, bool has_rotation);

  static constexpr double diameter = 1e-3;   // [m]
  static constexpr double spacing = 2.5e-3;  // [m] of cells

  Particles particles;
  GasGrid grid;

  double n_grains() const { return particles.size(); }
  GrainView grains() const { return {particles.records(), particles.stride(), {0, particles.size()}}; }
  double record_bytes() const { return 8.0 * static_cast<double>(particles.stride()); }
  /// Weights over the grid, and the cells that they touch.
  CellWeights weights(GasWeights kind) const;
  CellWindow window(const CellWeights& weights) const;
};

/// Records in L2, in L3 and in memory on most machines.
inline constexpr std::array<std::int32_t, 3> suspension_sizes = {4000, 64000, 2000000};
/// Kept for the next benchmark that asks for the same.
Suspension& suspension(std::int32_t n, bool has_rotation);
/// "4k", "2M".
std::string name_of(std::int32_t n);

}  // namespace moraine::bench
