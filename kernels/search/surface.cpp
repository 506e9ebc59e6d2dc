#include "kernels/search/surface.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace moraine {

namespace {

// ---------------------------------------------------------------------------------------------- analytic surfaces

/// A unit vector across a unit axis, always the same for the same axis.
Vec3 any_direction_across(Vec3 axis) {
  const double x = std::abs(axis.x), y = std::abs(axis.y), z = std::abs(axis.z);
  const Vec3 least = x <= y && x <= z ? Vec3{1, 0, 0} : y <= z ? Vec3{0, 1, 0} : Vec3{0, 0, 1};
  return normalized(cross(axis, least));
}

/// A point seen from an axis: height along it, distance from it, and the unit vector away from it.
struct Cylindrical {
  double height;
  double radius;
  Vec3 outward;
};

Cylindrical cylindrical(Vec3 offset, Vec3 axis) {
  const double height = dot(offset, axis);
  Vec3 across = offset - height * axis;
  across -= dot(across, axis) * axis;  // what round-off left along the axis, which matters next to it
  const double radius = length(across);
  const bool has_direction = radius > 1e-12 * std::abs(height);
  return {height, radius, has_direction ? across / radius : any_direction_across(axis)};
}

/// The touch where the offset from the closest point is (outward, along) in the plane through the axis; `on_surface` is the
/// normal, in the same plane, to take where there is no offset.
Touch touch_in_plane(const Cylindrical& c, Vec3 axis, double outward, double along, double on_outward,
                     double on_along) {
  const double distance = std::sqrt(outward * outward + along * along);
  if (distance > 0.0) return {(outward / distance) * c.outward + (along / distance) * axis, distance};
  return {on_outward * c.outward + on_along * axis, 0.0};
}

Touch touch_plane(const Surface& plane, Vec3 centre) { return {plane.axis, dot(plane.axis, centre - plane.point)}; }

/// The lateral surface; beyond its ends the rims.
Touch touch_cylinder(const Surface& cylinder, Vec3 centre) {
  const Cylindrical c = cylindrical(centre - cylinder.point, cylinder.axis);
  const double gap = c.radius - cylinder.radius_base;
  const bool is_beyond_end = std::isfinite(cylinder.length) && (c.height < 0.0 || c.height > cylinder.length);
  if (!is_beyond_end) return {gap > 0.0 ? c.outward : -c.outward, std::abs(gap)};
  const double beyond = c.height < 0.0 ? c.height : c.height - cylinder.length;
  return touch_in_plane(c, cylinder.axis, gap, beyond, -1.0, 0.0);
}

/// Most grains in a cylinder are far from its wall: told without a root or a division. May say no where the answer is yes.
bool is_clear_of_cylinder(const Surface& cylinder, Vec3 centre, double reach) {
  const Vec3 offset = centre - cylinder.point;
  const Vec3 across = offset - dot(offset, cylinder.axis) * cylinder.axis;
  const double inner = cylinder.radius_base - reach, outer = cylinder.radius_base + reach;
  const double squared = squared_length(across);
  return (inner > 0.0 && squared < 0.999999 * inner * inner) || squared > 1.000001 * outer * outer;
}

/// In the plane through axis and centre the cone is the segment from (radius_base, 0) to (radius_top, length).
Touch touch_cone(const Surface& cone, Vec3 centre) {
  const Cylindrical c = cylindrical(centre - cone.point, cone.axis);
  const double run = cone.radius_top - cone.radius_base;
  const double slant = std::sqrt(run * run + cone.length * cone.length);
  const double along_outward = run / slant, along_axis = cone.length / slant;
  const double gap = c.radius - cone.radius_base;
  const double along = gap * along_outward + c.height * along_axis;
  if (along < 0.0) return touch_in_plane(c, cone.axis, gap, c.height, -along_axis, along_outward);
  if (along > slant)
    return touch_in_plane(c, cone.axis, c.radius - cone.radius_top, c.height - cone.length, -along_axis, along_outward);
  const double outside = gap * along_axis - c.height * along_outward;
  const double side = outside > 0.0 ? 1.0 : -1.0;
  return {side * (along_axis * c.outward - along_outward * cone.axis), std::abs(outside)};
}

/// The annulus between hole and rim, from either side.
Touch touch_disc(const Surface& disc, Vec3 centre) {
  const Cylindrical c = cylindrical(centre - disc.point, disc.axis);
  if (c.radius > disc.radius_base) return touch_in_plane(c, disc.axis, c.radius - disc.radius_base, c.height, 0.0, 1.0);
  if (c.radius < disc.radius_top) return touch_in_plane(c, disc.axis, c.radius - disc.radius_top, c.height, 0.0, 1.0);
  return {c.height < 0.0 ? -disc.axis : disc.axis, std::abs(c.height)};
}

// ---------------------------------------------------------------------------------------------- triangles

// Feet so little outside a triangle count as inside (of the reach); so little is no way nearer (sine of the angle); and so
// little above a tangent plane is in it (of the reach). Each is far above round-off and far below anything that matters, and
// each is more generous than the one before, so that what two triangles both claim is hidden, and nothing is claimed by none.
constexpr double tolerance_inside = 1e-12;
constexpr double tolerance_nearer = 1e-10;
constexpr double tolerance_hidden = 1e-9;

/// Where on a triangle its closest point lies.
enum class Place : std::uint8_t { face, edge, corner };

struct Closest {
  Place place = Place::face;
  int k = 0;                    // edge or corner of the triangle
  Vec3 offset;                  // from the closest point to the centre; not set for a face
  double squared_distance = 0;  // not set for a face
};

constexpr int next_of_three(int k) { return k == 2 ? 0 : k + 1; }

/// Keeps the closest point of edge k if it is nearer than what was found so far.
void consider_edge(const Vec3* corners, int k, Vec3 from_corner, Vec3 edge, Vec3 centre, Closest& closest) {
  const double along = dot(from_corner, edge), squared = squared_length(edge);
  Closest found{Place::edge, k, {}, 0.0};
  if (along <= 0.0) {
    found.place = Place::corner;
    found.offset = from_corner;
  } else if (along >= squared) {
    found.place = Place::corner;
    found.k = next_of_three(k);
    found.offset = centre - corners[found.k];
  } else {
    found.offset = from_corner - (along / squared) * edge;
  }
  found.squared_distance = squared_length(found.offset);
  if (closest.place == Place::face || found.squared_distance < closest.squared_distance) closest = found;
}

/// The closest point of a triangle. Where the foot of the perpendicular is outside, the closest point lies on an edge that the
/// foot is outside of; so only those are looked at. `inside` [m]: how far outside still counts as inside. The normal need not
/// be a unit vector if `inside` is zero.
Closest closest_on_triangle(const Vec3* corners, Vec3 normal, Vec3 centre, double inside) {
  Closest closest;
  for (int k = 0; k < 3; ++k) {
    const Vec3 edge = corners[next_of_three(k)] - corners[k];
    const Vec3 from_corner = centre - corners[k];
    const double side = dot(cross(normal, edge), from_corner);
    if (side < 0.0 && side * side > inside * inside * squared_length(edge))
      consider_edge(corners, k, from_corner, edge, centre, closest);
  }
  return closest;
}

// ---------------------------------------------------------------------------------------------- meshes

/// Whether a step towards `way` from a point brings one nearer to a centre at `offset` from it.
bool leads_nearer(Vec3 way, Vec3 offset) {
  const double s = dot(way, offset);
  return s > 0.0 && s * s > tolerance_nearer * tolerance_nearer * squared_length(way) * squared_length(offset);
}

/// Whether a closest point on an edge is a minimum of the distance over all triangles of that edge: no way into any of them
/// leads nearer. Asked of the edge of lowest number only; the others say no.
bool is_minimum_at_edge(const MeshView& mesh, std::int32_t edge, Vec3 closest_point, Vec3 offset) {
  for (std::int32_t other = mesh.edge_ring[edge]; other != edge; other = mesh.edge_ring[other]) {
    if (other < edge) return false;
    const std::int32_t first = other - other % 3;
    const Vec3 opposite = mesh.corners[first + (other - first + 2) % 3];
    if (leads_nearer(opposite - closest_point, offset)) return false;
  }
  return true;
}

/// The same at a vertex: no way along an edge from it leads nearer, and so none into a triangle between two of them.
bool is_minimum_at_corner(const MeshView& mesh, std::int32_t corner, Vec3 offset) {
  for (std::int32_t other = mesh.corner_ring[corner]; other != corner; other = mesh.corner_ring[other]) {
    if (other < corner) return false;
    const std::int32_t first = other - other % 3, k = other - first;
    const Vec3 here = mesh.corners[other];
    if (leads_nearer(mesh.corners[first + (k + 1) % 3] - here, offset)) return false;
    if (leads_nearer(mesh.corners[first + (k + 2) % 3] - here, offset)) return false;
  }
  return true;
}

/// The nearest minima found so far, nearest first; of equally near ones the first found.
struct Minima {
  union {
    std::array<Touch, max_minima> at;  // in a union so that nobody sets two kilobytes to zero for each grain
  };
  int n = 0;

  Minima() {}

  void add(Vec3 normal, double distance) {
    if (n == max_minima && !(distance < at[max_minima - 1].distance)) return;
    int place = n < max_minima ? n++ : max_minima - 1;
    for (; place > 0 && distance < at[static_cast<std::size_t>(place - 1)].distance; --place)
      at[static_cast<std::size_t>(place)] = at[static_cast<std::size_t>(place - 1)];
    at[static_cast<std::size_t>(place)] = {normal, distance};
  }
};

void add_minimum_of_triangle(const MeshView& mesh, std::int32_t triangle, Vec3 centre, double reach, Minima& minima) {
  const Vec3* corners = mesh.corners + 3 * static_cast<std::int64_t>(triangle);
  const Vec3 normal = mesh.normals[triangle];
  const double height = dot(normal, centre - corners[0]);
  if (!(std::abs(height) < reach)) return;
  const Closest closest = closest_on_triangle(corners, normal, centre, tolerance_inside * reach);
  if (closest.place == Place::face) {
    minima.add(height < 0.0 ? -normal : normal, std::abs(height));
    return;
  }
  if (!(closest.squared_distance < reach * reach)) return;
  const std::int32_t number = 3 * triangle + closest.k;
  const bool is_minimum = closest.place == Place::edge
                              ? is_minimum_at_edge(mesh, number, centre - closest.offset, closest.offset)
                              : is_minimum_at_corner(mesh, number, closest.offset);
  if (!is_minimum) return;
  const double distance = std::sqrt(closest.squared_distance);
  minima.add(distance > tolerance_inside * reach ? closest.offset / distance : normal, distance);
}

/// Half the square of the distance between two unit vectors: 1 - cos of the angle, exact for small angles too.
double one_minus_cosine(Vec3 a, Vec3 b) { return 0.5 * squared_length(a - b); }

/// How far the place of a minimum is above the tangent plane of a nearer one [m].
double height_above(const Touch& nearer, const Touch& farther) {
  return nearer.distance - farther.distance + farther.distance * one_minus_cosine(nearer.normal, farther.normal);
}

/// From 1 where both are as near to 0 where the farther one sinks into the tangent plane of the nearer one.
double share_beside(const Touch& nearer, const Touch& farther, double tolerance) {
  const double most = nearer.distance * one_minus_cosine(nearer.normal, farther.normal);
  if (most <= tolerance) return 0.0;
  return std::clamp((height_above(nearer, farther) - tolerance) / (most - tolerance), 0.0, 1.0);
}

/// Removes the minima that are hidden by nearer ones (hidden ones hide as well: one mesh behind another).
void remove_hidden(Minima& minima, double tolerance) {
  std::array<bool, max_minima> is_hidden{};
  for (std::size_t i = 1; i < static_cast<std::size_t>(minima.n); ++i)
    for (std::size_t j = 0; j < i && !is_hidden[i]; ++j)
      is_hidden[i] = height_above(minima.at[j], minima.at[i]) <= tolerance;
  int n_kept = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(minima.n); ++i)
    if (!is_hidden[i]) minima.at[static_cast<std::size_t>(n_kept++)] = minima.at[i];
  minima.n = n_kept;
}

/// The mean of minima of one smooth surface, nearest first.
Touch mean_touch(const Touch* minima, int n, double reach, double tolerance) {
  if (n == 1) return minima[0];
  Vec3 normal;
  double sum = 0.0, sum_overlap = 0.0;
  for (int i = 0; i < n; ++i) {
    double share = 1.0;
    for (int j = 0; j < i; ++j) share = std::min(share, share_beside(minima[j], minima[i], tolerance));
    const double overlap = reach - minima[i].distance;
    const double weight = share * overlap;
    normal += weight * minima[i].normal;
    sum += weight;
    sum_overlap += weight * overlap;
  }
  return {normalized(normal), reach - sum_overlap / sum};
}

/// Moves the minima that belong to the first (nearest) of them to `group`, the rest up.
void take_group(Minima& minima, Minima& group) {
  const Vec3 normal = minima.at[0].normal;
  int n_rest = 0;
  group.n = 0;
  for (int i = 0; i < minima.n; ++i) {
    const Touch minimum = minima.at[static_cast<std::size_t>(i)];
    if (i == 0 || dot(normal, minimum.normal) >= smooth_cosine)
      group.at[static_cast<std::size_t>(group.n++)] = minimum;
    else
      minima.at[static_cast<std::size_t>(n_rest++)] = minimum;
  }
  minima.n = n_rest;
}

int merge_minima(Minima& minima, double reach, Touch* touches) {
  const double tolerance = tolerance_hidden * reach;
  remove_hidden(minima, tolerance);
  Minima group;
  int n_touches = 0;
  while (minima.n > 0 && n_touches < max_touches) {
    take_group(minima, group);
    touches[n_touches++] = mean_touch(group.at.data(), group.n, reach, tolerance);
  }
  return n_touches;
}

}  // namespace

bool touch_analytic(const Surface& surface, Vec3 centre, double reach, Touch& touch) {
  switch (surface.kind) {
    case SurfaceKind::plane:
    case SurfaceKind::mirror: touch = touch_plane(surface, centre); break;
    case SurfaceKind::cylinder:
      if (is_clear_of_cylinder(surface, centre, reach)) return false;
      touch = touch_cylinder(surface, centre);
      break;
    case SurfaceKind::cone: touch = touch_cone(surface, centre); break;
    case SurfaceKind::disc: touch = touch_disc(surface, centre); break;
    case SurfaceKind::mesh: return false;
  }
  return touch.distance < reach;
}

int touch_mesh(const MeshView& mesh, std::span<const std::int32_t> triangles, Vec3 centre, double reach,
               Touch* touches) {
  Minima minima;
  for (const std::int32_t triangle : triangles) add_minimum_of_triangle(mesh, triangle, centre, reach, minima);
  if (minima.n > 1) return merge_minima(minima, reach, touches);
  if (minima.n == 1) touches[0] = minima.at[0];
  return minima.n;
}

Vec3 closest_point_on_triangle(Vec3 p, Vec3 a, Vec3 b, Vec3 c) {
  const std::array<Vec3, 3> corners = {a, b, c};
  const Vec3 normal = triangle_normal(a, b, c);
  Closest closest;
  if (normal == Vec3{}) {
    for (int k = 0; k < 3; ++k) {
      const Vec3 from = corners[static_cast<std::size_t>(k)];
      consider_edge(corners.data(), k, p - from, corners[static_cast<std::size_t>(next_of_three(k))] - from, p,
                    closest);
    }
  } else {
    closest = closest_on_triangle(corners.data(), normal, p, 0.0);
  }
  return closest.place == Place::face ? p - dot(normal, p - a) * normal : p - closest.offset;
}

double squared_distance_to_triangle(Vec3 p, const Vec3* corners, Vec3 normal) {
  const Closest closest = closest_on_triangle(corners, normal, p, 0.0);
  const double height = dot(normal, p - corners[0]);
  return closest.place == Place::face ? height * height : closest.squared_distance;
}

Vec3 triangle_normal(Vec3 a, Vec3 b, Vec3 c) {
  // The product of the two shorter edges loses least.
  const Vec3 ab = b - a, bc = c - b, ca = a - c;
  const double l_ab = squared_length(ab), l_bc = squared_length(bc), l_ca = squared_length(ca);
  const double longest = std::max({l_ab, l_bc, l_ca});
  const Vec3 n = l_ab == longest ? cross(bc, ca) : l_bc == longest ? cross(ca, ab) : cross(ab, bc);
  const double twice_area = length(n);
  return twice_area > degenerate_ratio * longest ? n / twice_area : Vec3{};
}

}  // namespace moraine
