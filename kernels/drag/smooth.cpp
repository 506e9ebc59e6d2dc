#include "kernels/drag/smooth.hpp"

#include <algorithm>

namespace moraine {

namespace {

/// The plain tridiagonal system without the entries that close the circle.
template <bool is_unit>
void solve(const SmoothingFactors& f, double* __restrict__ values, std::int64_t along, std::int64_t across,
           std::int64_t n_lines) {
  const double* __restrict__ const inverse = f.inverse_pivot.data();
  const std::int64_t step = is_unit ? 1 : across;
  for (std::int64_t l = 0; l < n_lines; ++l) values[l * step] *= inverse[0];
  for (int m = 1; m < f.n; ++m) {
    double* const row = values + m * along;
    for (std::int64_t l = 0; l < n_lines; ++l)
      row[l * step] = (row[l * step] + f.a * row[l * step - along]) * inverse[m];
  }
  for (int m = f.n - 2; m >= 0; --m) {
    double* const row = values + m * along;
    const double factor = f.a * inverse[m];
    for (std::int64_t l = 0; l < n_lines; ++l) row[l * step] += factor * row[l * step + along];
  }
}

constexpr std::int64_t lines_at_once = 64;

/// From the answer of the plain system to that of the periodic one.
void close(const SmoothingFactors& f, double* values, std::int64_t along, std::int64_t across, std::int64_t n_lines) {
  const double* const last = values + (f.n - 1) * along;
  double share[lines_at_once];
  for (std::int64_t l = 0; l < n_lines; ++l)
    share[l] = (values[l * across] + f.closing_last * last[l * across]) * f.closing_gain;
  for (int m = 0; m < f.n; ++m) {
    const double closing = f.closing[static_cast<std::size_t>(m)];
    for (std::int64_t l = 0; l < n_lines; ++l) values[m * along + l * across] -= share[l] * closing;
  }
}

}  // namespace

SmoothingFactors smoothing_factors(int n, bool is_periodic, double a, std::span<double> inverse_pivot,
                                   std::span<double> closing) {
  SmoothingFactors f{n, is_periodic, a, inverse_pivot, closing};
  const auto size = static_cast<std::size_t>(n);
  // With v = (1, 0, ..., -a/g) and u = (g, 0, ..., -a) the periodic matrix is the tridiagonal one plus u v^T; g = -1 - 2a.
  const double g = -1.0 - 2.0 * a;
  double before = 0.0;
  for (std::size_t m = 0; m < size; ++m) {
    double diagonal = 1.0 + 2.0 * a;
    if (is_periodic) {
      if (m == 0) diagonal -= g;
      if (m + 1 == size) diagonal -= a * a / g;
    } else {
      if (m == 0) diagonal -= a;
      if (m + 1 == size) diagonal -= a;
    }
    inverse_pivot[m] = 1.0 / (diagonal - (m > 0 ? a * a * before : 0.0));
    before = inverse_pivot[m];
  }
  if (is_periodic) {
    for (std::size_t m = 0; m < size; ++m) closing[m] = 0.0;
    closing[0] = g;
    closing[size - 1] -= a;
    solve<true>(f, closing.data(), 1, 1, 1);
    f.closing_last = -a / g;
    f.closing_gain = 1.0 / (1.0 + closing[0] + f.closing_last * closing[size - 1]);
  }
  return f;
}

void smooth_lines(const SmoothingFactors& f, double* values, std::int64_t along, std::int64_t across,
                  std::int64_t n_lines) {
  if (across == 1)
    solve<true>(f, values, along, across, n_lines);
  else
    solve<false>(f, values, along, across, n_lines);
  if (!f.is_periodic) return;
  for (std::int64_t first = 0; first < n_lines; first += lines_at_once)
    close(f, values + first * across, along, across, std::min(lines_at_once, n_lines - first));
}

}  // namespace moraine
