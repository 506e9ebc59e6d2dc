// Gas between grains that the tests make up: jumps and waves of the void fraction, drag, and what is kept.
#include <catch2/catch.hpp>

#include "tests/physics/gas_laboratory.hpp"

using namespace moraine;
using namespace moraine::gas_laboratory;
using Kind = GasBoundary::Kind;

namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

/// A column along y with a given superficial velocity at its foot and air above.
Bench column(int n, double height, double density, double viscosity, double speed, double tolerance = 1e-10) {
  const GasGrid cells = grid({4, n, 1}, {4 * height / n, height, height / n}, {true, false, true});
  Gas air = gas(cells, density, viscosity);
  air.tolerance = tolerance;
  air.boundaries = {boundary(Kind::velocity, 2, {0, speed, 0}), boundary(Kind::pressure, 3)};
  return {air, cells};
}

template <typename Value>
void fill_cells(const Bench& bench, GridField<>& cells, Value value) {
  for (int k = 0; k < bench.grid.n[2]; ++k)
    for (int j = 0; j < bench.grid.n[1]; ++j)
      for (int i = 0; i < bench.grid.n[0]; ++i) cells(i, j, k) = value(bench.centre(0, i), bench.centre(1, j));
}

/// Ergun (1952): drag over slip velocity per volume, of grains of one size.
double ergun(double void_fraction, double density, double viscosity, double diameter, double slip) {
  const double solids = 1.0 - void_fraction;
  return 150.0 * solids * solids * viscosity / (void_fraction * diameter * diameter) +
         1.75 * solids * density * slip / diameter;
}

}  // namespace

TEST_CASE("uniform gas flow passes a jump of the void fraction without ringing", "[gas]") {
  Bench bench = column(32, 0.32, 1.2, 0.0, 0.5);
  fill_cells(bench, bench.load.void_fraction, [](double, double y) { return y > 0.08 && y < 0.2 ? 0.4 : 1.0; });
  bench.run(2.0, 2e-3);
  double highest = 0.0;
  for (int j = 1; j < 32; ++j) {
    const double face = 0.5 * (bench.load.void_fraction(0, j, 0) + bench.load.void_fraction(0, j - 1, 0));
    for (int i = 0; i < 4; ++i) {
      CHECK(face * bench.flow.velocity(1)(i, j, 0) == Approx(0.5).epsilon(1e-6));
      CHECK(std::abs(bench.flow.velocity(0)(i, j, 0)) < 1e-6);
    }
    highest = std::max(highest, std::abs(bench.flow.pressure()(0, j, 0)));
  }
  CHECK(highest < 2.0 * 1.2 * (0.5 / 0.4) * (0.5 / 0.4));  // of the order of what the faster gas takes to speed up
}

TEST_CASE("a jet into a patch of low void fraction makes no new extremes downstream of it", "[gas]") {
  const GasGrid cells = grid({32, 32, 1}, {0.32, 0.32, 0.01}, {true, true, true});
  Gas air = gas(cells, 1.2, 1.8e-5);
  air.velocity = {1.0, 0.0, 0.0};
  Bench bench(air, cells);
  fill_cells(bench, bench.load.void_fraction,
             [](double x, double y) { return std::hypot(x - 0.16, y - 0.16) < 0.05 ? 0.4 : 1.0; });
  fill_cells(bench, bench.load.exchange,
             [](double x, double y) { return std::hypot(x - 0.16, y - 0.16) < 0.05 ? 500.0 : 0.0; });
  bench.run(0.3, 1e-3);
  double fastest = 0.0;
  for (int j = 0; j < 32; ++j)
    for (int i = 0; i < 32; ++i) fastest = std::max(fastest, std::abs(bench.flow.velocity(0)(i, j, 0)));
  CHECK(fastest < 2.0);
}

TEST_CASE("a void fraction that moves with the gas leaves its velocity uniform", "[gas]") {
  const GasGrid cells = grid({24, 20, 1}, {0.24, 0.2, 0.01}, {true, true, true});
  Gas air = gas(cells, 1.2, 1.8e-5);
  air.velocity = {0.8, -0.5, 0.0};
  air.tolerance = 1e-13;
  Bench bench(air, cells);
  GridField<>& held = bench.load.void_fraction;
  fill_cells(bench, held, [](double x, double y) {
    return 0.7 + (x > 0.05 && x < 0.12 ? 0.2 : -0.1) * (y > 0.06 && y < 0.14 ? 1.0 : -0.5);
  });
  // On its way already: a start from nothing would make the velocity fit a void fraction at rest.
  for (const GasFlow::Kept& kept : bench.flow.kept())
    for (int j = 0; j < 20; ++j)
      for (int i = 0; i < 24; ++i)
        if (std::string(kept.name) == "gas_void_fraction" || std::string(kept.name) == "gas_carrier")
          (*kept.values)(i, j, 0) = held(i, j, 0);
  bench.flow.restore({1.0, 0.0, 0.0});
  double largest = 0.0;
  for (int step = 0; step < 60; ++step) {
    const double dt = step % 20 < 10 ? 2e-3 : 3e-3;
    // What continuity says on the grid of uniform flow, with the void fraction at the end of the step.
    GridField<> before(held.layout()), next(held.layout());
    for (int j = 0; j < 20; ++j)
      for (int i = 0; i < 24; ++i) before(i, j, 0) = next(i, j, 0) = held(i, j, 0);
    for (int sweep = 0; sweep < 200; ++sweep) {
      for (int j = 0; j < 20; ++j)
        for (int i = 0; i < 24; ++i)
          held(i, j, 0) = before(i, j, 0) - dt *
                                                (0.8 * (next((i + 1) % 24, j, 0) - next((i + 23) % 24, j, 0)) -
                                                 0.5 * (next(i, (j + 1) % 20, 0) - next(i, (j + 19) % 20, 0))) /
                                                0.02;
      for (int j = 0; j < 20; ++j)
        for (int i = 0; i < 24; ++i) next(i, j, 0) = held(i, j, 0);
    }
    CHECK(bench.advance(dt).n_parts == 1);
    for (int j = 0; j < 20; ++j)
      for (int i = 0; i < 24; ++i)
        largest = std::max({largest, std::abs(bench.flow.velocity(0)(i, j, 0) - 0.8),
                            std::abs(bench.flow.velocity(1)(i, j, 0) + 0.5)});
  }
  CHECK(largest < 1e-8);
}

TEST_CASE("gas through a bed of fixed grains loses Ergun's pressure", "[gas]") {
  const double density = 10.0, viscosity = 1.5e-3, held = 0.451335, height = 0.0156;
  for (const auto& [speed, drop] : {std::array{0.002, 22.992}, std::array{0.02, 230.507}}) {
    Bench bench = column(16, height, density, viscosity, speed, 1e-12);
    fill_cells(bench, bench.load.void_fraction, [&](double, double) { return held; });
    const double beta = ergun(held, density, viscosity, 1e-3, speed / held);
    fill_cells(bench, bench.load.exchange, [&](double, double) { return beta; });
    for (int step = 0; step < 20; ++step) bench.advance(1e-3);
    const double gradient = beta * speed / held / held;
    for (int j = 0; j < 16; ++j)
      CHECK(bench.flow.pressure()(1, j, 0) == Approx(gradient * (height - bench.centre(1, j))).epsilon(1e-7));
    CHECK(gradient * height == Approx(drop).epsilon(1e-4));
  }
}

TEST_CASE("the stiffest drag gives the pressure of the bed within a few steps", "[gas]") {
  Bench bench = column(16, 0.16, 1.2, 1.8e-5, 0.1);
  fill_cells(bench, bench.load.void_fraction, [](double, double y) { return y < 0.08 ? 0.4 : 1.0; });
  const double beta = 1e4 * 1.2 * 0.4 / 1e-3;
  fill_cells(bench, bench.load.exchange, [&](double, double y) { return y < 0.08 ? beta : 0.0; });
  for (int step = 0; step < 5; ++step) bench.advance(1e-3);
  const double gradient = beta * 0.1 / 0.4 / 0.4;
  for (int j = 1; j < 8; ++j)
    CHECK(bench.flow.pressure()(0, j - 1, 0) - bench.flow.pressure()(0, j, 0) == Approx(0.01 * gradient).epsilon(1e-6));
}

TEST_CASE("a run that starts at full speed has the pressure of the bed from its first step", "[gas]") {
  Bench bench = column(16, 0.16, 1.2, 1.8e-5, 0.5);
  fill_cells(bench, bench.load.void_fraction, [](double, double) { return 0.5; });
  fill_cells(bench, bench.load.exchange, [](double, double) { return 300.0; });
  bench.advance(1e-3);
  CHECK(bench.flow.pressure()(0, 0, 0) == Approx(300.0 * 0.5 / 0.5 / 0.5 * (0.16 - 0.005)).epsilon(1e-6));
  CHECK(bench.flow.cell_velocity(1)(2, 7, 0) == Approx(1.0).epsilon(1e-6));
  for (const int cell : {0, 7, 15})
    CHECK(bench.flow.cell_pressure_gradient(1)(2, cell, 0) == Approx(-300.0 * 0.5 / 0.5 / 0.5).epsilon(1e-6));
}

TEST_CASE("in model B the pressure gradient acts on the gas alone", "[gas]") {
  const GasGrid cells = grid({4, 16, 1}, {0.04, 0.16, 0.01}, {true, false, true});
  Gas air = gas(cells, 1.2, 1.8e-5);
  air.model = GasModel::b;
  air.boundaries = {boundary(Kind::velocity, 2, {0, 0.5, 0}), boundary(Kind::pressure, 3)};
  Bench bench(air, cells);
  fill_cells(bench, bench.load.void_fraction, [](double, double) { return 0.5; });
  fill_cells(bench, bench.load.exchange, [](double, double) { return 300.0; });
  bench.advance(1e-3);
  CHECK(bench.flow.cell_pressure_gradient(1)(2, 7, 0) == Approx(-300.0 * 0.5 / 0.5).epsilon(1e-6));
  const GasFlow::Budget budget = bench.flow.budget();
  CHECK(budget.drag.y == Approx(-300.0 * 1.0 * 0.04 * 0.16 * 0.01).epsilon(1e-9));
}

TEST_CASE("gas with a void fraction that varies follows a made-up solution in second order", "[gas]") {
  const double nu = 0.05, rho = 1.3;
  const auto held = [](double x, double y) { return 0.7 + 0.2 * std::sin(two_pi * x) * std::cos(two_pi * y); };
  const auto u = [&](double x, double y) {
    return (0.6 + 0.3 * std::sin(two_pi * x) * std::cos(two_pi * y)) / held(x, y);
  };
  const auto v = [&](double x, double y) {
    return (0.3 - 0.3 * std::cos(two_pi * x) * std::sin(two_pi * y)) / held(x, y);
  };
  const auto p = [](double x, double y) { return std::cos(two_pi * x) * std::cos(2 * two_pi * y); };
  const double d = 1e-4;  // differences of exact values: errors of 1e-7
  const auto dx = [&](auto f, double x, double y) { return (f(x + d, y) - f(x - d, y)) / (2 * d); };
  const auto dy = [&](auto f, double x, double y) { return (f(x, y + d) - f(x, y - d)) / (2 * d); };
  const auto xx = [&](double x, double y) { return held(x, y) * (u(x, y) * u(x, y) - 2 * nu * dx(u, x, y)); };
  const auto xy = [&](double x, double y) {
    return held(x, y) * (u(x, y) * v(x, y) - nu * (dy(u, x, y) + dx(v, x, y)));
  };
  const auto yy = [&](double x, double y) { return held(x, y) * (v(x, y) * v(x, y) - 2 * nu * dy(v, x, y)); };
  const auto error = [&](int n) {
    const GasGrid cells = grid({n, n, 1}, {1, 1, 1}, {true, true, true});
    Gas air = gas(cells, rho, rho * nu);
    air.tolerance = 1e-9;
    Bench bench(air, cells);
    bench.set_velocity(0, u);
    bench.set_velocity(1, v);
    fill_cells(bench, bench.load.void_fraction, held);
    // drag to rest fixes the mean velocity, which periodic boxes leave open
    fill_cells(bench, bench.load.exchange, [](double, double) { return 2.0; });
    fill_cells(bench, bench.load.exchange_velocity[0], [&](double x, double y) {
      return rho * (dx(xx, x, y) + dy(xy, x, y)) + held(x, y) * dx(p, x, y) + 2.0 * u(x, y);
    });
    fill_cells(bench, bench.load.exchange_velocity[1], [&](double x, double y) {
      return rho * (dx(xy, x, y) + dy(yy, x, y)) + held(x, y) * dy(p, x, y) + 2.0 * v(x, y);
    });
    bench.run(0.6, 0.05);
    double sum = 0.0;
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        const double du = bench.flow.velocity(0)(i, j, 0) - u(bench.face(0, i), bench.centre(1, j));
        const double dv = bench.flow.velocity(1)(i, j, 0) - v(bench.centre(0, i), bench.face(1, j));
        sum += du * du + dv * dv;
      }
    return std::sqrt(sum / (n * n));
  };
  const double coarse = error(16), middle = error(32), fine = error(64);
  INFO(coarse << " " << middle << " " << fine);
  CHECK(std::log2(coarse / middle) > 1.9);
  CHECK(std::log2(middle / fine) > 1.9);
}
