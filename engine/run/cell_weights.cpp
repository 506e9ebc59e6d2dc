#include "engine/run/cell_weights.hpp"

#include <algorithm>
#include <cmath>

namespace moraine {

namespace {

/// Where a point is along an axis, in cells: the centre of cell i is at i.
double place_along(const WeightAxis& axis, double x) { return (x - axis.low) / axis.spacing - 0.5; }

struct Reach {
  int low = 0, size = 1;
};

/// Cells whose weight is not zero somewhere from one place to another.
Reach reach_of(const WeightAxis& axis, double from, double to) {
  if (axis.is_whole()) return {};
  const int low = static_cast<int>(std::floor(std::min(from, to))) - 2 * axis.width + 1;
  const int high = static_cast<int>(std::floor(std::max(from, to))) + 2 * axis.width;
  return {low, high - low + 1};
}

/// Weights along one axis of the cells from `low` on.
void axis_weights(const WeightAxis& axis, double place, int low, int size, double* weights) {
  if (axis.is_whole()) {
    weights[0] = place >= place_along(axis, axis.begin) && place < place_along(axis, axis.end) ? 1.0 : 0.0;
    return;
  }
  const double share = 1.0 / axis.width;
  for (int i = 0; i < size; ++i) weights[i] = share * cubic_spline((place - (low + i)) * share);
}

/// The cells that a point between two centres gives weight to, on each axis.
struct Cells {
  std::array<int, 3> low{}, size{};
};
Cells cells_near(const WeightGrid& grid, const std::array<double, 3>& place) {
  Cells cells;
  for (std::size_t a = 0; a < 3; ++a) {
    const Reach reach = reach_of(grid[a], place[a], place[a]);
    cells.low[a] = reach.low;
    cells.size[a] = reach.size;
  }
  return cells;
}

/// Adds `factor` times the weights of a point to those of a block around it.
void add_point(const WeightGrid& grid, const std::array<double, 3>& place, const Cells& cells, double factor,
               CellWeights& weights) {
  constexpr std::size_t most = 64;  // cells along an axis, of the widest weight
  std::array<std::array<double, most>, 3> along;
  for (std::size_t a = 0; a < 3; ++a) axis_weights(grid[a], place[a], cells.low[a], cells.size[a], along[a].data());
  for (int k = 0; k < cells.size[2]; ++k) {
    const double z = factor * along[2][static_cast<std::size_t>(k)];
    for (int j = 0; j < cells.size[1]; ++j) {
      const double yz = along[1][static_cast<std::size_t>(j)] * z;
      const std::int64_t line =
          (std::int64_t{k + cells.low[2] - weights.low[2]} * weights.size[1] + j + cells.low[1] - weights.low[1]) *
              weights.size[0] +
          cells.low[0] - weights.low[0];
      double* const values = weights.values.data() + line;
      for (int i = 0; i < cells.size[0]; ++i) values[i] += along[0][static_cast<std::size_t>(i)] * yz;
    }
  }
}

/// Where the weights along a line change from one polynomial to another, from 0 to 1, both among them.
void find_knots(const WeightGrid& grid, const std::array<double, 3>& begin, const std::array<double, 3>& way,
                std::vector<double>& knots) {
  knots.assign({0.0, 1.0});
  const auto add = [&](double s) {
    if (s > 0.0 && s < 1.0) knots.push_back(s);
  };
  for (std::size_t a = 0; a < 3; ++a) {
    if (way[a] == 0.0) continue;
    if (grid[a].is_whole()) {
      for (const double edge : {grid[a].begin, grid[a].end}) add((place_along(grid[a], edge) - begin[a]) / way[a]);
      continue;
    }
    const double end = begin[a] + way[a];
    for (double knot = std::ceil(std::min(begin[a], end)); knot <= std::max(begin[a], end); knot += 1.0)
      add((knot - begin[a]) / way[a]);
  }
  std::sort(knots.begin(), knots.end());
}

void clear_values(CellWeights& weights) {
  const std::int64_t n = std::int64_t{weights.size[0]} * weights.size[1] * weights.size[2];
  weights.values.assign(static_cast<std::size_t>(n), 0.0);
}

}  // namespace

double cubic_spline(double distance) {
  const double u = std::abs(distance);
  if (u >= 2.0) return 0.0;
  if (u >= 1.0) return (2.0 - u) * (2.0 - u) * (2.0 - u) / 6.0;
  return 2.0 / 3.0 - u * u * (1.0 - 0.5 * u);
}

int grid_cell(const WeightAxis& axis, int cell) {
  if (axis.wraps) return (cell % axis.n + axis.n) % axis.n;
  return cell >= 0 && cell < axis.n ? cell : -1;
}

void find_block(const WeightGrid& grid, Vec3 begin, Vec3 way, CellWeights& weights) {
  for (std::size_t a = 0; a < 3; ++a) {
    const int axis = static_cast<int>(a);
    const double from = place_along(grid[a], begin[axis]);
    const Reach reach = reach_of(grid[a], from, from + way[axis] / grid[a].spacing);
    weights.low[a] = reach.low;
    weights.size[a] = reach.size;
  }
}

void point_weights(const WeightGrid& grid, Vec3 point, CellWeights& weights) {
  const std::array<double, 3> place = {place_along(grid[0], point.x), place_along(grid[1], point.y),
                                       place_along(grid[2], point.z)};
  find_block(grid, point, {}, weights);
  clear_values(weights);
  add_point(grid, place, cells_near(grid, place), 1.0, weights);
}

void line_weights(const WeightGrid& grid, Vec3 begin, Vec3 way, CellWeights& weights) {
  // Gauss and Legendre on (0, 1).
  constexpr std::array<double, 5> points = {0.046910077030668004, 0.23076534494715845, 0.5, 0.76923465505284155,
                                            0.95308992296933200};
  constexpr std::array<double, 5> shares = {0.11846344252809454, 0.23931433524968324, 0.28444444444444444,
                                            0.23931433524968324, 0.11846344252809454};
  std::array<double, 3> from, along;
  for (std::size_t a = 0; a < 3; ++a) {
    from[a] = place_along(grid[a], begin[static_cast<int>(a)]);
    along[a] = way[static_cast<int>(a)] / grid[a].spacing;
  }
  find_block(grid, begin, way, weights);
  clear_values(weights);
  std::vector<double>& knots = weights.knots;
  find_knots(grid, from, along, knots);
  for (std::size_t k = 0; k + 1 < knots.size(); ++k) {
    const double length = knots[k + 1] - knots[k];
    if (!(length > 0.0)) continue;
    for (std::size_t q = 0; q < points.size(); ++q) {
      const double s = knots[k] + points[q] * length;
      const std::array<double, 3> place = {from[0] + s * along[0], from[1] + s * along[1], from[2] + s * along[2]};
      Cells cells = cells_near(grid, place);
      for (std::size_t a = 0; a < 3; ++a)  // rounding may put a point just outside the line
        cells.low[a] = std::clamp(cells.low[a], weights.low[a], weights.low[a] + weights.size[a] - cells.size[a]);
      add_point(grid, place, cells, shares[q] * length, weights);
    }
  }
}

}  // namespace moraine
