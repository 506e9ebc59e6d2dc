#include "engine/openings/outlets.hpp"

#include "engine/openings/places.hpp"
#include "engine/walls/mesh_report.hpp"

namespace moraine {

namespace {

/// Whether the way from a to b passes through the disc: strictly from one side to the other, or onto it.
bool crosses_disc(const DiscShape& disc, Vec3 a, Vec3 b) {
  const Vec3 normal = normalized(disc.normal);
  const double from = dot(normal, a - disc.centre), to = dot(normal, b - disc.centre);
  if (from == to || (from > 0.0) == (to > 0.0)) return false;
  const Vec3 place = a + (from / (from - to)) * (b - a) - disc.centre;
  const double radius = length(place - dot(normal, place) * normal);
  return radius <= disc.radius && radius >= disc.hole_radius;
}

/// The same for a triangle (Moller & Trumbore 1997, J. Graphics Tools 2, 21), by signed volumes.
bool crosses_triangle(const Vec3* corners, Vec3 a, Vec3 b) {
  const auto volume = [](Vec3 p, Vec3 q, Vec3 r, Vec3 s) { return dot(cross(q - p, r - p), s - p); };
  const double from = volume(corners[0], corners[1], corners[2], a);
  const double to = volume(corners[0], corners[1], corners[2], b);
  if (from == to || (from > 0.0) == (to > 0.0)) return false;
  const double u = volume(a, b, corners[0], corners[1]);
  const double v = volume(a, b, corners[1], corners[2]);
  const double w = volume(a, b, corners[2], corners[0]);
  return (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
}

}  // namespace

Outlets::Outlets(const Scene& scene) : domain_(scene.domain.box()) {
  for (const Outlet& outlet : scene.outlets) {
    are_inside_ = are_inside_ || !std::holds_alternative<int>(outlet.where);
    outlets_.push_back(outlet);
    meshes_.emplace_back();
    if (auto* shape = std::get_if<MeshShape>(&outlets_.back().where)) {
      const MeshSurvey found = survey(shape->mesh);
      if (found.report.n_not_finite > 0 || found.report.n_usable() == 0)
        throw SceneError(
            {{"outlet", "outlet '" + outlet.name + "': its mesh cannot be used:\n" + found.report.text, false}});
      meshes_.back().emplace(shape->mesh, found);
      shape->mesh = {};
    }
  }
}

int Outlets::taking(Vec3 before, Vec3 now, double begin, double time) const {
  for (std::size_t k = 0; k < outlets_.size(); ++k) {
    const Outlet& outlet = outlets_[k];
    const bool is_open =
        outlet.is_once ? begin < outlet.from && outlet.from <= time : outlet.from <= time && time < outlet.until;
    if (is_open && takes(k, before, now)) return static_cast<int>(k);
  }
  return -1;
}

bool Outlets::takes(std::size_t k, Vec3 before, Vec3 now) const {
  const auto& where = outlets_[k].where;
  if (const int* face = std::get_if<int>(&where)) {
    const int axis = *face / 2;
    return *face % 2 == 0 ? now[axis] < domain_.low[axis] : now[axis] >= domain_.high[axis];
  }
  if (const auto* box = std::get_if<Box>(&where)) return box->contains(now);
  if (const auto* cylinder = std::get_if<CylinderRegion>(&where)) return contains(*cylinder, now);
  if (const auto* sphere = std::get_if<SphereRegion>(&where)) return contains(*sphere, now);
  if (const auto* plane = std::get_if<PlaneShape>(&where)) return dot(plane->normal, now - plane->point) < 0.0;
  if (const auto* disc = std::get_if<DiscShape>(&where)) return crosses_disc(*disc, before, now);
  return crosses_mesh(*meshes_[k], before, now);
}

bool Outlets::crosses_mesh(const MeshSurface& mesh, Vec3 before, Vec3 now) const {
  std::vector<std::int32_t> near;
  const Vec3 middle = 0.5 * (before + now);
  const double reach = 0.5 * length(now - before) * (1.0 + 1e-9);
  if (!(reach > 0.0)) return false;
  mesh.find(middle, reach, near);
  for (const std::int32_t triangle : near)
    if (crosses_triangle(mesh.view().corners + 3 * std::ptrdiff_t{triangle}, before, now)) return true;
  return false;
}

}  // namespace moraine
