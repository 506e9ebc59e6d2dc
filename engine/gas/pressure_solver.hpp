// The pressure equation of the gas: find p with
//   sum over the faces f of each cell of  c_f (p_beyond - p) / h_f^2  =  b,
// where p_beyond is the neighbour's value, or 0 beyond a face of the domain that is not periodic. c = 0 there makes a wall or an
// inlet (no flux); a pressure outlet has twice the coefficient of the face (half a cell away).
#pragma once

#include <array>
#include <memory>

#include "engine/gas/grid.hpp"
#include "engine/gas/grid_field.hpp"

namespace moraine {

struct PressureReport {
  int iterations = 0;
  double residual = 0.0;  // largest |b - A p| of all cells, in the unit of b
  bool is_converged = false;
};

/// Of this rank's block, local indices.
struct OpenCell {
  std::array<int, 3> cell{-1, -1, -1};  // none
  double residual = 0.0;                // |b - A p|, in the unit of b
};

/// Conjugate gradients, preconditioned by geometric multigrid. Same bits on any number of ranks and threads.
class PressureSolver {
 public:
  /// Any cuts will do that leave every part of a divided direction two cells; with even ones (share_out with an alignment of 2 or 4) fewer messages
  /// are sent, as a coarse cell lies on one rank then.
  PressureSolver(const GasGrid& grid, const GasRanks& ranks);
  ~PressureSolver();
  PressureSolver(PressureSolver&&) noexcept;
  PressureSolver& operator=(PressureSolver&&) noexcept;

  /// Coefficients at the low faces of each cell in each direction (>= 0), gas_ghosts layers; read at faces 0..n of the block, ghost values at
  /// inner borders and periodic faces need not be set. Where no face of the domain has an outlet the solution is free by a constant.
  void set(const std::array<const GridField<double>*, 3>& coefficients);

  /// Starts from what `p` holds; ends where the largest residual is at most `tolerance` (unit of b), or after max_iterations. Without outlet b is
  /// made to add up to zero and p's mean is zero. Ghost layers of p are filled at inner borders and periodic faces. All ranks.
  PressureReport solve(const GridField<double>& b, GridField<double>& p, double tolerance, int max_iterations = 200);

  /// Where the last solve() has left most over.
  OpenCell worst_cell() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace moraine
