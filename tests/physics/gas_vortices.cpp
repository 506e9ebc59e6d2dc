// Vortices in a periodic box: what the gas loses where nothing takes it, and the order in space and time.
#include <catch2/catch.hpp>

#include "tests/physics/gas_laboratory.hpp"

using namespace moraine;
using namespace moraine::gas_laboratory;

namespace {

double kinetic_energy(const Bench& bench) {
  double sum = 0.0;
  for (int j = 0; j < bench.grid.n[1]; ++j)
    for (int i = 0; i < bench.grid.n[0]; ++i)
      for (int a = 0; a < 2; ++a) sum += 0.5 * bench.flow.velocity(a)(i, j, 0) * bench.flow.velocity(a)(i, j, 0);
  return sum;
}

/// The triangular vortex of Gresho & Chan (1990), Int. J. Numer. Methods Fluids 11, 621, around the middle of the unit
/// square.
double gresho_speed(double r) { return r < 0.2 ? 5.0 * r : r < 0.4 ? 2.0 - 5.0 * r : 0.0; }

/// Decaying vortices, carried along by a mean flow so that nothing cancels: Taylor & Green (1937).
struct TaylorGreen {
  double viscosity;
  Vec3 carried{1.0, 0.5, 0.0};
  double u(double x, double y, double t) const {
    return carried.x - std::cos(wave * (x - carried.x * t)) * std::sin(wave * (y - carried.y * t)) * decay(t);
  }
  double v(double x, double y, double t) const {
    return carried.y + std::sin(wave * (x - carried.x * t)) * std::cos(wave * (y - carried.y * t)) * decay(t);
  }
  double decay(double t) const { return std::exp(-2.0 * viscosity * wave * wave * t); }
  static constexpr double wave = 2.0 * std::numbers::pi;
};

Bench taylor_green(int n, double until, int n_steps) {
  const GasGrid cells = grid({n, n, 1}, {1, 1, 1}, {true, true, true});
  const TaylorGreen exact{0.01};
  Gas air = gas(cells, 1.0, exact.viscosity);
  air.tolerance = 1e-12;
  Bench bench(air, cells);
  bench.set_velocity(0, [&](double x, double y) { return exact.u(x, y, 0.0); });
  bench.set_velocity(1, [&](double x, double y) { return exact.v(x, y, 0.0); });
  for (int s = 0; s < n_steps; ++s) CHECK(bench.advance(until / n_steps).n_parts == 1);
  return bench;
}

double error(const Bench& bench, double time) {
  const TaylorGreen exact{0.01};
  double sum = 0.0;
  for (int j = 0; j < bench.grid.n[1]; ++j)
    for (int i = 0; i < bench.grid.n[0]; ++i) {
      const double du = bench.flow.velocity(0)(i, j, 0) - exact.u(bench.face(0, i), bench.centre(1, j), time);
      const double dv = bench.flow.velocity(1)(i, j, 0) - exact.v(bench.centre(0, i), bench.face(1, j), time);
      sum += du * du + dv * dv;
    }
  return std::sqrt(sum / static_cast<double>(bench.grid.n[0] * bench.grid.n[1]));
}

double difference(const Bench& a, const Bench& b) {
  double sum = 0.0;
  for (int j = 0; j < a.grid.n[1]; ++j)
    for (int i = 0; i < a.grid.n[0]; ++i)
      for (int c = 0; c < 2; ++c) {
        const double d = a.flow.velocity(c)(i, j, 0) - b.flow.velocity(c)(i, j, 0);
        sum += d * d;
      }
  return std::sqrt(sum / static_cast<double>(a.grid.n[0] * a.grid.n[1]));
}

}  // namespace

TEST_CASE("Gresho's vortex keeps its energy without friction", "[gas]") {
  const GasGrid cells = grid({40, 40, 1}, {1, 1, 1}, {true, true, true});
  Bench bench(gas(cells, 1.0, 0.0), cells);
  const auto spin = [](double x, double y) {
    const double r = std::hypot(x, y);
    return r > 0 ? gresho_speed(r) / r : 0.0;
  };
  bench.set_velocity(0, [&](double x, double y) { return -(y - 0.5) * spin(x - 0.5, y - 0.5); });
  bench.set_velocity(1, [&](double x, double y) { return (x - 0.5) * spin(x - 0.5, y - 0.5); });
  const double before = kinetic_energy(bench);
  bench.run(3.0, 0.005);
  INFO("energy kept: " << kinetic_energy(bench) / before);
  CHECK(kinetic_energy(bench) / before > 0.99);
  CHECK(kinetic_energy(bench) / before < 1.001);
}

TEST_CASE("vortices leave through an outlet, which draws gas in, without growing", "[gas]") {
  const GasGrid cells = grid({60, 40, 1}, {1.5, 1, 1}, {false, false, true});
  Gas air = gas(cells, 1.0, 1e-5);
  air.velocity = {1.0, 0.0, 0.0};
  air.boundaries = {boundary(GasBoundary::Kind::velocity, 0, {1, 0, 0}), boundary(GasBoundary::Kind::pressure, 1),
                    boundary(GasBoundary::Kind::free_slip, 2), boundary(GasBoundary::Kind::free_slip, 3)};
  Bench bench(air, cells);
  const auto spin = [](double x, double y) { return 3.0 * gresho_speed(std::hypot(x, y)) / std::hypot(x, y); };
  bench.set_velocity(0, [&](double x, double y) { return 1.0 - (y - 0.51) * spin(x - 1.0, y - 0.51); });
  bench.set_velocity(1, [&](double x, double y) { return (x - 1.0) * spin(x - 1.0, y - 0.51); });
  double fastest = 0.0, slowest_out = 1.0;
  for (int step = 0; step < 400; ++step) {
    bench.advance(0.01);
    for (int j = 0; j < 40; ++j) {
      slowest_out = std::min(slowest_out, bench.flow.velocity(0)(60, j, 0));
      for (int i = 0; i < 60; ++i)
        fastest = std::max(fastest, std::hypot(bench.flow.velocity(0)(i, j, 0), bench.flow.velocity(1)(i, j, 0)));
    }
  }
  CHECK(slowest_out < -0.5);
  CHECK(fastest < 4.5);  // 4 at the start
  double left = 0.0;
  for (int j = 0; j < 40; ++j)
    for (int i = 1; i < 60; ++i) left = std::max(left, std::abs(bench.flow.velocity(0)(i, j, 0) - 1.0));
  INFO("left of the vortex: " << left);
  CHECK(left < 0.5);
}

TEST_CASE("Taylor and Green's vortices are second order in space", "[gas]") {
  const double coarse = error(taylor_green(16, 0.2, 50), 0.2), middle = error(taylor_green(32, 0.2, 100), 0.2),
               fine = error(taylor_green(64, 0.2, 200), 0.2);
  INFO(coarse << " " << middle << " " << fine);
  CHECK(std::log2(coarse / middle) > 1.9);
  CHECK(std::log2(middle / fine) > 1.9);
}

TEST_CASE("Taylor and Green's vortices are second order in time", "[gas]") {
  const Bench exact = taylor_green(24, 0.2, 1600);
  const double coarse = difference(taylor_green(24, 0.2, 50), exact),
               middle = difference(taylor_green(24, 0.2, 100), exact),
               fine = difference(taylor_green(24, 0.2, 200), exact);
  INFO(coarse << " " << middle << " " << fine);
  CHECK(std::log2(coarse / middle) > 1.9);
  CHECK(std::log2(middle / fine) > 1.9);
}
