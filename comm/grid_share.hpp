// How the cells of a uniform grid are shared out over ranks: blocks cut across y and z, so that lines along x stay whole.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "kernels/base/grid.hpp"

namespace moraine {

struct GridShare {
  std::array<int, 3> n{};  // cells of the whole grid
  std::array<bool, 3> periodic{};
  std::vector<int> cuts_y, cuts_z;  // first cell of each part, then n

  int parts_y() const { return static_cast<int>(cuts_y.size()) - 1; }
  int parts_z() const { return static_cast<int>(cuts_z.size()) - 1; }
  /// The first ranks have a block each, later ones none.
  int n_ranks() const { return parts_y() * parts_z(); }
  std::int64_t n_cells() const { return std::int64_t{n[0]} * n[1] * n[2]; }  // of the whole grid
  /// The same grid on one rank.
  GridShare undivided() const { return {n, periodic, {0, n[1]}, {0, n[2]}}; }
  int rank_of(int part_y, int part_z) const { return part_y + parts_y() * part_z; }
  /// The cells of a rank; empty where it has none.
  CellBlock block(int rank) const;
  /// The rank that has the cell.
  int owner(int j, int k) const;
};

/// Messages of one rank in some exchanges, known without a rank to send them.
struct GridTraffic {
  std::int64_t n_sent = 0, n_received = 0;
  std::int64_t bytes_sent = 0, bytes_received = 0;
  GridTraffic& operator+=(const GridTraffic& other) {
    n_sent += other.n_sent;
    n_received += other.n_received;
    bytes_sent += other.bytes_sent;
    bytes_received += other.bytes_received;
    return *this;
  }
};
/// So many of the same.
inline GridTraffic operator*(std::int64_t n, const GridTraffic& one) {
  return {n * one.n_sent, n * one.n_received, n * one.bytes_sent, n * one.bytes_received};
}

/// Cuts that are multiples of `alignment` (a power of two; the ends apart), into at most max_ranks blocks of at least about
/// `least_cells` cells, as even as that allows, with little surface.
GridShare share_out(std::array<int, 3> n, std::array<bool, 3> periodic, int max_ranks, std::int64_t least_cells,
                    int alignment = 1);

}  // namespace moraine
