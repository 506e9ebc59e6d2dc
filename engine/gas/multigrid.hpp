// Geometric multigrid for the pressure equation: one V-cycle, in float, as the preconditioner of conjugate gradients.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <vector>

#include "comm/grid_gather.hpp"
#include "comm/grid_halo.hpp"
#include "comm/grid_share.hpp"
#include "comm/world.hpp"
#include "engine/gas/team.hpp"
#include "engine/particles/aligned_array.hpp"
#include "kernels/base/exact_sum.hpp"
#include "kernels/base/vec3.hpp"
#include "kernels/gas/pressure.hpp"
#include "kernels/gas/split_rows.hpp"

namespace moraine {

/// The cells of a grid along each axis: sizes in units of the finest ones, which have the given spacing.
struct GridCells {
  std::array<std::vector<double>, 3> sizes;
  std::array<double, 3> spacing{};
  static GridCells uniform(std::array<int, 3> n, Vec3 spacing);
};

/// A grid of the hierarchy, and how it becomes the next coarser one.
struct LevelPlan {
  GridShare share;
  GridCells cells;
  std::array<bool, 3> is_halved{};
  bool has_odd_cut = false;  // a coarse cell has fine cells of two ranks; it belongs to the one with the first
};
/// From the finest grid to the coarsest, or to the first whose blocks are not worth a rank each: that one, and all coarser ones, are the root's alone.
std::vector<LevelPlan> plan_levels(const GridShare& share, const GridCells& cells);
std::int64_t cells_of_all(const std::vector<LevelPlan>& levels);
/// As the halos of its levels see a grid: rows are moved whole.
GridShare share_of_rows(GridShare share);
/// What a rank says to others: as weights are set, and in a cycle.
GridTraffic weights_traffic(const std::vector<LevelPlan>& levels, int rank);
GridTraffic cycle_traffic(const std::vector<LevelPlan>& levels, int rank);

/// The same as this rank has it: a block, one layer of ghosts.
struct MultigridLevel : LevelPlan {
  CellBlock block;
  SplitRows rows;
  std::array<AlignedArray<float>, 3> weights;  // at low faces
  AlignedArray<float> inverse;                 // of the diagonal
  AlignedArray<float> r, z;                    // right-hand side, solution
  int n_threads = 1;

  AlignedArray<float> residual;  // of all fine cells, where there is an odd cut

  bool has_seam = false;  // an odd number of cells around: neighbours across it have the same colour
  bool has_halo = false;
  // Half sweeps go over the grid in one wave along this axis (1 or 2), where it is neither divided nor periodic; 0: one after the other.
  int wave_axis = 0;
  GridHalo halo, weights_halo;  // of one array; of three

  FaceWeights<float> faces() const { return {weights[0].data(), weights[1].data(), weights[2].data()}; }
  Row row(int j, int k) const { return {rows.at(j, k), (block.low[1] + j + block.low[2] + k) & 1}; }
  int n_planes() const { return rows.n(wave_axis); }
  /// Calls work(j, k) for the rows of plane `at` across the axis of the wave.
  template <typename Work>
  void for_plane(int at, Work work) const {
    const int n = rows.n(3 - wave_axis);
    for (int other = 0; other < n; ++other) wave_axis == 2 ? work(other, at) : work(at, other);
  }
  /// Fills the ghosts of plane `at` from its other end, where the direction across is periodic.
  void wrap_plane(float* values, int at) const;
};

class Multigrid {
 public:
  /// On the grid of `share`, of which each rank has its block.
  Multigrid(const World& world, const GridShare& share, const GridCells& cells, int n_threads);

  MultigridLevel& finest() { return levels_.front(); }
  /// After the weights of the finest grid have been set at the low faces of own cells and at the high faces of the domain. All ranks.
  void set(Team team);
  /// Takes r of the finest grid, leaves an approximate solution in z, ghosts along y and z not filled. Linear and symmetric. Adds the sums of
  /// r z over this thread's rows to `product`. All ranks.
  void cycle(Team team, ExactSum& product);

 private:
  void add_level(const World& world, const LevelPlan& plan, int n_threads);
  void fill_ghosts(std::size_t l, Team team);
  void coarsen_weights(std::size_t l, Team team);
  void cycle(std::size_t l, Team team, ExactSum* product);
  void solve_at_root(Team team);
  void before(std::size_t l, Team team);
  void after(std::size_t l, Team team, ExactSum* product);
  void smooth_row(MultigridLevel& level, int j, int k, int half_sweep, bool is_first);
  void residual_row(MultigridLevel& level, int j, int k, float* out);
  void restrict_row(std::size_t l, int coarse_j, int coarse_k, Team team);
  void correct_row(std::size_t l, int j, int k, Team team);
  void exchange(MultigridLevel& level, AlignedArray<float>& values, Team team);
  float* scratch(Team team) { return scratch_[static_cast<std::size_t>(team.thread)].data(); }

  std::vector<MultigridLevel> levels_;
  std::vector<AlignedArray<float>> scratch_;  // two rows a thread
  // The coarsest of levels_ is solved by the root alone, where there are ranks: all of it, with all coarser ones.
  bool is_gathered_ = false;
  bool is_root_ = true;
  GridGather gather_;
  std::unique_ptr<Multigrid> below_;
};

}  // namespace moraine
