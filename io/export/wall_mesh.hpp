// Walls as triangles and lines, for those who draw them.
#pragma once

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "engine/scene/scene.hpp"

namespace moraine {

struct WallMesh {
  std::string name;
  double from = 0.0, until = infinity;         // [s] when it is there
  std::vector<std::array<Vec3, 3>> triangles;  // [m]
  std::vector<std::array<Vec3, 2>> lines;      // [m] rims and sharp edges
};

/// The walls of a scene, but for its mirrors; planes and endless cylinders are cut by the box.
std::vector<WallMesh> wall_meshes(const std::vector<WallDefinition>& walls, const Box& box);

/// The polygon in which a plane cuts a box, its corners in order around it; empty where it does not.
std::vector<Vec3> cut_polygon(const PlaneShape& plane, const Box& box);

/// Rims of a mesh, and edges where its surface turns by more than 30 degrees, as pairs of vertices.
std::vector<std::pair<std::int32_t, std::int32_t>> sharp_edges(const TriangleMesh& mesh);

}  // namespace moraine
