#include "io/export/spectrum.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>

namespace moraine {

namespace {

using Complex = std::complex<double>;

/// Fourier transform of 2^k values, in place (Cooley & Tukey 1965, Math. Comput. 19, 297).
void transform(std::vector<Complex>& values) {
  const std::size_t n = values.size();
  for (std::size_t i = 1, j = 0; i < n; ++i) {  // order of reversed bits
    std::size_t bit = n >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) std::swap(values[i], values[j]);
  }
  for (std::size_t length = 2; length <= n; length *= 2)
    for (std::size_t k = 0; k < length / 2; ++k) {
      const Complex turn =
          std::polar(1.0, -2.0 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(length));
      for (std::size_t at = k; at < n; at += length) {
        const Complex low = values[at], high = turn * values[at + length / 2];
        values[at] = low + high;
        values[at + length / 2] = low - high;
      }
    }
}

/// Mean step of the times, where they are even.
std::optional<double> even_step(std::span<const double> time) {
  const double step = (time.back() - time.front()) / static_cast<double>(time.size() - 1);
  if (!(step > 0.0)) return std::nullopt;
  for (std::size_t k = 1; k < time.size(); ++k)
    if (!(std::abs(time[k] - time[k - 1] - step) < 0.1 * step)) return std::nullopt;
  return step;
}

}  // namespace

std::optional<Spectrum> spectrum_of(std::span<const double> time, std::span<const double> values) {
  constexpr std::size_t least_samples = 64;
  if (time.size() != values.size() || values.size() < least_samples) return std::nullopt;
  if (!std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); })) return std::nullopt;
  const std::optional<double> step = even_step(time);
  if (!step) return std::nullopt;

  const std::size_t n = std::bit_floor(values.size() / 4);
  std::vector<double> window(n);
  double window_power = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    window[k] = 0.5 - 0.5 * std::cos(2.0 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(n));
    window_power += window[k] * window[k];
  }
  Spectrum spectrum;
  spectrum.density.assign(n / 2, 0.0);
  std::vector<Complex> piece(n);
  for (std::size_t first = 0; first + n <= values.size(); first += n / 2, ++spectrum.n_pieces) {
    double mean = 0.0;
    for (std::size_t k = 0; k < n; ++k) mean += values[first + k] / static_cast<double>(n);
    for (std::size_t k = 0; k < n; ++k) piece[k] = window[k] * (values[first + k] - mean);
    transform(piece);
    for (std::size_t f = 1; f <= n / 2; ++f) {
      const double sides = f < n / 2 ? 2.0 : 1.0;  // negative frequencies too, but for the highest
      spectrum.density[f - 1] += sides * std::norm(piece[f]) * *step / window_power;
    }
  }
  for (std::size_t f = 1; f <= n / 2; ++f) {
    spectrum.frequency.push_back(static_cast<double>(f) / (static_cast<double>(n) * *step));
    spectrum.density[f - 1] /= spectrum.n_pieces;
  }
  return spectrum;
}

}  // namespace moraine
