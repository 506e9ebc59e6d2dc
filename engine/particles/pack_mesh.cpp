#include "engine/particles/pack_mesh.hpp"

#include <algorithm>
#include <cmath>

#include "kernels/search/surface.hpp"

namespace moraine {

template <class Visit>
void MeshObstacle::each_cell(const CellRange& range, Visit&& visit) const {
  for (int k = range.first[2]; k <= range.last[2]; ++k)
    for (int j = range.first[1]; j <= range.last[1]; ++j)
      for (int i = range.first[0]; i <= range.last[0]; ++i) visit(i, j, k);
}

MeshObstacle::MeshObstacle(const TriangleMesh& mesh) : box_(Box::empty()) {
  for (const Vec3 vertex : mesh.vertices) box_.include(vertex);
  for (const auto& corners : mesh.triangles) {
    const auto at = [&](std::size_t k) { return mesh.vertices[static_cast<std::size_t>(corners[k])]; };
    triangles_.push_back({at(0), at(1), at(2)});
  }
  if (triangles_.empty()) return;
  // About four cells a triangle, as nearly cubes as the box allows; a surface meets few of them.
  box_ = box_.grown(1e-6 * length(box_.size()));
  const Vec3 size = box_.size();
  const double longest = std::max({size.x, size.y, size.z});
  const double wanted = std::clamp(std::cbrt(4.0 * static_cast<double>(triangles_.size())), 4.0, 128.0);
  for (int k = 0; k < 3; ++k) {
    n_[static_cast<std::size_t>(k)] = std::max(1, static_cast<int>(std::ceil(wanted * size[k] / longest)));
    edge_[k] = size[k] / n_[static_cast<std::size_t>(k)];
  }
  cells_.resize(static_cast<std::size_t>(n_[0]) * static_cast<std::size_t>(n_[1]) * static_cast<std::size_t>(n_[2]));
  for (std::size_t t = 0; t < triangles_.size(); ++t) {
    Box around = Box::empty();
    around.include(triangles_[t].a);
    around.include(triangles_[t].b);
    around.include(triangles_[t].c);
    each_cell(cells_around(around), [&](int i, int j, int k) {
      if (comes_near(triangles_[t], i, j, k)) cells_[cell_number(i, j, k)].push_back(static_cast<std::int32_t>(t));
    });
  }
}

MeshObstacle::CellRange MeshObstacle::cells_around(const Box& box) const {
  CellRange range;
  for (int k = 0; k < 3; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    const double last = n_[axis] - 1;
    range.first[axis] =
        static_cast<int>(std::clamp(std::floor((box.low[k] - box_.low[k]) / edge_[k] - 1e-6), 0.0, last));
    range.last[axis] =
        static_cast<int>(std::clamp(std::floor((box.high[k] - box_.low[k]) / edge_[k] + 1e-6), 0.0, last));
  }
  return range;
}

std::size_t MeshObstacle::cell_number(int i, int j, int k) const {
  return (static_cast<std::size_t>(k) * static_cast<std::size_t>(n_[1]) + static_cast<std::size_t>(j)) *
             static_cast<std::size_t>(n_[0]) +
         static_cast<std::size_t>(i);
}

bool MeshObstacle::comes_near(const Triangle& triangle, int i, int j, int k) const {
  const Vec3 middle = box_.low + Vec3{(i + 0.5) * edge_.x, (j + 0.5) * edge_.y, (k + 0.5) * edge_.z};
  const Vec3 closest = closest_point_on_triangle(middle, triangle.a, triangle.b, triangle.c);
  return length(closest - middle) <= 0.5 * length(edge_) * (1.0 + 1e-6);
}

std::optional<Vec3> MeshObstacle::from_closest(Vec3 p, double reach) const {
  const Box around = Box{p, p}.grown(reach);
  for (int k = 0; k < 3; ++k)
    if (triangles_.empty() || around.low[k] > box_.high[k] || around.high[k] < box_.low[k]) return std::nullopt;
  double nearest = reach * reach;
  std::optional<Vec3> found;
  each_cell(cells_around(around), [&](int i, int j, int k) {
    for (const std::int32_t t : cells_[cell_number(i, j, k)]) {
      const Triangle& triangle = triangles_[static_cast<std::size_t>(t)];
      const Vec3 d = p - closest_point_on_triangle(p, triangle.a, triangle.b, triangle.c);
      if (squared_length(d) >= nearest) continue;
      nearest = squared_length(d);
      found = d;
    }
  });
  return found;
}

}  // namespace moraine
