// Walls and probes.
#include <algorithm>

#include "engine/scene/checks.hpp"

namespace moraine::checks {

namespace {

/// A direction that can be made a unit vector.
void check_direction(const std::string& key, Vec3 direction, Findings& found) {
  if (!found.finite(key, direction, "-")) return;
  const double norm = length(direction);
  if (!(norm > 0.0 && std::isfinite(norm)))
    found.error(key, "is {}; expected a direction, which has a length", text(direction));
}

void check_shape(const PlaneShape& plane, const std::string& key, const Domain&, Findings& found) {
  found.finite(key + ".plane.point", plane.point, "m");
  check_direction(key + ".plane.normal", plane.normal, found);
}

void check_shape(const BoxShape& box, const std::string& key, const Domain&, Findings& found) {
  found.box(key + ".box", box.box);
}

void check_shape(const CylinderShape& cylinder, const std::string& key, const Domain&, Findings& found) {
  found.finite(key + ".cylinder.base", cylinder.base, "m");
  check_direction(key + ".cylinder.axis", cylinder.axis, found);
  found.positive(key + ".cylinder.radius", cylinder.radius, "m");
  if (cylinder.length != infinity) found.positive(key + ".cylinder.length", cylinder.length, "m");
}

void check_shape(const ConeShape& cone, const std::string& key, const Domain&, Findings& found) {
  found.finite(key + ".cone.base", cone.base, "m");
  check_direction(key + ".cone.axis", cone.axis, found);
  const bool has_base = found.not_negative(key + ".cone.radius_base", cone.radius_base, "m");
  const bool has_top = found.not_negative(key + ".cone.radius_top", cone.radius_top, "m");
  if (has_base && has_top && cone.radius_base == 0.0 && cone.radius_top == 0.0)
    found.error(key + ".cone.radius_base", "and radius_top are both 0; at least one must be greater than 0 [m]");
  found.positive(key + ".cone.length", cone.length, "m");
}

void check_shape(const DiscShape& disc, const std::string& key, const Domain&, Findings& found) {
  found.finite(key + ".disc.centre", disc.centre, "m");
  check_direction(key + ".disc.normal", disc.normal, found);
  const bool has_radius = found.positive(key + ".disc.radius", disc.radius, "m");
  if (found.not_negative(key + ".disc.hole_radius", disc.hole_radius, "m") && has_radius &&
      disc.hole_radius >= disc.radius)
    found.error(key + ".disc.hole_radius", "is {}; expected less than radius = {} [m]", disc.hole_radius, disc.radius);
}

void check_shape(const MeshShape& shape, const std::string& key, const Domain& domain, Findings& found) {
  const TriangleMesh& mesh = shape.mesh;
  if (mesh.triangles.empty()) {
    found.error(key + ".mesh", "has no triangles{}", shape.file.empty() ? "" : " (" + shape.file + ")");
    return;
  }
  const auto n = static_cast<std::int64_t>(mesh.vertices.size());
  const auto is_bad = [n](const std::array<std::int32_t, 3>& t) {
    return std::any_of(t.begin(), t.end(), [n](std::int32_t corner) { return corner < 0 || corner >= n; });
  };
  if (const auto bad = std::find_if(mesh.triangles.begin(), mesh.triangles.end(), is_bad);
      bad != mesh.triangles.end()) {
    found.error(key + ".mesh", "triangle {} names a vertex that does not exist; the mesh has {} vertices",
                bad - mesh.triangles.begin(), n);
    return;
  }
  Box extent = Box::empty();
  for (const Vec3 vertex : mesh.vertices) extent.include(vertex);
  if (is_usable(domain) && !meets(extent, domain.box()))
    found.warning(key + ".mesh",
                  "reaches from {} m, nowhere inside the domain, {} m; mesh files often are in millimetres: "
                  "scale = 0.001",
                  text(extent), text(domain.box()));
}

/// Times of a schedule in order, all of it numbers.
template <std::size_t n>
void check_schedule(const std::vector<std::array<double, n>>& schedule, const std::string& key, Findings& found) {
  for (std::size_t i = 0; i < schedule.size(); ++i) {
    const std::string row = fmt::format("{}[{}]", key, i);
    for (std::size_t k = 0; k < n; ++k)
      if (!found.finite(fmt::format("{}[{}]", row, k), schedule[i][k], k == 0 ? "s" : "-")) return;
    if (i > 0 && schedule[i][0] < schedule[i - 1][0])
      found.error(row + "[0]", "is {}; expected at least {}, the time before [s]", schedule[i][0], schedule[i - 1][0]);
    if (i > 0 && n == 4 && schedule[i][0] == schedule[i - 1][0])
      found.error(row + "[0]", "is {}, as the time before: a wall cannot be in two places [s]", schedule[i][0]);
  }
}

void check_servo(const WallMotion& m, const std::string& key, Findings& found) {
  if (m.force.has_value() == m.torque.has_value())
    found.error(key, "has {}; a servo needs exactly one of force and torque",
                m.force ? "force and torque" : "neither force nor torque");
  if (m.force) found.finite(key + ".force", *m.force, "N");
  if (m.torque) found.finite(key + ".torque", *m.torque, "N m");
  found.positive(key + ".gain", m.gain, m.torque ? "rad/(s N m)" : "m/(s N)");
  found.positive(key + ".max_speed", m.max_speed, m.torque ? "rad/s" : "m/s");
  found.not_negative(key + ".mass", m.mass, m.torque ? "kg m2" : "kg");
}

/// A scripted wall has one motion: whatever else it is to do, its function can say.
void check_script(const WallDefinition& wall, const WallMotion& m, const std::string& key, Findings& found) {
  found.finite(key + ".origin", m.origin, "m");
  if (!(m.max_speed > 0.0) || !std::isfinite(m.max_speed))
    found.error(
        key + ".max_speed",
        "is {}; a wall that a script moves needs a speed > 0 that no point of it in the domain ever exceeds [m/s]",
        m.max_speed);
  if (wall.motion.size() > 1)
    found.error(key, "is not the only motion of its wall; what a script moves is moved by it alone");
  if (wall.name.empty()) found.error(key, "moves a wall without a name; the script that moves it needs one");
}

void check_motion(const WallMotion& m, const std::string& key, Findings& found) {
  using Kind = WallMotion::Kind;
  if (m.kind != Kind::translate && m.kind != Kind::script) check_direction(key + ".axis", m.axis, found);
  if (m.turns()) found.finite(key + ".origin", m.origin, "m");
  check_schedule(m.ramp, key + ".ramp", found);
  check_schedule(m.places, key + ".places", found);
  check_schedule(m.angles, key + ".angles", found);
  if (m.kind == Kind::translate) {
    found.finite(key + ".velocity", m.velocity, "m/s");
    if (!m.places.empty() && (m.velocity != Vec3{} || !m.ramp.empty()))
      found.error(key + ".places", "goes without velocity and ramp: it says where the wall is at any time");
  }
  if (m.kind == Kind::rotate) {
    found.finite(key + ".speed", m.speed, "rad/s");
    if (!m.angles.empty() && (m.speed != 0.0 || !m.ramp.empty()))
      found.error(key + ".angles", "goes without speed and ramp: it says how far the wall has turned at any time");
  }
  if (m.kind == Kind::vibrate || m.kind == Kind::swing) {
    found.finite(key + ".amplitude", m.amplitude, m.kind == Kind::vibrate ? "m" : "rad");
    found.not_negative(key + ".frequency", m.frequency, "Hz");
    found.finite(key + ".phase", m.phase, "rad");
  }
  if (m.kind == Kind::servo) check_servo(m, key, found);
}

void check_motions(const Scene& scene, const WallDefinition& wall, const std::string& key, Findings& found) {
  int n_servos = 0;
  for (std::size_t m = 0; m < wall.motion.size(); ++m) {
    const std::string name = fmt::format("{}.motion[{}]", key, m);
    check_motion(wall.motion[m], name, found);
    if (wall.motion[m].kind == WallMotion::Kind::script) check_script(wall, wall.motion[m], name, found);
    n_servos += wall.motion[m].kind == WallMotion::Kind::servo ? 1 : 0;
    if (n_servos > 1) found.error(name, "is a second servo; a wall can have one");
    const bool leaves_plane = wall.motion[m].turns() && (wall.motion[m].axis.x != 0.0 || wall.motion[m].axis.y != 0.0);
    if (scene.domain.dimensions == 2 && leaves_plane)
      found.error(name + ".axis", "is {}; in two dimensions walls turn about \"z\"", text(wall.motion[m].axis));
  }
  if (!wall.motion.empty() && wall.symmetry)
    found.error(key + ".motion", "does not go with symmetry: a mirror stays where it is");
}

void check_mixing(const Scene& scene, const Probe& probe, const std::string& key, Findings& found) {
  std::vector<std::string> names;
  for (const Material& material : scene.materials) names.push_back(material.name);
  if (probe.material.empty())
    found.error(key + ".material", "missing: kind = \"mixing\" needs the name of a material; materials: {}",
                listing(names));
  else if (scene.material_index(probe.material) < 0)
    found.error(key + ".material", "\"{}\" is not a material{}", probe.material, nearest(probe.material, names));
}

void check_probe_kind(const Scene& scene, const Probe& probe, const std::string& key, Findings& found) {
  using Kind = Probe::Kind;
  const bool needs_wall = probe.kind == Kind::wall_force || probe.kind == Kind::wall_pressure;
  const bool has_bins = probe.kind == Kind::wall_pressure || probe.kind == Kind::profile || probe.kind == Kind::mixing;
  if (needs_wall) {
    std::vector<std::string> names;
    for (const WallDefinition& wall : scene.walls) names.push_back(wall.name);
    if (std::find(names.begin(), names.end(), probe.wall) == names.end()) {
      if (probe.wall.empty())
        found.error(key + ".wall", "missing: kind = \"{}\" needs the name of a wall; walls: {}", name_of(probe.kind),
                    listing(names));
      else
        found.error(key + ".wall", "\"{}\" is not a wall{}; walls: {}", probe.wall, nearest(probe.wall, names),
                    listing(names));
    }
  }
  if (has_bins && probe.bins < 1) found.error(key + ".bins", "is {}; expected 1 or more", probe.bins);
  if (has_bins && (probe.axis < 0 || probe.axis > 2))
    found.error(key + ".axis", "is {}; expected x, y or z (0, 1 or 2)", probe.axis);
  const bool has_region = probe.kind == Kind::region || probe.kind == Kind::profile ||
                          probe.kind == Kind::gas_profile || probe.kind == Kind::mixing || probe.kind == Kind::fields;
  if (probe.kind == Kind::mixing) check_mixing(scene, probe, key, found);
  if (has_region && found.box(key + ".region", probe.region) && is_usable(scene.domain) &&
      !meets(probe.region, scene.domain.box()))
    found.error(key + ".region", "reaches from {} m, nowhere inside the domain, {} m", text(probe.region),
                text(scene.domain.box()));
  if (probe.by_material && probe.kind != Kind::region && probe.kind != Kind::profile && probe.kind != Kind::fields)
    found.error(key + ".by_material", "is true; it goes with kind \"region\", \"profile\" and \"fields\"");
  if (probe.kind == Kind::energy && !scene.output.energy)
    found.error(key + ".kind", "\"energy\" needs the ledger: set output.energy = true");
}

void check_points(const Scene& scene, const Probe& probe, const std::string& key, Findings& found) {
  if (probe.points.empty()) found.error(key + ".points", "missing: kind = \"pressure\" needs at least one point [m]");
  const Box domain = scene.domain.box();
  for (std::size_t i = 0; i < probe.points.size(); ++i) {
    const Vec3 p = probe.points[i];
    const std::string name = fmt::format("{}.points[{}]", key, i);
    if (!found.finite(name, p, "m") || !is_usable(scene.domain)) continue;
    for (int axis = 0; axis < 3; ++axis) {
      if (p[axis] >= domain.low[axis] && p[axis] <= domain.high[axis]) continue;
      found.error(name, "is {} m, outside the domain, {} m", text(p), text(domain));
      break;
    }
  }
}

void check_pressure_drop(const Scene& scene, const Probe& probe, const std::string& key, Findings& found) {
  const Domain& domain = scene.domain;
  if (!probe.between) {
    if (domain.periodic[static_cast<std::size_t>(probe.axis)])
      found.error(key + ".between", "missing: the domain is periodic along {}, so that it has no faces there",
                  axis_names[probe.axis]);
    return;
  }
  const auto [low, high] = *probe.between;
  if (!found.finite(key + ".between[0]", low, "m") || !found.finite(key + ".between[1]", high, "m")) return;
  if (!(low < high)) found.error(key + ".between[1]", "is {}; expected more than between[0] = {} [m]", high, low);
  if (is_usable(domain) && (low < domain.low[probe.axis] || high > domain.high[probe.axis]))
    found.error(key + ".between", "reaches from {} to {} m, beyond the domain, {} to {} m along {}", low, high,
                domain.low[probe.axis], domain.high[probe.axis], axis_names[probe.axis]);
}

/// Of the kinds that look at the gas, or at what it does to a bed.
void check_gas_probe(const Scene& scene, const Probe& probe, const std::string& key, Findings& found) {
  using Kind = Probe::Kind;
  if (needs_gas(probe.kind) && !scene.gas)
    found.error(key + ".kind", "\"{}\" looks at the gas, but the scene has none; add [gas]", name_of(probe.kind));
  const bool has_axis =
      probe.kind == Kind::pressure_drop || probe.kind == Kind::bed_height || probe.kind == Kind::gas_profile;
  if (has_axis && (probe.axis < 0 || probe.axis > 2)) {
    found.error(key + ".axis", "is {}; expected x, y or z (0, 1 or 2)", probe.axis);
    return;
  }
  if (has_axis && probe.axis == 2 && scene.domain.dimensions == 2)
    found.error(key + ".axis", "is \"z\", along which nothing happens in two dimensions; expected \"x\" or \"y\"");
  if (probe.kind == Kind::pressure) check_points(scene, probe, key, found);
  if (probe.kind == Kind::pressure_drop) check_pressure_drop(scene, probe, key, found);
  if (probe.kind == Kind::bed_height && !(probe.share > 0.0 && probe.share <= 1.0))
    found.error(key + ".share", "is {}; expected more than 0 and at most 1", probe.share);
  if (probe.kind == Kind::gas_profile || probe.kind == Kind::gas_mean)
    found.not_negative(key + ".from", probe.from, "s");
}

/// Coarse-grained fields.
void check_fields(const Scene& scene, const Probe& probe, const std::string& key, Findings& found) {
  constexpr int most_width = 8;
  constexpr std::int64_t most_cells = std::int64_t{1} << 30;
  double n_cells = 1.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::string name = fmt::format("{}.cells[{}]", key, axis);
    if (probe.cells[axis] < 1) {
      if (probe.cells == std::array<int, 3>{})
        found.error(key + ".cells", "missing: kind = \"fields\" needs the numbers of cells along x, y and z");
      else
        found.error(name, "is {}; expected 1 or more", probe.cells[axis]);
      return;
    }
    n_cells *= probe.cells[axis];
  }
  if (n_cells > static_cast<double>(most_cells))
    found.error(key + ".cells", "are {} in all; expected at most {}", n_cells, most_cells);
  if (scene.domain.dimensions == 2 && probe.cells[2] != 1)
    found.error(key + ".cells[2]", "is {}; expected 1 in two dimensions", probe.cells[2]);
  if (probe.width < 1 || probe.width > most_width)
    found.error(key + ".width", "is {}; expected 1 to {} [cells]", probe.width, most_width);
  if (probe.margin && (*probe.margin < 0 || *probe.margin > 2 * most_width))
    found.error(key + ".margin", "is {}; expected 0 to {} [cells]", *probe.margin, 2 * most_width);
  found.not_negative(key + ".from", probe.from, "s");
  if (probe.name == "snapshots")
    found.error(key + ".name", "\"snapshots\" is the series of the grains themselves; choose another name");
  if (!(probe.average >= 0.0))
    found.error(key + ".average", "is {}; expected 0 or more [s]", probe.average);
  else if (probe.average > 0.0 && probe.average < probe.interval)
    found.error(key + ".average", "is {}, shorter than interval = {} [s]; expected a multiple of it, or 0",
                probe.average, probe.interval);
}

}  // namespace

void check_plane(const PlaneShape& plane, const std::string& key, const Domain& domain, Findings& found) {
  check_shape(plane, key, domain, found);
}
void check_disc(const DiscShape& disc, const std::string& key, const Domain& domain, Findings& found) {
  check_shape(disc, key, domain, found);
}
void check_mesh(const MeshShape& mesh, const std::string& key, const Domain& domain, Findings& found) {
  check_shape(mesh, key, domain, found);
}

void check_walls(const Scene& scene, Findings& found) {
  std::vector<std::string> materials;
  for (const Material& material : scene.materials) materials.push_back(material.name);
  for (std::size_t i = 0; i < scene.walls.size(); ++i) {
    const WallDefinition& wall = scene.walls[i];
    const std::string key = fmt::format("wall[{}]", i);
    check_name(scene.walls, i, "wall", found);
    const bool is_known = scene.material_index(wall.material) >= 0;
    if (wall.material.empty() && !wall.symmetry)
      found.error(key + ".material", "missing; expected the name of a material: {}", listing(materials));
    else if (!wall.material.empty() && !is_known)
      found.error(key + ".material", "\"{}\" is not a material{}", wall.material, nearest(wall.material, materials));
    std::visit([&](const auto& shape) { check_shape(shape, key, scene.domain, found); }, wall.shape);
    if (wall.symmetry && !std::holds_alternative<PlaneShape>(wall.shape))
      found.error(key + ".symmetry", "is true; only a plane can be a symmetry plane");
    if (wall.has_force_map && !std::holds_alternative<MeshShape>(wall.shape))
      found.error(key + ".force_map", "is true; only the triangles of a mesh can be told apart");
    check_motions(scene, wall, key, found);
    const bool has_from = found.finite(key + ".from", wall.from, "s");
    if (std::isnan(wall.until) || (has_from && wall.until <= wall.from))
      found.error(key + ".until", "is {}; expected more than from = {} [s]", wall.until, wall.from);
  }
}

void check_probes(const Scene& scene, Findings& found) {
  const std::vector<Probe>& probes = scene.output.probes;
  for (std::size_t i = 0; i < probes.size(); ++i) {
    const std::string key = fmt::format("probe[{}]", i);
    check_name(probes, i, "probe", found);
    if (probes[i].name.find_first_of("/\\\n\t") != std::string::npos)
      found.error(key + ".name", "\"{}\" cannot be the name of a file; leave out slashes", probes[i].name);
    found.positive(key + ".interval", probes[i].interval, "s");
    check_probe_kind(scene, probes[i], key, found);
    check_gas_probe(scene, probes[i], key, found);
    if (probes[i].kind == Probe::Kind::fields) check_fields(scene, probes[i], key, found);
  }
}

}  // namespace moraine::checks
