// Counter-based random numbers: the value depends on (seed, counter, purpose) and on nothing else, so that it is the
// same on every layout and after every restart. There is no stream and no state.
//
// Generator: SplitMix64's finaliser (Steele, Lea & Flood 2014) applied to a Weyl-sequence combination of the key words.
#pragma once

#include <cstdint>

#include "kernels/base/vec3.hpp"

namespace moraine {

/// What a random number is drawn for; a purpose per use keeps draws with the same seed and gid independent.
enum class RandomPurpose : std::uint64_t { position = 1, radius = 2, velocity = 3, choice = 4, jitter = 5 };

constexpr std::uint64_t mix64(std::uint64_t x) {
  x ^= x >> 30;
  x *= 0xbf58476d1ce4e5b9ULL;
  x ^= x >> 27;
  x *= 0x94d049bb133111ebULL;
  x ^= x >> 31;
  return x;
}

/// 64 random bits for draw number `draw` of item `counter` (usually a gid).
constexpr std::uint64_t random_bits(std::uint64_t seed, std::uint64_t counter, RandomPurpose purpose,
                                    std::uint64_t draw = 0) {
  constexpr std::uint64_t weyl = 0x9e3779b97f4a7c15ULL;
  std::uint64_t x = mix64(seed + weyl);
  x = mix64(x + weyl * (static_cast<std::uint64_t>(purpose) + 1));
  x = mix64(x ^ (counter * weyl + 0x632be59bd9b4e019ULL));
  return mix64(x + weyl * (draw + 1));
}

/// Uniform in [0, 1), 53 bits.
constexpr double random_uniform(std::uint64_t seed, std::uint64_t counter, RandomPurpose purpose,
                                std::uint64_t draw = 0) {
  return static_cast<double>(random_bits(seed, counter, purpose, draw) >> 11) * 0x1.0p-53;
}

/// Standard normal deviate (Box & Muller 1958); uses draws 2*draw and 2*draw+1.
inline double random_normal(std::uint64_t seed, std::uint64_t counter, RandomPurpose purpose, std::uint64_t draw = 0) {
  const double u = 1.0 - random_uniform(seed, counter, purpose, 2 * draw);
  const double v = random_uniform(seed, counter, purpose, 2 * draw + 1);
  return std::sqrt(-2.0 * std::log(u)) * std::cos(6.283185307179586 * v);
}

}  // namespace moraine
