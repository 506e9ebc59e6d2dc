// Space as the packing algorithms see it: periodic differences, and cells of several sizes in which spheres are found.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/base/box.hpp"

namespace moraine {

/// A sphere to be placed: centre and radius [m].
struct PackGrain {
  Vec3 position;
  double radius = 0.0;
};

/// The box in which grains are packed; periodic in some directions.
struct PackSpace {
  Box box;  // [m]; in periodic directions the domain
  std::array<bool, 3> periodic = {false, false, false};
  bool is_flat = false;  // two-dimensional: all centres at the same z
  double plane = 0.0;    // [m] that z

  /// a - b, to the nearest image of b.
  Vec3 difference(Vec3 a, Vec3 b) const {
    Vec3 d = a - b;
    for (int k = 0; k < 3; ++k)
      if (periodic[static_cast<std::size_t>(k)]) {
        const double size = box.high[k] - box.low[k];
        if (d[k] > 0.5 * size)
          d[k] -= size;
        else if (d[k] < -0.5 * size)
          d[k] += size;
      }
    return d;
  }

  /// The image of p inside the box, in the periodic directions.
  Vec3 wrapped(Vec3 p) const;
};

/// Cells over a packing space, one grid for each class of sizes (a factor of two each), so that large grains do not
/// make the cells of small ones large. Cells are numbered through all grids.
class CellLevels {
 public:
  /// Grids for spheres of these radii [m] at about these centres; centres outside the extent count to the outermost
  /// cells.
  CellLevels(const PackSpace& space, const Box& extent, std::span<const double> radii);

  int n_levels() const { return static_cast<int>(levels_.size()); }
  std::int64_t n_cells() const { return n_cells_; }
  /// The level of spheres of that radius; 0 holds the largest.
  int level_of(double radius) const;
  bool is_empty(int level) const { return levels_[static_cast<std::size_t>(level)].largest_radius == 0.0; }
  double largest_radius(int level) const { return levels_[static_cast<std::size_t>(level)].largest_radius; }
  std::int64_t cell_of(int level, Vec3 p) const;
  /// Calls visit(cell) for every cell of the level that holds points closer than `reach` to p along each axis, each
  /// once. Ends early, and returns true, as soon as a visit returns true.
  template <class Visit>
  bool visit_cells(int level, Vec3 p, double reach, Visit&& visit) const;

 private:
  struct Level {
    double largest_radius = 0.0;  // 0: nothing of that size
    std::int64_t first_cell = 0;
    std::array<int, 3> n = {1, 1, 1};
    Vec3 inverse_edge;  // [1/m]
  };
  struct Span {
    int begin = 0;  // may be negative or beyond n in a periodic direction
    int end = 0;
  };
  void size_level(Level& level, std::int64_t n_grains) const;
  Span span_of(const Level& level, int axis, double p, double reach) const;
  static int wrap_cell(int i, int n) { return i < 0 ? i + n : i >= n ? i - n : i; }

  PackSpace space_;
  Box extent_;
  double largest_radius_ = 0.0;
  std::vector<Level> levels_;
  std::int64_t n_cells_ = 0;
};

template <class Visit>
bool CellLevels::visit_cells(int number, Vec3 p, double reach, Visit&& visit) const {
  const Level& level = levels_[static_cast<std::size_t>(number)];
  const Span x = span_of(level, 0, p.x, reach);
  const Span y = span_of(level, 1, p.y, reach);
  const Span z = span_of(level, 2, p.z, reach);
  for (int k = z.begin; k < z.end; ++k) {
    const std::int64_t layer = wrap_cell(k, level.n[2]);
    for (int j = y.begin; j < y.end; ++j) {
      const std::int64_t row = (layer * level.n[1] + wrap_cell(j, level.n[1])) * level.n[0] + level.first_cell;
      for (int i = x.begin; i < x.end; ++i)
        if (visit(row + wrap_cell(i, level.n[0]))) return true;
    }
  }
  return false;
}

}  // namespace moraine
