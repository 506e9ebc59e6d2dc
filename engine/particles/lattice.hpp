// Sites of regular lattices inside a container, row by row so that ranks can share them, and small displacements from them.
#pragma once

#include <cstdint>

#include "engine/particles/pack_container.hpp"
#include "kernels/base/range.hpp"

namespace moraine {

/// Sites for spheres of that radius [m], neighbours at least `spacing` [m] apart, in rows along x, these along y, then z. In a
/// periodic direction that the region spans the lattice is stretched so that it closes. Flat: one layer.
class LatticeRows {
 public:
  LatticeRows(const Container& container, LatticeFill::Kind kind, double spacing, double radius);
  std::int64_t size() const { return std::int64_t{y_.n} * z_.n; }
  /// Calls f(site) for the sites of these rows, in order.
  template <typename Function>
  void for_each_site(Range rows, Function f) const {
    for (std::int64_t row = rows.begin; row < rows.end; ++row)
      for (int i = 0; i < x_.n; ++i) {
        const Vec3 p = site(i, static_cast<int>(row % y_.n), static_cast<int>(row / y_.n));
        if (container_->fits(p, fit_)) f(p);
      }
  }

 private:
  /// Evenly spaced places along one axis.
  struct Ladder {
    double first = 0.0;  // [m]
    double step = 0.0;   // [m]
    int n = 0;
  };
  static Ladder ladder(double low, double high, bool is_endless, double step, double margin, int period);
  Vec3 site(int i, int j, int k) const;

  const Container* container_;
  Ladder x_, y_, z_;
  double row_shift_ = 0.0;  // along x, of every other row
  Vec3 layer_shift_;        // of every other layer
  double fit_ = 0.0;        // [m] radius: a site that just touches a face is one
};

/// A random vector of length 0 to 1, evenly distributed over the ball (flat: the disc).
Vec3 random_in_ball(std::uint64_t seed, std::uint64_t number, bool is_flat);

}  // namespace moraine
