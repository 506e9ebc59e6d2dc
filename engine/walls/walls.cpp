#include "engine/walls/walls.hpp"

#include <algorithm>
#include <cmath>

#include "engine/walls/wall_extent.hpp"

namespace moraine {

namespace {

bool is_finite(Vec3 v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

Surface make_plane(Vec3 point, Vec3 normal, bool is_mirror) {
  Surface surface;
  surface.kind = is_mirror ? SurfaceKind::mirror : SurfaceKind::plane;
  surface.point = surface.centre = point;
  surface.axis = normal;
  return surface;
}

Surface make_round(SurfaceKind kind, Vec3 point, Vec3 axis, double radius_base, double radius_top, double length) {
  Surface surface;
  surface.kind = kind;
  surface.point = surface.centre = point;
  surface.axis = axis;
  surface.radius_base = radius_base;
  surface.radius_top = radius_top;
  surface.length = length;
  return surface;
}

}  // namespace

/// Turns the walls of a scene into surfaces and collects what is wrong with them.
class Walls::Builder {
 public:
  Builder(const Scene& scene, Walls& walls) : walls_(walls) {
    for (wall_ = 0; wall_ < scene.walls.size(); ++wall_) {
      definition_ = &scene.walls[wall_];
      std::visit([this](const auto& shape) { add(shape); }, definition_->shape);
    }
    if (!problems_.empty()) throw SceneError(problems_);
  }

 private:
  void add(const PlaneShape& plane) {
    if (!expect(is_finite(plane.point), "plane.point", "expected three finite coordinates [m]")) return;
    if (!has_direction(plane.normal, "plane.normal")) return;
    add_surface(make_plane(plane.point, normalized(plane.normal), definition_->symmetry));
  }

  void add(const BoxShape& shape) {
    if (!is_no_mirror()) return;
    const Vec3 low = shape.box.low, high = shape.box.high;
    const bool is_box = is_finite(low) && is_finite(high) && low.x < high.x && low.y < high.y && low.z < high.z;
    if (!expect(is_box, "box", "expected finite corners with low < high along x, y and z [m]")) return;
    for (int axis = 0; axis < 3; ++axis) {
      Vec3 inwards;
      inwards[axis] = 1.0;
      add_surface(make_plane(low, inwards, false), shape.box);
      add_surface(make_plane(high, Vec3{} - inwards, false), shape.box);
    }
  }

  void add(const CylinderShape& s) {
    if (!is_no_mirror() || !has_axis("cylinder", s.base, s.axis)) return;
    if (!expect(is_positive(s.radius), "cylinder.radius", "expected a radius > 0 [m]")) return;
    if (!expect(s.length > 0.0, "cylinder.length", "expected a length > 0 [m], or inf for a cylinder without ends"))
      return;
    add_surface(make_round(SurfaceKind::cylinder, s.base, normalized(s.axis), s.radius, s.radius, s.length));
  }

  void add(const ConeShape& s) {
    if (!is_no_mirror() || !has_axis("cone", s.base, s.axis)) return;
    const bool has_radii = s.radius_base >= 0.0 && s.radius_top >= 0.0 && is_positive(s.radius_base + s.radius_top);
    if (!expect(has_radii, "cone.radius_base", "expected radii >= 0 at both ends, one of them > 0 [m]")) return;
    if (!expect(is_positive(s.length), "cone.length", "expected a length > 0 [m]")) return;
    add_surface(make_round(SurfaceKind::cone, s.base, normalized(s.axis), s.radius_base, s.radius_top, s.length));
  }

  void add(const DiscShape& s) {
    if (!is_no_mirror()) return;
    if (!expect(is_finite(s.centre), "disc.centre", "expected three finite coordinates [m]")) return;
    if (!has_direction(s.normal, "disc.normal")) return;
    if (!expect(is_positive(s.radius), "disc.radius", "expected a radius > 0 [m]")) return;
    const bool has_hole = s.hole_radius >= 0.0 && s.hole_radius < s.radius;
    if (!expect(has_hole, "disc.hole_radius", "expected 0 <= hole_radius < radius [m]")) return;
    add_surface(make_round(SurfaceKind::disc, s.centre, normalized(s.normal), s.radius, s.hole_radius, 0.0));
  }

  void add(const MeshShape& shape) {
    if (!is_no_mirror()) return;
    MeshSurvey found = survey(shape.mesh);
    const std::string file = shape.file.empty() ? "the mesh" : "'" + shape.file + "'";
    if (!expect(found.report.n_not_finite == 0, "mesh", file + " has broken corners:\n" + found.report.text)) return;
    const std::string details = found.report.text.empty() ? "" : ":\n" + found.report.text;
    if (!expect(found.report.n_usable() > 0, "mesh", file + " has no usable triangle" + details)) return;
    Surface surface;
    surface.kind = SurfaceKind::mesh;
    surface.mesh = static_cast<std::int32_t>(walls_.meshes_.size());
    walls_.meshes_.emplace_back(shape.mesh, found);
    found.report.wall = static_cast<std::int32_t>(wall_);
    walls_.reports_.push_back(std::move(found.report));
    const Box& extent = walls_.meshes_.back().extent();
    surface.point = surface.centre = 0.5 * (extent.low + extent.high);
    add_surface(surface);
  }

  void add_surface(Surface surface, std::optional<Box> bounds = std::nullopt) {
    surface.wall = static_cast<std::int32_t>(wall_);
    walls_.surfaces_.push_back(surface);
    walls_.from_.push_back(definition_->from);
    walls_.until_.push_back(definition_->until);
    walls_.bounds_.push_back(bounds);
  }

  static bool is_positive(double x) { return x > 0.0 && std::isfinite(x); }

  bool is_no_mirror() { return expect(!definition_->symmetry, "symmetry", "only a plane can be a mirror"); }

  bool has_axis(const std::string& shape, Vec3 base, Vec3 axis) {
    return expect(is_finite(base), shape + ".base", "expected three finite coordinates [m]") &&
           has_direction(axis, shape + ".axis");
  }

  bool has_direction(Vec3 v, const std::string& key) {
    const double size = length(v);
    return expect(size > 0.0 && std::isfinite(size), key, "expected a direction, found a vector without one");
  }

  /// Notes a problem of the present wall unless all is well.
  bool expect(bool is_well, const std::string& key, const std::string& message) {
    if (is_well) return true;
    const std::string name = definition_->name.empty() ? "" : "wall '" + definition_->name + "': ";
    problems_.push_back({"wall[" + std::to_string(wall_) + "]." + key, name + message});
    return false;
  }

  Walls& walls_;
  std::size_t wall_ = 0;
  const WallDefinition* definition_ = nullptr;
  std::vector<Problem> problems_;
};

Walls::Walls(const Scene& scene) { Builder(scene, *this); }

MeshView Walls::mesh(std::int32_t index) const { return meshes_[static_cast<std::size_t>(index)].view(); }

bool Walls::is_active(std::int32_t surface, double time) const {
  const auto s = static_cast<std::size_t>(surface);
  return from_[s] <= time && time < until_[s];
}

double Walls::next_change(double time) const {
  double next = infinity;
  for (const std::vector<double>* changes : {&from_, &until_})
    for (const double change : *changes)
      if (change > time) next = std::min(next, change);
  return next;
}

double Walls::area(std::int32_t wall, const Box& clip) const {
  double area = 0.0;
  for (std::size_t s = 0; s < surfaces_.size(); ++s) {
    const Surface& surface = surfaces_[s];
    if (surface.wall != wall) continue;
    if (surface.kind == SurfaceKind::mesh)
      area += meshes_[static_cast<std::size_t>(surface.mesh)].area(clip);
    else
      area += area_of(surface, bounds_[s] ? common_part(*bounds_[s], clip) : clip);
  }
  return area;
}

Box Walls::extent(std::int32_t wall, const Box& domain) const {
  Box extent = Box::empty();
  for (std::size_t s = 0; s < surfaces_.size(); ++s) {
    const Surface& surface = surfaces_[s];
    if (surface.wall != wall) continue;
    const Box part = surface.kind == SurfaceKind::mesh
                         ? common_part(meshes_[static_cast<std::size_t>(surface.mesh)].extent(), domain)
                         : extent_of(surface, bounds_[s] ? common_part(*bounds_[s], domain) : domain);
    if (part == Box::empty()) continue;
    extent.include(part.low);
    extent.include(part.high);
  }
  return extent;
}

void Walls::find_candidates(const double* records, std::int64_t stride, std::int32_t begin, std::int32_t end,
                            double reach, double time, WallCandidates& found) const {
  std::vector<std::int32_t> active;
  for (std::int32_t s = 0; s < static_cast<std::int32_t>(surfaces_.size()); ++s)
    if (is_active(s, time)) active.push_back(s);
  Touch touch;
  for (std::int32_t grain = begin; grain < end; ++grain) {
    const double* record = records + grain * stride;
    const Vec3 centre = {record[0], record[1], record[2]};
    const double near = record[3] + reach;
    for (const std::int32_t s : active) {
      const Surface& surface = surfaces_[static_cast<std::size_t>(s)];
      if (surface.kind != SurfaceKind::mesh) {
        if (touch_analytic(surface, centre, near, touch)) found.list.push_back({grain, s, 0, 0});
        continue;
      }
      const auto first = static_cast<std::int32_t>(found.triangles.size());
      meshes_[static_cast<std::size_t>(surface.mesh)].find(centre, near, found.triangles);
      const auto n = static_cast<std::int32_t>(found.triangles.size()) - first;
      if (n > 0) found.list.push_back({grain, s, first, n});
    }
  }
}

}  // namespace moraine
