#include "engine/openings/places.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "kernels/base/sphere.hpp"

namespace moraine {

namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

/// Between low + r and high - r; the middle where a sphere just fits.
std::optional<double> between(double low, double high, double radius, double number) {
  const double room = high - low - 2.0 * radius;
  if (room < -1e-9 * radius) return std::nullopt;
  return room <= 0.0 ? 0.5 * (low + high) : low + radius + number * room;
}

std::optional<Vec3> place(const BoxRegion& region, double radius, const std::array<double, 3>& numbers) {
  Vec3 centre;
  for (int axis = 0; axis < 3; ++axis) {
    const std::optional<double> x =
        between(region.box.low[axis], region.box.high[axis], radius, numbers[static_cast<std::size_t>(axis)]);
    if (!x) return std::nullopt;
    centre[axis] = *x;
  }
  return centre;
}

std::optional<Vec3> place(const CylinderRegion& region, double radius, const std::array<double, 3>& numbers) {
  const double room = region.radius - radius;
  const int axis = region.axis;
  const std::optional<double> along = between(region.base[axis], region.base[axis] + region.length, radius, numbers[2]);
  if (room < 0.0 || !along) return std::nullopt;
  const double r = room * std::sqrt(numbers[0]), angle = two_pi * numbers[1];
  Vec3 centre = region.base;
  centre[axis] = *along;
  centre[(axis + 1) % 3] += r * std::cos(angle);
  centre[(axis + 2) % 3] += r * std::sin(angle);
  return centre;
}

std::optional<Vec3> place(const SphereRegion& region, double radius, const std::array<double, 3>& numbers) {
  const double room = region.radius - radius;
  if (room < 0.0) return std::nullopt;
  const double r = room * std::cbrt(numbers[0]), height = 2.0 * numbers[1] - 1.0, angle = two_pi * numbers[2];
  const double across = std::sqrt(std::max(0.0, 1.0 - height * height));
  return region.centre + r * Vec3{across * std::cos(angle), across * std::sin(angle), height};
}

/// Two unit vectors across a direction and each other.
std::array<Vec3, 2> directions_across(Vec3 direction) {
  const Vec3 n = normalized(direction);
  const Vec3 helper = std::abs(n.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
  const Vec3 u = normalized(cross(n, helper));
  return {u, cross(n, u)};
}

std::optional<Vec3> place(const DiscShape& disc, double radius, const std::array<double, 3>& numbers) {
  const double inner = disc.hole_radius > 0.0 ? disc.hole_radius + radius : 0.0, outer = disc.radius - radius;
  if (outer < inner) return std::nullopt;
  const double r = std::sqrt(inner * inner + numbers[0] * (outer * outer - inner * inner));
  const double angle = two_pi * numbers[1];
  const auto [u, v] = directions_across(disc.normal);
  return disc.centre + r * (std::cos(angle) * u + std::sin(angle) * v);
}

/// Twice the area of a flat polygon, along its normal (Newell 1972).
Vec3 area_vector(const PolygonShape& polygon) {
  Vec3 sum;
  for (std::size_t k = 1; k + 1 < polygon.points.size(); ++k)
    sum += cross(polygon.points[k] - polygon.points[0], polygon.points[k + 1] - polygon.points[0]);
  return sum;
}

std::optional<Vec3> place(const PolygonShape& polygon, double radius, const std::array<double, 3>& numbers) {
  const Vec3 normal = normalized(area_vector(polygon)), origin = polygon.points[0];
  const auto [u, v] = directions_across(normal);
  double low_u = infinity, high_u = -infinity, low_v = infinity, high_v = -infinity;
  for (const Vec3 point : polygon.points) {
    const double x = dot(point - origin, u), y = dot(point - origin, v);
    low_u = std::min(low_u, x), high_u = std::max(high_u, x);
    low_v = std::min(low_v, y), high_v = std::max(high_v, y);
  }
  const Vec3 centre =
      origin + (low_u + numbers[0] * (high_u - low_u)) * u + (low_v + numbers[1] * (high_v - low_v)) * v;
  // Inside where a ray in the plane crosses the rim an odd number of times, and not too near to the rim.
  bool is_inside = false;
  for (std::size_t k = 0; k < polygon.points.size(); ++k) {
    const Vec3 a = polygon.points[k], b = polygon.points[(k + 1) % polygon.points.size()], edge = b - a;
    const double t = std::clamp(dot(centre - a, edge) / squared_length(edge), 0.0, 1.0);
    if (squared_length(centre - a - t * edge) < radius * radius) return std::nullopt;
    const double ya = dot(a - centre, v), yb = dot(b - centre, v);
    if ((ya > 0.0) == (yb > 0.0)) continue;
    if (dot(a - centre, u) + (ya / (ya - yb)) * dot(edge, u) > 0.0) is_inside = !is_inside;
  }
  return is_inside ? std::optional(centre) : std::nullopt;
}

}  // namespace

bool contains(const CylinderRegion& cylinder, Vec3 point) {
  Vec3 offset = point - cylinder.base;
  const double along = offset[cylinder.axis];
  offset[cylinder.axis] = 0.0;
  return along >= 0.0 && along < cylinder.length && squared_length(offset) < cylinder.radius * cylinder.radius;
}

bool contains(const SphereRegion& sphere, Vec3 point) {
  return squared_length(point - sphere.centre) < sphere.radius * sphere.radius;
}

bool contains(const InletShape& shape, Vec3 point) {
  if (const auto* box = std::get_if<BoxRegion>(&shape)) return box->box.contains(point);
  if (const auto* cylinder = std::get_if<CylinderRegion>(&shape)) return contains(*cylinder, point);
  if (const auto* sphere = std::get_if<SphereRegion>(&shape)) return contains(*sphere, point);
  return false;
}

double volume_of(const InletShape& shape) {
  if (const auto* box = std::get_if<BoxRegion>(&shape)) return box->box.volume();
  if (const auto* c = std::get_if<CylinderRegion>(&shape)) return std::numbers::pi * c->radius * c->radius * c->length;
  if (const auto* sphere = std::get_if<SphereRegion>(&shape)) return sphere_volume(sphere->radius);
  return 0.0;
}

Box bounds_of(const InletShape& shape) {
  if (const auto* box = std::get_if<BoxRegion>(&shape)) return box->box;
  if (const auto* sphere = std::get_if<SphereRegion>(&shape))
    return Box{sphere->centre, sphere->centre}.grown(sphere->radius);
  if (const auto* disc = std::get_if<DiscShape>(&shape)) return Box{disc->centre, disc->centre}.grown(disc->radius);
  if (const auto* cylinder = std::get_if<CylinderRegion>(&shape)) {
    Box box = Box{cylinder->base, cylinder->base}.grown(cylinder->radius);
    box.low[cylinder->axis] = cylinder->base[cylinder->axis];
    box.high[cylinder->axis] = cylinder->base[cylinder->axis] + cylinder->length;
    return box;
  }
  Box box = Box::empty();
  for (const Vec3 point : std::get<PolygonShape>(shape).points) box.include(point);
  return box;
}

std::optional<Vec3> place_in(const InletShape& shape, double radius, const std::array<double, 3>& numbers) {
  return std::visit([&](const auto& s) { return place(s, radius, numbers); }, shape);
}

}  // namespace moraine
