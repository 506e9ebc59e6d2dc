#include "engine/run/plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "engine/contacts/law_table.hpp"
#include "engine/gas/gas_flow.hpp"
#include "engine/particles/fill.hpp"
#include "engine/particles/sizes.hpp"
#include "engine/run/coarse_fields.hpp"
#include "engine/run/one_contact.hpp"
#include "engine/scene/lists.hpp"
#include "engine/walls/motion.hpp"
#include "kernels/base/sphere.hpp"
#include "kernels/contact/reference/reference.hpp"
#include "kernels/contact/sweep.hpp"

namespace moraine {

namespace {

struct Sizes {
  double smallest = infinity;  // diameters [m]
  double largest = 0.0;
  double mean = 0.0;
};

/// Smallest and largest diameter of the grains of one material.
Sizes sizes_of(const Scene& scene, const std::string& material) {
  Sizes sizes;
  const int index = scene.material_index(material);
  const auto include = [&](double low, double high) {
    sizes.smallest = std::min(sizes.smallest, low);
    sizes.largest = std::max(sizes.largest, high);
  };
  for (const ParticleGroup& group : scene.particles) {
    const auto* listed = std::get_if<ListedGrains>(&group.fill);
    if (listed && listed->has_radius) {
      const ListFacts facts = facts_of(*listed);
      if (const auto m = static_cast<std::size_t>(index); facts.uses(m))
        include(facts.of_material[m].smallest, facts.of_material[m].largest);
    } else if (group.material == material) {
      const DiameterSampler sampler(group.diameter);
      include(sampler.smallest(), sampler.largest());
    }
  }
  for (const Inlet& inlet : scene.inlets) {
    if (inlet.list && inlet.list->has_radius) {
      for (const GrainSeed& grain : inlet.list->grains)
        if (inlet.material.empty() ? grain.material == index : inlet.material == material)
          include(2.0 * grain.radius, 2.0 * grain.radius);
    } else if (inlet.material == material) {
      const DiameterSampler sampler(inlet.diameter);
      include(sampler.smallest(), sampler.largest());
    }
  }
  return sizes;
}

/// Half a period of the stiffest vibration that rolling resistance or cohesion adds to a contact; infinite without.
double further_time(const Scene& scene, const PairParameters& p, double mass, double radius) {
  double time = infinity;
  const auto consider = [&](double inertia, double stiffness) {
    if (stiffness > 0.0) time = std::min(time, std::numbers::pi * std::sqrt(inertia / stiffness));
  };
  if (scene.contact.cohesion == CohesionLaw::jkr) consider(mass, jkr_stiffness(p, radius));
  if (scene.contact.rolling == RollingLaw::spring) {
    // The reduced inertia of two spheres is 2/5 m r^2 of the reduced mass and at least the reduced radius, up to twice that. A Hertz
    // contact is as stiff as at an overlap of a hundredth.
    const double k_n = scene.contact.normal == NormalLaw::linear ? p[Parameter::normal_stiffness]
                                                                 : 2.0 * p[Parameter::young] * 0.1 * radius;
    consider(0.4 * mass * radius * radius, rolling_stiffness(p, k_n, radius));
  }
  return time;
}

/// Time of a contact and its dashpot, for a reduced mass [kg] and radius [m].
double contact_time(const Scene& scene, const PairParameters& p, double mass, double radius, double speed) {
  const double beta = p[Parameter::damping];
  double normal = infinity, tangential = infinity;
  if (scene.contact.normal == NormalLaw::linear) {
    normal = std::numbers::pi * std::sqrt(mass / p[Parameter::normal_stiffness]) /
             std::sqrt(std::max(1e-3, 1.0 - beta * beta));
  } else {
    const double e = p[Parameter::young];
    normal = 2.868 * std::pow(mass * mass / (radius * e * e * speed), 0.2);
  }
  const bool has_spring =
      scene.contact.tangential == TangentialLaw::spring || scene.contact.tangential == TangentialLaw::power;
  if (has_spring && scene.contact.normal == NormalLaw::linear && p[Parameter::friction] > 0.0) {
    const double share = scene.contact.rotation ? 2.0 / 7.0 : 1.0;
    tangential = std::numbers::pi * std::sqrt(share * mass / p[Parameter::tangential_stiffness]);
  }
  return std::min({normal, tangential, further_time(scene, p, mass, radius)});
}

constexpr double most_steps = 1e15;  // of a run

/// The program itself and its libraries, one rank [bytes].
constexpr double bytes_of_program = 2.9e7;

/// Bytes a grain: record, gid, material, place at the last rebuild, pairs with memory, entries and marks, scratch of a rebuild.
double bytes_per_grain(const Scene& scene) {
  const bool remembers = has_history(scene.contact.tangential);
  const double record = 8.0 * record_size(scene.contact.rotation);
  const MemoryColumns columns = memory_of(law_choice(scene));
  const double pairs = 4.2 * (8.0 + 8.0 + 8.0 + 8.0 * memory_size(columns) + 2.0) + 8.0;
  return 2.0 * record + 8.0 + 2.0 + 36.0 + pairs + (remembers ? 110.0 : 0.0) + 40.0 +
         (scene.output.energy ? 32.0 : 0.0);
}

/// Bytes of a gas cell at the peak, when a checkpoint is written: the flow, the levels of the pressure solver, what is
/// exchanged with grains, and the image; 854 were measured in `deep_bed`.
double bytes_per_cell(const Gas& gas) { return gas.drag ? 860.0 : 700.0; }

double n_gas_cells(const Scene& scene) {
  double n = scene.gas ? 1.0 : 0.0;
  if (scene.gas)
    for (const int along : scene.gas->cells) n *= along;
  return n;
}

/// How far the attraction of the scene's largest grains reaches [m].
double attraction_range(const Scene& scene) {
  if (scene.contact.cohesion == CohesionLaw::none) return 0.0;
  double largest = 0.0;
  for (const Material& material : scene.materials) largest = std::max(largest, sizes_of(scene, material.name).largest);
  return SceneLaws(scene).attraction_range(scene.contact.cohesion, 0.5 * largest);
}

std::string range_text(const Scene& scene) {
  const double range = attraction_range(scene);
  return range > 0.0 ? fmt::format(" (reaches {:.3g} m beyond contact)", range) : std::string();
}

/// A bond sets in with its full force: what is missed between two steps is the error of its energy.
void warn_of_coarse_bonds(const Scene& scene, Plan& plan) {
  const double range = attraction_range(scene), speed = expected_speed(scene);
  if (!has_bond(scene.contact.cohesion) || !(range > 0.0)) return;
  const double steps = range / (speed * plan.time_step.step);
  if (steps < 5.0)
    plan.warnings.push_back(fmt::format(
        "at {:.3g} m/s, the fastest approach to expect, a grain crosses the reach of cohesion, {:.3g} m, in "
        "{:.1f} steps: the energy of bonds made at that speed is off by about {:.0f} %; time.step = {:.3g} s "
        "would take 5",
        speed, range, steps, 50.0 / steps, range / (5.0 * speed)));
}

void describe(const Scene& scene, Plan& plan) {
  const auto say = [](std::vector<std::string>& list, bool is_used, const std::string& used, const std::string& unused,
                      std::vector<std::string>& other) {
    if (is_used)
      list.push_back(used);
    else
      other.push_back(unused);
  };
  const bool is_mixed = scene.run.precision == Precision::mixed;
  plan.chosen.push_back(fmt::format(
      "contacts: normal {}, tangential {}, {} precision{}, {} lanes by {}", name_of(scene.contact.normal),
      name_of(scene.contact.tangential), is_mixed ? "mixed" : "double",
      is_mixed ? " (forces and memory of pairs in float)" : "", lanes_of_instruction_set(is_mixed), instruction_set()));
  say(plan.chosen, scene.contact.rotation, "rotation", "rotation (grains do not spin: 64 bytes a grain instead of 96)",
      plan.left_out);
  const bool remembers = has_history(scene.contact.tangential);
  say(plan.chosen, remembers, "contact history", "contact history (the tangential law needs none)", plan.left_out);
  say(plan.chosen, !are_grains_alike(scene), "species (grains of several sizes or materials)",
      "species (all grains are alike: contacts need not look up what they are)", plan.left_out);
  say(plan.chosen, scene.contact.tangential != TangentialLaw::none, "friction", "friction (no tangential law)",
      plan.left_out);
  say(plan.chosen, scene.contact.rolling != RollingLaw::none,
      fmt::format("rolling resistance {}", name_of(scene.contact.rolling)), "rolling resistance", plan.left_out);
  say(plan.chosen, scene.contact.cohesion != CohesionLaw::none,
      fmt::format("cohesion {}{}", name_of(scene.contact.cohesion), range_text(scene)), "cohesion", plan.left_out);
  const bool has_periodic = scene.domain.periodic[0] || scene.domain.periodic[1] || scene.domain.periodic[2];
  say(plan.chosen, has_periodic, "periodic images", "periodic images", plan.left_out);
  say(plan.chosen, !scene.walls.empty(),
      fmt::format("{} wall{}", scene.walls.size(), scene.walls.size() == 1 ? "" : "s"), "walls", plan.left_out);
  say(plan.chosen, scene.output.energy, "energy ledger", "energy ledger (output.energy = true keeps it)",
      plan.left_out);
  say(plan.chosen, scene.time.damping > 0.0, fmt::format("bulk viscosity {:g} 1/s", scene.time.damping),
      "bulk viscosity", plan.left_out);
  say(plan.chosen, !scene.outlets.empty(),
      fmt::format("{} outlet{}", scene.outlets.size(), scene.outlets.size() == 1 ? "" : "s"), "outlets", plan.left_out);
  say(plan.chosen, scene.domain.dimensions == 3, "three dimensions", "the third dimension (z is frozen)",
      plan.left_out);
  say(plan.chosen, !scene.inlets.empty(),
      fmt::format("{} inlet{}", scene.inlets.size(), scene.inlets.size() == 1 ? "" : "s"), "inlets", plan.left_out);
  std::string movers;
  for (const WallDefinition& wall : scene.walls)
    if (!wall.motion.empty())
      movers += (movers.empty() ? "" : ", ") + wall.name +
                (wall.has(WallMotion::Kind::script) ? " (by a script: this scene is run from Python)" : "");
  say(plan.chosen, !movers.empty(), "moving walls: " + movers, "moving walls", plan.left_out);
  say(plan.chosen, scene.gas.has_value(), "gas", "gas", plan.left_out);
}

/// mean_diameter() of so many grains in each group [m].
double mean_diameter_of(const Scene& scene, const std::vector<std::int64_t>& n_grains) {
  const auto mean_of = [](const DiameterSampler& sampler) {
    constexpr int n = 64;
    double sum = 0.0;
    for (int i = 0; i < n; ++i) sum += sampler((i + 0.5) / n);
    return sum / n;
  };
  double sum = 0.0, count = 0.0;
  for (std::size_t i = 0; i < n_grains.size(); ++i) {
    const ParticleGroup& group = scene.particles[i];
    const auto n = static_cast<double>(n_grains[i]);
    if (const auto* listed = std::get_if<ListedGrains>(&group.fill); listed && listed->has_radius)
      sum += facts_of(*listed).sum_of_diameters;
    else
      sum += n * mean_of(DiameterSampler(group.diameter));
    count += n;
  }
  for (const Inlet& inlet : scene.inlets) {
    if (inlet.list && inlet.list->has_radius) continue;
    if (count > 0.0) break;  // the grains of the start tell
    const DiameterSampler sampler(inlet.diameter);
    sum += sampler(0.5);
    count += 1.0;
  }
  if (count == 0.0)
    for (const Inlet& inlet : scene.inlets)
      for (const GrainSeed& grain : inlet.list->grains) sum += 2.0 * grain.radius, count += 1.0;
  return count > 0.0 ? sum / count : 0.0;
}

}  // namespace

bool are_grains_alike(const Scene& scene) {
  Sizes all;
  int n_materials = 0;
  for (const Material& material : scene.materials) {
    const Sizes sizes = sizes_of(scene, material.name);
    if (!(sizes.largest > 0.0)) continue;
    ++n_materials;
    all.smallest = std::min(all.smallest, sizes.smallest);
    all.largest = std::max(all.largest, sizes.largest);
  }
  return n_materials == 1 && all.smallest == all.largest;
}

double mean_diameter(const Scene& scene) { return mean_diameter_of(scene, count_groups(scene)); }

double expected_speed(const Scene& scene) {
  if (scene.time.max_speed > 0.0) return scene.time.max_speed;
  double speed = 0.0;
  for (const ParticleGroup& group : scene.particles) {
    speed = std::max(speed, length(group.velocity) + 4.0 * group.velocity_deviation);
    if (const auto* listed = std::get_if<ListedGrains>(&group.fill)) speed = std::max(speed, facts_of(*listed).fastest);
  }
  const Vec3 g = scene.time.gravity, size = scene.domain.box().size();
  double fall = 0.0;  // g h over the directions in which a grain can fall
  for (int axis = 0; axis < 3; ++axis)
    if (!scene.domain.periodic[static_cast<std::size_t>(axis)]) fall += std::abs(g[axis]) * size[axis];
  for (const Inlet& inlet : scene.inlets)
    speed = std::max(speed, length(inlet.velocity) + 4.0 * inlet.velocity_deviation);
  speed = std::sqrt(speed * speed + 2.0 * fall) + fastest_wall(scene);
  return speed > 0.0 ? speed : 1.0;
}

namespace {

/// A Rayleigh wave crosses the surface of the smallest grain, of each material with a Young's modulus; a fifth of that is
/// what quasi-static Hertz contacts need, whose stiffness is that of their load and not of an impact (Thornton & Randall
/// 1988; Li, Xu & Thornton 2005).
void limit_by_rayleigh(const Scene& scene, StepChoice& choice) {
  constexpr double share = 0.2;
  for (const Material& material : scene.materials) {
    const Sizes sizes = sizes_of(scene, material.name);
    if (!(sizes.largest > 0.0) || !(material.young > 0.0)) continue;
    const double shear = material.young / (2.0 * (1.0 + material.poisson));
    const double time = std::numbers::pi * 0.5 * sizes.smallest * std::sqrt(material.density / shear) /
                        (0.1631 * material.poisson + 0.8766);
    choice.limits.push_back({fmt::format("{:g} of the Rayleigh time of {} (d {:.4g} m), {:.4g} s", share, material.name,
                                         sizes.smallest, time),
                             share * time});
  }
}

double smallest_radius(const Scene& scene) {
  double smallest = infinity;
  for (const Material& material : scene.materials)
    smallest = std::min(smallest, 0.5 * sizes_of(scene, material.name).smallest);
  return smallest;
}

}  // namespace

StepChoice choose_time_step(const Scene& scene) {
  StepChoice choice;
  choice.contact_time = infinity;
  choice.speed = expected_speed(scene);
  for (const ContactCase& bodies : contact_cases(scene)) {
    const double time =
        contact_time(scene, bodies.parameters, bodies.reduced_mass(), bodies.reduced_radius(), choice.speed);
    if (time < choice.contact_time) {
      choice.contact_time = time;
      choice.limit = bodies.words;
    }
  }
  const bool has_grains = choice.contact_time < infinity;
  if (!has_grains) {  // anything will do
    choice.contact_time = scene.gas ? choose_gas_step(scene) * scene.time.steps_per_contact : scene.time.end;
    choice.limit = scene.gas ? "the gas (there are no grains)" : "nothing (there are no grains)";
  }
  if (scene.contact.normal == NormalLaw::hertz) choice.limit += fmt::format(" at {:.3g} m/s", choice.speed);
  choice.limits.push_back({choice.limit, choice.contact_time / scene.time.steps_per_contact});
  if (has_grains) {
    if (scene.contact.normal == NormalLaw::hertz) limit_by_rayleigh(scene, choice);
    choice.limits.push_back(
        {fmt::format("{:g} of the smallest radius travelled at {:.3g} m/s", foreseen_travel, choice.speed),
         foreseen_travel * smallest_radius(scene) / choice.speed});
    if (scene.gas) choice.limits.push_back({"the gas step, which is a whole number of them", choose_gas_step(scene)});
  }
  std::stable_sort(choice.limits.begin(), choice.limits.end(),
                   [](const StepLimit& a, const StepLimit& b) { return a.step < b.step; });
  choice.automatic = choice.limits.front().step;
  choice.step = scene.time.step.value_or(choice.automatic);
  choice.steps_per_contact = choice.contact_time / choice.step;
  return choice;
}

double choose_gas_step(const Scene& scene) {
  const Gas& gas = *scene.gas;
  if (gas.step) return *gas.step;
  const Vec3 size = scene.domain.box().size();
  const auto crossing = [&](Vec3 velocity) {  // between grains gas is about two and a half times as fast as above them
    double rate = 0.0;
    for (int axis = 0; axis < 3; ++axis)
      rate += 2.5 * std::abs(velocity[axis]) * gas.cells[static_cast<std::size_t>(axis)] / size[axis];
    return rate > 0.0 ? 1.0 / rate : infinity;
  };
  double step = crossing(gas.velocity);
  for (const GasBoundary& boundary : gas.boundaries) step = std::min(step, crossing(boundary.velocity));
  for (const Material& material : scene.materials) {
    const Sizes sizes = sizes_of(scene, material.name);
    // Stokes' drag, ten times as strong as on a grain alone, as in a bed
    if (gas.drag && sizes.largest > 0.0 && gas.viscosity > 0.0)
      step = std::min(step, 0.1 * material.density * sizes.smallest * sizes.smallest / (180.0 * gas.viscosity));
  }
  if (gas.drag && !(scene.particles.empty() && scene.inlets.empty())) {
    // Void fractions follow the grains from gas step to gas step: as fast as they may get, half a cell
    const double speed = expected_speed(scene);
    for (int axis = 0; axis < (scene.domain.dimensions == 2 ? 2 : 3); ++axis)
      step = std::min(step, 0.5 * size[axis] / gas.cells[static_cast<std::size_t>(axis)] / speed);
  }
  if (step < infinity) return step;
  return 1e-3 * std::max(scene.time.end, 0.0);
}

namespace {

/// Friction divides gas steps into parts that explicit steps of it can bear: thin gas in small cells does not come far.
void look_at_viscosity(const Scene& scene, Plan& plan) {
  constexpr double many = 200.0;
  const double step = static_cast<double>(plan.gas_steps) * plan.time_step.step;
  const double parts = viscous_parts(*scene.gas, gas_grid(scene.domain, *scene.gas), step);
  const std::string text = fmt::format(
      "is {:g} Pa s, {:.3g} m2/s over the density: so viscous for its cells that the gas step of {:.4g} s has to be "
      "divided into {:.3g} parts",
      scene.gas->viscosity, scene.gas->viscosity / scene.gas->density, step, std::ceil(parts));
  if (!(parts < most_gas_parts))
    throw SceneError({{"gas.viscosity",
                       text + fmt::format("; at most {:g} are possible: use larger cells, or a gas.step of at most "
                                          "{:.2g} s (the work stays the same)",
                                          most_gas_parts, 0.5 * most_gas_parts / parts * step),
                       false}});
  if (parts > many)
    plan.warnings.push_back("gas.viscosity " + text +
                            ", which takes time; larger cells need fewer, as the square of their width");
}

}  // namespace

Plan make_plan(const Scene& scene, int n_threads) {
  Plan plan;
  plan.time_step = choose_time_step(scene);
  const double n_steps = std::ceil(scene.time.end / plan.time_step.step - 1e-9);
  if (!(n_steps < most_steps))
    throw SceneError({{"time.end",
                       fmt::format("is {} s, {:.3g} steps of {:.3g} s; at most {:.0e} can be counted", scene.time.end,
                                   n_steps, plan.time_step.step, most_steps),
                       false}});
  plan.n_steps = static_cast<std::uint64_t>(n_steps);
  if (scene.gas)
    plan.gas_steps = static_cast<std::uint64_t>(
        std::clamp(std::floor(choose_gas_step(scene) / plan.time_step.step * (1.0 + 1e-9)), 1.0, most_steps));
  if (scene.gas) look_at_viscosity(scene, plan);
  const std::vector<std::int64_t> n_grains = count_groups(scene);
  plan.n_grains = static_cast<std::uint64_t>(std::accumulate(n_grains.begin(), n_grains.end(), std::int64_t{0}));
  plan.mean_diameter = mean_diameter_of(scene, n_grains);
  plan.skin = scene.run.skin > 0.0 ? scene.run.skin : 0.1 * plan.mean_diameter;
  plan.memory = bytes_of_program + static_cast<double>(plan.n_grains) * bytes_per_grain(scene) +
                (scene.gas ? n_gas_cells(scene) * bytes_per_cell(*scene.gas) : 0.0);
  for (const Probe& probe : scene.output.probes)
    if (probe.kind == Probe::Kind::fields) plan.memory += memory_of_fields(scene, probe);
  // Particle-steps a second of one core as measured on the settled bed (bench/results); a guess for any other scene.
  const double rate = 8e6 * std::max(1.0, 0.9 * n_threads);
  plan.seconds = static_cast<double>(plan.n_grains) * static_cast<double>(plan.n_steps) / rate;
  describe(scene, plan);
  warn_of_coarse_bonds(scene, plan);
  if (plan.time_step.steps_per_contact < 15.0)
    plan.warnings.push_back(
        fmt::format("time.step = {:.4g} s gives the shortest contact ({}, {:.4g} s) only {:.1f} steps: forces will be "
                    "wrong, and below about 6 the "
                    "run blows up; at most {:.4g} s (20 steps) is advised",
                    plan.time_step.step, plan.time_step.limit, plan.time_step.contact_time,
                    plan.time_step.steps_per_contact, plan.time_step.contact_time / 20.0));
  return plan;
}

}  // namespace moraine
