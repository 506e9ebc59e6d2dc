#include "engine/particles/lattice.hpp"

#include <cmath>
#include <numbers>

#include "kernels/base/random.hpp"

namespace moraine {
namespace {

/// Evenly spaced places along one axis.
struct Ladder {
  double first = 0.0;  // [m]
  double step = 0.0;   // [m]
  int n = 0;
};

/// Places `step` apart between low and high, `margin` away from either end; around an endless axis, stretched to close
/// after a multiple of `period` places.
Ladder ladder(double low, double high, bool is_endless, double step, double margin, int period) {
  const double rounding = 1e-9;
  if (is_endless) {
    const int n = static_cast<int>(std::floor((high - low) / step + rounding)) / period * period;
    return n > 0 ? Ladder{low + 0.5 * (high - low) / n, (high - low) / n, n} : Ladder{};
  }
  const double room = high - low - 2.0 * margin;
  if (room < -rounding * margin) return {};
  return {low + margin, step, 1 + static_cast<int>(std::floor(std::max(room, 0.0) / step + rounding))};
}

struct Lattice {
  Ladder x, y, z;
  double row_shift = 0.0;  // along x, of every other row
  Vec3 layer_shift;        // of every other layer
};

Lattice make_lattice(const Container& container, LatticeFill::Kind kind, double a, double radius) {
  const Box& box = container.extent();
  const bool is_hexagonal = kind == LatticeFill::Kind::hexagonal;
  const int period = is_hexagonal ? 2 : 1;
  const double row = is_hexagonal ? a * std::numbers::sqrt3 / 2.0 : a;
  const double layer = is_hexagonal ? a * std::sqrt(2.0 / 3.0) : a;
  Lattice lattice;
  lattice.x = ladder(box.low.x, box.high.x, container.is_endless(0), a, radius, 1);
  lattice.y = ladder(box.low.y, box.high.y, container.is_endless(1), row, radius, period);
  lattice.z = container.space().is_flat ? Ladder{container.space().plane, 1.0, 1}
                                        : ladder(box.low.z, box.high.z, container.is_endless(2), layer, radius, period);
  if (is_hexagonal) {
    // Every sphere of a layer above the middle of a triangle: half a spacing along x, a third of a row's distance along
    // y.
    lattice.row_shift = 0.5 * lattice.x.step;
    lattice.layer_shift = {0.5 * lattice.x.step, lattice.y.step / 3.0, 0.0};
  }
  return lattice;
}

}  // namespace

std::vector<Vec3> lattice_sites(const Container& container, LatticeFill::Kind kind, double spacing, double radius) {
  const Lattice lattice = make_lattice(container, kind, spacing, radius);
  const double fit = radius * (1.0 - 1e-9);  // a site that just touches a face is one
  std::vector<Vec3> sites;
  for (int k = 0; k < lattice.z.n; ++k)
    for (int j = 0; j < lattice.y.n; ++j)
      for (int i = 0; i < lattice.x.n; ++i) {
        Vec3 p{lattice.x.first + i * lattice.x.step, lattice.y.first + j * lattice.y.step,
               lattice.z.first + k * lattice.z.step};
        if (j % 2 == 1) p.x += lattice.row_shift;
        if (k % 2 == 1) p += lattice.layer_shift;
        p = container.space().wrapped(p);
        if (container.fits(p, fit)) sites.push_back(p);
      }
  return sites;
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
