// Times the pressure solver beside HYPRE's: see README.md.
#include <mpi.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "bench/gas/pressure.hpp"
#include "engine/gas/pressure_solver.hpp"

using namespace moraine;
using bench::PressureProblem;

namespace {

constexpr double warm_tolerance = 1e-4;  // of a right-hand side of about one

template <typename Work>
double timed(Work work) {  // [s]
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

struct OwnTiming {
  int iterations = 0, warm_iterations = 0;
  double set = 1e300, solve = 1e300, warm = 1e300;  // [s]
  double residual = 0.0;                            // in the root of the sum of squares, relative to b
};

GridField<double> coefficients(const PressureProblem& problem, const CellBlock& block, std::size_t axis) {
  GridField<double> c(GridLayout(block, gas_ghosts), 0.0);
  std::array<int, 3> n{block.size(0), block.size(1), block.size(2)};
  if (block.high[axis] == problem.n[axis]) ++n[axis];
  for (int k = 0; k < n[2]; ++k)
    for (int j = 0; j < n[1]; ++j)
      for (int i = 0; i < n[0]; ++i) c(i, j, k) = problem.coefficient(axis, {i, block.low[1] + j, block.low[2] + k});
  return c;
}

/// Root of the sum of squares of b - A p, one rank only.
double residual(const PressureProblem& problem, const std::array<GridField<double>, 3>& c, const GridField<double>& b,
                const GridField<double>& p) {
  double sum = 0.0, all = 0.0;
  const auto value = [&](int i, int j, int k) {
    const bool is_in = i >= 0 && j >= 0 && k >= 0 && i < problem.n[0] && j < problem.n[1] && k < problem.n[2];
    return is_in ? p(i, j, k) : 0.0;
  };
  for (int k = 0; k < problem.n[2]; ++k)
    for (int j = 0; j < problem.n[1]; ++j)
      for (int i = 0; i < problem.n[0]; ++i) {
        const double own = p(i, j, k);
        const double left =
            b(i, j, k) - (c[0](i, j, k) * (value(i - 1, j, k) - own) + c[0](i + 1, j, k) * (value(i + 1, j, k) - own) +
                          c[1](i, j, k) * (value(i, j - 1, k) - own) + c[1](i, j + 1, k) * (value(i, j + 1, k) - own) +
                          c[2](i, j, k) * (value(i, j, k - 1) - own) + c[2](i, j, k + 1) * (value(i, j, k + 1) - own));
        sum += left * left;
        all += b(i, j, k) * b(i, j, k);
      }
  return std::sqrt(sum / all);
}

OwnTiming time_own(const PressureProblem& problem, const World& world, int n_threads, double tolerance, int n_repeats) {
  OwnTiming timing;
  const GasRanks ranks{world, share_out(problem.n, {}, world.size(), 1, 8), n_threads};
  const GasGrid grid{problem.n, {}, {1.0, 1.0, 1.0}, {}, problem.n[2] == 1};
  const CellBlock block = ranks.block();
  const std::array<GridField<double>, 3> c{coefficients(problem, block, 0), coefficients(problem, block, 1),
                                           coefficients(problem, block, 2)};
  GridField<double> b(GridLayout(block, gas_ghosts), 0.0), p = GridField<double>(b.layout(), 0.0),
                                                           shifted(b.layout(), 0.0);
  for (int k = 0; k < block.size(2); ++k)
    for (int j = 0; j < block.size(1); ++j)
      for (int i = 0; i < block.size(0); ++i) {
        b(i, j, k) = problem.source(i, block.low[1] + j, block.low[2] + k);
        shifted(i, j, k) = b(i, j, k) * (1.0 + 0.01 * std::sin(0.1 * i));
      }
  PressureSolver solver(grid, ranks);
  for (int repeat = 0; repeat < n_repeats; ++repeat) {
    std::array<double, 3> times{};
    times[0] = timed([&] { solver.set({&c[0], &c[1], &c[2]}); });
    p.fill(0.0);
    times[1] = timed([&] { timing.iterations = solver.solve(b, p, tolerance).iterations; });
    GridField<double> again(b.layout(), 0.0);
    std::memcpy(again.data(), p.data(), static_cast<std::size_t>(p.layout().n_values()) * sizeof(double));
    times[2] = timed([&] { timing.warm_iterations = solver.solve(shifted, again, warm_tolerance).iterations; });
    world.max(times);
    timing.set = std::min(timing.set, times[0]);
    timing.solve = std::min(timing.solve, times[1]);
    timing.warm = std::min(timing.warm, times[2]);
  }
  if (world.is_alone()) timing.residual = residual(problem, c, b, p);
  return timing;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 7 && argc != 8) {
    std::fprintf(stderr, "usage: moraine_bench_pressure NX NY NZ THREADS TOLERANCE REPEATS [LOW]\n");
    return 2;
  }
  const World world = World::join();
  if (!World::is_launched()) MPI_Init(&argc, &argv);
  PressureProblem problem;
  problem.n = {std::atoi(argv[1]), std::atoi(argv[2]), std::atoi(argv[3])};
  if (argc == 8) problem.low = std::atof(argv[7]);
  const int n_threads = std::atoi(argv[4]), n_repeats = std::atoi(argv[6]);
  const double tolerance = std::atof(argv[5]);
  const OwnTiming own = time_own(problem, world, n_threads, tolerance, n_repeats);
  const bench::HypreTiming hypre = bench::time_hypre(problem, tolerance, n_repeats);
  if (world.is_root()) {
    std::printf("%d x %d x %d, %d ranks, %d threads\n", problem.n[0], problem.n[1], problem.n[2], world.size(),
                n_threads);
    std::printf(
        "moraine  %3d iterations  set %8.3f ms  solve %8.3f ms  (warm: %d iterations, %.3f ms; residual %.2e)\n",
        own.iterations, 1e3 * own.set, 1e3 * own.solve, own.warm_iterations, 1e3 * own.warm, own.residual);
    std::printf("hypre    %3d iterations  set %8.3f ms  solve %8.3f ms  (times as long: %.2f)\n", hypre.iterations,
                1e3 * hypre.set, 1e3 * hypre.solve, hypre.solve / own.solve);
  }
  if (!World::is_launched()) MPI_Finalize();
  return 0;
}
