// What a flux of momentum carries, and sums of rows.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <vector>

#include "kernels/gas/flow.hpp"

using namespace moraine;

namespace {

double random_value(std::uint64_t n) {
  return std::sin(12.9898 * static_cast<double>(n)) * std::cos(static_cast<double>(n * n % 8191));
}

}  // namespace

TEST_CASE("on parabolas gas carries the value at the face, at extrema too") {
  for (const double bend : {-2.0, 0.3, 1.0})
    for (double at = -3.0; at < 3.0; at += 0.25)
      for (const double flux : {-1.0, 1.0}) {
        const auto value = [&](double x) { return bend * (x - at) * (x - at) + 0.7; };
        CHECK(carried_value(value(-1.5), value(-0.5), value(0.5), value(1.5), flux) ==
              Approx(value(0.0)).margin(1e-13));
      }
}

TEST_CASE("on smooth waves gas carries a value of fourth order") {
  const auto error = [](double h, double x) {
    const auto value = [&](double s) { return std::sin(x + s * h); };
    return std::abs(carried_value(value(-1.5), value(-0.5), value(0.5), value(1.5), 1.0) - value(0.0));
  };
  for (const double x : {0.3, 1.2, 2.0, 2.6}) CHECK(error(0.1, x) / error(0.05, x) == Approx(16.0).epsilon(0.05));
}

TEST_CASE("where values alternate gas carries the upwind one") {
  CHECK(carried_value(1.0, -1.0, 1.0, -1.0, 2.0) == -1.0);
  CHECK(carried_value(1.0, -1.0, 1.0, -1.0, -2.0) == 1.0);
}

TEST_CASE("at a step gas carries the upwind value") {
  CHECK(carried_value(0.0, 0.0, 1.0, 1.0, 1.0) == 0.0);
  CHECK(carried_value(0.0, 0.0, 1.0, 1.0, -1.0) == 1.0);
}

TEST_CASE("what gas carries between values that rise or fall to a plateau lies between its two sides") {
  for (std::uint64_t n = 0; n < 2000; ++n) {
    double value[4];
    double sum = random_value(n);
    for (std::uint64_t k = 0; k < 4; ++k) value[k] = sum += std::abs(random_value(17 * n + k));
    value[3] = value[2];
    for (const double sign : {-1.0, 1.0}) {
      const double low = sign * value[1], high = sign * value[2];
      const double carried = carried_value(sign * value[0], low, high, sign * value[3], random_value(n + 5));
      CHECK(carried >= std::min(low, high) - 1e-12);
      CHECK(carried <= std::max(low, high) + 1e-12);
    }
  }
}

TEST_CASE("sums of drag over rows of any length are those of plain sums") {
  for (const int n : {1, 7, 8, 9, 255, 256, 257, 600}) {
    const auto size = static_cast<std::size_t>(n + 2);
    std::vector<double> u(size), p(size), held(size), exchange(size), push(size), cell_u(size, 1.0), cell_g(size, 2.0);
    for (std::size_t i = 0; i < size; ++i) {
      u[i] = random_value(i), p[i] = random_value(i + 1000), held[i] = 0.7 + 0.2 * random_value(i + 2000);
      exchange[i] = 3.0 + random_value(i + 3000), push[i] = random_value(i + 4000);
    }
    CellRow row;
    row.inverse_spacing = 10.0, row.mean_gradient = 0.5, row.weight = 0.25;
    row.velocity = u.data() + 1, row.pressure = p.data() + 1, row.void_fraction = held.data() + 1;
    row.exchange = exchange.data() + 1, row.exchange_velocity = push.data() + 1;
    row.cell_velocity = cell_u.data() + 1, row.cell_gradient = cell_g.data() + 1;
    const CellSums sums = add_cell_means(n, row);
    double drag = 0.0, reaction = 0.0;
    for (std::size_t i = 1; i + 1 < size; ++i) {
      const double velocity = 0.5 * (u[i] + u[i + 1]), gradient = 5.0 * (p[i + 1] - p[i - 1]) + 0.5;
      drag += push[i] - exchange[i] * velocity;
      reaction += (1.0 - held[i]) * gradient;
      CHECK(cell_u[i] == Approx(1.0 + 0.25 * velocity));
      CHECK(cell_g[i] == Approx(2.0 + 0.25 * gradient));
    }
    CHECK(sums.drag == Approx(drag).margin(1e-12));
    CHECK(sums.reaction == Approx(reaction).margin(1e-12));
  }
}
