#include "engine/particles/pack_container.hpp"

#include <fmt/format.h>

#include <numbers>
#include <type_traits>

namespace moraine {
namespace {

template <class... Ts>
struct Overloaded : Ts... {
  using Ts::operator()...;
};
template <class... Ts>
Overloaded(Ts...) -> Overloaded<Ts...>;

/// The component of v across an axis.
Vec3 across(Vec3 v, int axis) {
  v[axis] = 0.0;
  return v;
}

/// The unit vector along v, or some fixed direction where v is zero.
Vec3 direction_of(Vec3 v, double size, Vec3 otherwise) { return size > 0.0 ? v / size : otherwise; }

Surface plane(Vec3 point, Vec3 normal) {
  Surface surface;
  surface.kind = SurfaceKind::plane;
  surface.point = point;
  surface.axis = normalized(normal);
  return surface;
}

}  // namespace

Box bounds(const Region& region) {
  return std::visit(Overloaded{[](const BoxRegion& r) { return r.box; },
                               [](const CylinderRegion& r) {
                                 Box box{r.base, r.base};
                                 for (int k = 0; k < 3; ++k) {
                                   box.low[k] -= k == r.axis ? 0.0 : r.radius;
                                   box.high[k] += k == r.axis ? r.length : r.radius;
                                 }
                                 return box;
                               },
                               [](const SphereRegion& r) {
                                 return Box{r.centre, r.centre}.grown(r.radius);
                               }},
                    region);
}

double volume(const Region& region) {
  constexpr double pi = std::numbers::pi;
  return std::visit(Overloaded{[](const BoxRegion& r) { return r.box.volume(); },
                               [](const CylinderRegion& r) { return pi * r.radius * r.radius * r.length; },
                               [](const SphereRegion& r) { return 4.0 / 3.0 * pi * r.radius * r.radius * r.radius; }},
                    region);
}

std::string describe(const Region& region) {
  return std::visit(
      Overloaded{[](const BoxRegion& r) {
                   return fmt::format("a box of {:g} x {:g} x {:g} m", r.box.size().x, r.box.size().y, r.box.size().z);
                 },
                 [](const CylinderRegion& r) {
                   return fmt::format("a cylinder of radius {:g} m and length {:g} m", r.radius, r.length);
                 },
                 [](const SphereRegion& r) { return fmt::format("a sphere of radius {:g} m", r.radius); }},
      region);
}

Container::Container(const Scene& scene, const Region& region) : region_(region) {
  space_.box = scene.domain.box();
  space_.periodic = scene.domain.periodic;
  space_.is_flat = scene.domain.dimensions == 2;
  space_.plane = 0.5 * (scene.domain.low.z + scene.domain.high.z);
  if (space_.is_flat) space_.periodic[2] = false;  // all centres at one z: nothing to wrap
  std::visit([this](auto& shape) { cut(shape); }, region_);
  extent_ = bounds(region_);
  for (int k = 0; k < 3; ++k) {
    extent_.low[k] = std::max(extent_.low[k], space_.box.low[k]);
    extent_.high[k] = std::min(extent_.high[k], space_.box.high[k]);
  }
  if (space_.is_flat) extent_.low.z = extent_.high.z = space_.plane;
  for (const WallDefinition& wall : scene.walls)
    if (wall.from <= 0.0 && wall.until > 0.0) add_wall(wall);
}

void Container::cut_axis(int axis, double& low, double& high) {
  const auto k = static_cast<std::size_t>(axis);
  const double from = space_.box.low[axis], to = space_.box.high[axis];
  if (space_.is_flat && axis == 2) {
    is_endless_[k] = true;
    return;
  }
  const double rounding = 1e-9 * (to - from);
  is_endless_[k] = space_.periodic[k] && low <= from + rounding && high >= to - rounding;
  low = is_endless_[k] ? from : std::max(low, from);
  high = is_endless_[k] ? to : std::min(high, to);
  if (is_endless_[k]) return;
  bound_below(axis, low);
  bound_above(axis, high);
}

void Container::bound_below(int axis, double low) { faces_.push_back({axis, low, 1.0}); }
void Container::bound_above(int axis, double high) { faces_.push_back({axis, high, -1.0}); }

void Container::cut(BoxRegion& r) {
  for (int k = 0; k < 3; ++k) cut_axis(k, r.box.low[k], r.box.high[k]);
}

void Container::cut(CylinderRegion& r) {
  for (int k = 0; k < 3; ++k) {
    double low = k == r.axis ? r.base[k] : r.base[k] - r.radius;
    double high = k == r.axis ? r.base[k] + r.length : r.base[k] + r.radius;
    cut_axis(k, low, high);
    if (k != r.axis) continue;
    r.base[k] = low;
    r.length = high - low;
  }
}

void Container::cut(SphereRegion& r) {
  for (int k = 0; k < 3; ++k) {
    double low = r.centre[k] - r.radius, high = r.centre[k] + r.radius;
    cut_axis(k, low, high);
  }
}

void Container::add_plane(Vec3 point, Vec3 normal) {
  // Lids above and below a two-dimensional scene cannot push its grains anywhere.
  if (space_.is_flat && length(across(normal, 2)) < 1e-6 * length(normal)) return;
  walls_.push_back(plane(point, normal));
}

void Container::add_wall(const WallDefinition& wall) {
  std::visit(Overloaded{[&](const PlaneShape& s) { add_plane(s.point, s.normal); },
                        [&](const BoxShape& s) {
                          for (int k = 0; k < 3; ++k) {
                            Vec3 normal;
                            normal[k] = 1.0;
                            add_plane(s.box.low, normal);
                            add_plane(s.box.high, -normal);
                          }
                        },
                        [&](const CylinderShape& s) {
                          Surface surface;
                          surface.kind = SurfaceKind::cylinder;
                          surface.point = s.base;
                          surface.axis = normalized(s.axis);
                          surface.radius_base = surface.radius_top = s.radius;
                          surface.length = s.length;
                          walls_.push_back(surface);
                        },
                        [&](const ConeShape& s) {
                          Surface surface;
                          surface.kind = SurfaceKind::cone;
                          surface.point = s.base;
                          surface.axis = normalized(s.axis);
                          surface.radius_base = s.radius_base;
                          surface.radius_top = s.radius_top;
                          surface.length = s.length;
                          walls_.push_back(surface);
                        },
                        [&](const DiscShape& s) {
                          Surface surface;
                          surface.kind = SurfaceKind::disc;
                          surface.point = s.centre;
                          surface.axis = normalized(s.normal);
                          surface.radius_base = s.radius;
                          surface.radius_top = s.hole_radius;
                          walls_.push_back(surface);
                        },
                        [&](const MeshShape& s) { meshes_.emplace_back(s.mesh); }},
             wall.shape);
}

template <class Visit>
void Container::visit_bounds(Vec3 centre, double radius, Visit&& visit) const {
  for (const AxisBound& face : faces_) {
    const double gap = face.sign * (centre[face.axis] - face.place);
    if (gap >= radius) continue;
    Vec3 inward;
    inward[face.axis] = face.sign;
    visit(gap, inward);
  }
  if (const auto* r = std::get_if<CylinderRegion>(&region_)) {
    const Vec3 from_axis = across(centre - r->base, r->axis);
    const double distance = length(from_axis);
    if (r->radius - distance < radius)
      visit(r->radius - distance, -direction_of(from_axis, distance, across({1, 1, 1}, r->axis)));
  } else if (const auto* s = std::get_if<SphereRegion>(&region_)) {
    const Vec3 from_centre = centre - s->centre;
    const double distance = length(from_centre);
    if (s->radius - distance < radius) visit(s->radius - distance, -direction_of(from_centre, distance, {1, 0, 0}));
  }
  Touch touch;
  for (const Surface& wall : walls_)
    if (touch_analytic(wall, centre, radius, touch)) visit(touch.distance, touch.normal);
  for (const MeshObstacle& mesh : meshes_)
    if (const std::optional<Vec3> away = mesh.from_closest(centre, radius)) {
      const double distance = length(*away);
      visit(distance, direction_of(*away, distance, {0, 0, 1}));
    }
}

bool Container::fits(Vec3 centre, double radius) const {
  bool is_clear = true;
  visit_bounds(centre, radius, [&](double, Vec3) { is_clear = false; });
  return is_clear;
}

Vec3 Container::push(Vec3 centre, double radius, double& deepest) const {
  Vec3 sum;
  visit_bounds(centre, radius, [&](double gap, Vec3 inward) {
    deepest = std::max(deepest, radius - gap);
    sum += (radius - gap) * inward;
  });
  return sum;
}

}  // namespace moraine
