// Values on a grid, from the blocks of all ranks to the root and back.
#pragma once

#include <cstddef>

#include "comm/grid_share.hpp"
#include "comm/halo.hpp"
#include "comm/world.hpp"
#include "kernels/base/grid.hpp"

namespace moraine {

class GridGather {
 public:
  GridGather() = default;
  /// For arrays of the rank's block of `share` with `layers` ghost layers in memory, values of value_bytes each; the root's arrays of the
  /// whole grid have as many ghost layers. `world` has share.n_ranks() ranks; all make the same calls.
  GridGather(const World& world, const GridShare& share, int layers, std::size_t value_bytes);

  /// Own cells of all ranks into the root's array, and the ghosts beyond the ends of the grid. `whole` is not used elsewhere.
  void to_root(const void* block, void* whole);
  /// The same way back.
  void from_root(const void* whole, void* block);

 private:
  template <typename Move>
  void for_each_row(int rank, Move move) const;

  GridShare share_;
  int rank_ = 0, layers_ = 0;
  std::size_t value_bytes_ = 0;
  Halo to_, from_;
};

/// Of a rank in one to_root(), and in one from_root(), of such values.
GridTraffic to_root_traffic(const GridShare& share, int rank, int layers, std::size_t value_bytes);
GridTraffic from_root_traffic(const GridShare& share, int rank, int layers, std::size_t value_bytes);

}  // namespace moraine
