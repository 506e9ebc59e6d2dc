// Sum of doubles without rounding: the result does not depend on the order of the terms, nor on how they were shared out
// over threads or ranks.
//
// A long fixed-point accumulator over the whole range of a double (Kulisch 2013, Computer Arithmetic and Validity), in
// 32-bit digits kept in 64-bit words so that carries are rare. Rounded once, when read.
#pragma once

#include <array>
#include <cstdint>

#include "kernels/base/vec3.hpp"

namespace moraine {

class ExactSum {
 public:
  /// Adds a value. Infinities and NaNs are remembered and make the sum NaN.
  void add(double value);
  /// Adds all that another accumulator holds.
  void add(const ExactSum& other);
  /// The sum, rounded to the nearest double.
  double value() const;

  /// All that the accumulator holds, as integers: to be kept, or added word by word to those of others (of other ranks). Each is
  /// below 2^32 in size, so that a double holds it.
  static constexpr std::size_t n_words = 69;
  std::array<std::int64_t, n_words> words() const;
  /// From words, or from the sums of up to 2^29 accumulators' words.
  static ExactSum from_words(const std::array<std::int64_t, n_words>& words);

 private:
  void normalize();
  static constexpr int n_digits = n_words - 1;  // 2^-1074 .. 2^1024 and room above
  std::array<std::int64_t, n_digits> digits_{};
  std::int32_t pending_ = 0;  // additions since the carries were last taken up
  bool is_invalid_ = false;
};

struct ExactSum3 {
  ExactSum x, y, z;
  void add(Vec3 v) { x.add(v.x), y.add(v.y), z.add(v.z); }
  void add(const ExactSum3& o) { x.add(o.x), y.add(o.y), z.add(o.z); }
  Vec3 value() const { return {x.value(), y.value(), z.value()}; }
};

}  // namespace moraine
