#include "io/cli/check_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/particles/fill.hpp"
#include "engine/run/coarse_fields.hpp"
#include "engine/run/one_contact.hpp"
#include "engine/run/simulation.hpp"
#include "engine/walls/walls.hpp"
#include "io/cli/gas_text.hpp"
#include "io/cli/launch.hpp"
#include "io/cli/layout.hpp"
#include "io/cli/memory.hpp"
#include "io/cli/text.hpp"
#include "io/scene_toml/scene_toml.hpp"

namespace moraine {

namespace {

/// "name         text", the name in a column of its own.
std::string row(const std::string& name, const std::string& text) { return fmt::format("{:<13}{}\n", name, text); }

std::string vector_text(Vec3 v) { return fmt::format("({:.6g}, {:.6g}, {:.6g})", v.x, v.y, v.z); }

std::string size_text(const SizeDistribution& size) {
  switch (size.kind) {
    case SizeDistribution::Kind::single: return fmt::format("{:.6g} m", size.value);
    case SizeDistribution::Kind::uniform: return fmt::format("{:.6g} to {:.6g} m, uniform", size.low, size.high);
    case SizeDistribution::Kind::normal:
      return fmt::format("normal, mean {:.6g} m, deviation {:.6g} m, within {:.6g} to {:.6g} m", size.mean,
                         size.deviation, size.low, size.high);
    case SizeDistribution::Kind::lognormal:
      return fmt::format("lognormal, mean {:.6g} m, deviation {:.6g} m, within {:.6g} to {:.6g} m", size.mean,
                         size.deviation, size.low, size.high);
    case SizeDistribution::Kind::list: break;
  }
  if (size.values.empty()) return "no sizes";
  const auto [least, greatest] = std::minmax_element(size.values.begin(), size.values.end());
  return fmt::format("{} sizes, {:.6g} to {:.6g} m", size.values.size(), *least, *greatest);
}

std::string listed_text(const ListedGrains& list, const SizeDistribution& size) {
  const std::string origin = list.source.empty() ? "listed in the scene" : "from " + list.source;
  if (!list.has_radius || list.grains.empty()) return origin + ", diameter " + size_text(size);
  double least = infinity, greatest = 0.0;
  for (const GrainSeed& grain : list.grains) {
    least = std::min(least, 2.0 * grain.radius);
    greatest = std::max(greatest, 2.0 * grain.radius);
  }
  return fmt::format("{}, {} grains, diameter {:.6g} to {:.6g} m", origin, list.grains.size(), least, greatest);
}

std::string group_text(const ParticleGroup& group) {
  std::string text = group.material + ": ";
  if (const auto* fill = std::get_if<RandomFill>(&group.fill)) {
    text += "random, diameter " + size_text(group.diameter);
    if (fill->solid_fraction) text += fmt::format(", to a solid fraction of {:.4g}", *fill->solid_fraction);
    if (fill->count) text += fmt::format(", {} grains", count_text(static_cast<std::uint64_t>(*fill->count)));
  } else if (const auto* lattice = std::get_if<LatticeFill>(&group.fill)) {
    text += fmt::format("{} lattice, diameter {}", lattice->kind == LatticeFill::Kind::cubic ? "cubic" : "hexagonal",
                        size_text(group.diameter));
  } else {
    text += listed_text(std::get<ListedGrains>(group.fill), group.diameter);
  }
  return text;
}

std::string domain_text(const Domain& domain) {
  std::string text = vector_text(domain.low) + " to " + vector_text(domain.high) + " m";
  std::string axes;
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (domain.periodic[axis]) axes += (axes.empty() ? "" : ", ") + std::string(1, "xyz"[axis]);
  if (!axes.empty()) text += ", periodic in " + axes;
  return domain.dimensions == 2 ? text + ", two-dimensional" : text;
}

std::string material_text(const Material& material) {
  std::string text = material.name;
  if (material.density > 0.0) text += fmt::format(": {:.6g} kg/m3", material.density);
  if (material.young > 0.0)
    text += fmt::format(", Young's modulus {:.4g} Pa, Poisson's ratio {:.3g}", material.young, material.poisson);
  return text;
}

const char* shape_name(const WallDefinition& wall) {
  constexpr const char* names[] = {"plane", "box", "cylinder", "cone", "disc", "mesh"};
  return names[wall.shape.index()];
}

std::string wall_text(const WallDefinition& wall) {
  std::string text = wall.name + ": " + (wall.symmetry ? "symmetry plane" : shape_name(wall));
  if (wall.frictionless && !wall.symmetry) text += ", frictionless";
  if (!wall.material.empty() && !wall.symmetry) text += ", " + wall.material;
  if (wall.from > 0.0) text += fmt::format(", from {:.6g} s", wall.from);
  if (std::isfinite(wall.until)) text += fmt::format(", until {:.6g} s", wall.until);
  const auto* mesh = std::get_if<MeshShape>(&wall.shape);
  if (mesh == nullptr) return text;
  const MeshReport report = inspect(mesh->mesh);
  text += fmt::format(", {} of {}", counted(static_cast<std::uint64_t>(report.n_triangles), "triangle"), mesh->file);
  return text + (report.text.empty() ? ", closed" : "");
}

/// What the mesh of a wall reports, each line on a row of its own.
std::string mesh_rows(const WallDefinition& wall) {
  const auto* mesh = std::get_if<MeshShape>(&wall.shape);
  if (mesh == nullptr) return {};
  std::string rows;
  const std::string report = inspect(mesh->mesh).text;
  for (std::size_t at = 0; at < report.size();) {
    const std::size_t end = std::min(report.find('\n', at), report.size());
    rows += row("", "  " + report.substr(at, end - at));
    at = end + 1;
  }
  return rows;
}

std::string list_rows(const std::string& name, const std::vector<std::string>& texts) {
  std::string rows;
  for (const std::string& text : texts) rows += row(rows.empty() ? name : "", text);
  return rows;
}

/// What the step makes of an impact, tried out with the scene's own law.
std::string step_error_rows(const Scene& scene, const StepChoice& choice) {
  const ImpactError error = impact_error(scene, choice.step);
  const std::string at = fmt::format(" at {:.3g} m/s", choice.speed);
  return row("step error",
             fmt::format("restitution {:.4g} +- {:.2g}: {}{}", error.exact, error.restitution, error.pair, at)) +
         row("", fmt::format("energy of an impact without losses +- {:.2g} of it: {}{}", error.energy,
                             error.energy_pair, at));
}

std::string time_rows(const Scene& scene, const Plan& plan) {
  const StepChoice& choice = plan.time_step;
  std::string rows = row("time step", fmt::format("{:.6g} s{}, {:.3g} steps in the shortest contact ({:.4g} s)",
                                                  choice.step, scene.time.step ? " (given)" : " (chosen)",
                                                  choice.steps_per_contact, choice.contact_time));
  rows += row("", "the shortest is " + choice.limit);
  if (scene.time.step) rows += row("", fmt::format("\"auto\" would choose {:.6g} s", choice.automatic));
  rows += row("", "limited by " + choice.limits.front().words);
  for (std::size_t i = 1; i < choice.limits.size(); ++i)
    rows += row("", fmt::format("  {:.4g} s would be allowed by {}", choice.limits[i].step, choice.limits[i].words));
  if (plan.n_grains > 0) rows += step_error_rows(scene, choice);
  return rows + row("time", fmt::format("{:.6g} s in {}", scene.time.end, counted(plan.n_steps, "step")));
}

std::string balance_text(Balance balance, const Layout& layout) {
  if (layout.ranks == 1) return "one rank, nothing to balance";
  switch (balance) {
    case Balance::automatic: return "cores follow the grains, and cuts where that is not enough";
    case Balance::threads: return "cores of a node follow the grains; ranks have equal boxes";
    case Balance::cuts: return "cuts between ranks follow the grains";
    case Balance::off: break;
  }
  return "off; ranks have equal boxes";
}

/// What a probe of fields writes, on which grid.
std::string field_text(const Scene& scene, const Probe& probe) {
  const WeightGrid grid = field_grid(scene, probe);
  const std::string files = std::isinf(probe.average) ? "one file at the end"
                            : probe.average > 0.0     ? fmt::format("files of {:.6g} s", probe.average)
                                                      : "a file each";
  return fmt::format(", fields on {} x {} x {} cells, {}", grid[0].n, grid[1].n, grid[2].n, files);
}

std::vector<std::string> output_lines(const Scene& scene, double time_step) {
  const Output& output = scene.output;
  std::vector<std::string> lines;
  lines.push_back(output.snapshot_interval > 0.0 ? fmt::format("a snapshot every {:.6g} s", output.snapshot_interval)
                                                 : "one snapshot at the end");
  lines.push_back(output.checkpoint_interval > 0.0
                      ? fmt::format("a checkpoint every {:.6g} s", output.checkpoint_interval)
                      : "a checkpoint at the end");
  for (const Probe& probe : output.probes) {
    lines.push_back(
        fmt::format("{}.csv every {:.6g} s", probe.name, probe.interval > 0.0 ? probe.interval : time_step));
    if (probe.kind == Probe::Kind::fields) lines.back() += field_text(scene, probe);
  }
  for (const WallDefinition& wall : scene.walls)
    if (wall.has_force_map) lines.push_back("a map of the forces on " + wall.name + " with each snapshot");
  return lines;
}

}  // namespace

std::string check_text(const std::filesystem::path& scene_file, const std::vector<std::string>& overrides,
                       const std::optional<std::string>& layout, std::string* refusal) {
  std::vector<SceneMessage> messages;
  const Scene scene = read_scene(scene_file, overrides, &messages);
  const LayoutChoice choice = layout_for(scene, layout);
  const Layout chosen = choice.layout;
  const Plan plan = make_plan(scene, chosen.threads);

  std::string text = row("scene", scene_file.string() + (scene.title.empty() ? "" : ": " + scene.title));
  text += row("grains", count_text(plan.n_grains));
  for (const ParticleGroup& group : scene.particles) text += row("", group_text(group));
  text += row("domain", domain_text(scene.domain));
  std::vector<std::string> lines;
  for (const Material& material : scene.materials) lines.push_back(material_text(material));
  text += list_rows("materials", lines);
  for (std::size_t i = 0; i < scene.walls.size(); ++i)
    text += row(i == 0 ? "walls" : "", wall_text(scene.walls[i])) + mesh_rows(scene.walls[i]);
  text += time_rows(scene, plan);
  text += list_rows("gas", gas_lines(scene, plan.time_step.step, plan.gas_steps));
  text += list_rows("kernels", plan.chosen);
  text += list_rows("left out", plan.left_out);
  text += row("skin", fmt::format("{:.6g} m", plan.skin));
  text += list_rows("output", output_lines(scene, plan.time_step.step));
  text += row("layout", chosen.text() + (choice.why.empty() ? "" : " (" + choice.why + ")"));
  text += row("balance", balance_text(scene.run.balance, chosen));
  text += row("memory", fmt::format("about {}", bytes_text(memory_of_run(plan, chosen))));
  if (refusal != nullptr) try {
      if (const auto doubt = expect_to_fit(plan, chosen)) text += row("", *doubt);
    } catch (const UsageError& error) {
      *refusal = error.what();
    }
  text += row("will take", fmt::format("about {}", duration_text(plan.seconds)));

  lines.clear();
  for (const SceneMessage& message : messages) lines.push_back(message.text());
  for (const std::string& warning : plan.warnings) lines.push_back(warning);
  return text + list_rows("warnings", lines);
}

}  // namespace moraine
