// The pressure solver's parts: smoother and cycle, on the jumping coefficients of bench/gas.
#include "engine/gas/multigrid.hpp"

#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "bench/gas/pressure.hpp"
#include "bench/kernels/meter.hpp"

namespace moraine::bench {

namespace {

using Cells = std::array<int, 3>;
/// In L2, in L3 and in memory on most machines: 24 bytes a cell on the finest grid.
constexpr Cells grids[] = {{24, 24, 24}, {64, 64, 64}, {128, 128, 200}};

std::string name_of(const Cells& n) {
  return std::to_string(n[0]) + "x" + std::to_string(n[1]) + "x" + std::to_string(n[2]);
}

class Hierarchy {
 public:
  Hierarchy(const Cells& n, int n_threads) : multigrid_(World(), share_out(n, {}, 1, 1), cells_of(n), n_threads) {
    PressureProblem problem;
    problem.n = n;
    MultigridLevel& level = finest();
    for (int k = 0; k <= n[2]; ++k)
      for (int j = 0; j <= n[1]; ++j)
        for (int i = 0; i <= n[0]; ++i) set(problem, level, {i, j, k});
    parallel(level.n_threads, [&](int thread) { multigrid_.set({thread, level.n_threads}); });
  }
  MultigridLevel& finest() { return multigrid_.finest(); }
  double n_cells() { return static_cast<double>(finest().block.n_cells()); }

  /// Both colours of the finest grid, row by row, by one thread.
  void smooth() {
    MultigridLevel& level = finest();
    for (int colour = 0; colour < 2; ++colour)
      for (int k = 0; k < level.rows.n(2); ++k)
        for (int j = 0; j < level.rows.n(1); ++j)
          relax(level.rows, level.row(j, k), colour, false, level.faces(), level.r.data(), level.inverse.data(),
                level.z.data());
  }
  void cycle() {
    const int n = finest().n_threads;
    products_.assign(static_cast<std::size_t>(n), {});
    parallel(n, [&](int thread) { multigrid_.cycle({thread, n}, products_[static_cast<std::size_t>(thread)]); });
    benchmark::DoNotOptimize(products_.data());
  }

 private:
  static GridCells cells_of(const Cells& n) {
    GridCells cells;
    cells.spacing = {1.0, 1.0, 1.0};
    for (std::size_t a = 0; a < 3; ++a) cells.sizes[a].assign(static_cast<std::size_t>(n[a]), 1.0);
    return cells;
  }
  /// The low faces of a cell, and its right-hand side where it is one.
  static void set(const PressureProblem& problem, MultigridLevel& level, const Cells& at) {
    const std::int64_t place = level.rows.at(at[1], at[2]) + level.rows.in_row(at[0]);
    int n_beyond = 0;
    for (std::size_t a = 0; a < 3; ++a) n_beyond += at[a] == problem.n[a];
    for (std::size_t a = 0; a < 3; ++a)
      if (n_beyond == 0 || (n_beyond == 1 && at[a] == problem.n[a]))
        level.weights[a][static_cast<std::size_t>(place)] = static_cast<float>(problem.coefficient(a, at));
    if (n_beyond == 0)
      level.r[static_cast<std::size_t>(place)] = static_cast<float>(problem.source(at[0], at[1], at[2]));
  }

  Multigrid multigrid_;
  std::vector<ExactSum> products_;
};

Hierarchy& hierarchy(const Cells& n, int n_threads) {
  static std::map<std::pair<Cells, int>, std::unique_ptr<Hierarchy>> kept;
  std::unique_ptr<Hierarchy>& found = kept[{n, n_threads}];
  if (!found) found = std::make_unique<Hierarchy>(n, n_threads);
  return *found;
}

constexpr double value = sizeof(float);     // [bytes]
constexpr double cell_bytes = 6.0 * value;  // three weights, right-hand side, inverse diagonal, solution

/// Half sweep: for half the cells six products and their sum, right-hand side and diagonal; all weights and the solution of the other
/// colour in, half of the rest in, half of the solution out.
constexpr double half_sweep_flops = 0.5 * 13.0, half_sweep_bytes = (3.0 + 0.5 + 0.5 + 0.5 + 0.5) * value;

void smoother(benchmark::State& state, const Cells& n) {
  Hierarchy& all = hierarchy(n, 1);
  Work work;
  work.items_name = "cells/s";
  work.items = all.n_cells();
  work.flops = 2.0 * half_sweep_flops * work.items;
  work.bytes = 2.0 * half_sweep_bytes * work.items;
  work.working_set = cell_bytes * work.items;
  work.is_float = true;
  measure(state, work, [&] { all.smooth(); });
}

/// One V-cycle: on each grid four half sweeps (the first from zero), the residual of one colour, restriction, correction, four half
/// sweeps, and on the finest the product. What has to move: all of a grid once on the way down and once on the way up, as the sweeps of
/// a way follow each other through the cache.
void cycle(benchmark::State& state, const Cells& n, int n_threads) {
  Hierarchy& all = hierarchy(n, n_threads);
  constexpr double of_all_grids = 8.0 / 7.0;
  const double flops = 0.5 + 7.0 * half_sweep_flops + 0.5 * 19.0 + 1.0 + 0.5;
  Work work;
  work.items_name = "cells/s";
  work.items = all.n_cells();
  work.flops = (of_all_grids * flops + 2.0) * work.items;
  work.bytes = of_all_grids * (cell_bytes + cell_bytes + value) * work.items;
  work.working_set = of_all_grids * cell_bytes * work.items;
  work.is_float = true;
  work.n_threads = all.finest().n_threads;
  measure(state, work, [&] { all.cycle(); });
}

}  // namespace

void add_multigrid() {
  const int n_all = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  for (const Cells& n : grids) add("multigrid/smoother/" + name_of(n), [=](benchmark::State& s) { smoother(s, n); });
  for (const Cells& n : grids)
    for (const int n_threads : n_all > 1 ? std::vector<int>{1, n_all} : std::vector<int>{1})
      add("multigrid/cycle/" + name_of(n) + "/threads:" + std::to_string(n_threads),
          [=](benchmark::State& s) { cycle(s, n, n_threads); });
}

}  // namespace moraine::bench
