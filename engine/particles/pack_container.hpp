// Where grains may lie: inside a region of space, inside the domain, and clear of the scene's walls.
#pragma once

#include <string>
#include <vector>

#include "engine/particles/pack_cells.hpp"
#include "engine/particles/pack_mesh.hpp"
#include "engine/scene/scene.hpp"
#include "kernels/search/surface.hpp"

namespace moraine {

/// The bounding box of a region [m].
Box bounds(const Region& region);
/// Volume of a region [m3].
double volume(const Region& region);
/// A region in words, for messages.
std::string describe(const Region& region);

/// A region, cut by the domain and by the scene's walls, as constraints on a sphere.
///
/// A region that spans the domain in a periodic direction (from face to face, or beyond) is endless there: only its
/// other sides bound it. Walls count that stand at the start: planes (and boxes) as half-spaces, other shapes and
/// meshes as surfaces with two sides.
class Container {
 public:
  Container(const Scene& scene, const Region& region);

  const PackSpace& space() const { return space_; }
  const Region& region() const { return region_; }  // cut off at the faces of the domain where it is a box or cylinder
  const Box& extent() const { return extent_; }     // [m] bounding box of the places for centres
  bool is_endless(int axis) const { return is_endless_[static_cast<std::size_t>(axis)]; }

  /// True where a sphere lies inside, clear of everything.
  bool fits(Vec3 centre, double radius) const;
  /// The sum over everything the sphere cuts of the depth [m] times the direction out of it; adds to `deepest` [m].
  Vec3 push(Vec3 centre, double radius, double& deepest) const;

 private:
  /// Calls visit(gap, inward) for every bound whose surface is closer to the centre than the radius.
  template <class Visit>
  void visit_bounds(Vec3 centre, double radius, Visit&& visit) const;
  void cut(BoxRegion& region);
  void cut(CylinderRegion& region);
  void cut(SphereRegion& region);
  void cut_axis(int axis, double& low, double& high);
  void bound_below(int axis, double low);
  void bound_above(int axis, double high);
  void add_wall(const WallDefinition& wall);
  void add_plane(Vec3 point, Vec3 normal);

  struct AxisBound {
    int axis = 0;
    double place = 0.0;  // [m]
    double sign = 1.0;   // +1: grains lie above
  };
  PackSpace space_;
  Region region_;
  Box extent_;
  std::array<bool, 3> is_endless_ = {false, false, false};
  std::vector<AxisBound> faces_;
  std::vector<Surface> walls_;
  std::vector<MeshObstacle> meshes_;
};

}  // namespace moraine
