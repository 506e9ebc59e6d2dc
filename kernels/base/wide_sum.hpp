// Sum of doubles in 128-bit fixed point: independent of the order of the terms, and of how they were shared out over threads or ranks, as
// ExactSum, but a thirtieth of its size. Right where there are very many sums of quantities of ordinary size.
#pragma once

#include <array>
#include <cstdint>

namespace moraine {

class WideSum {
 public:
  /// Multiples of 2^-80 (8e-25), to the nearest. Sums beyond 2^46 (7e13) in size, and what is not finite, make it not a number.
  void add(double value);
  void add(const WideSum& other);
  double value() const;

  /// All that it holds as numbers that a double has room for, also after those of many ranks are added up.
  static constexpr std::size_t n_words = 5;
  std::array<std::int64_t, n_words> words() const;
  static WideSum from_words(const std::array<std::int64_t, n_words>& words);

 private:
  __extension__ using Wide = __int128;  // in all compilers that Moraine is built with
  static constexpr Wide not_a_number = static_cast<Wide>(1) << 126;
  void check();
  Wide units_ = 0;
};

}  // namespace moraine
