// Cells of a uniform grid, and where their values lie in memory.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace moraine {

/// Half-open block of cells.
struct CellBlock {
  std::array<int, 3> low{};
  std::array<int, 3> high{};
  constexpr int size(int axis) const {
    return high[static_cast<std::size_t>(axis)] - low[static_cast<std::size_t>(axis)];
  }
  constexpr std::int64_t n_cells() const { return std::int64_t{size(0)} * size(1) * size(2); }
  constexpr bool is_empty() const { return size(0) <= 0 || size(1) <= 0 || size(2) <= 0; }
  constexpr bool contains(int i, int j, int k) const {
    return i >= low[0] && i < high[0] && j >= low[1] && j < high[1] && k >= low[2] && k < high[2];
  }
  constexpr bool operator==(const CellBlock&) const = default;
};

/// Where the values of a block lie: x runs fastest, with `ghost` layers of cells around. Indices count from the block's first cell, from
/// -ghost to size + ghost - 1. A value on a face lies at the cell on the high side of the face, so that face 0 is the low
/// face of the first cell, and the high face of the last cell lies in the first ghost layer.
struct GridLayout {
  std::array<int, 3> size{};
  int ghost = 0;
  constexpr GridLayout() = default;
  constexpr GridLayout(const CellBlock& block, int layers)
      : size{block.size(0), block.size(1), block.size(2)}, ghost(layers) {}
  constexpr std::int64_t stride(int axis) const {
    return axis == 0 ? 1 : axis == 1 ? size[0] + 2 * ghost : std::int64_t{size[0] + 2 * ghost} * (size[1] + 2 * ghost);
  }
  constexpr std::int64_t at(int i, int j, int k) const {
    return (k + ghost) * stride(2) + (j + ghost) * stride(1) + (i + ghost);
  }
  constexpr std::int64_t n_values() const { return stride(2) * (size[2] + 2 * ghost); }
  constexpr bool operator==(const GridLayout&) const = default;
};

}  // namespace moraine
