// Where the pressure solver keeps the values of a block of cells: in each line along x the cells with even i first, then those
// with odd i. The cells of one colour of a red-black order lie side by side so, and their neighbours do too.
#pragma once

#include <array>
#include <cstdint>

#include "kernels/base/grid.hpp"

namespace moraine {

/// One layer of ghosts around. A row is [even i | room | odd i]; each part has whole vectors of values. What is no cell, nor the
/// ghost of one, holds zero.
class SplitRows {
 public:
  static constexpr int lanes = 8;
  SplitRows() = default;
  explicit SplitRows(std::array<int, 3> n) : n_(n), half_(((n[0] + 1) / 2 + lanes - 1) / lanes * lanes) {}

  int n(int axis) const { return n_[static_cast<std::size_t>(axis)]; }
  /// Values of one parity, up to whole vectors.
  int half() const { return half_; }
  int n_even() const { return (n_[0] + 1) / 2; }
  int n_odd() const { return n_[0] / 2; }
  int row() const { return 2 * half_ + lanes; }
  std::int64_t plane() const { return std::int64_t{row()} * (n_[1] + 2); }
  std::int64_t n_values() const { return plane() * (n_[2] + 2); }
  /// Of a row, with local indices from -1 to n.
  std::int64_t at(int j, int k) const { return plane() * (k + 1) + std::int64_t{row()} * (j + 1); }
  /// Of a cell in its row, i from -1 to n.
  int in_row(int i) const { return i & 1 ? half_ + lanes + (i >> 1) : i / 2; }
  int odd() const { return half_ + lanes; }
  /// The same memory as rows of plain values: for who moves whole rows.
  GridLayout as_grid() const {
    GridLayout layout;
    layout.size = {row() - 2, n_[1], n_[2]};
    layout.ghost = 1;
    return layout;
  }

 private:
  std::array<int, 3> n_{};
  int half_ = 0;
};

}  // namespace moraine
