// The weights by which grains and contacts are spread over cells, and sums in 128-bit fixed point.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "engine/run/cell_weights.hpp"
#include "kernels/base/wide_sum.hpp"
#include "tests/support/surface_shapes.hpp"

using namespace moraine;

namespace {

WeightGrid grid_of(int width) {
  WeightGrid grid;
  for (std::size_t a = 0; a < 3; ++a)
    grid[a] = {static_cast<double>(a) - 1.0, 0.1 + 0.02 * static_cast<double>(a), 20, width, a == 1};
  return grid;
}

double sum_of(const CellWeights& weights) { return std::accumulate(weights.values.begin(), weights.values.end(), 0.0); }

double weight_at(const CellWeights& weights, std::array<int, 3> cell) {
  std::int64_t place = 0;
  for (std::size_t a = 3; a-- > 0;) {
    if (cell[a] < weights.low[a] || cell[a] >= weights.low[a] + weights.size[a]) return 0.0;
    place = place * weights.size[a] + cell[a] - weights.low[a];
  }
  return weights.values[static_cast<std::size_t>(place)];
}

}  // namespace

TEST_CASE("the weights of a grain add up to one wherever it is, and lie around it") {
  shapes::Dice dice(5);
  CellWeights weights;
  for (const int width : {1, 2, 3, 8})
    for (int n = 0; n < 20; ++n) {
      const WeightGrid grid = grid_of(width);
      const Vec3 point{dice.uniform(-1, 1), dice.uniform(0, 2), dice.uniform(1, 3)};
      point_weights(grid, point, weights);
      REQUIRE(sum_of(weights) == Approx(1.0).epsilon(1e-12));
      Vec3 centre;
      for (int k = 0; k < weights.size[2]; ++k)
        for (int j = 0; j < weights.size[1]; ++j)
          for (int i = 0; i < weights.size[0]; ++i) {
            const std::array<int, 3> cell = {weights.low[0] + i, weights.low[1] + j, weights.low[2] + k};
            const double w = weight_at(weights, cell);
            REQUIRE(w >= 0.0);
            for (std::size_t a = 0; a < 3; ++a)
              centre[static_cast<int>(a)] += w * (grid[a].low + (cell[a] + 0.5) * grid[a].spacing);
          }
      for (int a = 0; a < 3; ++a)
        REQUIRE(centre[a] == Approx(point[a]).margin(1e-12));  // linear functions are reproduced
    }
}

TEST_CASE("the weights of a line are the mean of those of its points, to round-off") {
  shapes::Dice dice(6);
  CellWeights line, point;
  for (const int width : {1, 2})
    for (int n = 0; n < 10; ++n) {
      const WeightGrid grid = grid_of(width);
      const Vec3 begin{dice.uniform(-1, 1), dice.uniform(0, 2), dice.uniform(1, 3)};
      const Vec3 way{dice.uniform(-0.3, 0.3), n % 3 == 0 ? 0.0 : dice.uniform(-0.3, 0.3), dice.uniform(-0.05, 0.05)};
      line_weights(grid, begin, way, line);
      REQUIRE(sum_of(line) == Approx(1.0).epsilon(1e-14));
      // Simpson's rule on many pieces errs by less than 1e-8 where a spline's third derivative jumps.
      const int pieces = 400;
      std::vector<double> mean(line.values.size(), 0.0);
      for (int s = 0; s <= pieces; ++s) {
        point_weights(grid, begin + (static_cast<double>(s) / pieces) * way, point);
        const double share = (s == 0 || s == pieces ? 1.0 : s % 2 == 1 ? 4.0 : 2.0) / (3.0 * pieces);
        std::size_t place = 0;
        for (int k = 0; k < line.size[2]; ++k)
          for (int j = 0; j < line.size[1]; ++j)
            for (int i = 0; i < line.size[0]; ++i)
              mean[place++] += share * weight_at(point, {line.low[0] + i, line.low[1] + j, line.low[2] + k});
      }
      for (std::size_t c = 0; c < mean.size(); ++c) REQUIRE(line.values[c] == Approx(mean[c]).margin(1e-8));
    }
}

TEST_CASE("along an axis of one cell the weight is the same from where it begins to where it ends") {
  WeightGrid grid = grid_of(1);
  grid[0] = {0.0, 2.0, 1, 1, false, 0.0, 2.0};
  CellWeights weights;
  line_weights(grid, {-0.5, 1.0, 2.0}, {2.0, 0.1, 0.0}, weights);
  CHECK(weights.size[0] == 1);
  CHECK(sum_of(weights) == Approx(0.75).epsilon(1e-14));
  grid[0].begin = -std::numeric_limits<double>::infinity();
  line_weights(grid, {-0.5, 1.0, 2.0}, {2.0, 0.1, 0.0}, weights);
  CHECK(sum_of(weights) == Approx(1.0).epsilon(1e-14));
  CHECK(grid_cell(grid[1], -3) == 17);
  CHECK(grid_cell(grid[2], -3) == -1);
}

TEST_CASE("wide sums do not depend on the order of their terms, nor on how they were shared out") {
  shapes::Dice dice(7);
  std::vector<double> values;
  for (int n = 0; n < 3000; ++n) values.push_back(dice.uniform(-1, 1) * std::pow(10.0, dice.uniform(-9, 9)));
  WideSum forward, backward;
  std::array<WideSum, 5> parts;
  double plain = 0.0;
  for (std::size_t n = 0; n < values.size(); ++n) {
    forward.add(values[n]);
    backward.add(values[values.size() - 1 - n]);
    parts[n % parts.size()].add(values[n]);
    plain += values[n];
  }
  std::array<std::int64_t, WideSum::n_words> words{};
  for (const WideSum& part : parts)
    for (std::size_t k = 0; k < words.size(); ++k) words[k] += part.words()[k];
  CHECK(forward.words() == backward.words());
  CHECK(WideSum::from_words(words).words() == forward.words());
  CHECK(forward.value() == Approx(plain).epsilon(1e-12));
  for (const double value : {0.0, 1.0, -1.0, 1e-20, -3e9, 0.1, -0.1}) {
    WideSum one;
    one.add(value);
    CHECK(one.value() == Approx(value).epsilon(1e-15).margin(1e-24));
    CHECK(WideSum::from_words(one.words()).value() == one.value());
  }
  WideSum broken;
  broken.add(std::numeric_limits<double>::infinity());
  CHECK(std::isnan(WideSum::from_words(broken.words()).value()));
}
