#include "io/export/povray_walls.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "io/export/wall_mesh.hpp"

namespace moraine {

namespace {

constexpr double line_share = 0.0012;  // thickness of lines over the size of the picture's box

Vec3 corner(const Box& box, int i) {
  return {(i & 1) != 0 ? box.high.x : box.low.x, (i & 2) != 0 ? box.high.y : box.low.y,
          (i & 4) != 0 ? box.high.z : box.low.z};
}

Vec3 clamped(Vec3 p, const Box& box) {
  return {std::clamp(p.x, box.low.x, box.high.x), std::clamp(p.y, box.low.y, box.high.y),
          std::clamp(p.z, box.low.z, box.high.z)};
}

std::string triangle_mesh(const std::vector<Vec3>& vertices, const std::vector<std::array<std::int32_t, 3>>& triangles,
                          const char* texture) {
  std::string text = fmt::format("mesh2 {{\n vertex_vectors {{ {}", vertices.size());
  for (const Vec3 v : vertices) text += ",\n  " + povray_vector(v);
  text += fmt::format("\n }}\n face_indices {{ {}", triangles.size());
  for (const auto& t : triangles) text += fmt::format(",\n  <{},{},{}>", t[0], t[1], t[2]);
  return text + fmt::format("\n }}\n texture {{ {} }} no_shadow\n}}\n", texture);
}

std::string line(Vec3 a, Vec3 b, double radius) {
  if (squared_length(b - a) == 0.0) return {};
  return fmt::format("cylinder {{ {}, {}, {:.6g} texture {{ edge }} no_shadow }}\n", povray_vector(a), povray_vector(b),
                     radius);
}

class WallWriter {
 public:
  WallWriter(const Box& frame, const Camera& camera)
      // A little larger than the frame, so that planes on its faces are cut by it.
      : frame_(frame),
        clip_(frame.grown(1e-6 * length(frame.size()))),
        camera_(camera),
        radius_(line_share * length(frame.size())) {}

  std::string operator()(const PlaneShape& plane) const {
    const std::vector<Vec3> points = cut_polygon(plane, clip_);
    if (points.empty()) return {};
    std::string text;
    for (std::size_t i = 0; i < points.size(); ++i) text += line(points[i], points[(i + 1) % points.size()], radius_);
    if (!faces_camera(points[0], plane.normal)) return text;  // seen from behind it would hide the grains
    std::vector<std::array<std::int32_t, 3>> triangles;
    for (std::int32_t i = 1; i + 1 < static_cast<std::int32_t>(points.size()); ++i) triangles.push_back({0, i, i + 1});
    return text + triangle_mesh(points, triangles, "wall");
  }

  std::string operator()(const BoxShape& shape) const {
    const Box box{clamped(shape.box.low, clip_), clamped(shape.box.high, clip_)};
    std::string text = povray_edges(box, radius_, "edge");
    for (int axis = 0; axis < 3; ++axis)
      for (const bool is_high : {false, true}) text += box_face(box, axis, is_high);
    return text;
  }

  std::string operator()(const CylinderShape& shape) const {
    const double far = std::isfinite(shape.length) ? shape.length : 2.0 * length(frame_.size());
    return tube(shape.base, shape.axis, shape.radius, shape.radius, far);
  }

  std::string operator()(const ConeShape& shape) const {
    return tube(shape.base, shape.axis, shape.radius_base, shape.radius_top, shape.length);
  }

  std::string operator()(const DiscShape& shape) const {
    return fmt::format("disc {{ {}, {}, {:.9g}, {:.9g} texture {{ wall }} no_shadow }}\n", povray_vector(shape.centre),
                       povray_vector(normalized(shape.normal)), shape.radius, shape.hole_radius);
  }

  std::string operator()(const MeshShape& shape) const {
    return triangle_mesh(shape.mesh.vertices, shape.mesh.triangles, "glass_wall") + edges_of(shape.mesh);
  }

 private:
  std::string edges_of(const TriangleMesh& mesh) const {
    std::string text;
    for (const auto& [a, b] : sharp_edges(mesh))
      text += line(mesh.vertices[static_cast<std::size_t>(a)], mesh.vertices[static_cast<std::size_t>(b)], radius_);
    return text;
  }

  bool faces_camera(Vec3 point, Vec3 normal) const {
    return dot(camera_.is_parallel ? -camera_.ahead : camera_.place - point, normal) > 0.0;
  }

  std::string box_face(const Box& box, int axis, bool is_high) const {
    std::vector<Vec3> points;
    for (const int i : {0, 1, 3, 2}) {
      const int low_bits = i & ((1 << axis) - 1), high_bits = (i >> axis) << (axis + 1);
      points.push_back(corner(box, low_bits | high_bits | (is_high ? 1 << axis : 0)));
    }
    Vec3 inward;
    inward[axis] = is_high ? -1.0 : 1.0;
    return faces_camera(points[0], inward) ? triangle_mesh(points, {{0, 1, 2}, {0, 2, 3}}, "wall") : std::string();
  }

  std::string ring(Vec3 centre, Vec3 axis, double radius) const {
    if (radius <= 0.0 || !clip_.grown(radius).contains(centre)) return {};
    std::string text;
    const Vec3 helper = std::abs(axis.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
    const Vec3 u = normalized(cross(axis, helper)), v = cross(axis, u);
    constexpr int n = 96;
    const auto at = [&](int i) {
      const double angle = 2.0 * 3.14159265358979323846 * i / n;
      return centre + radius * (std::cos(angle) * u + std::sin(angle) * v);
    };
    for (int i = 0; i < n; ++i) text += line(at(i), at(i + 1), radius_);
    return text;
  }

  std::string tube(Vec3 base, Vec3 direction, double radius_base, double radius_top, double far) const {
    const Vec3 axis = normalized(direction), top = base + far * axis;
    const double least = 1e-9 * length(frame_.size());  // POV-Ray refuses cones with two points, and bad radii
    return fmt::format(
               "cone {{ {}, {:.9g}, {}, {:.9g} open texture {{ glass_wall }} no_shadow clipped_by {{ box {{ {}, {} }} "
               "}} }}\n",
               povray_vector(base), std::max(radius_base, least), povray_vector(top), std::max(radius_top, 0.0),
               povray_vector(clip_.grown(radius_).low), povray_vector(clip_.grown(radius_).high)) +
           ring(base, axis, radius_base) + ring(top, axis, radius_top);
  }

  Box frame_, clip_;
  const Camera& camera_;
  double radius_;
};

Vec3 vector_at(const std::vector<double>& numbers, std::size_t i) {
  return {numbers[i], numbers[i + 1], numbers[i + 2]};
}

/// A shape as another place has it; a box becomes its faces where it is turned.
class Mover {
 public:
  explicit Mover(const std::vector<double>& n)
      : rows_{vector_at(n, 0), vector_at(n, 3), vector_at(n, 6)}, shift_(vector_at(n, 9)) {}
  using Shape = decltype(WallDefinition::shape);
  Shape operator()(const PlaneShape& s) const { return PlaneShape{place(s.point), turn(s.normal)}; }
  Shape operator()(const CylinderShape& s) const {
    return CylinderShape{place(s.base), turn(s.axis), s.radius, s.length};
  }
  Shape operator()(const ConeShape& s) const {
    return ConeShape{place(s.base), turn(s.axis), s.radius_base, s.radius_top, s.length};
  }
  Shape operator()(const DiscShape& s) const {
    return DiscShape{place(s.centre), turn(s.normal), s.radius, s.hole_radius};
  }
  Shape operator()(MeshShape s) const {
    for (Vec3& vertex : s.mesh.vertices) vertex = place(vertex);
    return s;
  }
  Shape operator()(const BoxShape& s) const {
    if (turn({1, 0, 0}) == Vec3{1, 0, 0} && turn({0, 1, 0}) == Vec3{0, 1, 0})
      return BoxShape{{s.box.low + shift_, s.box.high + shift_}};
    MeshShape faces;
    for (int i = 0; i < 8; ++i) faces.mesh.vertices.push_back(place(corner(s.box, i)));
    faces.mesh.triangles = {{0, 1, 3}, {0, 3, 2}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                            {2, 3, 7}, {2, 7, 6}, {0, 2, 6}, {0, 6, 4}, {1, 3, 7}, {1, 7, 5}};
    return faces;
  }

 private:
  Vec3 turn(Vec3 v) const { return {dot(rows_[0], v), dot(rows_[1], v), dot(rows_[2], v)}; }
  Vec3 place(Vec3 v) const { return turn(v) + shift_; }
  std::array<Vec3, 3> rows_;
  Vec3 shift_;
};

}  // namespace

std::vector<WallDefinition> moved_walls(std::vector<WallDefinition> walls, const Image& image) {
  for (WallDefinition& wall : walls) {
    const auto pose = image.accumulators.find(pose_name(wall.name));
    if (pose != image.accumulators.end() && pose->second.size() == 12)
      wall.shape = std::visit(Mover(pose->second), wall.shape);
  }
  return walls;
}

std::string povray_vector(Vec3 v) { return fmt::format("<{:.9g},{:.9g},{:.9g}>", v.x, v.y, v.z); }

std::string povray_edges(const Box& box, double radius, const std::string& texture) {
  std::string text;
  for (int i = 0; i < 8; ++i)
    for (int axis = 0; axis < 3; ++axis)
      if ((i & (1 << axis)) == 0 && squared_length(corner(box, i | (1 << axis)) - corner(box, i)) > 0.0)
        text += fmt::format("cylinder {{ {}, {}, {:.6g} texture {{ {} }} no_shadow }}\n", povray_vector(corner(box, i)),
                            povray_vector(corner(box, i | (1 << axis))), radius, texture);
  return text;
}

std::string povray_walls(const std::vector<WallDefinition>& walls, const Box& frame, const Camera& camera,
                         double time) {
  const WallWriter writer(frame, camera);
  std::string text;
  for (const WallDefinition& wall : walls) {
    if (wall.symmetry || time < wall.from || time >= wall.until) continue;
    text += "// wall " + wall.name + '\n' + std::visit(writer, wall.shape);
  }
  return text;
}

}  // namespace moraine
