// Where grains leave a scene.
#pragma once

#include <optional>
#include <vector>

#include "engine/scene/scene.hpp"
#include "engine/walls/mesh_surface.hpp"

namespace moraine {

class Outlets {
 public:
  explicit Outlets(const Scene& scene);

  /// True where grains may leave inside the domain, so that all of them must be asked.
  bool are_inside() const { return are_inside_; }
  /// The first outlet, by number, that takes a grain whose centre has come from `before` to `now` in the step that ends at `time` [s]
  /// and began at `begin`; -1 where none does. Depends on nothing else.
  int taking(Vec3 before, Vec3 now, double begin, double time) const;

 private:
  bool takes(std::size_t outlet, Vec3 before, Vec3 now) const;
  bool crosses_mesh(const MeshSurface& mesh, Vec3 before, Vec3 now) const;

  Box domain_;
  std::vector<Outlet> outlets_;                     // meshes left out
  std::vector<std::optional<MeshSurface>> meshes_;  // of each outlet
  bool are_inside_ = false;
};

}  // namespace moraine
