// Diameters of grains at birth: a size distribution as its quantile function, so that one uniform random number gives
// one diameter and the same number always gives the same grain.
#pragma once

#include <vector>

#include "engine/scene/scene.hpp"

namespace moraine {

/// Quantile of the standard normal distribution, 0 < p < 1 (Acklam's rational approximation, refined by one step of
/// Halley's method on erfc to full double precision).
double normal_quantile(double p);

/// Draws diameters from a distribution.
///
/// Normal and lognormal: mean and deviation are those of the untruncated diameter; the distribution is cut off at `low`
/// and `high`. A bound that is not given (0) is three standard deviations away (of the logarithm, for lognormal), but
/// never below a twentieth of the mean.
class DiameterSampler {
 public:
  /// Throws std::invalid_argument with what is wrong, in words.
  explicit DiameterSampler(const SizeDistribution& distribution);
  /// Diameter [m] below which the share u of the grains lies, 0 <= u < 1.
  double operator()(double u) const;
  double smallest() const { return low_; }  // [m]
  double largest() const { return high_; }  // [m]

 private:
  void prepare_normal(const SizeDistribution& d, bool is_logarithmic);
  void prepare_list(const SizeDistribution& d);

  SizeDistribution::Kind kind_;
  double low_ = 0.0, high_ = 0.0;              // [m]
  double centre_ = 0.0, width_ = 0.0;          // of the normal deviate: of the diameter, or of its logarithm
  double share_low_ = 0.0, share_high_ = 1.0;  // of the parent distribution below the bounds
  bool is_mirrored_ = false;                   // window above the centre: worked on below it, where shares are exact
  std::vector<double> values_, cumulated_;     // list
};

}  // namespace moraine
