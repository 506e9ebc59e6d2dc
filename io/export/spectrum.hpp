// How the power of a time series is spread over frequencies.
#pragma once

#include <optional>
#include <span>
#include <vector>

namespace moraine {

/// One-sided density: its integral over frequency is the variance of the series.
struct Spectrum {
  std::vector<double> frequency;  // [Hz] from one over the length of a piece up to half the rate of samples
  std::vector<double> density;    // [square of the values' unit/Hz]
  int n_pieces = 0;               // that it is the mean of
};

/// Mean over pieces that overlap by half, each less its mean, in Hann's window (Welch 1967, IEEE Trans. Audio Electroacoust. 15, 70).
/// Pieces hold as large a power of two of samples as leaves seven of them or more. Nothing where there are fewer than 64 samples, where they are not
/// numbers, or where `time` [s] does not go in even steps (within a tenth).
std::optional<Spectrum> spectrum_of(std::span<const double> time, std::span<const double> values);

}  // namespace moraine
