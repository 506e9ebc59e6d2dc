// The gas: its grid, its properties, what it meets on the faces of the domain.
#include <algorithm>
#include <array>
#include <string_view>

#include "engine/scene/checks.hpp"

namespace moraine::checks {

namespace {

using Kind = GasBoundary::Kind;

/// More cells than any machine that this was made for can hold; a slip of the pen.
constexpr double most_cells = 1e10;
/// Spacing over diameter below which void fractions jump too much as grains pass from cell to cell. At 2.5 a bed of
/// uniform spheres is known to fail with weights = "cell"; with "trilinear" grains in rows sink too fast by 16 % at 1.15, by 1.7 % at 1.33
/// and by less from there (tests/stability/gas.cpp has the scene).
constexpr double least_spacing_cell = 3.0, least_spacing_trilinear = 1.3;

std::string_view type_name(Kind kind) {
  constexpr std::array<std::string_view, 4> names = {"velocity", "pressure", "no_slip", "free_slip"};
  return names[static_cast<std::size_t>(kind)];
}

bool has_cells(const Gas& gas) {
  return std::all_of(gas.cells.begin(), gas.cells.end(), [](int n) { return n >= 1; });
}

double spacing(const Scene& scene, int axis) {
  return (scene.domain.high[axis] - scene.domain.low[axis]) / scene.gas->cells[static_cast<std::size_t>(axis)];
}

void check_cells(const Scene& scene, Findings& found) {
  const std::array<int, 3>& cells = scene.gas->cells;
  double n_cells = 1.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (cells[axis] < 1) found.error(fmt::format("gas.cells[{}]", axis), "is {}; expected 1 or more", cells[axis]);
    n_cells *= cells[axis];
  }
  if (scene.domain.dimensions == 2 && cells[2] > 1)
    found.error("gas.cells[2]", "is {}; expected 1: in two dimensions the grid is one cell thick", cells[2]);
  if (has_cells(*scene.gas) && n_cells > most_cells)
    found.error("gas.cells", "is [{}, {}, {}]: {:.3g} cells; at most {:.0e} are possible", cells[0], cells[1], cells[2],
                n_cells, most_cells);
}

void check_properties(const Scene& scene, Findings& found) {
  const Gas& gas = *scene.gas;
  found.positive("gas.density", gas.density, "kg/m3");
  if (found.not_negative("gas.viscosity", gas.viscosity, "Pa s") && gas.drag && gas.viscosity == 0.0)
    found.error(
        "gas.viscosity",
        "is 0; expected more than 0 [Pa s]: drag laws go by Reynolds' number, and without viscosity there is none");
  if (gas.step && found.positive("gas.step", *gas.step, "s") && scene.time.step && *gas.step < *scene.time.step)
    found.warning("gas.step",
                  "is {} s, shorter than the grain step, time.step = {} s: the gas step will be as long as that",
                  *gas.step, *scene.time.step);
  if (!(gas.least_void_fraction > 0.0 && gas.least_void_fraction < 1.0))
    found.error("gas.least_void_fraction", "is {}; expected more than 0 and less than 1", gas.least_void_fraction);
  if (!(gas.tolerance > 0.0 && gas.tolerance < 1.0))
    found.error("gas.tolerance", "is {}; expected more than 0 and less than 1, 1e-6 is usual", gas.tolerance);
  if (found.finite("gas.velocity", gas.velocity, "m/s") && scene.domain.dimensions == 2 && gas.velocity.z != 0.0)
    found.warning("gas.velocity", "has a z component of {} m/s, which does nothing in two dimensions", gas.velocity.z);
  if (!found.finite("gas.pressure_gradient", gas.pressure_gradient, "Pa/m")) return;
  for (int axis = 0; axis < 3; ++axis)
    if (gas.pressure_gradient[axis] != 0.0 && !scene.domain.periodic[static_cast<std::size_t>(axis)])
      found.error("gas.pressure_gradient",
                  "is {} Pa/m along {}, which is not periodic: there the boundaries drive the gas; expected 0",
                  gas.pressure_gradient[axis], axis_names[axis]);
}

double largest_diameter(const Scene& scene) {
  double largest = 0.0;
  for (const ParticleGroup& group : scene.particles) largest = std::max(largest, diameter_range(group).second);
  return largest;
}

void check_weights(const Scene& scene, Findings& found) {
  const Gas& gas = *scene.gas;
  if (gas.weights == GasWeights::smoothed && !(gas.smoothing > 0.0 && std::isfinite(gas.smoothing)))
    found.error("gas.smoothing", "is {}; weights = \"smoothed\" needs a length greater than 0 [m]", gas.smoothing);
  if (gas.weights != GasWeights::smoothed && gas.smoothing != 0.0)
    found.error("gas.smoothing", "is {} m; it goes with weights = \"smoothed\" only", gas.smoothing);
  if (!gas.drag || !is_usable(scene.domain) || !has_cells(gas) || gas.weights == GasWeights::smoothed) return;
  const bool is_cell = gas.weights == GasWeights::cell;
  const double least = (is_cell ? least_spacing_cell : least_spacing_trilinear) * largest_diameter(scene);
  for (int axis = 0; axis < 3; ++axis) {
    if (gas.cells[static_cast<std::size_t>(axis)] == 1 || spacing(scene, axis) >= least * (1.0 - 1e-12)) continue;
    found.warning(
        "gas.cells",
        "are {:.3g} m wide along {}, {:.3g} times the largest grain: with weights = \"{}\" void fractions jump "
        "as grains pass from cell to cell; use {}, or cells of at least {:.3g} m",
        spacing(scene, axis), axis_names[axis], spacing(scene, axis) / largest_diameter(scene), name_of(gas.weights),
        is_cell ? "\"trilinear\" or \"smoothed\"" : "\"smoothed\" with a smoothing of about a diameter", least);
    return;
  }
}

// ---- boundaries

/// Cells of a face of the domain, in the two directions along it, that lie in a part: from low to high, the high ones
/// not among them.
struct FaceCells {
  std::array<int, 2> low{}, high{};
  bool is_empty() const { return low[0] >= high[0] || low[1] >= high[1]; }
  bool covers(int a, int b) const { return a >= low[0] && a < high[0] && b >= low[1] && b < high[1]; }
};

std::array<int, 2> along_face(int face) { return {face / 2 == 0 ? 1 : 0, face / 2 == 2 ? 1 : 2}; }

FaceCells cells_of(const Scene& scene, const GasBoundary& boundary) {
  FaceCells out;
  const std::array<int, 2> axes = along_face(boundary.face);
  for (std::size_t k = 0; k < 2; ++k) {
    const int n = scene.gas->cells[static_cast<std::size_t>(axes[k])];
    const double h = spacing(scene, axes[k]), origin = scene.domain.low[axes[k]];
    out.high[k] = n;
    if (!boundary.part) continue;
    const auto first_from = [&](double edge) {
      return static_cast<int>(std::clamp(std::ceil((edge - origin) / h - 0.5), 0.0, static_cast<double>(n)));
    };
    out.low[k] = first_from(boundary.part->low[axes[k]]);
    out.high[k] = first_from(boundary.part->high[axes[k]]);
  }
  return out;
}

/// Factor of a ramp at a time.
double ramp_at(const std::vector<std::array<double, 2>>& ramp, double time) {
  if (ramp.empty()) return 1.0;
  if (time <= ramp.front()[0]) return ramp.front()[1];
  for (std::size_t i = 1; i < ramp.size(); ++i) {
    const auto [t0, f0] = ramp[i - 1];
    const auto [t1, f1] = ramp[i];
    if (time < t1) return f0 + (f1 - f0) * (time - t0) / (t1 - t0);
  }
  return ramp.back()[1];
}

/// In two directions lies on the face, in the third reaches it.
bool check_part(const Scene& scene, const GasBoundary& boundary, const std::string& key, Findings& found) {
  const Box& part = *boundary.part;
  if (!found.finite(key + ".low", part.low, "m") || !found.finite(key + ".high", part.high, "m")) return false;
  for (const int axis : along_face(boundary.face)) {
    if (part.low[axis] < part.high[axis]) continue;
    found.error(fmt::format("{}.high[{}]", key, axis), "is {}; expected more than low[{}] = {} [m]", part.high[axis],
                axis, part.low[axis]);
    return false;
  }
  const int normal = boundary.face / 2;
  const double place = boundary.face % 2 == 0 ? scene.domain.low[normal] : scene.domain.high[normal];
  const double slack = 1e-9 * (scene.domain.high[normal] - scene.domain.low[normal]);
  if (place < part.low[normal] - slack || place > part.high[normal] + slack) {
    found.error(key, "reaches from {} to {} m along {}, not to the face \"{}\" at {} m", part.low[normal],
                part.high[normal], axis_names[normal], face_name(boundary.face), place);
    return false;
  }
  if (!cells_of(scene, boundary).is_empty()) return true;
  const std::array<int, 2> axes = along_face(boundary.face);
  found.error(
      key, "covers no cell: no centre of a cell of {:.3g} x {:.3g} m lies in it; make it larger, or the cells smaller",
      spacing(scene, axes[0]), spacing(scene, axes[1]));
  return false;
}

void check_velocity(const GasBoundary& boundary, const std::string& key, Findings& found) {
  if (!found.finite(key, boundary.velocity, "m/s")) return;
  const int normal = boundary.face / 2;
  const double through = boundary.velocity[normal];
  if (boundary.kind == Kind::velocity && through == 0.0)
    found.error(key,
                "is {}: nothing comes in along {}; give it a component along {}, or use type = \"no_slip\" for a wall "
                "that moves",
                text(boundary.velocity), axis_names[normal], axis_names[normal]);
  if (boundary.kind == Kind::no_slip && through != 0.0)
    found.error(key,
                "has a component of {} m/s along {}, through the wall; a wall moves along itself only: use type = "
                "\"velocity\" for gas that comes in",
                through, axis_names[normal]);
}

void check_ramp(const GasBoundary& boundary, const std::string& key, Findings& found) {
  for (std::size_t i = 0; i < boundary.ramp.size(); ++i) {
    const auto [time, factor] = boundary.ramp[i];
    found.finite(fmt::format("{}[{}][1]", key, i), factor, "-");
    if (!found.finite(fmt::format("{}[{}][0]", key, i), time, "s")) return;
    if (i == 0 || time > boundary.ramp[i - 1][0]) continue;
    found.error(fmt::format("{}[{}][0]", key, i), "is {}; expected more than {}, the time before it [s]", time,
                boundary.ramp[i - 1][0]);
    return;
  }
}

/// True where the entry can be used to judge what all of them do together.
bool check_boundary(const Scene& scene, const GasBoundary& boundary, const std::string& key, Findings& found) {
  if (boundary.face < 0 || boundary.face > 5) {
    found.error(key + ".face", "is {}; expected 0 to 5 (x-low, x-high, y-low, y-high, z-low, z-high)", boundary.face);
    return false;
  }
  const int normal = boundary.face / 2;
  check_velocity(boundary, key + ".velocity", found);
  check_ramp(boundary, key + ".ramp", found);
  found.finite(key + ".pressure", boundary.pressure, "Pa");
  if (scene.domain.periodic[static_cast<std::size_t>(normal)]) {
    found.error(key + ".face", "is \"{}\", but the domain is periodic along {}: the gas has no boundary there",
                face_name(boundary.face), axis_names[normal]);
    return false;
  }
  if (scene.domain.dimensions == 2 && normal == 2) {
    found.error(key + ".face", "is \"{}\", but in two dimensions the gas does not move along z",
                face_name(boundary.face));
    return false;
  }
  if (!is_usable(scene.domain) || !has_cells(*scene.gas)) return false;
  return !boundary.part || check_part(scene, boundary, key + ".part", found);
}

/// What is seen of each entry, later ones lying over earlier ones: area [m2] by entry.
std::vector<double> visible_areas(const Scene& scene) {
  const std::vector<GasBoundary>& entries = scene.gas->boundaries;
  std::vector<FaceCells> cells;
  for (const GasBoundary& entry : entries) cells.push_back(cells_of(scene, entry));
  std::vector<double> areas(entries.size(), 0.0);
  for (int face = 0; face < 6; ++face) {
    std::array<std::vector<int>, 2> cuts;  // between them the whole face is alike
    for (std::size_t i = 0; i < entries.size(); ++i) {
      if (entries[i].face != face) continue;
      for (std::size_t k = 0; k < 2; ++k) cuts[k].insert(cuts[k].end(), {cells[i].low[k], cells[i].high[k]});
    }
    for (std::vector<int>& list : cuts) {
      std::sort(list.begin(), list.end());
      list.erase(std::unique(list.begin(), list.end()), list.end());
    }
    const std::array<int, 2> axes = along_face(face);
    const double cell_area = spacing(scene, axes[0]) * spacing(scene, axes[1]);
    for (std::size_t a = 0; a + 1 < cuts[0].size(); ++a)
      for (std::size_t b = 0; b + 1 < cuts[1].size(); ++b)
        for (std::size_t i = entries.size(); i-- > 0;) {
          if (entries[i].face != face || !cells[i].covers(cuts[0][a], cuts[1][b])) continue;
          areas[i] += cell_area * (cuts[0][a + 1] - cuts[0][a]) * (cuts[1][b + 1] - cuts[1][b]);
          break;
        }
  }
  return areas;
}

/// Gas that cannot be pressed together comes out as fast as it goes in.
void check_balance(const Scene& scene, const std::vector<double>& areas, Findings& found) {
  const std::vector<GasBoundary>& entries = scene.gas->boundaries;
  std::vector<double> times = {0.0};
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (entries[i].kind == Kind::pressure && areas[i] > 0.0) return;
    for (const auto& [time, factor] : entries[i].ramp) times.push_back(time);
  }
  for (const double time : times) {
    double in = 0.0, out = 0.0;  // [m3/s]
    for (std::size_t i = 0; i < entries.size(); ++i) {
      if (entries[i].kind != Kind::velocity) continue;
      const double sign = entries[i].face % 2 == 0 ? 1.0 : -1.0;
      const double flow = sign * entries[i].velocity[entries[i].face / 2] * areas[i] * ramp_at(entries[i].ramp, time);
      (flow > 0.0 ? in : out) += std::abs(flow);
    }
    if (std::abs(in - out) <= 1e-9 * std::max(in, out)) continue;
    found.error("gas.boundary",
                "lets {:.6g} m3/s in and {:.6g} m3/s out at {} s, and the gas cannot be pressed together; add "
                "[[gas.boundary]] with type = \"pressure\" where it can leave",
                in, out, time);
    return;
  }
}

void check_boundaries(const Scene& scene, Findings& found) {
  const std::vector<GasBoundary>& entries = scene.gas->boundaries;
  bool are_good = is_usable(scene.domain) && has_cells(*scene.gas);
  for (std::size_t i = 0; i < entries.size(); ++i)
    are_good = check_boundary(scene, entries[i], fmt::format("gas.boundary[{}]", i), found) && are_good;
  if (!are_good) return;
  const std::vector<double> areas = visible_areas(scene);
  for (std::size_t i = 0; i < entries.size(); ++i)
    if (areas[i] == 0.0)
      found.warning(fmt::format("gas.boundary[{}]", i),
                    "(type = \"{}\") does nothing: later entries cover all of it, and they go before it",
                    type_name(entries[i].kind));
  check_balance(scene, areas, found);
}

// ---- walls

struct IsInside {
  const Box& domain;
  double slack;  // [m]

  /// Strictly inside the domain.
  bool is_inside(Vec3 p) const {
    for (int axis = 0; axis < 3; ++axis)
      if (p[axis] <= domain.low[axis] + slack || p[axis] >= domain.high[axis] - slack) return false;
    return true;
  }
  bool operator()(const PlaneShape& plane) const {
    bool is_before = false, is_behind = false;
    for (int corner = 0; corner < 8; ++corner) {
      const Vec3 p{corner & 1 ? domain.high.x : domain.low.x, corner & 2 ? domain.high.y : domain.low.y,
                   corner & 4 ? domain.high.z : domain.low.z};
      const double distance = dot(p - plane.point, plane.normal) / length(plane.normal);
      is_before = is_before || distance > slack;
      is_behind = is_behind || distance < -slack;
    }
    return is_before && is_behind;
  }
  bool operator()(const BoxShape& box) const {
    for (int axis = 0; axis < 3; ++axis)
      if (box.box.low[axis] > domain.low[axis] + slack || box.box.high[axis] < domain.high[axis] - slack) return true;
    return false;
  }
  bool operator()(const MeshShape& shape) const {
    return std::any_of(shape.mesh.vertices.begin(), shape.mesh.vertices.end(), [&](Vec3 v) { return is_inside(v); });
  }
  bool operator()(const CylinderShape&) const { return true; }
  bool operator()(const ConeShape&) const { return true; }
  bool operator()(const DiscShape&) const { return true; }
};

void check_that_walls_are_seen(const Scene& scene, Findings& found) {
  if (!is_usable(scene.domain)) return;
  const Box domain = scene.domain.box();
  const IsInside is_inside{domain, 1e-6 * length(domain.size())};
  for (std::size_t i = 0; i < scene.walls.size(); ++i)
    if (std::visit(is_inside, scene.walls[i].shape))
      found.warning(fmt::format("wall[{}]", i),
                    "(\"{}\") stands inside the domain, and the gas does not see it: for the gas only the faces of the "
                    "domain are walls",
                    scene.walls[i].name);
}

}  // namespace

void check_gas(const Scene& scene, Findings& found) {
  if (!scene.gas) return;
  check_cells(scene, found);
  check_properties(scene, found);
  check_weights(scene, found);
  check_boundaries(scene, found);
  check_that_walls_are_seen(scene, found);
  if (scene.particles.empty() && !scene.time.step)
    found.error("time.step", "is \"auto\", and there are no grains to choose it by; give it a number [s]");
}

}  // namespace moraine::checks
