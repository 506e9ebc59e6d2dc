// A triangle mesh prepared for contact: usable triangles, their connectivity, and a tree to find those near a grain.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/scene/scene.hpp"
#include "engine/walls/mesh_report.hpp"
#include "kernels/base/box.hpp"
#include "kernels/search/surface.hpp"

namespace moraine {

class MeshSurface {
 public:
  /// Takes the usable triangles of a mesh, in its order.
  MeshSurface(const TriangleMesh& mesh, const MeshSurvey& survey);

  MeshView view() const { return {corners_.data(), normals_.data(), edge_ring_.data(), corner_ring_.data()}; }
  std::int32_t n_triangles() const { return static_cast<std::int32_t>(normals_.size()); }
  const Box& extent() const { return extent_; }  // [m]
  double area(const Box& clip) const;            // [m2] of the part inside

  /// Appends the triangles nearer to the centre than reach [m], in ascending order. Thread-safe.
  void find(Vec3 centre, double reach, std::vector<std::int32_t>& found) const;

 private:
  // Node of a bounding-box tree, depth first: a node's first child follows it, `next` is the node after its last descendant.
  struct Node {
    Box box;
    std::int32_t next = 0;
    std::int32_t first = 0;  // leaf: its triangles are leaf_triangles_[first, first + n_triangles)
    std::int32_t n_triangles = 0;
  };

  void take_triangles(const TriangleMesh& mesh, const MeshSurvey& survey);
  void link(const MeshSurvey& survey);
  void build_tree();
  void build_node(const std::vector<Box>& boxes, std::int32_t begin, std::int32_t end);

  std::vector<Vec3> corners_;              // three per triangle
  std::vector<Vec3> normals_;              // one per triangle
  std::vector<std::int32_t> edge_ring_;    // three per triangle, see MeshView
  std::vector<std::int32_t> corner_ring_;  // three per triangle, see MeshView
  std::vector<Node> nodes_;
  std::vector<std::int32_t> leaf_triangles_;
  Box extent_ = Box::empty();
};

}  // namespace moraine
