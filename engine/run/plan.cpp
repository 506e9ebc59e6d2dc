#include "engine/run/plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/contacts/law_table.hpp"
#include "engine/particles/fill.hpp"
#include "engine/particles/sizes.hpp"
#include "engine/scene/lists.hpp"
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

double mean_diameter(const Scene& scene) {
  double sum = 0.0, count = 0.0;
  for (const ParticleGroup& group : scene.particles) {
    if (const auto* listed = std::get_if<ListedGrains>(&group.fill); listed && listed->has_radius) {
      const ListFacts facts = facts_of(*listed);
      sum += facts.sum_of_diameters;
      count += static_cast<double>(facts.n_grains);
    } else {
      const DiameterSampler sampler(group.diameter);
      constexpr int n = 64;
      for (int i = 0; i < n; ++i) sum += sampler((i + 0.5) / n) / n;
      count += 1.0;
    }
  }
  return count > 0.0 ? sum / count : 0.0;
}

/// Bytes a grain: record, gid, material, place at the last rebuild, pairs with memory and entries, scratch of a rebuild.
double bytes_per_grain(const Scene& scene) {
  const bool remembers = has_history(scene.contact.tangential);
  const double record = 8.0 * record_size(scene.contact.rotation);
  const MemoryColumns columns = memory_of(law_choice(scene));
  const double further = 8.0 * ((columns.has_rolling ? 3.0 : 0.0) + (columns.has_bond ? 1.0 : 0.0));
  const double pairs = 4.2 * (8.0 + 8.0 + (remembers ? 32.0 : 0.0) + further + 2.0);
  return 2.0 * record + 8.0 + 2.0 + 24.0 + pairs + (remembers ? 110.0 : 0.0) + 40.0 +
         (scene.output.energy ? 32.0 : 0.0);
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
  plan.chosen.push_back(fmt::format("contacts: normal {}, tangential {}, double precision, {} lanes by {}",
                                    name_of(scene.contact.normal), name_of(scene.contact.tangential),
                                    std::string(instruction_set()) == "AVX3" ? 8 : 4, instruction_set()));
  say(plan.chosen, scene.contact.rotation, "rotation", "rotation (grains do not spin: 64 bytes a grain instead of 96)",
      plan.left_out);
  const bool remembers = has_history(scene.contact.tangential);
  say(plan.chosen, remembers, "contact history", "contact history (the tangential law needs none)", plan.left_out);
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
  say(plan.chosen, scene.gas.has_value(), "gas", "gas", plan.left_out);
}

}  // namespace

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
  speed = std::sqrt(speed * speed + 2.0 * fall);
  return speed > 0.0 ? speed : 1.0;
}

StepChoice choose_time_step(const Scene& scene) {
  StepChoice choice;
  choice.contact_time = infinity;
  const double speed = expected_speed(scene);
  std::vector<std::pair<std::string, Sizes>> grains;
  for (const Material& material : scene.materials)
    if (const Sizes sizes = sizes_of(scene, material.name); sizes.largest > 0.0)
      grains.emplace_back(material.name, sizes);
  const auto density = [&](const std::string& name) {
    return scene.materials[static_cast<std::size_t>(scene.material_index(name))].density;
  };
  const auto mass = [&](const std::string& name, double d) { return density(name) * sphere_volume(0.5 * d); };
  const auto consider = [&](const PairParameters& p, double reduced_mass, double reduced_radius,
                            const std::string& words) {
    const double time = contact_time(scene, p, reduced_mass, reduced_radius, speed);
    if (time < choice.contact_time) {
      choice.contact_time = time;
      choice.limit = words;
    }
  };
  for (const auto& [a, sa] : grains) {
    const double da = sa.smallest, ma = mass(a, da);
    for (const auto& [b, sb] : grains) {
      const double db = sb.smallest, mb = mass(b, db);
      consider(pair_parameters(scene, a, b), ma * mb / (ma + mb), 0.5 * da * db / (da + db),
               fmt::format("{} (d {:.4g} m) with {} (d {:.4g} m)", a, da, b, db));
    }
    for (const WallDefinition& wall : scene.walls) {
      if (wall.symmetry) {
        consider(pair_parameters(scene, a, a), 0.5 * ma, 0.25 * da,
                 fmt::format("{} (d {:.4g} m) with its mirror image", a, da));
      } else {
        consider(pair_parameters(scene, a, wall.material), ma, 0.5 * da,
                 fmt::format("{} (d {:.4g} m) with wall \"{}\" ({})", a, da, wall.name, wall.material));
      }
    }
  }
  if (choice.contact_time == infinity) {  // no grains: anything will do
    choice.contact_time = scene.gas ? choose_gas_step(scene) * scene.time.steps_per_contact : scene.time.end;
    choice.limit = scene.gas ? "the gas (there are no grains)" : "nothing (there are no grains)";
  }
  if (scene.contact.normal == NormalLaw::hertz) choice.limit += fmt::format(" at {:.3g} m/s", speed);
  choice.automatic = choice.contact_time / scene.time.steps_per_contact;
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
  if (step < infinity) return step;
  return 1e-3 * std::max(scene.time.end, 0.0);
}

Plan make_plan(const Scene& scene, int n_threads) {
  Plan plan;
  plan.time_step = choose_time_step(scene);
  if (scene.gas)
    plan.gas_steps = static_cast<std::uint64_t>(
        std::max(1.0, std::floor(choose_gas_step(scene) / plan.time_step.step * (1.0 + 1e-9))));
  plan.n_steps = static_cast<std::uint64_t>(std::ceil(scene.time.end / plan.time_step.step - 1e-9));
  plan.n_grains = static_cast<std::uint64_t>(count_grains(scene));
  plan.skin = scene.run.skin > 0.0 ? scene.run.skin : 0.1 * mean_diameter(scene);
  plan.memory = 4e7 + static_cast<double>(plan.n_grains) * bytes_per_grain(scene);
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
