// The machine's roof: how fast it can multiply and add, and how fast it moves data at each level of memory, measured in the
// same run as the kernels (the roofline model: Williams, Waterman & Patterson 2009, Commun. ACM 52(4)).
#pragma once

#include <array>
#include <cstddef>

namespace moraine::bench {

enum class Level { l2, l3, memory };
inline constexpr std::array<const char*, 3> level_names = {"L2", "L3", "memory"};

struct Ceiling {
  double flops = 0.0;                 // [1/s] double-precision, a fused multiply-add being two
  double float_flops = 0.0;           // [1/s] single-precision
  std::array<double, 3> bandwidth{};  // [bytes/s] of a triad, by level
};

struct Roof {
  int n_threads = 1;   // all that this process may use
  std::size_t l2 = 0;  // [bytes] of one core
  std::size_t l3 = 0;  // [bytes] of all
  Ceiling one, all;

  const Ceiling& of(int threads) const { return threads <= 1 ? one : all; }
  /// The nearest level that holds that many bytes for each of the threads.
  Level level(double bytes, int threads) const;
};

/// Measured once, when first asked for; takes about two seconds.
const Roof& roof();

}  // namespace moraine::bench
