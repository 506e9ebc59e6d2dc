// Cell values between the ranks that have grains and those that have the cells.
//
// Each rank has a window: the cells that its grains touch. What it has deposited there is sent to the owners of the cells, which add it up
// (integers: in any order); what the owners know of the cells comes back the same way. Point to point, with messages that stay the
// same for as long as the windows do.
#pragma once

#include <cstdint>
#include <vector>

#include "comm/grid_share.hpp"
#include "comm/halo.hpp"
#include "comm/world.hpp"
#include "kernels/drag/cells.hpp"

namespace moraine {

/// Room around the cells that grains touch: one more to each side, so that grains that move a little do not ask for another window.
CellWindow with_room(const CellWindow& needed, const GridShare& share);

/// What each rank says in the exchanges of a gas step, for the windows of all ranks: two to the owners of cells, if grains move the gas, and two back.
std::vector<GridTraffic> exchange_traffic(const std::vector<CellWindow>& windows, const GridShare& share,
                                          bool moves_gas);

class CellExchange {
 public:
  CellExchange(World world, GridShare share, int n_threads);

  const CellWindow& window() const { return window_; }
  /// Whether the window has these cells, without being needlessly large.
  bool fits(const CellWindow& needed) const;
  /// A window around these cells for this rank; empty where it has no grains. All ranks call it.
  void open(const CellWindow& needed);

  /// Adds what all ranks hold in their windows to the values of the owners, `width` (1 or 4) each cell, x fastest. All ranks call it.
  void to_owners(int width, const std::int64_t* window_values, std::int64_t* block_values);
  /// Copies the owners' values to all windows that have the cell, `width` (4 or 8) each cell. All ranks call it.
  void to_windows(int width, const double* block_values, double* window_values);

  std::size_t memory() const;

 private:
  /// Lines along x of some rank's window that lie in the block of one owner.
  struct Piece {
    int rank = 0;  // at the other end
    CellWindow window;
    std::vector<std::array<int, 2>> lines;  // y and z in the window
    std::int64_t n_cells() const { return static_cast<std::int64_t>(lines.size()) * window.size(0); }
  };
  Piece piece_of(const CellWindow& window, int owner, int other) const;
  std::vector<int> owners_of(const CellWindow& window) const;
  void open_halos();
  Halo& halo_of(int width, bool is_to_owners);
  /// Calls f(window_index, block_index, n_cells) for each run of cells of line `number` of a piece; the block is this rank's.
  template <typename Function>
  void each_run(const Piece& piece, std::size_t number, Function f) const;
  template <typename Function>
  void each_line(const Piece& piece, Function f) const;
  void pack_window(const Piece& piece, int width, const std::int64_t* values, std::int64_t* to) const;
  void unpack_window(const Piece& piece, int width, const double* from, double* values) const;

  World world_;
  GridShare share_;
  int n_threads_ = 1;
  CellBlock block_;
  CellWindow window_;
  Piece local_;                                      // of this rank's window in its own block
  std::vector<Piece> to_owner_;                      // of this rank's window, by owner
  std::vector<Piece> from_;                          // of other ranks' windows in this rank's block
  std::vector<std::size_t> owner_link_, from_link_;  // of the halos, for each of those pieces
  static constexpr int n_kinds = 4;
  Halo halos_[n_kinds];
};

}  // namespace moraine
