// Spreading cell values over a length, along one direction.
//
// Implicit diffusion, (I - a D) s = f, with D the second difference: symmetric, keeps the sum, and its response to a single cell has a
// variance of 2a cells^2. Bounded directions end without flux.
#pragma once

#include <cstdint>
#include <span>

namespace moraine {

/// The factors of the tridiagonal system of n cells, computed once.
struct SmoothingFactors {
  int n = 0;
  bool is_periodic = false;
  double a = 0.0;
  std::span<double> inverse_pivot;  // n, of the elimination from the first cell
  std::span<double> closing;  // n, periodic: answer to the entries that close the circle (Sherman & Morrison 1950)
  double closing_last = 0.0, closing_gain = 0.0;
};

/// Fills in `inverse_pivot` and `closing`, of n values each.
SmoothingFactors smoothing_factors(int n, bool is_periodic, double a, std::span<double> inverse_pivot,
                                   std::span<double> closing);

/// Solves `n_lines` systems at a time, in place: cell m of line l lies at values[m * along + l * across].
void smooth_lines(const SmoothingFactors& factors, double* values, std::int64_t along, std::int64_t across,
                  std::int64_t n_lines);

}  // namespace moraine
