// Weights by which a grain, or the line between two grains, is spread over the cells of a uniform grid.
//
// A grain's weight is the product of a cubic B-spline along each axis (Schoenberg 1946; the smoothest kernel of its reach), whose knots are
// a whole number of cells apart. So the weights at the centres of the cells add up to one wherever the grain is (partition of unity),
// and what a grid holds is what its grains have, to round-off. Along an axis of one cell the weight is the same everywhere on it.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "kernels/base/vec3.hpp"

namespace moraine {

/// One side of a grid.
struct WeightAxis {
  double low = 0.0;      // [m]
  double spacing = 1.0;  // [m] of cells
  int n = 1;             // cells
  int width = 1;         // cells between two knots
  bool wraps = false;    // the last cell is beside the first
  // [m] Of one cell only: where the weight begins and ends.
  double begin = -std::numeric_limits<double>::infinity();
  double end = std::numeric_limits<double>::infinity();
  bool is_whole() const { return n == 1; }
};
using WeightGrid = std::array<WeightAxis, 3>;

/// The cubic B-spline of unit knots, at a distance from its middle.
double cubic_spline(double distance);

/// Weights of a block of cells, x fastest; `low` may lie outside the grid, and a cell of an axis that wraps stands for that modulo n.
struct CellWeights {
  std::array<int, 3> low{};
  std::array<int, 3> size{};
  std::vector<double> values;
  std::vector<double> knots;  // of line_weights()
};

/// The block of cells that a straight line from `begin` to begin + way gives weight to; values are left alone.
void find_block(const WeightGrid& grid, Vec3 begin, Vec3 way, CellWeights& weights);

/// Sets the weights of a point.
void point_weights(const WeightGrid& grid, Vec3 point, CellWeights& weights);

/// Sets the mean of the weights along a straight line: the integral over s from 0 to 1 of the weights at begin + s way. Exact to round-off: between
/// two centres of cells weights are polynomials of the ninth degree in s, for which five points of Gauss and Legendre do.
void line_weights(const WeightGrid& grid, Vec3 begin, Vec3 way, CellWeights& weights);

/// The cell along an axis that one of a block of weights stands for, or -1 outside the grid.
int grid_cell(const WeightAxis& axis, int cell);

}  // namespace moraine
