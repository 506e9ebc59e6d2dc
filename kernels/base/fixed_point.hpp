// Doubles as integers, so that sums do not depend on the order of their terms.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace moraine {

/// A power of two by which values up to `largest` become integers up to 2^bits.
inline double scale_for(double largest, int bits) {
  if (!(largest > 0.0) || !std::isfinite(largest)) return 1.0;
  int exponent = 0;
  std::frexp(largest, &exponent);
  return std::ldexp(1.0, std::clamp(bits - exponent, -1000, 1000));
}
inline std::int64_t fixed(double value, double scale) { return std::llround(value * scale); }

}  // namespace moraine
