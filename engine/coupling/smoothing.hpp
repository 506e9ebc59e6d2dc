// Cell values spread over a length, for grains that are not small beside the cells. kernels/drag/smooth.hpp has the equation.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "engine/gas/grid.hpp"
#include "engine/particles/aligned_array.hpp"
#include "kernels/drag/smooth.hpp"

namespace moraine {

class Smoothing {
 public:
  /// Over a standard deviation [m] along each direction that has more than one cell.
  Smoothing(const GasGrid& grid, const GasRanks& ranks, double deviation);

  /// Spreads fields on the cells of this rank's block, x fastest, without ghosts. Keeps their sums; symmetric, so that what is spread is
  /// felt the same way. Same bits on any number of ranks and threads. All ranks of the gas call it.
  void apply(std::span<double* const> fields);
  std::size_t memory() const { return gathered_.capacity_bytes(); }

 private:
  void along_x(std::span<double* const> fields) const;
  void along(std::size_t axis, std::span<double* const> fields);
  void across_ranks(std::size_t axis, std::span<double* const> fields);
  void solve(std::size_t axis, double* values, std::int64_t along, std::int64_t across, std::int64_t n_lines) const;

  GasRanks ranks_;
  CellBlock block_;
  std::array<SmoothingFactors, 3> factors_;
  std::array<std::vector<double>, 3> pivots_, closings_;
  AlignedArray<double> gathered_;  // whole lines along an axis that ranks share
};

}  // namespace moraine
