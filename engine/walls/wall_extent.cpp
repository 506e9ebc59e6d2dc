#include "engine/walls/wall_extent.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

namespace moraine {

namespace {

constexpr double pi = std::numbers::pi;

/// The part of a polygon where p[axis] * sign <= limit (Sutherland & Hodgman 1974); points within `slack` stay.
std::vector<Vec3> cut(const std::vector<Vec3>& polygon, int axis, double sign, double limit, double slack) {
  std::vector<Vec3> kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec3 p = polygon[i], q = polygon[(i + 1) % polygon.size()];
    const double beyond_p = sign * p[axis] - limit, beyond_q = sign * q[axis] - limit;
    if (beyond_p <= slack) kept.push_back(p);
    if ((beyond_p <= slack) != (beyond_q <= slack)) kept.push_back(p + (beyond_p / (beyond_p - beyond_q)) * (q - p));
  }
  return kept;
}

/// The part of a polygon inside a box.
std::vector<Vec3> inside(std::vector<Vec3> polygon, const Box& box) {
  const double slack = 1e-12 * length(box.size());  // what lies in a face of the box is inside
  for (int axis = 0; axis < 3; ++axis) {
    polygon = cut(polygon, axis, 1.0, box.high[axis], slack);
    polygon = cut(polygon, axis, -1.0, -box.low[axis], slack);
  }
  return polygon;
}

/// The polygon in which a plane cuts a box.
std::vector<Vec3> plane_in_box(const Surface& plane, const Box& box) {
  const Vec3 middle = 0.5 * (box.low + box.high);
  const double size = length(box.size());
  const double height = dot(plane.axis, middle - plane.point);
  if (!(std::abs(height) <= size)) return {};
  const Vec3 foot = middle - height * plane.axis;
  const Vec3 least = std::abs(plane.axis.x) < 0.6 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
  const Vec3 u = size * normalized(cross(plane.axis, least)), v = cross(plane.axis, u);
  return inside({foot - u - v, foot + u - v, foot + u + v, foot - u + v}, box);
}

double polygon_area(const std::vector<Vec3>& polygon) {
  Vec3 sum;
  for (std::size_t i = 2; i < polygon.size(); ++i) sum += cross(polygon[i - 1] - polygon[0], polygon[i] - polygon[0]);
  return 0.5 * length(sum);
}

/// The part of a straight line inside a box, as an interval of its parameter within [from, to]; nothing where from > to.
struct Interval {
  double from, to;
};
Interval line_in_box(Vec3 point, Vec3 direction, const Box& box, Interval within) {
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0.0) {
      if (point[axis] < box.low[axis] || point[axis] > box.high[axis]) return {1.0, 0.0};
      continue;
    }
    const double a = (box.low[axis] - point[axis]) / direction[axis],
                 b = (box.high[axis] - point[axis]) / direction[axis];
    within.from = std::max(within.from, std::min(a, b));
    within.to = std::min(within.to, std::max(a, b));
  }
  return within;
}

/// Area inside a box of what a straight line sweeps when it turns about an axis: from a point at radius_from to the point `along` the axis
/// at radius_to, t = 0 to 1 (`range` may go further). Sums narrow strips; exact where all of it is inside.
double swept_area(Vec3 point, Vec3 axis, double along, double radius_from, double radius_to, Interval range,
                  const Box& box) {
  constexpr int n = 3600;
  const Vec3 least = std::abs(axis.x) < 0.6 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
  const Vec3 u = normalized(cross(axis, least)), v = cross(axis, u);
  const double run = radius_to - radius_from;
  double sum = 0.0;  // of the integral of the radius over t
  for (int i = 0; i < n; ++i) {
    const double angle = 2.0 * pi * (i + 0.5) / n;
    const Vec3 out = std::cos(angle) * u + std::sin(angle) * v;
    const Interval inside = line_in_box(point + radius_from * out, along * axis + run * out, box, range);
    if (!(inside.from < inside.to)) continue;
    sum += (inside.to - inside.from) * (radius_from + 0.5 * run * (inside.from + inside.to));
  }
  return sum * 2.0 * pi / n * std::sqrt(along * along + run * run);
}

/// Adds the bounding box of a circle.
void include_circle(Box& box, Vec3 centre, Vec3 axis, double radius) {
  const auto half = [&](double a) { return radius * std::sqrt(std::max(0.0, 1.0 - a * a)); };
  const Vec3 reach = {half(axis.x), half(axis.y), half(axis.z)};
  box.include(centre - reach);
  box.include(centre + reach);
}

Box bounding_box(const Surface& s) {
  Box box = Box::empty();
  include_circle(box, s.point, s.axis, s.radius_base);
  if (s.kind == SurfaceKind::disc) return box;
  if (std::isfinite(s.length)) {
    const double far_radius = s.kind == SurfaceKind::cylinder ? s.radius_base : s.radius_top;
    include_circle(box, s.point + s.length * s.axis, s.axis, far_radius);
    return box;
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (s.axis[axis] == 0.0) continue;
    box.low[axis] = -std::numeric_limits<double>::infinity();
    box.high[axis] = std::numeric_limits<double>::infinity();
  }
  return box;
}

}  // namespace

Box common_part(const Box& a, const Box& b) {
  Box common;
  for (int axis = 0; axis < 3; ++axis) {
    common.low[axis] = std::max(a.low[axis], b.low[axis]);
    common.high[axis] = std::min(a.high[axis], b.high[axis]);
    if (!(common.low[axis] <= common.high[axis])) return Box::empty();
  }
  return common;
}

double area_of(const Surface& s, const Box& clip) {
  constexpr double infinite = std::numeric_limits<double>::infinity();
  switch (s.kind) {
    case SurfaceKind::plane:
    case SurfaceKind::mirror: return polygon_area(plane_in_box(s, clip));
    case SurfaceKind::cylinder:
      if (std::isfinite(s.length))
        return swept_area(s.point, s.axis, s.length, s.radius_base, s.radius_base, {0.0, 1.0}, clip);
      return swept_area(s.point, s.axis, 1.0, s.radius_base, s.radius_base, {-infinite, infinite}, clip);
    case SurfaceKind::cone: return swept_area(s.point, s.axis, s.length, s.radius_base, s.radius_top, {0.0, 1.0}, clip);
    case SurfaceKind::disc: return swept_area(s.point, s.axis, 0.0, s.radius_top, s.radius_base, {0.0, 1.0}, clip);
    case SurfaceKind::mesh: break;
  }
  return 0.0;
}

double area_of(const std::array<Vec3, 3>& triangle, const Box& clip) {
  return polygon_area(inside(std::vector<Vec3>(triangle.begin(), triangle.end()), clip));
}

Box extent_of(const Surface& s, const Box& clip) {
  if (s.kind != SurfaceKind::plane && s.kind != SurfaceKind::mirror) return common_part(bounding_box(s), clip);
  Box box = Box::empty();
  for (const Vec3 p : plane_in_box(s, clip)) box.include(p);
  return box;
}

}  // namespace moraine
