// Pressure equations with a known discrete solution, the same on any division: values are functions of the cell's global indices.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <string>

#include "engine/gas/pressure_solver.hpp"
#include "kernels/base/random.hpp"

namespace moraine::pressure {

enum class PressureOutlet { none, top, both_ends_of_x };
enum class PressureNoise { none, white };

struct PressureProblem {
  std::array<int, 3> n{};
  std::array<bool, 3> periodic{};
  PressureOutlet outlet = PressureOutlet::top;
  double jump = 1.0;  // conductivity of the lowest 40 % along z (y where flat) over the one above
  PressureNoise noise = PressureNoise::none;
  double closed = 0.0;  // share of the faces with no conductivity at all
  Vec3 spacing{1.0, 1.0, 1.0};

  GasGrid grid() const { return {n, {}, spacing, periodic, n[2] == 1}; }
  GasRanks alone(int n_threads) const { return {World(), share_out(n, periodic, 1, 1), n_threads}; }
};

inline double random_of(std::uint64_t seed, int i, int j, int k) {
  const auto key =
      (static_cast<std::uint64_t>(k) << 40) ^ (static_cast<std::uint64_t>(j) << 20) ^ static_cast<std::uint64_t>(i);
  return random_uniform(seed, key, RandomPurpose::choice);
}

inline int wrapped(int i, int n) { return (i % n + n) % n; }

inline double conductivity(const PressureProblem& p, int i, int j, int k) {
  const int up = p.n[2] > 1 ? k : j, height = p.n[2] > 1 ? p.n[2] : p.n[1];
  if (up >= 0.4 * height) return 1.0;
  return p.jump * (p.noise == PressureNoise::white ? 1.0 + 9.0 * random_of(1, i, j, k) : 1.0);
}

/// Of the low face of cell (i, j, k) along the axis: global indices from 0 to n.
inline double coefficient(const PressureProblem& p, std::size_t axis, std::array<int, 3> at) {
  std::array<int, 3> below = at;
  --below[axis];
  const bool is_end = at[axis] == 0 || at[axis] == p.n[axis];
  if (is_end && !p.periodic[axis]) {
    const std::size_t up = p.n[2] > 1 ? 2 : 1;
    const bool is_open = (p.outlet == PressureOutlet::top && axis == up && at[axis] == p.n[axis]) ||
                         (p.outlet == PressureOutlet::both_ends_of_x && axis == 0);
    const std::array<int, 3> cell = at[axis] == 0 ? at : below;
    return is_open ? 2.0 * conductivity(p, cell[0], cell[1], cell[2]) : 0.0;
  }
  for (std::size_t a = 0; a < 3; ++a) {
    at[a] = wrapped(at[a], p.n[a]);
    below[a] = wrapped(below[a], p.n[a]);
  }
  if (random_of(10 + axis, at[0], at[1], at[2]) < p.closed) return 0.0;
  const double low = conductivity(p, below[0], below[1], below[2]), high = conductivity(p, at[0], at[1], at[2]);
  return 2.0 * low * high / (low + high);
}

/// The coefficients of a block, as the solver wants them.
inline std::array<GridField<double>, 3> coefficients(const PressureProblem& p, const CellBlock& block) {
  std::array<GridField<double>, 3> fields;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    fields[axis] = GridField<double>(GridLayout(block, gas_ghosts), -1e300);  // ghosts need not be set
    std::array<int, 3> n{block.size(0), block.size(1), block.size(2)};
    if (block.high[axis] == p.n[axis]) ++n[axis];
    for (int k = 0; k < n[2]; ++k)
      for (int j = 0; j < n[1]; ++j)
        for (int i = 0; i < n[0]; ++i)
          fields[axis](i, j, k) = coefficient(p, axis, {block.low[0] + i, block.low[1] + j, block.low[2] + k});
  }
  return fields;
}

/// A rough solution: noise on a wave.
inline double rough(const PressureProblem& p, int i, int j, int k) {
  return std::sin(2.0 * i / p.n[0] + 3.0 * j / p.n[1] - 2.5 * k / p.n[2]) + random_of(5, i, j, k) - 0.5;
}

/// sum of c (p_beyond - p) / h^2 over the faces of a cell, written out.
template <typename Solution>
double applied(const PressureProblem& p, const Solution& solution, int i, int j, int k) {
  double sum = 0.0;
  const std::array<double, 3> h{p.spacing.x, p.spacing.y, p.spacing.z};
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const int by : {-1, 1}) {
      std::array<int, 3> face{i, j, k}, beyond{i, j, k};
      if (by > 0) ++face[axis];
      beyond[axis] += by;
      const bool is_out = beyond[axis] < 0 || beyond[axis] >= p.n[axis];
      double value = 0.0;
      if (!is_out || p.periodic[axis]) {
        beyond[axis] = wrapped(beyond[axis], p.n[axis]);
        if (is_out && by > 0) face[axis] = 0;
        value = solution(beyond[0], beyond[1], beyond[2]);
      }
      sum += coefficient(p, axis, face) * (value - solution(i, j, k)) / (h[axis] * h[axis]);
    }
  return sum;
}

template <typename Value>
GridField<double> field(const CellBlock& block, Value value) {
  GridField<double> values(GridLayout(block, gas_ghosts), 0.0);
  for (int k = 0; k < block.size(2); ++k)
    for (int j = 0; j < block.size(1); ++j)
      for (int i = 0; i < block.size(0); ++i)
        values(i, j, k) = value(block.low[0] + i, block.low[1] + j, block.low[2] + k);
  return values;
}

/// Largest value of a function of global indices over a block.
template <typename Value>
double largest(const CellBlock& block, Value value) {
  double most = 0.0;
  for (int k = block.low[2]; k < block.high[2]; ++k)
    for (int j = block.low[1]; j < block.high[1]; ++j)
      for (int i = block.low[0]; i < block.high[0]; ++i) most = std::max(most, std::abs(value(i, j, k)));
  return most;
}

struct Outcome {
  PressureReport report;
  double error = 0.0;     // largest, of the solution
  double residual = 0.0;  // largest, of the written-out equation
  GridField<double> p;
};

/// Solves for the rough solution from zero, to a residual relative to the largest b.
inline Outcome solve_rough(const PressureProblem& problem, const GasRanks& ranks, double tolerance) {
  const CellBlock block = ranks.block();
  const CellBlock all{{0, 0, 0}, problem.n};
  const auto exact = [&](int i, int j, int k) { return rough(problem, i, j, k); };
  const auto b_of = [&](int i, int j, int k) { return applied(problem, exact, i, j, k); };
  double mean = 0.0;
  if (problem.outlet == PressureOutlet::none) {
    for (int k = 0; k < all.high[2]; ++k)
      for (int j = 0; j < all.high[1]; ++j)
        for (int i = 0; i < all.high[0]; ++i) mean += exact(i, j, k);
    mean /= static_cast<double>(all.n_cells());
  }
  const double size = largest(all, b_of);
  PressureSolver solver(problem.grid(), ranks);
  const auto c = coefficients(problem, block);
  solver.set({&c[0], &c[1], &c[2]});
  const GridField<double> b = field(block, b_of);
  Outcome outcome;
  outcome.p = GridField<double>(GridLayout(block, gas_ghosts), 0.0);
  outcome.report = solver.solve(b, outcome.p, tolerance * size);
  const auto solved = [&](int i, int j, int k) {
    return outcome.p(i - block.low[0], j - block.low[1], k - block.low[2]);
  };
  outcome.error = largest(block, [&](int i, int j, int k) { return solved(i, j, k) - (exact(i, j, k) - mean); });
  if (ranks.world.is_alone())
    outcome.residual =
        largest(all, [&](int i, int j, int k) { return applied(problem, solved, i, j, k) - b_of(i, j, k); });
  outcome.residual /= size;
  outcome.report.residual /= size;
  return outcome;
}

inline std::string name(const PressureProblem& p) {
  std::string text;
  for (const int n : p.n) text += std::to_string(n) + " ";
  text += "periodic ";
  for (const bool is : p.periodic) text += is ? "1" : "0";
  return text + " outlet " + std::to_string(static_cast<int>(p.outlet)) + " jump " + std::to_string(p.jump) +
         " closed " + std::to_string(p.closed);
}

}  // namespace moraine::pressure
