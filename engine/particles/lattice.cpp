#include "engine/particles/lattice.hpp"

#include <cmath>
#include <numbers>

#include "kernels/base/random.hpp"

namespace moraine {
/// Places `step` apart between low and high, `margin` away from either end; around an endless axis, stretched to close
/// after a multiple of `period` places.
LatticeRows::Ladder LatticeRows::ladder(double low, double high, bool is_endless, double step, double margin,
                                        int period) {
  const double rounding = 1e-9;
  if (is_endless) {
    const int n = static_cast<int>(std::floor((high - low) / step + rounding)) / period * period;
    return n > 0 ? Ladder{low + 0.5 * (high - low) / n, (high - low) / n, n} : Ladder{};
  }
  const double room = high - low - 2.0 * margin;
  if (room < -rounding * margin) return {};
  return {low + margin, step, 1 + static_cast<int>(std::floor(std::max(room, 0.0) / step + rounding))};
}

LatticeRows::LatticeRows(const Container& container, LatticeFill::Kind kind, double spacing, double radius)
    : container_(&container), fit_(radius * (1.0 - 1e-9)) {
  const Box& box = container.extent();
  const bool is_hexagonal = kind == LatticeFill::Kind::hexagonal;
  const int period = is_hexagonal ? 2 : 1;
  const double row = is_hexagonal ? spacing * std::numbers::sqrt3 / 2.0 : spacing;
  const double layer = is_hexagonal ? spacing * std::sqrt(2.0 / 3.0) : spacing;
  x_ = ladder(box.low.x, box.high.x, container.is_endless(0), spacing, radius, 1);
  y_ = ladder(box.low.y, box.high.y, container.is_endless(1), row, radius, period);
  z_ = container.space().is_flat ? Ladder{container.space().plane, 1.0, 1}
                                 : ladder(box.low.z, box.high.z, container.is_endless(2), layer, radius, period);
  if (is_hexagonal) {
    // Every sphere of a layer above the middle of a triangle: half a spacing along x, a third of a row's distance along
    // y.
    row_shift_ = 0.5 * x_.step;
    layer_shift_ = {0.5 * x_.step, y_.step / 3.0, 0.0};
  }
}

Vec3 LatticeRows::site(int i, int j, int k) const {
  Vec3 p{x_.first + i * x_.step, y_.first + j * y_.step, z_.first + k * z_.step};
  if (j % 2 == 1) p.x += row_shift_;
  if (k % 2 == 1) p += layer_shift_;
  return container_->space().wrapped(p);
}

Vec3 random_in_ball(std::uint64_t seed, std::uint64_t number, bool is_flat) {
  for (std::uint64_t attempt = 0;; ++attempt) {
    const auto draw = [&](std::uint64_t k) {
      return 2.0 * random_uniform(seed, number, RandomPurpose::jitter, 3 * attempt + k) - 1.0;
    };
    const Vec3 v{draw(0), draw(1), is_flat ? 0.0 : draw(2)};
    if (squared_length(v) <= 1.0) return v;
  }
}

}  // namespace moraine
