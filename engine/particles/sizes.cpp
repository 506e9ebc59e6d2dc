#include "engine/particles/sizes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

namespace moraine {
namespace {

/// Share of a standard normal distribution below x.
double normal_share(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }

/// P. J. Acklam (2003), "An algorithm for computing the inverse normal cumulative distribution function"; error 1.2e-9.
double acklam_quantile(double p) {
  constexpr std::array a = {-3.969683028665376e+01, 2.209460984245205e+02,  -2.759285104469687e+02,
                            1.383577518672690e+02,  -3.066479806614716e+01, 2.506628277459239e+00};
  constexpr std::array b = {-5.447609879822406e+01, 1.615858368580409e+02, -1.556989798598866e+02,
                            6.680131188771972e+01, -1.328068155288572e+01};
  constexpr std::array c = {-7.784894002430293e-03, -3.223964580411365e-01, -2.400758277161838e+00,
                            -2.549732539343734e+00, 4.374664141464968e+00,  2.938163982698783e+00};
  constexpr std::array d = {7.784695709041462e-03, 3.224671290700398e-01, 2.445134137142996e+00, 3.754408661907416e+00};
  constexpr double tail = 0.02425;
  if (p > 1.0 - tail) return -acklam_quantile(1.0 - p);
  if (p < tail) {
    const double q = std::sqrt(-2.0 * std::log(p));
    return (((((c[0] * q + c[1]) * q + c[2]) * q + c[3]) * q + c[4]) * q + c[5]) /
           ((((d[0] * q + d[1]) * q + d[2]) * q + d[3]) * q + 1.0);
  }
  const double q = p - 0.5;
  const double r = q * q;
  return (((((a[0] * r + a[1]) * r + a[2]) * r + a[3]) * r + a[4]) * r + a[5]) * q /
         (((((b[0] * r + b[1]) * r + b[2]) * r + b[3]) * r + b[4]) * r + 1.0);
}

void expect(bool is_true, const std::string& message) {
  if (!is_true) throw std::invalid_argument(message);
}

}  // namespace

double normal_quantile(double p) {
  const double x = acklam_quantile(p);
  const double error = (normal_share(x) - p) * std::sqrt(2.0 * std::numbers::pi) * std::exp(0.5 * x * x);
  return x - error / (1.0 + 0.5 * x * error);
}

DiameterSampler::DiameterSampler(const SizeDistribution& d) : kind_(d.kind) {
  switch (kind_) {
    case SizeDistribution::Kind::single: low_ = high_ = d.value; break;
    case SizeDistribution::Kind::uniform:
      low_ = d.low;
      high_ = d.high;
      break;
    case SizeDistribution::Kind::normal: prepare_normal(d, false); break;
    case SizeDistribution::Kind::lognormal: prepare_normal(d, true); break;
    case SizeDistribution::Kind::list: prepare_list(d); break;
  }
  expect(std::isfinite(low_) && std::isfinite(high_) && low_ > 0.0, "every diameter must be greater than zero");
  expect(low_ <= high_, "the smallest diameter is greater than the largest");
}

void DiameterSampler::prepare_normal(const SizeDistribution& d, bool is_logarithmic) {
  expect(d.mean > 0.0, "the mean diameter must be greater than zero");
  expect(d.deviation > 0.0, "the standard deviation of the diameter must be greater than zero (or give one diameter)");
  centre_ = d.mean;
  width_ = d.deviation;
  if (is_logarithmic) {
    // The lognormal distribution whose mean and deviation are those of the diameter itself.
    const double variance = std::log1p((d.deviation / d.mean) * (d.deviation / d.mean));
    centre_ = std::log(d.mean) - 0.5 * variance;
    width_ = std::sqrt(variance);
  }
  const auto diameter = [&](double deviate) {
    return is_logarithmic ? std::exp(centre_ + width_ * deviate) : centre_ + width_ * deviate;
  };
  const auto deviate = [&](double size) { return ((is_logarithmic ? std::log(size) : size) - centre_) / width_; };
  low_ = d.low > 0.0 ? d.low : std::max(diameter(-3.0), d.mean / 20.0);
  high_ = d.high > 0.0 && std::isfinite(d.high) ? d.high : diameter(3.0);
  if (low_ > high_) return;
  double from = deviate(low_);
  double to = deviate(high_);
  is_mirrored_ = from > 0.0;
  if (is_mirrored_) {
    std::swap(from, to);
    from = -from;
    to = -to;
  }
  share_low_ = normal_share(from);
  share_high_ = normal_share(to);
  expect(share_high_ > 1e-200,
         "the bounds of the diameter lie too far from its mean for any grain to fall between them");
}

void DiameterSampler::prepare_list(const SizeDistribution& d) {
  expect(!d.values.empty(), "the list of diameters is empty");
  expect(d.weights.empty() || d.weights.size() == d.values.size(), "there must be one weight for each diameter");
  values_ = d.values;
  double sum = 0.0;
  for (std::size_t i = 0; i < values_.size(); ++i) {
    const double weight = d.weights.empty() ? 1.0 : d.weights[i];
    expect(weight >= 0.0 && std::isfinite(weight), "a weight must not be negative");
    cumulated_.push_back(sum += weight);
  }
  expect(sum > 0.0, "at least one weight must be greater than zero");
  low_ = *std::min_element(values_.begin(), values_.end());
  high_ = *std::max_element(values_.begin(), values_.end());
}

double DiameterSampler::operator()(double u) const {
  switch (kind_) {
    case SizeDistribution::Kind::single: return low_;
    case SizeDistribution::Kind::uniform: return low_ + u * (high_ - low_);
    case SizeDistribution::Kind::list: {
      const auto place = std::upper_bound(cumulated_.begin(), cumulated_.end(), u * cumulated_.back());
      return values_[std::min(static_cast<std::size_t>(place - cumulated_.begin()), values_.size() - 1)];
    }
    default: {
      const double v = is_mirrored_ ? 1.0 - u : u;
      const double share = std::clamp(share_low_ + v * (share_high_ - share_low_), 1e-300, 1.0 - 0x1.0p-53);
      const double deviate = is_mirrored_ ? -normal_quantile(share) : normal_quantile(share);
      const double value = centre_ + width_ * deviate;
      return std::clamp(kind_ == SizeDistribution::Kind::lognormal ? std::exp(value) : value, low_, high_);
    }
  }
}

}  // namespace moraine
