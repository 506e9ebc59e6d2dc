// Axis-aligned box.
#pragma once

#include <algorithm>
#include <limits>

#include "kernels/base/vec3.hpp"

namespace moraine {

/// Half-open box [low, high) [m].
struct Box {
  Vec3 low;
  Vec3 high;

  /// A box that contains nothing and grows by include().
  static constexpr Box empty() {
    constexpr double inf = std::numeric_limits<double>::infinity();
    return {{inf, inf, inf}, {-inf, -inf, -inf}};
  }

  constexpr Vec3 size() const { return high - low; }
  constexpr double volume() const { return size().x * size().y * size().z; }
  constexpr bool contains(Vec3 p) const {
    return p.x >= low.x && p.x < high.x && p.y >= low.y && p.y < high.y && p.z >= low.z && p.z < high.z;
  }
  constexpr void include(Vec3 p) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  /// The box widened by `margin` on every side.
  constexpr Box grown(double margin) const {
    const Vec3 m{margin, margin, margin};
    return {low - m, high + m};
  }
  constexpr bool operator==(const Box&) const = default;
};

}  // namespace moraine
