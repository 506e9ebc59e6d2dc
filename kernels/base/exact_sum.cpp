#include "kernels/base/exact_sum.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace moraine {

namespace {
__extension__ using Wide = unsigned __int128;  // in all compilers that Moraine is built with
constexpr std::int64_t digit_base = std::int64_t{1} << 32;
constexpr std::int32_t max_pending = 1 << 29;  // |digit| grows by less than 2^32 an addition
}  // namespace

void ExactSum::add(double value) {
  const auto bits = std::bit_cast<std::uint64_t>(value);
  const int exponent = static_cast<int>(bits >> 52 & 0x7ff);
  if (exponent == 0x7ff) {
    is_invalid_ = true;
    return;
  }
  // value = mantissa * 2^(shift - 1074)
  const std::uint64_t mantissa = (bits & 0xfffffffffffffULL) | (exponent ? 0x10000000000000ULL : 0ULL);
  const int shift = exponent ? exponent - 1 : 0;
  const auto digit = static_cast<std::size_t>(shift / 32);
  const Wide wide = static_cast<Wide>(mantissa) << (shift % 32);
  const auto low = static_cast<std::int64_t>(static_cast<std::uint64_t>(wide) & 0xffffffffULL);
  const auto middle = static_cast<std::int64_t>(static_cast<std::uint64_t>(wide >> 32) & 0xffffffffULL);
  const auto high = static_cast<std::int64_t>(static_cast<std::uint64_t>(wide >> 64));
  if (bits >> 63) {
    digits_[digit] -= low;
    digits_[digit + 1] -= middle;
    digits_[digit + 2] -= high;
  } else {
    digits_[digit] += low;
    digits_[digit + 1] += middle;
    digits_[digit + 2] += high;
  }
  if (++pending_ >= max_pending) normalize();
}

void ExactSum::add(const ExactSum& other) {
  ExactSum addend = other;
  addend.normalize();
  normalize();
  for (std::size_t i = 0; i < n_digits; ++i) digits_[i] += addend.digits_[i];
  is_invalid_ = is_invalid_ || other.is_invalid_;
  pending_ = 2;
}

void ExactSum::normalize() {
  std::int64_t carry = 0;
  for (std::size_t i = 0; i < n_digits; ++i) {
    const std::int64_t digit = digits_[i] + carry;
    carry = digit >> 32;  // floor
    digits_[i] = i + 1 < n_digits ? digit - carry * digit_base : digit;
  }
  pending_ = 1;
}

std::array<std::int64_t, ExactSum::n_words> ExactSum::words() const {
  ExactSum sum = *this;
  sum.normalize();
  std::array<std::int64_t, n_words> words{};
  std::copy(sum.digits_.begin(), sum.digits_.end(), words.begin());
  words.back() = is_invalid_ ? 1 : 0;
  return words;
}

ExactSum ExactSum::from_words(const std::array<std::int64_t, n_words>& words) {
  ExactSum sum;
  std::copy_n(words.begin(), n_digits, sum.digits_.begin());
  sum.is_invalid_ = words.back() != 0;
  sum.normalize();
  return sum;
}

double ExactSum::value() const {
  if (is_invalid_) return std::numeric_limits<double>::quiet_NaN();
  ExactSum sum = *this;
  sum.normalize();
  const bool is_negative = sum.digits_[n_digits - 1] < 0;
  if (is_negative) {
    for (std::int64_t& digit : sum.digits_) digit = -digit;
    sum.normalize();
  }
  int top = n_digits - 1;
  while (top > 0 && sum.digits_[static_cast<std::size_t>(top)] == 0) --top;
  // The top 96 bits decide the rounding; any bit further down only breaks a tie.
  Wide head = 0;
  for (int i = top; i > top - 3; --i)
    head = head << 32 | static_cast<std::uint64_t>(i >= 0 ? sum.digits_[static_cast<std::size_t>(i)] : 0);
  bool has_rest = false;
  for (int i = top - 3; i >= 0; --i) has_rest = has_rest || sum.digits_[static_cast<std::size_t>(i)] != 0;
  if (head == 0) return 0.0;
  int exponent = 32 * (top - 2) - 1074;
  int width = 0;
  for (Wide h = head; h != 0; h >>= 1) ++width;
  // Keep 64 bits, the lowest sticky; then let the conversion to 53 bits round to nearest even.
  if (width > 64) {
    const int drop = width - 64;
    const Wide mask = (static_cast<Wide>(1) << drop) - 1;
    has_rest = has_rest || (head & mask) != 0;
    head >>= drop;
    exponent += drop;
  }
  auto kept = static_cast<std::uint64_t>(head);
  if (has_rest && width > 53) kept |= 1;
  const double magnitude = std::ldexp(static_cast<double>(kept), exponent);
  return is_negative ? -magnitude : magnitude;
}

}  // namespace moraine
