// Sums over the ranks that do not depend on how many there are.
#pragma once

#include <span>

#include "comm/world.hpp"
#include "kernels/base/exact_sum.hpp"

namespace moraine {

/// Adds up what the ranks have summed, each accumulator by itself. All ranks call it.
void total(const World& world, std::span<ExactSum> sums);
/// The sum of all ranks of one accumulator. All ranks call it.
inline double total(const World& world, ExactSum sum) {
  total(world, std::span(&sum, 1));
  return sum.value();
}

}  // namespace moraine
