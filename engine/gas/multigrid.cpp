#include "engine/gas/multigrid.hpp"

#include <algorithm>
#include <cstdint>

#include "engine/gas/wave.hpp"

namespace moraine {

namespace {

// Half sweeps (one colour each) before and after the coarse grid, in opposite orders.
constexpr int n_half_sweeps = 4;
// A thread more is worth its barriers from so many cells on; a rank of its own, its messages.
constexpr std::int64_t cells_per_thread = 3000;
constexpr std::int64_t cells_per_rank = 8000;
// Directions are coarsened together where their spacings differ by less.
constexpr double most_anisotropy = 1.5;

std::array<bool, 3> halved_axes(const GridShare& share, const GridCells& cells) {
  double least = 0.0;
  for (std::size_t a = 0; a < 3; ++a)
    if (share.n[a] > 1 && (least == 0.0 || cells.spacing[a] < least)) least = cells.spacing[a];
  std::array<bool, 3> is_halved{};
  for (std::size_t a = 0; a < 3; ++a) is_halved[a] = share.n[a] > 1 && cells.spacing[a] < most_anisotropy * least;
  return is_halved;
}

GridCells coarse_cells(const GridCells& fine, const std::array<bool, 3>& is_halved) {
  GridCells coarse = fine;
  for (std::size_t a = 0; a < 3; ++a) {
    if (!is_halved[a]) continue;
    const std::vector<double>& sizes = fine.sizes[a];
    coarse.spacing[a] = 2.0 * fine.spacing[a];
    coarse.sizes[a].assign((sizes.size() + 1) / 2, 0.0);
    for (std::size_t i = 0; i < sizes.size(); ++i) coarse.sizes[a][i / 2] += sizes[i];
  }
  return coarse;
}

GridShare coarse_share(const GridShare& fine, const std::array<bool, 3>& is_halved) {
  GridShare coarse = fine;
  const auto halve = [](std::vector<int>& cuts) {
    for (int& cut : cuts) cut = (cut + 1) / 2;
  };
  for (std::size_t a = 0; a < 3; ++a)
    if (is_halved[a]) coarse.n[a] = (fine.n[a] + 1) / 2;
  if (is_halved[1]) halve(coarse.cuts_y);
  if (is_halved[2]) halve(coarse.cuts_z);
  return coarse;
}

bool has_odd(const std::vector<int>& cuts) {
  return std::any_of(cuts.begin(), cuts.end() - 1, [](int cut) { return cut % 2 != 0; });
}

int thinnest(const std::vector<int>& cuts) {
  int least = cuts.back();
  for (std::size_t p = 1; p < cuts.size(); ++p) least = std::min(least, cuts[p] - cuts[p - 1]);
  return least;
}

/// Whether the blocks of a level are too small to be worth a rank each, or to be halved once more.
bool is_too_small(const GridShare& share) {
  if (share.n_ranks() == 1) return false;
  return share.n_cells() / share.n_ranks() < cells_per_rank || (share.parts_y() > 1 && thinnest(share.cuts_y) < 2) ||
         (share.parts_z() > 1 && thinnest(share.cuts_z) < 2);
}

/// The axis along which half sweeps can follow each other in a wave, as no ghosts have to be filled along it between them; 0: none.
int wave_axis_of(const GridShare& share, int n_stages, int n_threads) {
  if (share.n_ranks() > 1 || (share.periodic[1] && share.periodic[2])) return 0;
  if (share.periodic[1]) return 2;
  if (share.periodic[2]) return 1;
  return is_thick_enough(share.n[2], n_stages, n_threads) || share.n[2] >= share.n[1] ? 2 : 1;
}

/// Distance between the cells on both sides of face f; to the boundary at the ends, where there is one.
double distance(const std::vector<double>& sizes, std::size_t f, bool is_periodic) {
  const std::size_t n = sizes.size();
  if (f > 0 && f < n) return 0.5 * (sizes[f - 1] + sizes[f]);
  if (is_periodic) return 0.5 * (sizes[0] + sizes[n - 1]);
  return 0.5 * (f == 0 ? sizes[0] : sizes[n - 1]);
}

/// What multiplies the sum of fine weights at coarse face f. Cells that are lumped together conduct as if they were not apart; that is put right by
/// the ratio of distances (without it, corrections of smooth errors are too small by half).
float face_factor(const MultigridLevel& fine, const MultigridLevel& coarse, std::size_t axis, std::size_t f) {
  if (!fine.is_halved[axis]) return 1.0F;
  const bool is_periodic = fine.share.periodic[axis];
  if (is_periodic && coarse.share.n[axis] == 1) return 0.0F;  // to itself
  const std::size_t fine_face = std::min(2 * f, fine.cells.sizes[axis].size());
  return static_cast<float>(distance(fine.cells.sizes[axis], fine_face, is_periodic) /
                            distance(coarse.cells.sizes[axis], f, is_periodic));
}

void allocate(AlignedArray<float>& values, std::int64_t n) {
  values.resize_discarding(static_cast<std::size_t>(n));
  std::fill(values.begin(), values.end(), 0.0F);
}

/// Local fine indices in coarse cell `c` along an axis: [begin, end).
struct Children {
  int begin, end;
};
Children children(const MultigridLevel& fine, const MultigridLevel& coarse, std::size_t axis, int c) {
  const int global = coarse.block.low[axis] + c;
  if (!fine.is_halved[axis]) return {global - fine.block.low[axis], global - fine.block.low[axis] + 1};
  return {2 * global - fine.block.low[axis], std::min(2 * global + 2, fine.share.n[axis]) - fine.block.low[axis]};
}

int parent(const MultigridLevel& fine, const MultigridLevel& coarse, std::size_t axis, int local) {
  const int global = fine.block.low[axis] + local;
  return (fine.is_halved[axis] ? global / 2 : global) - coarse.block.low[axis];
}

/// Calls work(j, k) for a thread's share of the rows of a block of n_y x n_z rows.
template <typename Work>
void for_rows(int n_y, int n_z, Team team, Work work) {
  const Range range = team.share(std::int64_t{n_y} * n_z);
  for (std::int64_t row = range.begin; row < range.end; ++row)
    work(static_cast<int>(row % n_y), static_cast<int>(row / n_y));
}

template <typename Work>
void for_rows(const MultigridLevel& level, Team team, Work work) {
  for_rows(level.rows.n(1), level.rows.n(2), team, work);
}

}  // namespace

GridCells GridCells::uniform(std::array<int, 3> n, Vec3 spacing) {
  GridCells cells;
  cells.spacing = {spacing.x, spacing.y, spacing.z};
  for (std::size_t a = 0; a < 3; ++a) cells.sizes[a].assign(static_cast<std::size_t>(n[a]), 1.0);
  return cells;
}

GridShare share_of_rows(GridShare share) {
  share.n[0] = SplitRows({share.n[0], 1, 1}).as_grid().size[0];
  share.periodic[0] = false;
  return share;
}

std::vector<LevelPlan> plan_levels(const GridShare& share, const GridCells& cells) {
  std::vector<LevelPlan> levels{{share, cells, {}, false}};
  for (;;) {
    LevelPlan& fine = levels.back();
    if (levels.size() > 1 && is_too_small(fine.share)) return levels;
    fine.is_halved = halved_axes(fine.share, fine.cells);
    if (fine.is_halved == std::array<bool, 3>{}) return levels;
    fine.has_odd_cut =
        (fine.is_halved[1] && has_odd(fine.share.cuts_y)) || (fine.is_halved[2] && has_odd(fine.share.cuts_z));
    levels.push_back({coarse_share(fine.share, fine.is_halved), coarse_cells(fine.cells, fine.is_halved), {}, false});
  }
}

std::int64_t cells_of_all(const std::vector<LevelPlan>& levels) {
  std::int64_t n_cells = 0;
  for (const LevelPlan& level : levels) n_cells += level.share.n_cells();
  return n_cells;
}

GridTraffic weights_traffic(const std::vector<LevelPlan>& levels, int rank) {
  GridTraffic traffic;
  for (const LevelPlan& level : levels) traffic += halo_traffic(share_of_rows(level.share), rank, 1, 3, sizeof(float));
  const GridShare last = share_of_rows(levels.back().share);
  if (last.n_ranks() > 1) traffic += 3 * to_root_traffic(last, rank, 1, sizeof(float));
  return traffic;
}

GridTraffic cycle_traffic(const std::vector<LevelPlan>& levels, int rank) {
  GridTraffic traffic;
  const auto halo = [&](std::size_t l) {
    return halo_traffic(share_of_rows(levels[l].share), rank, 1, 1, sizeof(float));
  };
  for (std::size_t l = 0; l < levels.size(); ++l) {
    const bool has_coarse = l + 1 < levels.size();
    if (!has_coarse && levels[l].share.n_ranks() > 1) {
      const GridShare rows = share_of_rows(levels[l].share);
      traffic += to_root_traffic(rows, rank, 1, sizeof(float));
      traffic += from_root_traffic(rows, rank, 1, sizeof(float));
      break;
    }
    // After each half sweep but the very last; the correction of the coarse grid; and what lies on two ranks.
    const bool is_odd = has_coarse && levels[l].has_odd_cut;
    traffic += (2 * n_half_sweeps - 1 + (has_coarse ? 1 : 0) + (is_odd ? 1 : 0)) * halo(l);
    if (is_odd) traffic += halo(l + 1);
  }
  return traffic;
}

void MultigridLevel::wrap_plane(float* values, int at) const {
  const int across = 3 - wave_axis, n = rows.n(across);
  if (!share.periodic[static_cast<std::size_t>(across)]) return;
  const auto row_at = [&](int other) { return values + (wave_axis == 2 ? rows.at(other, at) : rows.at(at, other)); };
  std::copy_n(row_at(n - 1), rows.row(), row_at(-1));
  std::copy_n(row_at(0), rows.row(), row_at(n));
}

Multigrid::Multigrid(const World& world, const GridShare& share, const GridCells& cells, int n_threads)
    : is_root_(world.is_root()) {
  for (const LevelPlan& plan : plan_levels(share, cells)) add_level(world, plan, n_threads);
  scratch_.resize(static_cast<std::size_t>(n_threads));
  for (auto& rows : scratch_) allocate(rows, 2 * levels_.front().rows.row());
  const MultigridLevel& last = levels_.back();
  is_gathered_ = last.share.n_ranks() > 1;
  if (!is_gathered_) return;
  gather_ = GridGather(world, share_of_rows(last.share), 1, sizeof(float));
  if (!is_root_) return;
  below_ = std::make_unique<Multigrid>(World(), last.share.undivided(), last.cells, n_threads);
}

void Multigrid::add_level(const World& world, const LevelPlan& plan, int n_threads) {
  MultigridLevel level;
  static_cast<LevelPlan&>(level) = plan;
  const GridShare& share = plan.share;
  level.block = share.block(world.rank());
  level.rows = SplitRows({level.block.size(0), level.block.size(1), level.block.size(2)});
  for (auto* values : {&level.weights[0], &level.weights[1], &level.weights[2], &level.inverse, &level.r, &level.z})
    allocate(*values, level.rows.n_values());
  if (plan.has_odd_cut) allocate(level.residual, level.rows.n_values());
  // The same on all ranks: what ranks wait for should take all equally long.
  const std::int64_t n_cells = share.n_cells() / share.n_ranks();
  level.n_threads = n_cells >= cells_per_thread * n_threads ? n_threads : 1;
  for (std::size_t a = 0; a < 3; ++a)
    level.has_seam = level.has_seam || (share.periodic[a] && share.n[a] % 2 == 1 && share.n[a] > 1);
  level.has_halo = share.n_ranks() > 1 || share.periodic[1] || share.periodic[2];
  constexpr int n_stages = n_half_sweeps + 1;
  level.wave_axis = wave_axis_of(share, n_stages, n_threads);
  if (level.wave_axis > 0 && !is_thick_enough(level.n_planes(), n_stages, level.n_threads)) level.wave_axis = 0;
  const GridShare rows_share = share_of_rows(share);
  level.halo = GridHalo(world, rows_share, 1, 1, sizeof(float));
  level.weights_halo = GridHalo(world, rows_share, 1, 3, sizeof(float));
  levels_.push_back(std::move(level));
}

void Multigrid::exchange(MultigridLevel& level, AlignedArray<float>& values, Team team) {
  team.sync();
  if (!level.has_halo) return;
  if (team.is_first()) level.halo.exchange({values.data()});
  team.sync();
}

void Multigrid::fill_ghosts(std::size_t l, Team team) {
  MultigridLevel& level = levels_[l];
  const SplitRows& rows = level.rows;
  if (level.share.periodic[0])
    for_rows(level, team, [&](int j, int k) { wrap_row(rows, level.weights[0].data() + rows.at(j, k)); });
  team.sync();
  if (level.has_halo && team.is_first())
    level.weights_halo.exchange({level.weights[0].data(), level.weights[1].data(), level.weights[2].data()});
  team.sync();
  for_rows(level, team,
           [&](int j, int k) { invert_diagonal(rows, rows.at(j, k), level.faces(), level.inverse.data()); });
  team.sync();
}

void Multigrid::coarsen_weights(std::size_t l, Team team) {
  const MultigridLevel& fine = levels_[l];
  MultigridLevel& coarse = levels_[l + 1];
  float* const sum = scratch(team);
  std::vector<float> factors(static_cast<std::size_t>(coarse.rows.n(0)) + 1);
  for (std::size_t f = 0; f < factors.size(); ++f) factors[f] = face_factor(fine, coarse, 0, f);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // The last block has the faces at the end of the domain too.
    std::array<int, 3> n{coarse.rows.n(0), coarse.rows.n(1), coarse.rows.n(2)};
    if (axis > 0 && coarse.block.high[axis] == coarse.share.n[axis] && !coarse.share.periodic[axis]) ++n[axis];
    for_rows(n[1], n[2], team, [&](int j, int k) {
      const std::array<int, 3> at{0, j, k};
      Children y = children(fine, coarse, 1, j), z = children(fine, coarse, 2, k);
      Children& normal = axis == 1 ? y : z;
      if (axis > 0) {  // fine faces that lie in the coarse one; at the end of the domain those of the first ghosts
        normal.begin = std::min(normal.begin, fine.rows.n(static_cast<int>(axis)));
        normal.end = normal.begin + 1;
      }
      std::fill(sum, sum + fine.rows.row(), 0.0F);
      for (int fk = z.begin; fk < z.end; ++fk)
        for (int fj = y.begin; fj < y.end; ++fj)
          add_row(fine.rows, fine.weights[axis].data() + fine.rows.at(fj, fk), sum);
      float* const to = coarse.weights[axis].data() + coarse.rows.at(j, k);
      if (axis == 0) {
        pick_row(coarse.rows, fine.is_halved[0], fine.rows, sum, factors.data(), to);
      } else {
        fold_row(coarse.rows, fine.is_halved[0], fine.rows, sum, to);
        const auto face = static_cast<std::size_t>(coarse.block.low[axis] + at[axis]);
        multiply_row(coarse.rows, face_factor(fine, coarse, axis, face), to);
      }
    });
  }
  team.sync();
}

void Multigrid::set(Team team) {
  fill_ghosts(0, team);
  for (std::size_t l = 1; l < levels_.size(); ++l) {
    coarsen_weights(l - 1, team);
    fill_ghosts(l, team);
  }
  if (!is_gathered_) return;
  MultigridLevel& last = levels_.back();
  if (team.is_first())
    for (std::size_t axis = 0; axis < 3; ++axis)
      gather_.to_root(last.weights[axis].data(), is_root_ ? below_->finest().weights[axis].data() : nullptr);
  team.sync();
  if (is_root_) below_->set(team);
}

void Multigrid::smooth_row(MultigridLevel& level, int j, int k, int half_sweep, bool is_first) {
  const SplitRows& rows = level.rows;
  const Row row = level.row(j, k);
  const int colour = half_sweep % 2;
  const bool wraps = level.share.periodic[0];
  if (is_first) {
    relax_from_zero(rows, row, colour, level.r.data(), level.inverse.data(), level.z.data());
    clear_colour(rows, row, 1 - colour, level.z.data() + row.start);
  } else {
    relax(rows, row, colour, wraps, level.faces(), level.r.data(), level.inverse.data(), level.z.data());
  }
  if (wraps) wrap_row(rows, level.z.data() + row.start);
}

/// The residual of the colour relaxed last is zero, except across a seam.
void Multigrid::residual_row(MultigridLevel& level, int j, int k, float* out) {
  const int last = (n_half_sweeps - 1) % 2;
  const Row row = level.row(j, k);
  residual(level.rows, row, 1 - last, level.faces(), level.r.data(), level.z.data(), out);
  if (level.has_seam)
    residual(level.rows, row, last, level.faces(), level.r.data(), level.z.data(), out);
  else
    clear_colour(level.rows, row, last, out);
}

/// A row of the coarse right-hand side.
void Multigrid::restrict_row(std::size_t l, int coarse_j, int coarse_k, Team team) {
  MultigridLevel& fine = levels_[l];
  MultigridLevel& coarse = levels_[l + 1];
  float *const sum = scratch(team), *const addend = sum + fine.rows.row();
  const Children y = children(fine, coarse, 1, coarse_j), z = children(fine, coarse, 2, coarse_k);
  std::fill(sum, sum + fine.rows.row(), 0.0F);
  for (int k = z.begin; k < z.end; ++k)
    for (int j = y.begin; j < y.end; ++j) {
      if (!fine.has_odd_cut) residual_row(fine, j, k, addend);
      add_row(fine.rows, fine.has_odd_cut ? fine.residual.data() + fine.rows.at(j, k) : addend, sum);
    }
  fold_row(coarse.rows, fine.is_halved[0], fine.rows, sum, coarse.r.data() + coarse.rows.at(coarse_j, coarse_k));
}

/// Only the colour that is not relaxed next needs the correction.
void Multigrid::correct_row(std::size_t l, int j, int k, Team team) {
  MultigridLevel& fine = levels_[l];
  MultigridLevel& coarse = levels_[l + 1];
  const int next = (n_half_sweeps - 1) % 2;
  const Row row = fine.row(j, k);
  const float* const from = coarse.z.data() + coarse.rows.at(parent(fine, coarse, 1, j), parent(fine, coarse, 2, k));
  for (int colour = 0; colour < 2; ++colour)
    if (colour != next || fine.has_seam)
      prolong(fine.rows, row, colour, fine.is_halved[0], coarse.rows, from, scratch(team), fine.z.data());
  if (fine.share.periodic[0]) wrap_row(fine.rows, fine.z.data() + row.start);
}

/// The half sweeps before the coarse grid, and its right-hand side.
void Multigrid::before(std::size_t l, Team team) {
  MultigridLevel& level = levels_[l];
  const bool has_coarse = l + 1 < levels_.size();
  if (level.wave_axis > 0) {
    const auto axis = static_cast<std::size_t>(level.wave_axis);
    wave(level.n_planes(), n_half_sweeps + (has_coarse ? 1 : 0), team, [&](int stage, int at) {
      if (stage < n_half_sweeps) {
        level.for_plane(at, [&](int j, int k) { smooth_row(level, j, k, stage, stage == 0); });
        return level.wrap_plane(level.z.data(), at);
      }
      // at the last plane of those that make a coarse one
      if (level.is_halved[axis] && at % 2 == 0 && at + 1 < level.n_planes()) return;
      const int coarse_at = parent(level, levels_[l + 1], axis, at);
      const SplitRows& coarse_rows = levels_[l + 1].rows;
      const int n = coarse_rows.n(3 - level.wave_axis);
      for (int other = 0; other < n; ++other)
        axis == 2 ? restrict_row(l, other, coarse_at, team) : restrict_row(l, coarse_at, other, team);
    });
    return;
  }
  for (int s = 0; s < n_half_sweeps; ++s) {
    for_rows(level, team, [&](int j, int k) { smooth_row(level, j, k, s, s == 0); });
    exchange(level, level.z, team);
  }
  if (!has_coarse) return;
  if (level.has_odd_cut) {
    for_rows(level, team,
             [&](int j, int k) { residual_row(level, j, k, level.residual.data() + level.rows.at(j, k)); });
    exchange(level, level.residual, team);
  }
  for_rows(levels_[l + 1], team, [&](int j, int k) { restrict_row(l, j, k, team); });
  team.sync();
}

/// The correction of the coarse grid, and the half sweeps after it.
void Multigrid::after(std::size_t l, Team team, ExactSum* product) {
  MultigridLevel& level = levels_[l];
  const bool has_coarse = l + 1 < levels_.size();
  const auto multiply = [&](int j, int k) {
    const std::int64_t row = level.rows.at(j, k);
    product->add(dot_row(level.rows, level.r.data() + row, level.z.data() + row));
  };
  if (level.wave_axis > 0) {
    wave(level.n_planes(), n_half_sweeps + 1, team, [&](int stage, int at) {
      level.for_plane(at, [&](int j, int k) {
        if (stage > 0) smooth_row(level, j, k, n_half_sweeps - stage, false);
        if (stage == 0 && has_coarse) correct_row(l, j, k, team);
        if (stage == n_half_sweeps && product) multiply(j, k);
      });
      level.wrap_plane(level.z.data(), at);
    });
    return;
  }
  if (has_coarse) {
    if (level.has_odd_cut) exchange(levels_[l + 1], levels_[l + 1].z, team);
    for_rows(level, team, [&](int j, int k) { correct_row(l, j, k, team); });
    exchange(level, level.z, team);
  }
  for (int s = n_half_sweeps - 1; s >= 0; --s) {
    for_rows(level, team, [&](int j, int k) { smooth_row(level, j, k, s, false); });
    if (s > 0) exchange(level, level.z, team);
  }
  if (product) for_rows(level, team, multiply);
  team.sync();
}

void Multigrid::solve_at_root(Team team) {
  MultigridLevel& last = levels_.back();
  team.sync();
  if (team.is_first()) gather_.to_root(last.r.data(), is_root_ ? below_->finest().r.data() : nullptr);
  team.sync();
  if (is_root_) below_->cycle(0, team, nullptr);
  team.sync();
  if (team.is_first()) gather_.from_root(is_root_ ? below_->finest().z.data() : nullptr, last.z.data());
  team.sync();
}

void Multigrid::cycle(Team team, ExactSum& product) { cycle(0, team, &product); }

void Multigrid::cycle(std::size_t l, Team team, ExactSum* product) {
  MultigridLevel& level = levels_[l];
  const bool is_last = l + 1 == levels_.size();
  if (is_last && is_gathered_) return solve_at_root(team);
  if (level.n_threads < team.n) {
    team.sync();
    if (team.is_first()) cycle(l, Team{}, product);
    team.sync();
    return;
  }
  before(l, team);
  if (!is_last) cycle(l + 1, team, nullptr);
  after(l, team, product);
}

}  // namespace moraine
