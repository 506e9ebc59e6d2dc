// The walls of a scene as surfaces, and which grains are near them.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/scene/scene.hpp"
#include "engine/walls/mesh_report.hpp"
#include "engine/walls/mesh_surface.hpp"
#include "kernels/base/box.hpp"
#include "kernels/search/surface.hpp"

namespace moraine {

/// A grain near a surface: it may touch it before the next rebuild.
struct WallCandidate {
  std::int32_t grain = 0;  // local index
  std::int32_t surface = 0;
  std::int32_t triangles = 0;  // mesh: first entry in WallCandidates::triangles
  std::int32_t n_triangles = 0;
};

/// Candidates in order of (grain, surface), triangles of each in ascending order.
struct WallCandidates {
  std::vector<WallCandidate> list;
  std::vector<std::int32_t> triangles;
};

class Walls {
 public:
  /// Builds the surfaces of all walls of the scene, in its order; a box is six planes (x low, x high, y low ...). Degenerate
  /// and duplicate triangles of meshes are left out. Throws SceneError with every shape that cannot be used.
  explicit Walls(const Scene& scene);

  std::span<const Surface> surfaces() const { return surfaces_; }
  MeshView mesh(std::int32_t index) const;
  /// What was found in the mesh of each mesh wall, in order of the walls; open edges (a hopper's two rims) are no error.
  const std::vector<MeshReport>& reports() const { return reports_; }
  /// True where the wall of the surface exists at that time [s].
  bool is_active(std::int32_t surface, double time) const;
  /// The next time after `time` at which a wall appears or vanishes [s]; infinity where there is none.
  double next_change(double time) const;
  /// Area of the part of a wall inside `clip` [m2], whose faces belong to it.
  double area(std::int32_t wall, const Box& clip) const;
  /// The part of a wall's bounding box inside `domain` [m]; Box::empty() where nothing of it is inside.
  Box extent(std::int32_t wall, const Box& domain) const;

  /// Appends to `found` the candidates of grains [begin, end) among active surfaces: those nearer than radius + reach.
  /// `records`: position and radius are the first four doubles of each grain's record of `stride` doubles.
  /// Thread-safe: each thread may search its own range into its own list.
  void find_candidates(const double* records, std::int64_t stride, std::int32_t begin, std::int32_t end, double reach,
                       double time, WallCandidates& found) const;

 private:
  class Builder;

  std::vector<Surface> surfaces_;
  std::vector<double> from_, until_;        // [s] of each surface
  std::vector<std::optional<Box>> bounds_;  // of each surface: that of its wall, where the shape is a box
  std::vector<MeshSurface> meshes_;
  std::vector<MeshReport> reports_;
};

}  // namespace moraine
