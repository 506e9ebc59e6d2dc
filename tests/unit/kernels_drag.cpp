// Drag laws at their limits; deposits and interpolation with the same weights; smoothing.
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "kernels/drag/cells.hpp"
#include "kernels/drag/elementary.hpp"
#include "kernels/drag/laws.hpp"
#include "kernels/drag/smooth.hpp"

using namespace moraine;

namespace {

constexpr DragLaw all_laws[] = {DragLaw::schiller_naumann, DragLaw::wen_yu,    DragLaw::ergun,
                                DragLaw::gidaspow,         DragLaw::di_felice, DragLaw::syamlal_obrien,
                                DragLaw::beetstra,         DragLaw::koch_hill};
constexpr GasWeights all_weights[] = {GasWeights::cell, GasWeights::trilinear};
constexpr double pi = 3.14159265358979323846;

/// Numbers in [0, 1), always the same.
class Numbers {
 public:
  double operator()() {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<double>(state_ >> 11) * 0x1p-53;
  }

 private:
  std::uint64_t state_ = 12345;
};

/// Grains anywhere in a grid, as hot records, with one that has left, and some on faces and in corners.
struct Cloud {
  std::array<int, 3> n;
  std::array<bool, 3> periodic;
  Vec3 low{-0.3, 0.1, 0.7}, spacing{0.01, 0.02, 0.015};
  static constexpr int n_grains = 500, width = 8;
  std::vector<double> records;
  Cloud(std::array<int, 3> cells, std::array<bool, 3> wraps) : n(cells), periodic(wraps) {
    Numbers number;
    for (int i = 0; i < n_grains; ++i) {
      const Vec3 at{number(), number(), number()};
      for (int a = 0; a < 3; ++a) {
        const double place = i < 8 ? (i >> a & 1) : at[a];
        records.push_back(low[a] + place * n[static_cast<std::size_t>(a)] * spacing[a]);
      }
      records.push_back(0.001 * (1.0 + number()));
      for (int a = 0; a < 3; ++a) records.push_back(number() - 0.3);
      records.push_back(1000.0);
    }
    records[20 * width] = std::nan("");
  }
  GrainView view() const { return {records.data(), width, {0, n_grains}}; }
  CellWeights weights(GasWeights kind) const { return {kind, n, low, spacing, periodic}; }
  /// A window of all cells, and one more where the grid is periodic.
  CellWindow window() const {
    CellWindow w;
    for (std::size_t a = 0; a < 3; ++a) {
      const int beyond = periodic[a] && n[a] > 1 ? 1 : 0;
      w.low[a] = -beyond;
      w.high[a] = n[a] + beyond;
    }
    return w;
  }
  double volume(int i) const { return 4.0 / 3.0 * pi * std::pow(records[static_cast<std::size_t>(i * width + 3)], 3); }
  static bool is_here(int i) { return i != 20; }
};

const std::vector<Cloud>& clouds() {
  static const std::vector<Cloud> all = {{{7, 5, 6}, {false, false, false}}, {{7, 5, 6}, {true, true, true}},
                                         {{5, 4, 1}, {false, true, false}},  {{1, 1, 9}, {false, false, true}},
                                         {{2, 1, 3}, {true, true, true}},    {{1, 1, 1}, {false, true, false}}};
  return all;
}

std::vector<double> random_cells(std::int64_t n) {
  Numbers number;
  std::vector<double> values;
  for (std::int64_t c = 0; c < n; ++c) values.push_back(number() - 0.5);
  return values;
}

}  // namespace

TEST_CASE("logarithm and exponential are within 1e-15 of the library's") {
  double of_log = 0.0, of_exp = 0.0;
  for (double x = 1e-12; x < 1e12; x *= 1.0037)
    of_log = std::max(of_log, std::abs(elementary::log(x) / std::log(x) - 1.0));
  for (double x = -690.0; x < 690.0; x += 0.0713)
    of_exp = std::max(of_exp, std::abs(elementary::exp(x) / std::exp(x) - 1.0));
  CHECK(of_log < 1e-15);
  CHECK(of_exp < 1e-15);
  CHECK(elementary::exp(0.0) == 1.0);
  CHECK(elementary::log(1.0) == 0.0);
  CHECK(elementary::pow(10.0, -3.65) == Approx(std::pow(10.0, -3.65)).epsilon(1e-14));
}

TEST_CASE(
    "every drag law is Stokes' for a lone grain that hardly moves, but Ergun's and those that are fitted elsewhere") {
  for (const DragLaw law :
       {DragLaw::schiller_naumann, DragLaw::wen_yu, DragLaw::gidaspow, DragLaw::beetstra, DragLaw::koch_hill})
    CHECK(drag_factor(law, 1.0, 0.0) == Approx(1.0).epsilon(1e-4));
  CHECK(drag_factor(DragLaw::di_felice, 1.0, 0.0) == Approx(4.8 * 4.8 / 24.0).epsilon(1e-12));
  CHECK(drag_factor(DragLaw::syamlal_obrien, 1.0, 0.0) == Approx(4.8 * 4.8 / 24.0).epsilon(1e-12));
  CHECK(drag_factor(DragLaw::ergun, 1.0, 0.0) == 0.0);
}

TEST_CASE("drag laws are finite, not negative and continuous in Re from rest to 1e6, for any void fraction") {
  for (const DragLaw law : all_laws)
    for (const double eps : {0.05, 0.3, 0.5, 0.6, 0.7999, 0.8, 0.9, 0.989, 0.99, 0.995, 1.0 - 1e-9, 1.0}) {
      if (eps >= 0.3)
        CHECK(drag_factor(law, eps, 1e-9) == Approx(drag_factor(law, eps, 0.0)).epsilon(1e-3).margin(1e-9));
      for (double re = 1e-9; re < 1e6; re *= 3.7) {
        const double f = drag_factor(law, eps, re);
        CHECK(std::isfinite(f));
        CHECK(f >= 0.0);
      }
    }
}

TEST_CASE("drag coefficients of arrays are those of single grains, to the bit, wherever they lie in the array") {
  Numbers number;
  constexpr int n = 37;
  std::vector<double> eps, slip, radius, c(n), shifted(n);
  for (int i = 0; i < n; ++i) {
    eps.push_back(0.3 + 0.7 * number());
    slip.push_back(i == 5 ? 0.0 : 3.0 * number());
    radius.push_back(1e-4 + 1e-3 * number());
  }
  const GasProperties gas{1.2, 1.8e-5};
  for (const DragLaw law : all_laws) {
    drag_coefficients(law, GasModel::a, gas, n, eps.data(), slip.data(), radius.data(), c.data());
    for (int first = 1; first < 9; ++first) {
      drag_coefficients(law, GasModel::a, gas, n - first, eps.data() + first, slip.data() + first,
                        radius.data() + first, shifted.data());
      CHECK(std::equal(shifted.begin(), shifted.end() - first, c.begin() + first));
    }
    drag_coefficients(law, GasModel::b, gas, n, eps.data(), slip.data(), radius.data(), shifted.data());
    for (std::size_t i = 0; i < n; ++i) {
      const double re = 2.0 * gas.density * eps[i] * slip[i] * radius[i] / gas.viscosity;
      CHECK(c[i] ==
            Approx(6.0 * pi * gas.viscosity * radius[i] * eps[i] * drag_factor(law, eps[i], re)).epsilon(1e-13));
      CHECK(shifted[i] == Approx(c[i] / eps[i]).epsilon(1e-13));
    }
  }
}

TEST_CASE("deposits keep volume and momentum, for all weights and grids") {
  for (const Cloud& cloud : clouds())
    for (const GasWeights kind : all_weights) {
      const CellWindow window = cloud.window();
      const double scale = 0x1p72;
      std::vector<std::int64_t> cells(static_cast<std::size_t>(window.n_cells())), four(cells.size() * 4);
      deposit_volume(cloud.view(), cloud.weights(kind), window, scale, cells.data());
      const std::vector<double> coefficients(Cloud::n_grains, 0.37);
      deposit_exchange(cloud.view(), cloud.weights(kind), window, coefficients.data(), 0x1p45, 0x1p45, false,
                       four.data());
      double volume = 0.0, momentum = 0.0;
      for (int i = 0; i < Cloud::n_grains; ++i) {
        if (!Cloud::is_here(i)) continue;
        volume += cloud.volume(i);
        momentum += 0.37 * cloud.records[static_cast<std::size_t>(i * Cloud::width + 5)];
      }
      double deposited = 0.0, exchanged = 0.0, carried = 0.0;
      for (std::size_t c = 0; c < cells.size(); ++c) {
        CHECK(cells[c] >= 0);
        deposited += static_cast<double>(cells[c]) / scale;
        exchanged += static_cast<double>(four[4 * c]) * 0x1p-45;
        carried += static_cast<double>(four[4 * c + 2]) * 0x1p-45;
      }
      CHECK(deposited == Approx(volume).epsilon(1e-12));
      CHECK(exchanged == Approx(0.37 * (Cloud::n_grains - 1)).epsilon(1e-12));
      CHECK(carried == Approx(momentum).epsilon(1e-12));
    }
}

TEST_CASE("constants are felt as they are, to the bit") {
  for (const Cloud& cloud : clouds())
    for (const GasWeights kind : all_weights) {
      const CellWindow window = cloud.window();
      std::vector<double> cells;
      for (std::int64_t c = 0; c < window.n_cells(); ++c) cells.insert(cells.end(), {0.7, 0.1, 0.2, 0.3});
      SlipTile tile;
      GrainView some = cloud.view();
      some.range = {0, SlipTile::size};
      gather_slip(some, cloud.weights(kind), window, cells.data(), false, tile);
      for (int i = 0; i < SlipTile::size; ++i) {
        const double* const record = cloud.view().record(i);
        if (!Cloud::is_here(i)) {
          CHECK(tile.radius[i] == 0.0);
          continue;
        }
        CHECK(tile.void_fraction[i] == 0.7);
        const double x = 0.1 - record[4], y = 0.2 - record[5], z = 0.3 - record[6];
        CHECK(tile.slip[i] == std::sqrt(x * x + y * y + z * z));
      }
    }
}

TEST_CASE("linear fields are felt linearly between the centres of the outermost cells") {
  const Cloud cloud({7, 5, 6}, {false, false, false});
  const CellWindow window = cloud.window();
  const auto field = [](double x, double y, double z) { return 0.2 + 3.0 * x - 2.0 * y + 5.0 * z; };
  std::vector<double> cells(static_cast<std::size_t>(4 * window.n_cells()));
  for (int k = 0; k < 6; ++k)
    for (int j = 0; j < 5; ++j)
      for (int i = 0; i < 7; ++i)
        cells[static_cast<std::size_t>(4 * (window.line(j, k) + i))] =
            field(cloud.low.x + (i + 0.5) * cloud.spacing.x, cloud.low.y + (j + 0.5) * cloud.spacing.y,
                  cloud.low.z + (k + 0.5) * cloud.spacing.z);
  GrainView some = cloud.view();
  some.range = {0, SlipTile::size};
  SlipTile tile;
  gather_slip(some, cloud.weights(GasWeights::trilinear), window, cells.data(), false, tile);
  int n_inside = 0;
  for (int i = 0; i < SlipTile::size; ++i) {
    const double* const r = some.record(i);
    bool is_inside = Cloud::is_here(i);
    for (int a = 0; a < 3; ++a) {
      const double place = (r[a] - cloud.low[a]) / cloud.spacing[a];
      is_inside = is_inside && place > 0.5 && place < cloud.n[static_cast<std::size_t>(a)] - 0.5;
    }
    if (!is_inside) continue;
    ++n_inside;
    CHECK(tile.void_fraction[i] == Approx(field(r[0], r[1], r[2])).epsilon(1e-12));
  }
  CHECK(n_inside > 50);
}

TEST_CASE("what is deposited and what is felt are adjoint: sums over cells are sums over grains") {
  for (const Cloud& cloud : clouds())
    for (const GasWeights kind : all_weights) {
      const CellWindow window = cloud.window();
      const std::vector<double> values = random_cells(8 * window.n_cells());
      std::vector<double> coefficients;
      Numbers number;
      for (int i = 0; i < Cloud::n_grains; ++i) coefficients.push_back(number());
      std::vector<std::int64_t> sums(static_cast<std::size_t>(4 * window.n_cells()));
      deposit_exchange(cloud.view(), cloud.weights(kind), window, coefficients.data(), 0x1p48, 0x1p48, false,
                       sums.data());
      std::vector<double> acceleration(3 * Cloud::n_grains);
      Feel how;
      how.sum_scale = 0x1p40;
      ForceSums forces;
      feel(cloud.view(), cloud.weights(kind), window, values.data(), coefficients.data(), how, acceleration.data(),
           forces);
      double over_cells = 0.0;
      for (std::size_t c = 0; c < sums.size() / 4; ++c)
        over_cells +=
            0x1p-48 * (static_cast<double>(sums[4 * c]) * values[8 * c + 1] - static_cast<double>(sums[4 * c + 2]));
      const double scale = static_cast<double>(forces.drag[3]) * 0x1p-40;
      CHECK(std::abs(over_cells - static_cast<double>(forces.drag[1]) * 0x1p-40) < 1e-11 * scale);
    }
}

TEST_CASE("acceleration is drag, pressure gradient and buoyancy over the mass") {
  const Cloud cloud({3, 1, 1}, {false, false, false});
  const std::vector<double> cell = {1.0, 2.0, 3.0, 0.0, 10.0, 20.0, 30.0, 0.0};
  std::vector<double> values;
  for (int c = 0; c < 3; ++c) values.insert(values.end(), cell.begin(), cell.end());
  const std::vector<double> coefficients(Cloud::n_grains, 0.01);
  std::vector<double> acceleration(3 * Cloud::n_grains);
  for (const bool is_a : {true, false})
    for (const bool is_flat : {true, false}) {
      Feel how{{0.5, 0.6, 0.7}, is_a, is_flat, 1.0};
      ForceSums forces;
      feel(cloud.view(), cloud.weights(GasWeights::trilinear), cloud.window(), values.data(), coefficients.data(), how,
           acceleration.data(), forces);
      for (int i = 0; i < Cloud::n_grains; ++i)
        for (int a = 0; a < 3; ++a) {
          const double* const r = cloud.view().record(i);
          const double force =
              0.01 * (cell[static_cast<std::size_t>(a)] - r[4 + a]) +
              cloud.volume(i) * (how.buoyancy[a] - (is_a ? cell[static_cast<std::size_t>(4 + a)] : 0.0));
          const bool moves = Cloud::is_here(i) && !(is_flat && a == 2);
          CHECK(acceleration[static_cast<std::size_t>(3 * i + a)] == Approx(moves ? force * r[7] : 0.0));
        }
    }
}

TEST_CASE(
    "in a dense fluid a grain gets its share of a push at once and the rest later; none is lost, and a first one "
    "begins at rest") {
  const Cloud cloud({3, 1, 1}, {false, false, false});
  const double eps = 0.4, density = 5000.0;
  const std::vector<double> cell = {1.0, 2.0, 3.0, eps, 10.0, 20.0, 30.0, 0.0};
  std::vector<double> values;
  for (int c = 0; c < 3; ++c) values.insert(values.end(), cell.begin(), cell.end());
  const std::vector<double> coefficients(Cloud::n_grains, 0.01);
  const auto pushes = [&](double fluid_density, std::vector<double> before) {
    const Feel how{{0.5, 0.6, 0.7}, true, false, 1.0, fluid_density};
    ForceSums forces;
    feel(cloud.view(), cloud.weights(GasWeights::trilinear), cloud.window(), values.data(), coefficients.data(), how,
         before.data(), forces);
    return before;
  };
  const std::vector<double> none(3 * Cloud::n_grains, 0.0), whole = pushes(0.0, none);
  std::vector<double> before(3 * Cloud::n_grains, -2.0);
  for (int i = 0; i < Cloud::n_grains; ++i) {
    if (!Cloud::is_here(i)) continue;
    const double inverse_mass = cloud.view().record(i)[7];
    const double carried = density * cloud.volume(i) * inverse_mass * (1.0 - eps) / eps;
    const double share = carried > 0.1 ? 1.1 / (1.0 + carried) : 1.0;
    for (int a = 0; a < 3; ++a) {
      const auto k = static_cast<std::size_t>(3 * i + a);
      const double buoyancy = cloud.volume(i) * Vec3{0.5, 0.6, 0.7}[a] * inverse_mass;
      CHECK(pushes(density, before)[k] == Approx(-2.0 + share * (whole[k] + 2.0)));
      CHECK(pushes(density, none)[k] == Approx(share < 1.0 ? buoyancy + share * (whole[k] - buoyancy) : whole[k]));
    }
  }
  for (int n = 0; n < 2000; ++n) before = pushes(density, before);
  for (std::size_t k = 0; k < before.size(); ++k) CHECK(before[k] == Approx(whole[k]).epsilon(1e-6).margin(1e-9));
}

TEST_CASE("smoothing keeps sums, is symmetric, and spreads by the length asked for") {
  for (const bool is_periodic : {false, true})
    for (const int n : {1, 2, 3, 61}) {
      for (const double a : {0.3, 4.0}) {
        std::vector<double> pivots(static_cast<std::size_t>(n)), closing(pivots.size());
        const SmoothingFactors factors = smoothing_factors(n, is_periodic && n > 1, a, pivots, closing);
        // the answers to a one in each cell, 61 lines at once, in both orders of memory
        std::vector<double> along(static_cast<std::size_t>(n * n)), across(along.size());
        for (int m = 0; m < n; ++m)
          along[static_cast<std::size_t>(m * n + m)] = across[static_cast<std::size_t>(m * n + m)] = 1.0;
        smooth_lines(factors, along.data(), n, 1, n);
        smooth_lines(factors, across.data(), 1, n, n);
        CHECK(along.size() == across.size());
        for (int l = 0; l < n; ++l) {
          double sum = 0.0, variance = 0.0;
          for (int m = 0; m < n; ++m) {
            const double value = along[static_cast<std::size_t>(m * n + l)];
            CHECK(value == across[static_cast<std::size_t>(l * n + m)]);
            CHECK(value == Approx(along[static_cast<std::size_t>(l * n + m)]).epsilon(1e-12).margin(1e-15));
            CHECK(value > 0.0);
            sum += value;
            variance += value * (m - l) * (m - l);
          }
          CHECK(sum == Approx(1.0).epsilon(1e-13));
          if (n == 61 && l == 30) CHECK(variance == Approx(2.0 * a).epsilon(a > 1.0 ? 1e-2 : 1e-10));
        }
      }
    }
}

TEST_CASE("grains outside the grid, or nowhere, count for the cells at its faces") {
  for (const bool is_periodic : {false, true})
    for (const GasWeights kind : all_weights) {
      const Cloud cloud({7, 5, 6}, {is_periodic, is_periodic, is_periodic});
      const CellWeights weights = cloud.weights(kind);
      for (const double x : {-1e300, -10.0, cloud.low.x - 1e-9, cloud.low.x + 0.07, 10.0, 1e300, std::nan("")}) {
        double weight = 0.0;
        const int cell = weights.axes[0].first(x, weight);
        CHECK(cell >= cloud.window().low[0]);
        CHECK(cell + weights.axes[0].pair < cloud.window().high[0]);
        CHECK(weight >= 0.0);
        CHECK(weight <= 1.0);
      }
    }
}
