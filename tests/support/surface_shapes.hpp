// Meshes and random numbers for the tests of surfaces and walls.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <vector>

#include "engine/scene/scene.hpp"
#include "engine/walls/mesh_surface.hpp"
#include "kernels/base/random.hpp"

namespace moraine::shapes {

/// Reproducible random numbers.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : seed_(seed) {}
  double uniform(double low, double high) {
    return low + (high - low) * random_uniform(seed_, n_++, RandomPurpose::choice);
  }
  Vec3 point(Vec3 low, Vec3 high) { return {uniform(low.x, high.x), uniform(low.y, high.y), uniform(low.z, high.z)}; }
  Vec3 direction() {
    const double z = uniform(-1, 1), angle = uniform(0, 2 * std::numbers::pi), r = std::sqrt(1 - z * z);
    return {r * std::cos(angle), r * std::sin(angle), z};
  }
  int index(int n) { return static_cast<int>(uniform(0, n)); }

 private:
  std::uint64_t seed_;
  std::uint64_t n_ = 0;
};

/// Right-handed orthonormal frame.
struct Frame {
  Vec3 origin, x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
  Vec3 place(Vec3 p) const { return origin + p.x * x + p.y * y + p.z * z; }
  Vec3 turn(Vec3 v) const { return v.x * x + v.y * y + v.z * z; }
};

inline Frame random_frame(Dice& dice) {
  Frame frame;
  frame.origin = dice.point({-1, -1, -1}, {1, 1, 1});
  frame.z = dice.direction();
  frame.x = normalized(cross(frame.z, dice.direction()));
  frame.y = cross(frame.z, frame.x);
  return frame;
}

inline void place(TriangleMesh& mesh, const Frame& frame) {
  for (Vec3& v : mesh.vertices) v = frame.place(v);
}

/// A sheet of n_u x n_v quadrilaterals of two triangles over the unit square, bent by `f`. Closed in u: the last column of
/// vertices is the first.
inline TriangleMesh sheet(int n_u, int n_v, bool is_closed, const std::function<Vec3(double u, double v)>& f) {
  TriangleMesh mesh;
  const int columns = is_closed ? n_u : n_u + 1;
  for (int j = 0; j <= n_v; ++j)
    for (int i = 0; i < columns; ++i)
      mesh.vertices.push_back(f(static_cast<double>(i) / n_u, static_cast<double>(j) / n_v));
  const auto at = [&](int i, int j) { return static_cast<std::int32_t>(j * columns + i % columns); };
  for (int j = 0; j < n_v; ++j)
    for (int i = 0; i < n_u; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return mesh;
}

/// The square [-1, 1]^2 in z = 0, of 2 n^2 triangles; vertices inside are displaced in the plane by up to `jitter` of a third
/// of the spacing.
inline TriangleMesh plane_mesh(int n, double jitter, Dice& dice) {
  return sheet(n, n, false, [&](double u, double v) {
    const bool is_inside = u > 0 && u < 1 && v > 0 && v < 1;
    const double shift = is_inside ? jitter * 2.0 / n / 3.0 : 0.0;
    return Vec3{2 * u - 1 + shift * dice.uniform(-1, 1), 2 * v - 1 + shift * dice.uniform(-1, 1), 0.0};
  });
}

/// Lateral surface of a cone (or cylinder) of n facets about z, from z = 0 to z = length, of n_v rows.
inline TriangleMesh cone_mesh(int n, int n_v, double radius_base, double radius_top, double length) {
  return sheet(n, n_v, true, [=](double u, double v) {
    const double angle = 2 * std::numbers::pi * u, r = radius_base + v * (radius_top - radius_base);
    return Vec3{r * std::cos(angle), r * std::sin(angle), v * length};
  });
}

/// The box [low, high] as 12 triangles times n^2, closed, normals outwards. Vertices of the six faces are listed apart.
inline TriangleMesh box_mesh(Vec3 low, Vec3 high, int n = 1) {
  TriangleMesh mesh;
  for (int axis = 0; axis < 3; ++axis)
    for (int side = 0; side < 2; ++side) {
      const int a = (axis + 1) % 3, b = (axis + 2) % 3;
      const TriangleMesh face = sheet(n, n, false, [&](double u, double v) {
        Vec3 p;
        p[axis] = side ? high[axis] : low[axis];
        p[a] = low[a] + (side ? u : v) * (high[a] - low[a]);
        p[b] = low[b] + (side ? v : u) * (high[b] - low[b]);
        return p;
      });
      const auto first = static_cast<std::int32_t>(mesh.vertices.size());
      mesh.vertices.insert(mesh.vertices.end(), face.vertices.begin(), face.vertices.end());
      for (const auto& t : face.triangles) mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    }
  return mesh;
}

inline MeshSurface make_surface(const TriangleMesh& mesh) { return MeshSurface(mesh, survey(mesh)); }

/// All touches of a sphere with a mesh, by way of the search for candidates.
inline std::vector<Touch> touches(const MeshSurface& mesh, Vec3 centre, double reach) {
  std::vector<std::int32_t> near;
  mesh.find(centre, reach, near);
  std::vector<Touch> found(max_touches);
  found.resize(static_cast<std::size_t>(touch_mesh(mesh.view(), near, centre, reach, found.data())));
  return found;
}

}  // namespace moraine::shapes
