#include "io/cli/gas_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/scene/checks.hpp"
#include "engine/scene/lists.hpp"
#include "io/cli/text.hpp"
#include "kernels/drag/cells.hpp"

namespace moraine {

namespace {

const char* name_of(DragLaw law) {
  switch (law) {
    case DragLaw::schiller_naumann: return "Schiller & Naumann";
    case DragLaw::wen_yu: return "Wen & Yu";
    case DragLaw::ergun: return "Ergun";
    case DragLaw::gidaspow: return "Gidaspow";
    case DragLaw::di_felice: return "Di Felice";
    case DragLaw::syamlal_obrien: return "Syamlal & O'Brien";
    case DragLaw::beetstra: return "Beetstra, van der Hoef & Kuipers";
    case DragLaw::koch_hill: return "Koch & Hill";
  }
  return "";
}

Vec3 spacing_of(const Scene& scene) {
  const Vec3 size = scene.domain.box().size();
  const std::array<int, 3>& n = scene.gas->cells;
  return {size.x / n[0], size.y / n[1], size.z / n[2]};
}

double largest_diameter(const Scene& scene) {
  double largest = 0.0;
  for (const ParticleGroup& group : scene.particles) largest = std::max(largest, checks::diameter_range(group).second);
  return largest;
}

std::string cells_text(const Scene& scene) {
  const std::array<int, 3>& n = scene.gas->cells;
  const Vec3 h = spacing_of(scene);
  std::string text = fmt::format("{} x {} x {} cells of {:.4g} x {:.4g} x {:.4g} m", n[0], n[1], n[2], h.x, h.y, h.z);
  const double d = largest_diameter(scene);
  return d > 0.0 ? text + fmt::format(", {:.3g} x {:.3g} x {:.3g} grain diameters", h.x / d, h.y / d, h.z / d) : text;
}

std::string step_text(const Gas& gas, double time_step, std::uint64_t grain_steps) {
  const auto steps = static_cast<double>(grain_steps);
  const std::string text =
      fmt::format("gas step {:.4g} s, {:.0f} grain step{}", steps * time_step, steps, steps == 1.0 ? "" : "s");
  return gas.step ? text + fmt::format(" (at most {:.4g} s was asked for)", *gas.step) : text + " (chosen)";
}

std::string drag_text(const Gas& gas) {
  if (!gas.drag) return "no drag: grains do not feel the gas, nor the gas the grains";
  constexpr std::array weights = {"by the cell they are in", "over the eight nearest cells", "smoothed"};
  std::string text = fmt::format("drag of {}, model {}, grains spread {}", name_of(*gas.drag),
                                 gas.model == GasModel::a ? "A" : "B", weights[static_cast<std::size_t>(gas.weights)]);
  if (gas.weights == GasWeights::smoothed) text += fmt::format(" over {:.4g} m", gas.smoothing);
  return gas.moves_gas ? text : text + "; one-way: the gas does not feel the grains";
}

std::string ramp_text(const std::vector<std::array<double, 2>>& ramp) {
  if (ramp.empty()) return {};
  std::string text = ", times";
  for (std::size_t i = 0; i < ramp.size(); ++i)
    text += fmt::format("{} {:.4g} at {:.4g} s", i == 0 ? "" : ",", ramp[i][1], ramp[i][0]);
  return text;
}

std::string boundary_text(const GasBoundary& boundary) {
  using Kind = GasBoundary::Kind;
  const auto vector = [](Vec3 v) { return fmt::format("({:.6g}, {:.6g}, {:.6g})", v.x, v.y, v.z); };
  std::string text = checks::face_name(boundary.face);
  if (boundary.part)
    text += fmt::format(", part from {} to {} m", vector(boundary.part->low), vector(boundary.part->high));
  text += ": ";
  switch (boundary.kind) {
    case Kind::velocity: {
      const double inwards = (boundary.face % 2 == 0 ? 1.0 : -1.0) * boundary.velocity[boundary.face / 2];
      text += fmt::format("gas {} at {} m/s{}", inwards > 0.0 ? "comes in" : "is drawn off", vector(boundary.velocity),
                          boundary.profile == GasBoundary::Profile::parabolic ? " in the mean, parabolic" : "");
      return text + ramp_text(boundary.ramp);
    }
    case Kind::pressure: return text + fmt::format("outlet at {:.6g} Pa", boundary.pressure);
    case Kind::free_slip: return text + "smooth wall";
    case Kind::no_slip: break;
  }
  if (boundary.velocity == Vec3{}) return text + "wall";
  return text + fmt::format("wall that moves at {} m/s", vector(boundary.velocity)) + ramp_text(boundary.ramp);
}

/// The faces of which the scene says nothing.
std::string other_faces(const Scene& scene) {
  std::string names;
  for (int face = 0; face < 6; ++face) {
    const auto axis = static_cast<std::size_t>(face / 2);
    if (scene.domain.periodic[axis] || (axis == 2 && scene.domain.dimensions == 2)) continue;
    const auto is_on_face = [face](const GasBoundary& boundary) { return boundary.face == face; };
    if (std::none_of(scene.gas->boundaries.begin(), scene.gas->boundaries.end(), is_on_face))
      names += (names.empty() ? "" : ", ") + std::string(checks::face_name(face));
  }
  return names.empty() ? names : names + ": wall" + (names.find(',') == std::string::npos ? "" : "s");
}

/// Where grains carry much of the fluid along, what it does to them is spread over gas steps (engine/coupling/README.md).
std::string dense_text(const Scene& scene) {
  const Gas& gas = *scene.gas;
  if (!gas.drag || gas.model != GasModel::a || !gas.moves_gas) return {};
  const std::vector<bool> is_grain = grain_materials(scene);
  double carried = 0.0;  // in a packing with a void fraction of 0.4
  for (std::size_t m = 0; m < is_grain.size(); ++m)
    if (is_grain[m]) carried = std::max(carried, 1.5 * gas.density / scene.materials[m].density);
  if (share_at_once(carried) == 1.0) return {};
  return fmt::format(
      "a dense fluid: packed grains carry {:.2g} times their mass of it along; they get {:.0f} % of a push at once, "
      "the rest over the next gas steps",
      carried, 100.0 * share_at_once(carried));
}

/// How long the fastest gas that comes in takes through a cell, with a few grains in its way.
std::string limits_text(const Scene& scene) {
  const Gas& gas = *scene.gas;
  std::string text =
      fmt::format("void fraction taken as at least {:.3g}, mass imbalance of a cell at most {:.1e} of its gas",
                  gas.least_void_fraction, gas.tolerance);
  double rate = 0.0;
  const Vec3 h = spacing_of(scene);
  for (const GasBoundary& boundary : gas.boundaries)
    for (int axis = 0; axis < 3; ++axis) rate = std::max(rate, std::abs(boundary.velocity[axis]) / h[axis]);
  return rate > 0.0 ? text + fmt::format("; the fastest boundary crosses a cell in {:.3g} s", 1.0 / rate) : text;
}

}  // namespace

std::vector<std::string> gas_lines(const Scene& scene, double time_step, std::uint64_t grain_steps) {
  if (!scene.gas) return {};
  const Gas& gas = *scene.gas;
  std::vector<std::string> lines = {cells_text(scene),
                                    fmt::format("{:.6g} kg/m3, {:.6g} Pa s", gas.density, gas.viscosity),
                                    step_text(gas, time_step, grain_steps), drag_text(gas)};
  for (const GasBoundary& boundary : gas.boundaries) lines.push_back(boundary_text(boundary));
  if (const std::string others = other_faces(scene); !others.empty()) lines.push_back(others);
  for (int axis = 0; axis < 3; ++axis)
    if (gas.pressure_gradient[axis] != 0.0)
      lines.push_back(fmt::format("mean pressure gradient {:.6g} Pa/m along {}", gas.pressure_gradient[axis],
                                  checks::axis_names[axis]));
  if (const std::string dense = dense_text(scene); !dense.empty()) lines.push_back(dense);
  lines.push_back(limits_text(scene));
  return lines;
}

}  // namespace moraine
