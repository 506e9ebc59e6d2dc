#include "io/export/wall_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

namespace moraine {

namespace {

constexpr int n_round = 64;  // corners of what stands for a circle

Vec3 corner(const Box& box, int i) {
  return {(i & 1) != 0 ? box.high.x : box.low.x, (i & 2) != 0 ? box.high.y : box.low.y,
          (i & 4) != 0 ? box.high.z : box.low.z};
}

std::array<Vec3, 2> across(Vec3 normal) {
  const Vec3 helper = std::abs(normal.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
  const Vec3 u = normalized(cross(normal, helper));
  return {u, cross(normal, u)};
}

std::vector<Vec3> circle(Vec3 centre, Vec3 axis, double radius) {
  const auto [u, v] = across(axis);
  std::vector<Vec3> points;
  for (int i = 0; i < n_round; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / n_round;
    points.push_back(centre + radius * (std::cos(angle) * u + std::sin(angle) * v));
  }
  return points;
}

/// Makes the triangles and lines of one wall.
struct Mesher {
  const Box& box;
  WallMesh& mesh;

  void outline(const std::vector<Vec3>& points) const {
    for (std::size_t i = 0; i < points.size(); ++i) mesh.lines.push_back({points[i], points[(i + 1) % points.size()]});
  }
  void polygon(const std::vector<Vec3>& points) const {
    for (std::size_t i = 1; i + 1 < points.size(); ++i) mesh.triangles.push_back({points[0], points[i], points[i + 1]});
    outline(points);
  }
  /// A strip between two rings of as many points.
  void strip(const std::vector<Vec3>& a, const std::vector<Vec3>& b) const {
    for (std::size_t i = 0; i < a.size(); ++i) {
      const std::size_t next = (i + 1) % a.size();
      mesh.triangles.push_back({a[i], a[next], b[next]});
      mesh.triangles.push_back({a[i], b[next], b[i]});
    }
    outline(a);
    outline(b);
  }
  void tube(Vec3 base, Vec3 direction, double radius_base, double radius_top, double far) const {
    const Vec3 axis = normalized(direction);
    strip(circle(base, axis, radius_base), circle(base + far * axis, axis, radius_top));
  }

  void operator()(const PlaneShape& shape) const { polygon(cut_polygon(shape, box)); }
  void operator()(const BoxShape& shape) const {
    for (int axis = 0; axis < 3; ++axis)
      for (const int side : {0, 1 << axis}) {
        std::vector<Vec3> points;
        for (const int i : {0, 1, 3, 2}) {
          const int low_bits = i & ((1 << axis) - 1), high_bits = (i >> axis) << (axis + 1);
          points.push_back(corner(shape.box, low_bits | high_bits | side));
        }
        polygon(points);
      }
  }
  void operator()(const CylinderShape& shape) const {
    if (std::isfinite(shape.length)) {
      tube(shape.base, shape.axis, shape.radius, shape.radius, shape.length);
      return;
    }
    // from where the axis enters the box to where it leaves it
    const Vec3 axis = normalized(shape.axis);
    double low = infinity, high = -infinity;
    for (int i = 0; i < 8; ++i) {
      const double along = dot(corner(box, i) - shape.base, axis);
      low = std::min(low, along);
      high = std::max(high, along);
    }
    low = std::max(low, 0.0);
    if (low < high) tube(shape.base + low * axis, axis, shape.radius, shape.radius, high - low);
  }
  void operator()(const ConeShape& shape) const {
    tube(shape.base, shape.axis, shape.radius_base, shape.radius_top, shape.length);
  }
  void operator()(const DiscShape& shape) const {
    const Vec3 normal = normalized(shape.normal);
    const std::vector<Vec3> rim = circle(shape.centre, normal, shape.radius);
    if (shape.hole_radius > 0.0)
      strip(circle(shape.centre, normal, shape.hole_radius), rim);
    else
      polygon(rim);
  }
  void operator()(const MeshShape& shape) const {
    const auto vertex = [&](std::int32_t i) { return shape.mesh.vertices[static_cast<std::size_t>(i)]; };
    for (const auto& t : shape.mesh.triangles) mesh.triangles.push_back({vertex(t[0]), vertex(t[1]), vertex(t[2])});
    for (const auto& [a, b] : sharp_edges(shape.mesh)) mesh.lines.push_back({vertex(a), vertex(b)});
  }
};

}  // namespace

std::vector<WallMesh> wall_meshes(const std::vector<WallDefinition>& walls, const Box& box) {
  const Box clip = box.grown(1e-6 * length(box.size()));  // so that planes on its faces are cut by it
  std::vector<WallMesh> meshes;
  for (const WallDefinition& wall : walls) {
    if (wall.symmetry) continue;
    meshes.push_back({wall.name, wall.from, wall.until, {}, {}});
    std::visit(Mesher{clip, meshes.back()}, wall.shape);
  }
  return meshes;
}

std::vector<Vec3> cut_polygon(const PlaneShape& plane, const Box& box) {
  std::vector<Vec3> points;
  const Vec3 normal = normalized(plane.normal);
  for (int i = 0; i < 8; ++i)
    for (int axis = 0; axis < 3; ++axis) {
      const int j = i | (1 << axis);
      if (i == j) continue;
      const Vec3 a = corner(box, i), b = corner(box, j);
      const double da = dot(a - plane.point, normal), db = dot(b - plane.point, normal);
      if ((da <= 0.0) == (db <= 0.0) && da != 0.0) continue;
      points.push_back(da == db ? a : a + (da / (da - db)) * (b - a));
      if (da == 0.0 && db == 0.0) points.push_back(b);
    }
  if (points.size() < 3) return {};
  Vec3 middle;
  for (const Vec3 p : points) middle += p / static_cast<double>(points.size());
  const auto [u, v] = across(normal);
  std::sort(points.begin(), points.end(), [&, u = u, v = v](Vec3 a, Vec3 b) {
    return std::atan2(dot(a - middle, v), dot(a - middle, u)) < std::atan2(dot(b - middle, v), dot(b - middle, u));
  });
  return points;
}

std::vector<std::pair<std::int32_t, std::int32_t>> sharp_edges(const TriangleMesh& mesh) {
  std::map<std::pair<std::int32_t, std::int32_t>, std::vector<Vec3>> normals;  // of the triangles on each edge
  for (const auto& t : mesh.triangles) {
    const auto vertex = [&](std::size_t i) { return mesh.vertices[static_cast<std::size_t>(t[i % 3])]; };
    const Vec3 normal = cross(vertex(1) - vertex(0), vertex(2) - vertex(0));
    if (squared_length(normal) == 0.0) continue;
    for (std::size_t i = 0; i < 3; ++i) normals[std::minmax(t[i], t[(i + 1) % 3])].push_back(normalized(normal));
  }
  std::vector<std::pair<std::int32_t, std::int32_t>> edges;
  for (const auto& [edge, sides] : normals)
    if (sides.size() != 2 || std::abs(dot(sides[0], sides[1])) < 0.866) edges.push_back(edge);
  return edges;
}

}  // namespace moraine
