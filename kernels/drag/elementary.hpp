// Logarithm, exponential and power without branches, so that loops over them run in vector lanes; the same bits in every lane
// width and on every machine, which the mathematical libraries do not promise. Relative error below 1e-15 of log and exp.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>

namespace moraine::elementary {

/// Natural logarithm of a positive, normal number: x = 2^e m with m in [sqrt(1/2), sqrt(2)), log m = 2 artanh((m - 1)/(m + 1)).
inline double log(double x) {
  constexpr std::uint64_t one = std::uint64_t{1023} << 52, exponent_mask = std::uint64_t{0xfff} << 52;
  constexpr std::uint64_t sqrt_half = 0x3fe6a09e667f3bcdULL;
  const auto bits = std::bit_cast<std::uint64_t>(x);
  const std::uint64_t shifted = bits - sqrt_half + one;
  const auto m = std::bit_cast<double>(bits - (shifted & exponent_mask) + one);
  // the biased exponent as a double: in the lowest bits of 2^52
  const double e = std::bit_cast<double>((shifted >> 52) | 0x4330000000000000ULL) - (4503599627370496.0 + 1023.0);
  const double s = (m - 1.0) / (m + 1.0), q = s * s;
  double series = 1.0 / 21.0;
  series = series * q + 1.0 / 19.0;
  series = series * q + 1.0 / 17.0;
  series = series * q + 1.0 / 15.0;
  series = series * q + 1.0 / 13.0;
  series = series * q + 1.0 / 11.0;
  series = series * q + 1.0 / 9.0;
  series = series * q + 1.0 / 7.0;
  series = series * q + 1.0 / 5.0;
  series = series * q + 1.0 / 3.0;
  const double log_m = 2.0 * s + 2.0 * s * q * series;
  return e * 0x1.62e42fefa3800p-1 + (log_m + e * 0x1.ef35793c76730p-45);  // log 2 in two parts
}

/// exp(x) for |x| up to 700, beyond which x counts as 700: x = n log 2 + r with |r| <= log(2)/2, Taylor series of exp(r).
inline double exp(double x) {
  constexpr double round =
      6755399441055744.0;  // 1.5 * 2^52: adding it rounds to an integer, which lies in the lowest bits
  x = std::min(std::max(x, -700.0), 700.0);
  const double with_n = x * 0x1.71547652b82fep+0 + round;
  const double n = with_n - round;
  const double r = (x - n * 0x1.62e42fefa3800p-1) - n * 0x1.ef35793c76730p-45;
  double series = 1.0 / 6227020800.0;
  series = series * r + 1.0 / 479001600.0;
  series = series * r + 1.0 / 39916800.0;
  series = series * r + 1.0 / 3628800.0;
  series = series * r + 1.0 / 362880.0;
  series = series * r + 1.0 / 40320.0;
  series = series * r + 1.0 / 5040.0;
  series = series * r + 1.0 / 720.0;
  series = series * r + 1.0 / 120.0;
  series = series * r + 1.0 / 24.0;
  series = series * r + 1.0 / 6.0;
  series = series * r + 0.5;
  series = series * r + 1.0;
  series = series * r + 1.0;
  return std::bit_cast<double>(std::bit_cast<std::uint64_t>(series) + (std::bit_cast<std::uint64_t>(with_n) << 52));
}

/// x^y for positive, normal x.
inline double pow(double x, double y) { return exp(y * log(x)); }

}  // namespace moraine::elementary
