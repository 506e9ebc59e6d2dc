#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "engine/particles/sizes.hpp"
#include "kernels/base/random.hpp"

using namespace moraine;
using Kind = SizeDistribution::Kind;

namespace {

struct Moments {
  double mean = 0.0, deviation = 0.0, smallest = 1e300, largest = 0.0;
};

Moments sample(const SizeDistribution& distribution, int n) {
  const DiameterSampler diameter(distribution);
  double sum = 0.0, squares = 0.0;
  Moments m;
  for (int i = 0; i < n; ++i) {
    const double d = diameter(random_uniform(7, static_cast<std::uint64_t>(i), RandomPurpose::radius));
    sum += d;
    squares += d * d;
    m.smallest = std::min(m.smallest, d);
    m.largest = std::max(m.largest, d);
  }
  m.mean = sum / n;
  m.deviation = std::sqrt(squares / n - m.mean * m.mean);
  return m;
}

/// Moments of a density known up to a factor, by the midpoint rule.
template <class Density>
Moments integrate(double low, double high, Density density) {
  constexpr int n = 200000;
  double weight = 0.0, sum = 0.0, squares = 0.0;
  for (int i = 0; i < n; ++i) {
    const double d = low + (i + 0.5) * (high - low) / n;
    const double w = density(d);
    weight += w;
    sum += w * d;
    squares += w * d * d;
  }
  const double mean = sum / weight;
  return {mean, std::sqrt(squares / weight - mean * mean), low, high};
}

SizeDistribution normal(double mean, double deviation, double low, double high) {
  SizeDistribution d;
  d.kind = Kind::normal;
  d.mean = mean;
  d.deviation = deviation;
  d.low = low;
  d.high = high;
  return d;
}

constexpr int n_samples = 1000000;

void check_moments(const Moments& found, const Moments& exact) {
  // Five standard errors of the mean; as much for the deviation, whose standard error is of that order.
  const double error = 5.0 * exact.deviation / std::sqrt(static_cast<double>(n_samples));
  CHECK(found.mean == Approx(exact.mean).margin(error));
  CHECK(found.deviation == Approx(exact.deviation).margin(error));
  CHECK(found.smallest >= exact.smallest);
  CHECK(found.largest <= exact.largest);
}

}  // namespace

TEST_CASE("the normal quantile inverts the normal distribution to round-off", "[fill]") {
  for (const double p : {1e-300, 1e-20, 1e-6, 0.01, 0.02425, 0.3, 0.5, 0.77, 0.97575, 0.999, 1.0 - 1e-12}) {
    const double x = normal_quantile(p);
    CHECK(0.5 * std::erfc(-x / std::numbers::sqrt2) == Approx(p).epsilon(1e-12));
  }
  CHECK(normal_quantile(0.5) == Approx(0.0).margin(1e-15));
  CHECK(normal_quantile(0.975) == Approx(1.959963984540054).epsilon(1e-14));
}

TEST_CASE("uniform diameters have the mean and deviation of a uniform distribution", "[fill]") {
  SizeDistribution d;
  d.kind = Kind::uniform;
  d.low = 0.4;
  d.high = 1.0;
  check_moments(sample(d, n_samples), {0.7, 0.6 / std::sqrt(12.0), 0.4, 1.0});
}

TEST_CASE("truncated normal diameters have the moments of the truncated density", "[fill]") {
  const auto density = [](double d) { return std::exp(-0.5 * std::pow((d - 1.0) / 0.3, 2)); };
  for (const auto& [low, high] : {std::pair{0.5, 1.2}, {0.1, 1.9}, {1.4, 1.5}, {1.9, 2.6}, {0.05, 0.2}})
    check_moments(sample(normal(1.0, 0.3, low, high), n_samples), integrate(low, high, density));
}

TEST_CASE("truncated lognormal diameters have the moments of the truncated density", "[fill]") {
  const double variance = std::log(1.0 + 0.25);
  const double centre = -0.5 * variance;
  const auto density = [&](double d) { return std::exp(-0.5 * std::pow(std::log(d) - centre, 2) / variance) / d; };
  for (const auto& [low, high] : {std::pair{0.3, 3.0}, {1.2, 1.6}}) {
    SizeDistribution d = normal(1.0, 0.5, low, high);
    d.kind = Kind::lognormal;
    check_moments(sample(d, n_samples), integrate(low, high, density));
  }
}

TEST_CASE("a wide lognormal distribution has the mean and deviation that were asked for", "[fill]") {
  SizeDistribution d = normal(1.0, 0.3, 1e-3, 1e3);
  d.kind = Kind::lognormal;
  check_moments(sample(d, n_samples), {1.0, 0.3, 1e-3, 1e3});
}

TEST_CASE("listed diameters come with the frequency of their weights", "[fill]") {
  SizeDistribution d;
  d.kind = Kind::list;
  d.values = {0.002, 0.004, 0.008};
  d.weights = {3.0, 0.0, 1.0};
  const DiameterSampler diameter(d);
  int n_small = 0;
  for (int i = 0; i < 100000; ++i) {
    const double size = diameter(random_uniform(1, static_cast<std::uint64_t>(i), RandomPurpose::radius));
    CHECK_FALSE(size == 0.004);
    n_small += size == 0.002;
  }
  CHECK(n_small == Approx(75000).margin(5 * std::sqrt(100000 * 0.75 * 0.25)));
}

TEST_CASE("bounds that are not given lie three deviations from the mean, and never at zero", "[fill]") {
  const DiameterSampler narrow(normal(1.0, 0.1, 0.0, 0.0));
  CHECK(narrow.smallest() == Approx(0.7));
  CHECK(narrow.largest() == Approx(1.3));
  const DiameterSampler wide(normal(1.0, 0.5, 0.0, 0.0));
  CHECK(wide.smallest() == Approx(0.05));
}

TEST_CASE("a distribution that makes no sense is refused in words", "[fill]") {
  CHECK_THROWS_WITH(DiameterSampler(normal(1.0, 0.1, 2.0, 1.0)), Catch::Contains("smallest diameter is greater"));
  CHECK_THROWS_WITH(DiameterSampler(normal(-1.0, 0.1, 0.0, 0.0)), Catch::Contains("mean diameter"));
  CHECK_THROWS_WITH(DiameterSampler(normal(1.0, 0.01, 2.0, 3.0)), Catch::Contains("too far from its mean"));
  SizeDistribution list;
  list.kind = Kind::list;
  CHECK_THROWS_WITH(DiameterSampler(list), Catch::Contains("empty"));
  list.values = {0.001, 0.002};
  list.weights = {1.0};
  CHECK_THROWS_WITH(DiameterSampler(list), Catch::Contains("one weight for each"));
  CHECK_THROWS_AS(DiameterSampler(SizeDistribution{}), std::invalid_argument);
}
