// The pressure equation that the solvers are timed on: conductivity of cells white noise in [low, 10 low] in the lowest 40 %, 1 above; harmonic
// means on faces; outlet on top, walls elsewhere; right-hand side white noise in [-1, 1].
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "kernels/base/grid.hpp"
#include "kernels/base/random.hpp"

namespace moraine::bench {

struct PressureProblem {
  std::array<int, 3> n{64, 64, 200};
  double low = 1e-4;

  static double random_of(std::uint64_t seed, int i, int j, int k) {
    const auto key =
        (static_cast<std::uint64_t>(k) << 40) ^ (static_cast<std::uint64_t>(j) << 20) ^ static_cast<std::uint64_t>(i);
    return random_uniform(seed, key, RandomPurpose::choice);
  }
  double conductivity(int i, int j, int k) const {
    const int up = n[2] > 1 ? k : j, height = n[2] > 1 ? n[2] : n[1];
    return up < 0.4 * height ? low * (1.0 + 9.0 * random_of(1, i, j, k)) : 1.0;
  }
  double source(int i, int j, int k) const { return 2.0 * random_of(2, i, j, k) - 1.0; }
  /// Of the low face of a cell.
  double coefficient(std::size_t axis, std::array<int, 3> at) const {
    std::array<int, 3> below = at;
    --below[axis];
    if (at[axis] == n[axis])
      return axis == (n[2] > 1 ? 2U : 1U) ? 2.0 * conductivity(below[0], below[1], below[2]) : 0.0;
    if (at[axis] == 0) return 0.0;
    const double a = conductivity(below[0], below[1], below[2]), b = conductivity(at[0], at[1], at[2]);
    return 2.0 * a * b / (a + b);
  }
};

struct HypreTiming {
  int iterations = 0;
  double set = 0.0, solve = 0.0;  // [s] the shortest of all repeats; of all ranks the longest
};

/// All ranks of the job.
HypreTiming time_hypre(const PressureProblem& problem, double tolerance, int n_repeats);

}  // namespace moraine::bench
