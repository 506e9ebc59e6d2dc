// Surfaces that grains touch, as plain values, and where a sphere touches them.
//
// A wall of a scene is one or more surfaces (a box is six planes). A sphere touches an analytic surface at its closest point,
// once; it touches a mesh at every local minimum of the distance to it, minima of nearly the same direction being one contact
// (see touch_mesh).
#pragma once

#include <cstdint>
#include <span>

#include "kernels/base/vec3.hpp"

namespace moraine {

enum class SurfaceKind : std::uint8_t { plane, mirror, cylinder, cone, disc, mesh };

struct Surface {
  SurfaceKind kind = SurfaceKind::plane;
  std::int32_t wall = 0;        // index of the wall in the scene
  std::int32_t parameters = 0;  // reserved for the engine: offset of this wall's contact parameters
  Vec3 point;                   // plane: a point; cylinder, cone: centre of the base; disc: centre [m]
  Vec3 axis{0, 0, 1};           // plane, disc: unit normal; cylinder, cone: unit axis
  double radius_base = 0.0;     // cylinder: radius; cone: at the base; disc: outer radius [m]
  double radius_top = 0.0;      // cone: at the far end; disc: radius of the hole [m]
  double length = 0.0;          // cylinder, cone: along the axis; an infinite cylinder has no end on either side [m]
  std::int32_t mesh = -1;       // mesh: index of the mesh
};

/// A sphere's contact with a surface.
struct Touch {
  Vec3 normal;            // unit vector from the surface to the centre of the sphere
  double distance = 0.0;  // [m] from the surface to the centre; negative behind a plane
};

/// A sphere can touch one mesh in at most so many places at once; deeper ones win.
inline constexpr int max_touches = 8;

/// So many local minima of the distance are told apart before they are merged into touches; the nearest win. Only a sphere
/// that fits a finely meshed hollow almost exactly comes near it.
inline constexpr int max_minima = 64;

/// Minima whose normals have at least this dot product (30 degrees apart, and a little more, so that a circle of twelve
/// facets counts as smooth) are one touch of one smooth surface.
inline constexpr double smooth_cosine = 0.866;

/// A mesh prepared for contact. A corner is numbered 3 * triangle + k, k = 0, 1, 2; edge k runs from corner k to corner k + 1
/// (mod 3) of its triangle and has the number of its first corner.
///
/// The rings hold the connectivity: following one from any member leads through every corner (edge) at the same place and back
/// to the start. An open edge is a ring of its own; an edge of three or more triangles is as good as any other.
struct MeshView {
  const Vec3* corners = nullptr;              // [m] three a triangle
  const Vec3* normals = nullptr;              // unit normal of each triangle
  const std::int32_t* edge_ring = nullptr;    // next edge with the same two ends, three a triangle
  const std::int32_t* corner_ring = nullptr;  // next corner at the same vertex, three a triangle
};

/// The touch of a sphere of that centre with an analytic surface (not a mesh): the point of the surface nearest to the centre.
/// True where its distance is less than `reach` [m]: the radius for a contact, radius + skin for a candidate. Planes push along
/// their normal from behind, too. Where every direction is as good (a centre on an axis or on the surface) one is chosen, always
/// the same: on a cylinder, cone or rim towards the axis, on a disc along its normal.
bool touch_analytic(const Surface& surface, Vec3 centre, double reach, Touch& touch);

/// Touches of a sphere with a mesh, given candidate triangles in ascending order: all of the mesh nearer than `reach` at least;
/// more change nothing. Writes at most max_touches, the nearest first, and returns their number.
///
/// A minimum of the distance is a point of the mesh nearer to the centre than all points of the mesh around it: the foot of the
/// perpendicular inside a triangle, or a point of an edge or vertex from which no triangle around it leads nearer. A minimum
/// that lies on or behind the tangent plane of a nearer one is hidden by that one. Those left with nearly the same normal
/// (smooth_cosine) are one touch, their mean:
///   normal ~ sum w_i n_i,   overlap = sum w_i o_i / sum w_i,   w_i = o_i s_i,   o_i = reach - d_i,
/// where the share s_i falls from 1 (as near as the nearest) to 0 (in the tangent plane of a nearer one, the place where a foot
/// leaves its triangle across a hollow edge), so that normal and overlap are continuous as a sphere rolls over facets.
int touch_mesh(const MeshView& mesh, std::span<const std::int32_t> triangles, Vec3 centre, double reach,
               Touch* touches);

/// Triangles whose height is less than this part of their longest edge are lines: their normal would be mostly round-off.
inline constexpr double degenerate_ratio = 1e-9;

/// Unit normal of the triangle, right-handed about (a, b, c); zero if it is degenerate.
Vec3 triangle_normal(Vec3 a, Vec3 b, Vec3 c);

/// The point of the triangle (a, b, c) closest to p (compare Ericson 2005, Real-Time Collision Detection, 5.1.5). For degenerate
/// triangles the closest point of their edges.
Vec3 closest_point_on_triangle(Vec3 p, Vec3 a, Vec3 b, Vec3 c);

/// Square of the distance [m2] from p to a triangle of three corners whose unit normal is known.
double squared_distance_to_triangle(Vec3 p, const Vec3* corners, Vec3 normal);

}  // namespace moraine
