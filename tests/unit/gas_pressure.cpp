// The pressure solver on one rank.
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "engine/gas/wave.hpp"
#include "kernels/gas/split_rows.hpp"
#include "tests/support/pressure_problems.hpp"

using namespace moraine;
using namespace moraine::pressure;

namespace {

constexpr bool is = true, no = false;

bool has_same_bits(const GridField<double>& a, const GridField<double>& b) {
  const GridLayout& layout = a.layout();
  for (int k = 0; k < layout.size[2]; ++k)
    for (int j = 0; j < layout.size[1]; ++j)
      for (int i = 0; i < layout.size[0]; ++i)
        if (std::bit_cast<std::uint64_t>(a(i, j, k)) != std::bit_cast<std::uint64_t>(b(i, j, k))) return false;
  return true;
}

std::vector<PressureProblem> shapes() {
  std::vector<PressureProblem> problems;
  const std::vector<std::array<int, 3>> sizes{{1, 1, 1},   {2, 2, 2},   {17, 1, 1},  {1, 17, 1},
                                              {1, 1, 31},  {8, 8, 8},   {7, 11, 13}, {15, 90, 1},
                                              {15, 40, 3}, {31, 2, 29}, {3, 41, 5},  {33, 16, 20}};
  for (const auto& n : sizes)
    for (const auto& periodic : {std::array<bool, 3>{no, no, no}, std::array<bool, 3>{is, no, no}}) {
      PressureProblem problem;
      problem.n = n;
      problem.periodic = periodic;
      problem.jump = 1e-2;
      problem.noise = PressureNoise::white;
      problems.push_back(problem);
    }
  return problems;
}

std::vector<PressureProblem> singular_ones() {
  std::vector<PressureProblem> problems;
  for (const auto& n : {std::array<int, 3>{16, 12, 20}, {15, 13, 17}, {1, 9, 10}, {12, 1, 7}, {2, 3, 5}})
    for (const auto& periodic :
         {std::array<bool, 3>{no, no, no}, std::array<bool, 3>{is, is, is}, std::array<bool, 3>{no, is, no}})
      problems.push_back({n, periodic, PressureOutlet::none, 1e-2, PressureNoise::white});
  return problems;
}

}  // namespace

TEST_CASE("every cell and ghost of a split row has a place of its own") {
  for (int n = 1; n < 70; ++n) {
    const SplitRows rows({n, 1, 1});
    std::vector<int> count(static_cast<std::size_t>(rows.row()), 0);
    bool is_alone = true;
    for (int i = -1; i <= n; ++i) is_alone = is_alone && ++count.at(static_cast<std::size_t>(rows.in_row(i))) == 1;
    CHECK(is_alone);
    CHECK(rows.n_even() + rows.n_odd() == n);
  }
}

TEST_CASE("a wave runs every stage of every plane once, after those that it needs") {
  for (const int n_threads : {1, 2, 3, 4})
    for (const int n : {1, 7, 23, 40, 41}) {
      const int n_stages = 5;
      if (!is_thick_enough(n, n_stages, n_threads)) continue;
      std::vector<int> done(static_cast<std::size_t>(n), 0);  // stages of each plane
      std::vector<int> n_wrong(static_cast<std::size_t>(n_threads), 0);
      parallel(n_threads, [&](int thread) {
        wave(n, n_stages, Team{thread, n_threads}, [&](int s, int k) {
          const int around = s > 0 ? 1 : 0;  // the first needs nothing, and its neighbours may be at work
          for (int at = std::max(0, k - around); at <= std::min(n - 1, k + around); ++at) {
            const int stages = done[static_cast<std::size_t>(at)];
            const bool is_right = at == k ? stages == s : stages >= s && stages <= s + 2;
            n_wrong[static_cast<std::size_t>(thread)] += is_right ? 0 : 1;
          }
          ++done[static_cast<std::size_t>(k)];
        });
      });
      INFO(n << " planes, " << n_threads << " threads");
      CHECK(std::all_of(done.begin(), done.end(), [](int stages) { return stages == n_stages; }));
      CHECK(std::all_of(n_wrong.begin(), n_wrong.end(), [](int wrong) { return wrong == 0; }));
    }
}

TEST_CASE("pressure comes out as it was put in, on grids of all shapes") {
  for (const PressureProblem& problem : shapes()) {
    const Outcome outcome = solve_rough(problem, problem.alone(1), 1e-12);
    INFO(name(problem));
    CHECK(outcome.report.is_converged);
    CHECK(outcome.report.iterations <= 13);
    CHECK(outcome.residual <= 2e-12);
    CHECK(std::abs(outcome.residual - outcome.report.residual) <= 1e-12);
    CHECK(outcome.error < 1e-7);
  }
}

TEST_CASE("pressure that is free by a constant has no mean") {
  for (const PressureProblem& problem : singular_ones()) {
    const Outcome outcome = solve_rough(problem, problem.alone(1), 1e-12);
    INFO(name(problem));
    CHECK(outcome.report.is_converged);
    CHECK(outcome.report.iterations <= 14);
    CHECK(outcome.residual <= 2e-12);
    CHECK(outcome.error < 1e-7);
  }
}

TEST_CASE("an imbalance that no pressure can mend is taken out of all cells alike") {
  PressureProblem problem{{9, 10, 11}, {}, PressureOutlet::none};
  const GasRanks ranks = problem.alone(1);
  PressureSolver solver(problem.grid(), ranks);
  const auto c = coefficients(problem, ranks.block());
  solver.set({&c[0], &c[1], &c[2]});
  const auto exact = [&](int i, int j, int k) { return rough(problem, i, j, k); };
  const GridField<double> b =
      field(ranks.block(), [&](int i, int j, int k) { return applied(problem, exact, i, j, k) + 0.25; });
  GridField<double> p(b.layout(), 0.0);
  CHECK(solver.solve(b, p, 1e-11).is_converged);
  const auto solved = [&](int i, int j, int k) { return p(i, j, k); };
  CHECK(largest(ranks.block(),
                [&](int i, int j, int k) { return applied(problem, solved, i, j, k) - b(i, j, k) + 0.25; }) < 1e-10);
}

TEST_CASE("cells without any open face have zero pressure, and what they ask for counts for nothing") {
  PressureProblem problem{{10, 9, 12}, {}, PressureOutlet::top, 1e-3, PressureNoise::white};
  for (const PressureOutlet outlet : {PressureOutlet::top, PressureOutlet::none}) {
    problem.outlet = outlet;
    const GasRanks ranks = problem.alone(1);
    const CellBlock block = ranks.block();
    auto c = coefficients(problem, block);
    const std::vector<std::array<int, 3>> closed{{4, 4, 4}, {0, 0, 0}, {9, 3, 11}};
    for (const auto& [i, j, k] : closed) {
      c[0](i, j, k) = c[0](i + 1, j, k) = c[1](i, j, k) = c[1](i, j + 1, k) = c[2](i, j, k) = c[2](i, j, k + 1) = 0.0;
    }
    GridField<double> b = field(block, [&](int i, int j, int k) { return rough(problem, i, j, k); });
    GridField<double> p(b.layout(), 0.0), again(b.layout(), 0.0);
    PressureSolver solver(problem.grid(), ranks);
    solver.set({&c[0], &c[1], &c[2]});
    CHECK(solver.solve(b, p, 1e-10).is_converged);
    for (const auto& [i, j, k] : closed) {
      b(i, j, k) = 1e6;
      again(i, j, k) = 17.0;
      CHECK(p(i, j, k) == 0.0);
    }
    CHECK(solver.solve(b, again, 1e-10).is_converged);
    CHECK(has_same_bits(p, again));
  }
}

TEST_CASE("closed faces here and there do not stop the pressure solver") {
  for (const double closed : {0.02, 0.1, 0.3}) {
    PressureProblem problem{{20, 21, 22}, {}, PressureOutlet::top, 1e-3, PressureNoise::white, closed};
    const Outcome outcome = solve_rough(problem, problem.alone(1), 1e-8);
    INFO(name(problem));
    CHECK(outcome.report.is_converged);
    CHECK(outcome.residual <= 1.1e-8);
    CHECK(outcome.report.iterations <= 40);
  }
}

TEST_CASE("iterations of the pressure solver grow neither with the grid nor with the jump of its coefficients") {
  for (const int n : {16, 32, 64}) {
    PressureProblem problem{{n, n, n}};
    CHECK(solve_rough(problem, problem.alone(1), 1e-8).report.iterations <= 9);
  }
  for (const double jump : {1e6, 1e3, 1.0, 1e-2, 1e-4, 1e-6}) {
    PressureProblem problem{{24, 24, 50}, {}, PressureOutlet::top, jump, PressureNoise::white};
    INFO("jump " << jump);
    CHECK(solve_rough(problem, problem.alone(1), 1e-8).report.iterations <= 10);
  }
}

TEST_CASE("cells of unequal sides cost the pressure solver few iterations") {
  for (const Vec3 spacing :
       {Vec3{1.0, 1.0, 10.0}, {10.0, 1.0, 1.0}, {1.0, 3.0, 9.0}, {1.0, 1.4, 1.6}, {100.0, 1.0, 30.0}}) {
    PressureProblem problem{{24, 30, 28}, {no, is, no}, PressureOutlet::top, 1e-3, PressureNoise::white, 0.0, spacing};
    const Outcome outcome = solve_rough(problem, problem.alone(1), 1e-8);
    INFO(spacing.x << " " << spacing.y << " " << spacing.z);
    CHECK(outcome.report.is_converged);
    CHECK(outcome.report.iterations <= 16);
  }
}

TEST_CASE("coefficients and pressures of any size are solved alike") {
  PressureProblem problem{{12, 13, 14}, {}, PressureOutlet::top, 1e-3, PressureNoise::white};
  const GasRanks ranks = problem.alone(1);
  const CellBlock block = ranks.block();
  const auto c = coefficients(problem, block);
  const auto solve_scaled = [&](double factor, double size) {
    std::array<GridField<double>, 3> scaled;
    for (std::size_t a = 0; a < 3; ++a) {
      scaled[a] = GridField<double>(c[a].layout(), 0.0);
      for (std::int64_t at = 0; at < c[a].layout().n_values(); ++at) scaled[a].data()[at] = factor * c[a].data()[at];
    }
    const GridField<double> b = field(block, [&](int i, int j, int k) { return size * rough(problem, i, j, k); });
    GridField<double> p(b.layout(), 0.0);
    PressureSolver solver(problem.grid(), ranks);
    solver.set({&scaled[0], &scaled[1], &scaled[2]});
    const PressureReport report = solver.solve(b, p, 1e-9 * size);
    CHECK(report.is_converged);
    for (std::int64_t at = 0; at < p.layout().n_values(); ++at) p.data()[at] *= factor / size;
    return p;
  };
  const GridField<double> p = solve_scaled(1.0, 1.0);
  CHECK(has_same_bits(p, solve_scaled(std::ldexp(1.0, -100), std::ldexp(1.0, 40))));
  CHECK(has_same_bits(p, solve_scaled(std::ldexp(1.0, 150), std::ldexp(1.0, -120))));
}

TEST_CASE("pressure has the same bits on any number of threads") {
  for (const auto& n : {std::array<int, 3>{32, 33, 64}, {15, 400, 1}, {13, 17, 90}, {40, 64, 9}}) {
    PressureProblem problem{n, {is, no, no}, PressureOutlet::top, 1e-4, PressureNoise::white};
    for (const bool is_around : {no, is}) {
      problem.periodic[1] = is_around && n[2] > 1;
      const Outcome one = solve_rough(problem, problem.alone(1), 1e-9);
      for (const int n_threads : {2, 3, 4}) {
        const Outcome many = solve_rough(problem, problem.alone(n_threads), 1e-9);
        INFO(name(problem) << ", threads " << n_threads);
        CHECK(many.report.iterations == one.report.iterations);
        CHECK(has_same_bits(one.p, many.p));
      }
    }
  }
}

TEST_CASE("pressure converges to that of the continuous equation in second order") {
  // div(c grad p) = b on [0,1]^3, c = 2 + sin x + y z; no flow through the walls, p = 0 on top
  const auto solution = [](double x, double y, double z) {
    return std::cos(M_PI * x) * std::cos(2.0 * M_PI * y) * (1.0 - z * z);
  };
  const auto conductivity_at = [](double x, double y, double z) { return 2.0 + std::sin(x) + y * z; };
  const auto right_side = [&](double x, double y, double z) {
    const double cx = std::cos(M_PI * x), cy = std::cos(2.0 * M_PI * y);
    const double px = -M_PI * std::sin(M_PI * x) * cy * (1.0 - z * z);
    const double py = -2.0 * M_PI * cx * std::sin(2.0 * M_PI * y) * (1.0 - z * z), pz = -2.0 * cx * cy * z;
    const double laplace = -5.0 * M_PI * M_PI * solution(x, y, z) - 2.0 * cx * cy;
    return conductivity_at(x, y, z) * laplace + std::cos(x) * px + z * py + y * pz;
  };
  std::vector<double> errors;
  for (const int n : {10, 20, 40}) {
    const double h = 1.0 / n;
    PressureProblem problem{{n, n, n}};
    problem.spacing = {h, h, h};
    const GasRanks ranks = problem.alone(1);
    const CellBlock block = ranks.block();
    std::array<GridField<double>, 3> c;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      c[axis] = GridField<double>(GridLayout(block, gas_ghosts), 0.0);
      std::array<int, 3> at{}, last{n - 1, n - 1, n - 1};
      if (axis == 2) last[2] = n;
      for (at[2] = 0; at[2] <= last[2]; ++at[2])
        for (at[1] = 0; at[1] <= last[1]; ++at[1])
          for (at[0] = 0; at[0] <= last[0]; ++at[0]) {
            std::array<double, 3> x{(at[0] + 0.5) * h, (at[1] + 0.5) * h, (at[2] + 0.5) * h};
            x[axis] -= 0.5 * h;
            const double twice = at[axis] == n ? 2.0 : 1.0;
            if (at[axis] > 0) c[axis](at[0], at[1], at[2]) = twice * conductivity_at(x[0], x[1], x[2]);
          }
    }
    const auto centre = [h](int i) { return (i + 0.5) * h; };
    const GridField<double> b =
        field(block, [&](int i, int j, int k) { return right_side(centre(i), centre(j), centre(k)); });
    GridField<double> p(b.layout(), 0.0);
    PressureSolver solver(problem.grid(), ranks);
    solver.set({&c[0], &c[1], &c[2]});
    REQUIRE(solver.solve(b, p, 1e-9).is_converged);
    errors.push_back(
        largest(block, [&](int i, int j, int k) { return p(i, j, k) - solution(centre(i), centre(j), centre(k)); }));
  }
  CHECK(std::log2(errors[0] / errors[1]) == Approx(2.0).margin(0.15));
  CHECK(std::log2(errors[1] / errors[2]) == Approx(2.0).margin(0.1));
}

TEST_CASE("a pressure solve that starts near the solution needs fewer iterations") {
  PressureProblem problem{{16, 16, 60}, {}, PressureOutlet::top, 1e-4, PressureNoise::white};
  const GasRanks ranks = problem.alone(1);
  const CellBlock block = ranks.block();
  PressureSolver solver(problem.grid(), ranks);
  const auto c = coefficients(problem, block);
  solver.set({&c[0], &c[1], &c[2]});
  GridField<double> b = field(block, [&](int i, int j, int k) { return rough(problem, i, j, k); });
  GridField<double> p(b.layout(), 0.0);
  const PressureReport cold = solver.solve(b, p, 1e-6);
  const PressureReport unchanged = solver.solve(b, p, 1e-6);
  CHECK(unchanged.is_converged);
  CHECK(unchanged.iterations <= 1);
  for (std::int64_t at = 0; at < b.layout().n_values(); ++at) b.data()[at] *= 1.001;
  const PressureReport warm = solver.solve(b, p, 1e-6);
  CHECK(warm.is_converged);
  CHECK(warm.iterations <= cold.iterations - 2);
  CHECK(warm.iterations >= 1);
}

TEST_CASE("a pressure solve that cannot converge says so") {
  PressureProblem problem{{16, 16, 16}};
  const GasRanks ranks = problem.alone(2);
  const CellBlock block = ranks.block();
  PressureSolver solver(problem.grid(), ranks);
  const auto c = coefficients(problem, block);
  solver.set({&c[0], &c[1], &c[2]});
  GridField<double> b = field(block, [&](int i, int j, int k) { return rough(problem, i, j, k); });
  GridField<double> p(b.layout(), 0.0);
  const PressureReport stopped = solver.solve(b, p, 1e-9, 2);
  CHECK_FALSE(stopped.is_converged);
  CHECK(stopped.iterations == 2);
  CHECK(stopped.residual > 1e-9);
  b(3, 4, 5) = std::numeric_limits<double>::quiet_NaN();
  p.fill(0.0);
  CHECK_FALSE(solver.solve(b, p, 1e-9).is_converged);
  const GridField<double> nothing(b.layout(), 0.0);
  p.fill(0.0);
  const PressureReport trivial = solver.solve(nothing, p, 0.0);
  CHECK(trivial.is_converged);
  CHECK(trivial.iterations == 0);
}
