// What the gas keeps: momentum, mass, and all bits over a restart and on any number of threads.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>

#include "tests/physics/gas_laboratory.hpp"
#include "tests/support/gas_scenes.hpp"

using namespace moraine;
using namespace moraine::gas_laboratory;
using scenes::BusyGas;

namespace {

constexpr double step = 2e-3;

Bench busy(const BusyGas& scene, int n_threads = 1) { return {scene.gas, scene.grid, alone(scene.grid, n_threads)}; }

GasReport advance(const BusyGas& scene, Bench& bench) {
  scene.load({{}, scene.grid.n}, bench.time, bench.load);
  return bench.advance(step);
}

bool is_same(Bench& a, Bench& b) {
  const auto kept_a = a.flow.kept(), kept_b = b.flow.kept();
  for (std::size_t f = 0; f < kept_a.size(); ++f)
    for (int k = 0; k < a.grid.n[2]; ++k)
      for (int j = 0; j < a.grid.n[1]; ++j)
        for (int i = 0; i < a.grid.n[0]; ++i) {
          const double x = (*kept_a[f].values)(i, j, k), y = (*kept_b[f].values)(i, j, k);
          if (std::memcmp(&x, &y, sizeof x) != 0) {
            UNSCOPED_INFO(kept_a[f].name << " at " << i << " " << j << " " << k << ": " << x << " " << y);
            return false;
          }
        }
  return true;
}

/// Copies what a restart keeps, and no more: cells, and faces as far as the domain has them.
void copy_kept(Bench& from, Bench& to) {
  const auto kept_from = from.flow.kept(), kept_to = to.flow.kept();
  for (std::size_t f = 0; f < kept_from.size(); ++f) {
    std::array<int, 3> n = from.grid.n;
    const int axis = kept_from[f].face_axis;
    if (axis >= 0 && !from.grid.periodic[static_cast<std::size_t>(axis)]) ++n[static_cast<std::size_t>(axis)];
    for (int k = 0; k < n[2]; ++k)
      for (int j = 0; j < n[1]; ++j)
        for (int i = 0; i < n[0]; ++i) (*kept_to[f].values)(i, j, k) = (*kept_from[f].values)(i, j, k);
  }
  to.flow.restore(from.flow.kept_numbers());
  to.time = from.time;
}

void check_momentum(const BusyGas& scene) {
  Bench bench = busy(scene);
  Vec3 before = bench.flow.budget().momentum;
  int n_divided = 0;
  for (int s = 0; s < 25; ++s) {
    if (advance(scene, bench).n_parts > 1) ++n_divided;
    const GasFlow::Budget budget = bench.flow.budget();
    const Vec3 change = (budget.momentum - before) / step;
    const double scale = length(change) + length(budget.boundary_force) + length(budget.drag);
    INFO("step " << s << ": " << change.x << " " << change.y << " " << change.z);
    CHECK(length(change - budget.boundary_force - budget.drag) < 1e-10 * scale);
    before = budget.momentum;
  }
  CHECK(n_divided > 2);
}

}  // namespace

TEST_CASE("the momentum of the gas changes by what boundaries and grains give it", "[gas]") {
  check_momentum(BusyGas({15, 24, 1}, true));
  check_momentum(BusyGas({8, 7, 20}, false));
  check_momentum(BusyGas({8, 6, 20}, false, true));
}

TEST_CASE("the walls of a channel bear its friction", "[gas]") {
  const GasGrid cells = grid({4, 16, 1}, {0.02, 0.01, 0.005}, {true, false, true});
  Gas air = gas(cells, 1.0, 1e-3);
  air.pressure_gradient.x = -1200.0;
  Bench bench(air, cells);
  bench.run(0.4, 0.01);
  // The mean gradient pushes, the plates hold with as much: nothing is left.
  CHECK(std::abs(bench.flow.budget().boundary_force.x) < 1e-6 * 1200.0 * 0.02 * 0.01 * 0.005);
}

TEST_CASE("as much gas flows in as out, and through each cell", "[gas]") {
  const BusyGas scene({15, 24, 1}, true);
  Bench bench = busy(scene);
  for (int s = 0; s < 10; ++s) {
    const GasReport report = advance(scene, bench);
    CHECK(report.imbalance <= scene.gas.tolerance * (1.0 + 1e-9));
    CHECK(report.courant < 1.0);
  }
  scene.load({{}, scene.grid.n}, 0.0, bench.load);  // grains at rest from here on
  for (int s = 0; s < 2; ++s) {
    bench.load.void_fraction.fill(0.8);
    bench.advance(step);
  }
  const auto inflow = bench.flow.budget().inflow;
  REQUIRE(inflow.size() == 5);
  const double width = 15 * 0.01, depth = 0.012;
  CHECK(inflow[0] + inflow[1] == Approx(-inflow[2]).epsilon(1e-4));
  CHECK(inflow[0] == Approx(1.2 * 0.4 * 8.0 / 15.0 * width * depth).epsilon(1e-9));
  CHECK(inflow[1] == Approx(1.2 * 2.0 * 7.0 / 15.0 * width * depth).epsilon(1e-9));
}

TEST_CASE("in every cell and step what is there changes by what flows in, to the tolerance that is reported", "[gas]") {
  constexpr double short_step = 4e-4;  // not divided, so that fluxes at its end are those of the step
  for (const BusyGas& scene : {BusyGas({15, 24, 1}, true), BusyGas({8, 7, 20}, false)}) {
    Bench bench = busy(scene);
    advance(scene, bench);
    int n_checked = 0;
    for (int s = 0; s < 12; ++s) {
      GridField<> before(bench.flow.void_fraction().layout());
      std::copy_n(bench.flow.void_fraction().data(), before.layout().n_values(), before.data());
      scene.load({{}, scene.grid.n}, bench.time, bench.load);
      const GasReport report = bench.advance(short_step);
      if (report.n_parts != 1) continue;
      ++n_checked;
      const GridField<>& after = bench.flow.void_fraction();
      double worst = 0.0, emptiest = 1.0;
      const auto cells = [&](auto visit) {
        for (int k = 0; k < scene.grid.n[2]; ++k)
          for (int j = 0; j < scene.grid.n[1]; ++j)
            for (int i = 0; i < scene.grid.n[0]; ++i) visit(i, j, k);
      };
      cells([&](int i, int j, int k) { emptiest = std::min(emptiest, after(i, j, k)); });
      cells([&](int i, int j, int k) {
        const auto flux = [&](int axis, int up) {  // through the low or the high face
          const int x = i + (axis == 0 ? up : 0), y = j + (axis == 1 ? up : 0), z = k + (axis == 2 ? up : 0);
          const double held = after(x, y, z) + after(x - (axis == 0), y - (axis == 1), z - (axis == 2));
          return 0.5 * held * bench.flow.velocity(axis)(x, y, z);
        };
        double change = after(i, j, k) - before(i, j, k);
        for (int axis = 0; axis < (scene.grid.is_flat ? 2 : 3); ++axis)
          change += short_step * (flux(axis, 1) - flux(axis, 0)) / scene.grid.spacing[axis];
        worst = std::max(worst, std::abs(change) / emptiest);
      });
      CHECK(worst <= scene.gas.tolerance * (1.0 + 1e-6));
      CHECK(worst <= report.imbalance * (1.0 + 1e-6) + 1e-13);
    }
    CHECK(n_checked > 6);
  }
}

TEST_CASE("gas goes on after a restart bit by bit", "[gas]") {
  for (const BusyGas& scene : {BusyGas({15, 24, 1}, true), BusyGas({8, 6, 20}, false, true)}) {
    Bench through = busy(scene), again = busy(scene);
    for (int s = 0; s < 7; ++s) advance(scene, through);
    copy_kept(through, again);
    for (int s = 0; s < 7; ++s) {
      advance(scene, through);
      advance(scene, again);
    }
    CHECK(is_same(through, again));
  }
}

TEST_CASE("gas has the same bits on any number of threads", "[gas]") {
  const BusyGas scene({8, 7, 20}, false);
  Bench one = busy(scene);
  for (int s = 0; s < 3; ++s) advance(scene, one);
  for (const int n_threads : {2, 3, 4}) {
    Bench more = busy(scene, n_threads);
    for (int s = 0; s < 3; ++s) advance(scene, more);
    CHECK(is_same(one, more));
    CHECK(one.flow.budget().boundary_force == more.flow.budget().boundary_force);
    CHECK(one.flow.budget().momentum == more.flow.budget().momentum);
  }
}

TEST_CASE("gas that cannot leave is refused before the run", "[gas]") {
  const GasGrid cells = grid({4, 4, 1}, {1, 1, 1}, {false, false, true});
  Gas air = gas(cells, 1.0, 1.0);
  air.boundaries = {boundary(GasBoundary::Kind::velocity, 2, {0, 1, 0})};
  CHECK_THROWS_WITH(GasFlow(air, {}, cells, alone(cells)), Catch::Contains("y-low") && Catch::Contains("pressure"));
  air.boundaries.push_back(boundary(GasBoundary::Kind::velocity, 3, {0, 1, 0}));
  CHECK_NOTHROW(GasFlow(air, {}, cells, alone(cells)));
  air.boundaries[0].ramp = {{0.0, 0.0}, {1.0, 1.0}};
  CHECK_THROWS_AS(GasFlow(air, {}, cells, alone(cells)), SceneError);
}
