#include "kernels/base/wide_sum.hpp"

#include <cmath>
#include <limits>

namespace moraine {

namespace {
constexpr int unit_bits = 80;
constexpr double most = 0x1p46;
}  // namespace

void WideSum::check() {
  if (units_ >= not_a_number || units_ <= -not_a_number) units_ = not_a_number;
}

void WideSum::add(double value) {
  if (units_ == not_a_number) return;
  if (!(std::abs(value) < most)) {
    units_ = not_a_number;
    return;
  }
  // To the nearest: a double of more than 53 bits above the unit is whole as it is.
  const double units = std::ldexp(value, unit_bits);
  units_ += static_cast<Wide>(std::abs(units) < 0x1p52 ? std::nearbyint(units) : units);
  check();
}

void WideSum::add(const WideSum& other) {
  if (units_ == not_a_number) return;
  units_ += other.units_;  // both are below 2^126, or the other is that
  check();
}

double WideSum::value() const {
  if (units_ == not_a_number) return std::numeric_limits<double>::quiet_NaN();
  return std::ldexp(static_cast<double>(units_), -unit_bits);
}

std::array<std::int64_t, WideSum::n_words> WideSum::words() const {
  std::array<std::int64_t, n_words> words{};
  words[4] = units_ == not_a_number ? 1 : 0;
  Wide rest = words[4] ? 0 : units_;
  for (std::size_t k = 0; k < 4; ++k) {
    words[k] = static_cast<std::int64_t>(rest & 0xffffffff);
    rest >>= 32;  // floor
  }
  words[3] += static_cast<std::int64_t>(rest) * (std::int64_t{1} << 32);  // the sign
  return words;
}

WideSum WideSum::from_words(const std::array<std::int64_t, n_words>& words) {
  WideSum sum;
  for (std::size_t k = 4; k-- > 0;) sum.units_ = sum.units_ * (Wide{1} << 32) + words[k];
  if (words[4] != 0) sum.units_ = not_a_number;
  sum.check();
  return sum;
}

}  // namespace moraine
