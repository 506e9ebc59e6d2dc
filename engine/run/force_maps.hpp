// What grains do to each triangle of mesh walls, added up from step to step: the force maps of snapshots.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "comm/world.hpp"
#include "engine/contacts/wall_contacts.hpp"
#include "engine/run/image.hpp"
#include "engine/scene/scene.hpp"
#include "engine/walls/walls.hpp"
#include "kernels/base/wide_sum.hpp"

namespace moraine {

class ForceMaps {
 public:
  ForceMaps(const Scene& scene, const Walls& walls);
  bool empty() const { return maps_.empty(); }

  /// One step: what this rank's grains have done to triangles, in any order.
  void add(std::span<const std::vector<TriangleForce>> forces);
  /// Forgets all steps.
  void begin();

  /// Means over the steps so far, where the walls are now. All ranks; the same on all.
  std::vector<WallMap> maps(const World& world, const Walls& walls) const;

  /// To and from the accumulators of a checkpoint; what is not there, or of another mesh, begins anew. All ranks.
  void keep(const World& world, std::map<std::string, std::vector<double>>& accumulators) const;
  void restore(const World& world, const std::map<std::string, std::vector<double>>& accumulators);

  std::size_t memory() const;

 private:
  enum Sum : std::size_t { force, normal = force + 3, tangential, n_sums };
  struct OfWall {
    std::string name;
    std::int32_t surface = 0, mesh = 0;
    std::int32_t n_triangles = 0;
    std::uint64_t n_steps = 0;
    std::vector<WideSum> sums;  // n_sums a triangle, of this rank
  };
  static std::vector<WideSum> total(const World& world, const OfWall& wall);

  std::vector<OfWall> maps_;
  std::vector<int> map_of_;  // of each surface, or -1
};

}  // namespace moraine
