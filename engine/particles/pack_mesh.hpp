// A triangle mesh as an obstacle for spheres that are being placed: the point of it closest to a centre, found through
// a grid.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "engine/scene/scene.hpp"

namespace moraine {

class MeshObstacle {
 public:
  explicit MeshObstacle(const TriangleMesh& mesh);
  /// From the closest point of the mesh to p, where it is closer than `reach` [m].
  std::optional<Vec3> from_closest(Vec3 p, double reach) const;

 private:
  struct Triangle {
    Vec3 a, b, c;
  };
  struct CellRange {
    std::array<int, 3> first{}, last{};
  };
  CellRange cells_around(const Box& box) const;
  std::size_t cell_number(int i, int j, int k) const;
  bool comes_near(const Triangle& triangle, int i, int j, int k) const;
  /// Calls visit(cell) for every cell of a range.
  template <class Visit>
  void each_cell(const CellRange& range, Visit&& visit) const;

  std::vector<Triangle> triangles_;
  Box box_;
  std::array<int, 3> n_ = {1, 1, 1};
  Vec3 edge_{1, 1, 1};  // [m] of a cell
  std::vector<std::vector<std::int32_t>> cells_;
};

}  // namespace moraine
