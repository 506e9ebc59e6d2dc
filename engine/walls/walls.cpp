#include "engine/walls/walls.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/walls/wall_extent.hpp"

namespace moraine {

namespace {

bool is_finite(Vec3 v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

Surface make_plane(Vec3 point, Vec3 normal, bool is_mirror) {
  Surface surface;
  surface.kind = is_mirror ? SurfaceKind::mirror : SurfaceKind::plane;
  surface.point = point;
  surface.axis = normal;
  return surface;
}

Surface make_round(SurfaceKind kind, Vec3 point, Vec3 axis, double radius_base, double radius_top, double length) {
  Surface surface;
  surface.kind = kind;
  surface.point = point;
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
    surface.point = 0.5 * (extent.low + extent.high);
    add_surface(surface);
  }

  void add_surface(Surface surface, std::optional<Box> bounds = std::nullopt) {
    surface.wall = static_cast<std::int32_t>(wall_);
    walls_.home_.push_back(surface);
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

Walls::Walls(const Scene& scene) : domain_(scene.domain.box()) {
  Builder(scene, *this);
  for (const WallDefinition& wall : scene.walls) {
    Mover mover;
    mover.motions = wall.motion;
    mover.is_moving = !wall.motion.empty();
    if (wall.has(WallMotion::Kind::servo)) {
      mover.servo = static_cast<int>(servo_walls_.size());
      servo_walls_.push_back(static_cast<std::int32_t>(movers_.size()));
      servo_states_.emplace_back();
    }
    if (wall.has(WallMotion::Kind::script)) {
      mover.script = static_cast<int>(scripted_walls_.size());
      scripted_walls_.push_back(static_cast<std::int32_t>(movers_.size()));
      ScriptState& script = script_states_.emplace_back();
      script.origin = script.centre = wall.motion.front().origin;
    }
    is_any_moving_ = is_any_moving_ || mover.is_moving;
    movers_.push_back(std::move(mover));
  }
}

void Walls::move_to(double time, double dt) {
  if (!is_any_moving_) return;
  for (Mover& mover : movers_) {
    if (!mover.is_moving) continue;
    if (mover.script >= 0) {
      const ScriptState& script = script_states_[static_cast<std::size_t>(mover.script)];
      mover.before = std::exchange(mover.pose, script.pose);
      mover.now = {script.velocity, script.spin, script.centre};
      mover.late = {script.velocity, script.spin, script.centre - 0.5 * dt * script.velocity};
      continue;
    }
    const ServoState servo = mover.servo < 0 ? ServoState{} : servo_states_[static_cast<std::size_t>(mover.servo)];
    const WallState now = state_of(mover.motions, time, servo);
    mover.before = mover.pose;
    mover.pose = now.pose;
    mover.now = now.velocity;
    ServoState late = servo;
    late.place -= 0.5 * dt * late.speed;
    mover.late = time > 0.0 ? state_of(mover.motions, time - 0.5 * dt, late).velocity : now.velocity;
  }
  for (std::size_t s = 0; s < surfaces_.size(); ++s) {
    const Mover& mover = movers_[static_cast<std::size_t>(surfaces_[s].wall)];
    if (!mover.is_moving || surfaces_[s].kind == SurfaceKind::mesh) continue;
    surfaces_[s].point = mover.pose.to_world(home_[s].point);
    surfaces_[s].axis = mover.pose.turn(home_[s].axis);
  }
}

void Walls::give_rates(std::size_t number, const WallRates& rates, bool is_start) {
  ScriptState& script = script_states_[number];
  Mover& mover = movers_[static_cast<std::size_t>(scripted_walls_[number])];
  mover.now = {rates.velocity, rates.spin, script.centre};
  if (is_start) {
    mover.late = mover.now;
  } else {  // of the moment between two steps
    mover.now.velocity = 0.5 * (script.velocity + rates.velocity);
    mover.now.spin = 0.5 * (script.spin + rates.spin);
  }
  script.velocity = rates.velocity;
  script.spin = rates.spin;
}

void Walls::advance_scripts(double dt) {
  for (ScriptState& script : script_states_) script = advanced(script, dt);
}

double Walls::fastest_in_domain(std::size_t number, const WallRates& rates) const {
  // The velocity is linear in the place, so its size is largest at a corner.
  double most = 0.0;
  for (int k = 0; k < 8; ++k)
    most = std::max(most,
                    length(rates.velocity + cross(rates.spin, corner_of(domain_, k) - script_states_[number].centre)));
  return most;
}

double Walls::distance_come(std::size_t s, const Pose& from, const Pose& to) const {
  const Surface& surface = home_[s];
  double most = 0.0;
  if (surface.kind == SurfaceKind::mesh) {
    // What a point moves by is linear in its place at home: most at a corner of the mesh's box.
    const Box& box = meshes_[static_cast<std::size_t>(surface.mesh)].extent();
    for (int k = 0; k < 8; ++k)
      most = std::max(most, length(to.to_world(corner_of(box, k)) - from.to_world(corner_of(box, k))));
    return most;
  }
  const Vec3 old_point = from.to_world(surface.point), new_point = to.to_world(surface.point);
  const Vec3 old_axis = from.turn(surface.axis), new_axis = to.turn(surface.axis);
  if (surface.kind == SurfaceKind::plane) {
    // The distance from a plane is linear in the place: it changes most at a corner of the domain.
    for (int k = 0; k < 8; ++k) {
      const Vec3 x = corner_of(domain_, k);
      most = std::max(most, std::abs(dot(new_axis, x - new_point) - dot(old_axis, x - old_point)));
    }
    return most;
  }
  // A surface of revolution: its axis is moved, then tilted about its point; no part of it moves further than the tilt of the chord
  // times its distance from that point.
  const double radius = std::max(surface.radius_base, surface.radius_top);
  double extent = std::hypot(surface.length, radius);
  if (!std::isfinite(extent)) {
    extent = 0.0;
    for (int k = 0; k < 8; ++k) extent = std::max(extent, length(corner_of(domain_, k) - old_point) + radius);
  }
  return length(new_point - old_point) + extent * length(new_axis - old_axis);
}

double Walls::wander() const {
  double most = 0.0;
  for (std::size_t s = 0; is_any_moving_ && s < home_.size(); ++s) {
    const Mover& mover = movers_[static_cast<std::size_t>(home_[s].wall)];
    if (mover.is_moving) most = std::max(most, distance_come(s, mover.marked, mover.pose));
  }
  return most;
}

double Walls::last_wander() const {
  double most = 0.0;
  for (std::size_t s = 0; is_any_moving_ && s < home_.size(); ++s) {
    const Mover& mover = movers_[static_cast<std::size_t>(home_[s].wall)];
    if (mover.is_moving) most = std::max(most, distance_come(s, mover.before, mover.pose));
  }
  return most;
}

void Walls::mark() {
  for (Mover& mover : movers_) mover.marked = mover.pose;
}

const WallMotion& Walls::servo(std::size_t number) const {
  const std::vector<WallMotion>& motions = movers_[static_cast<std::size_t>(servo_walls_[number])].motions;
  return *std::find_if(motions.begin(), motions.end(),
                       [](const WallMotion& m) { return m.kind == WallMotion::Kind::servo; });
}

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
  for (std::size_t s = 0; s < home_.size(); ++s) {
    const Surface& surface = home_[s];
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
  for (std::size_t s = 0; s < home_.size(); ++s) {
    const Surface& surface = home_[s];
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
  // Grains that follow each other in memory lie near each other: what the ball around a few does not meet, none of them does.
  constexpr std::int32_t n_together = 16;
  std::vector<std::int32_t> met;
  for (std::int32_t first = begin; first < end; first += n_together) {
    const std::int32_t last = std::min(end, first + n_together);
    Box box = Box::empty();
    double largest = 0.0;
    for (std::int32_t grain = first; grain < last; ++grain) {
      const double* const record = records + grain * stride;
      if (record[0] == record[0]) box.include({record[0], record[1], record[2]});
      largest = std::max(largest, record[3]);
    }
    const Vec3 middle = 0.5 * (box.low + box.high);
    const double far = (0.5 * length(box.size()) + largest + reach) * (1.0 + 1e-9);
    Touch touch;
    met.clear();
    for (const std::int32_t s : active) {
      const Surface& surface = surfaces_[static_cast<std::size_t>(s)];
      if (surface.kind == SurfaceKind::mesh || touch_analytic(surface, middle, far, touch)) met.push_back(s);
    }
    for (std::int32_t grain = first; grain < last && !met.empty(); ++grain)
      find_candidates_of(grain, records + grain * stride, met, reach, found);
  }
}

void Walls::find_candidates_of(std::int32_t grain, const double* record, std::span<const std::int32_t> surfaces,
                               double reach, WallCandidates& found) const {
  const Vec3 centre = {record[0], record[1], record[2]};
  const double near = record[3] + reach;
  Touch touch;
  for (const std::int32_t s : surfaces) {
    const Surface& surface = surfaces_[static_cast<std::size_t>(s)];
    if (surface.kind != SurfaceKind::mesh) {
      if (touch_analytic(surface, centre, near, touch)) found.list.push_back({grain, s, 0, 0});
      continue;
    }
    const auto first = static_cast<std::int32_t>(found.triangles.size());
    const Mover& mover = movers_[static_cast<std::size_t>(surface.wall)];
    const Vec3 seen = mover.is_moving ? mover.pose.to_home(centre) : centre;
    meshes_[static_cast<std::size_t>(surface.mesh)].find(seen, near, found.triangles);
    const auto n = static_cast<std::int32_t>(found.triangles.size()) - first;
    if (n > 0) found.list.push_back({grain, s, first, n});
  }
}

}  // namespace moraine
