// Restitution: what comes out of a collision is what the scene asked for, whatever the sizes and the time step.
//
// A contact begins and ends between two steps, and dashpots are weighted there (kernels/contact/README.md). So the error of each
// collision, wherever that moment falls, is of second order with the linear law; a Hertz dashpot, which begins like
// overlap^(1/4), has first order left.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "tests/physics/laboratory.hpp"

using namespace moraine;
using namespace moraine::physics;

namespace {

struct Collision {
  NormalLaw normal = NormalLaw::linear;
  double restitution = 1.0;
  double size_ratio = 1.0;
  double steps_per_contact = 50.0;
  bool is_wall = false;  // the second body is a plane
  int n_phases = 32;
};

struct Errors {
  double mean = 0.0;    // of the restitution, over the phases
  double spread = 0.0;  // root of the mean square
  double worst = 0.0;
};

/// Time of a contact without its dashpot for two grains of density 2500, the larger one of radius 1 mm, at 1 m/s.
struct Pair {
  double r1, r2, m1, m2, reduced, time;
};

constexpr double density = 2500.0, young = 1e8, poisson = 0.25, stiffness = 1e4, speed = 1.0;

Pair pair_of(const Collision& c) {
  Pair p{1e-3, 1e-3 / c.size_ratio, 0, 0, 0, 0};
  p.m1 = mass_of(density, p.r1);
  p.m2 = mass_of(density, p.r2);
  p.reduced = c.is_wall ? p.m2 : p.m1 * p.m2 / (p.m1 + p.m2);
  if (c.normal == NormalLaw::linear) {
    p.time = pi * std::sqrt(p.reduced / stiffness);
  } else {
    const double e = 0.5 * young / (1.0 - poisson * poisson), r = c.is_wall ? p.r2 : p.r1 * p.r2 / (p.r1 + p.r2);
    p.time = 2.868 * std::pow(p.reduced * p.reduced / (r * e * e * speed), 0.2);
  }
  return p;
}

Errors collide(const Collision& c) {
  const Pair pair = pair_of(c);
  const double step = pair.time / c.steps_per_contact, spacing = 4e-3;
  Scene scene = empty_scene({-0.01, -0.01, -0.01}, {spacing * c.n_phases, 0.01, 0.01}, step);
  scene.output.fields = {"position", "velocity"};
  scene.materials = {{"grain", density, young, poisson}};
  scene.contact.normal = c.normal;
  scene.contact.tangential = TangentialLaw::none;
  scene.contact.rotation = false;
  PairLaw law = pair_law("grain", "grain", c.restitution, 0.0);
  if (c.normal == NormalLaw::linear) law.normal_stiffness = stiffness;
  scene.contact.pairs.push_back(law);
  if (c.is_wall) add_plane(scene, "floor", "grain", {0, 0, 0}, {0, 0, 1});
  for (int i = 0; i < c.n_phases; ++i) {
    const double x = i * spacing, gap = speed * step * (2.0 + (i + 0.5) / c.n_phases);
    if (c.is_wall) {
      add_grain(scene, "grain", pair.r2, {x, 0, pair.r2 + gap}, {0, 0, -speed});
    } else {
      add_grain(scene, "grain", pair.r1, {x, 0, -pair.r1}, {});
      add_grain(scene, "grain", pair.r2, {x, 0, pair.r2 + gap}, {0, 0, -speed});
    }
  }
  Simulation run(scene, 1);
  // A strongly damped contact lasts longer than an elastic one; one that has parted stays so.
  while (run.time() < 12.0 * pair.time) run.step();
  const State end = state_of(run);
  Errors errors;
  for (std::size_t i = 0; i < static_cast<std::size_t>(c.n_phases); ++i) {
    const double out = c.is_wall ? end.velocity[i].z : end.velocity[2 * i + 1].z - end.velocity[2 * i].z;
    const double error = out / speed - c.restitution;
    errors.mean += error / c.n_phases;
    errors.spread += error * error / c.n_phases;
    errors.worst = std::max(errors.worst, std::abs(error));
  }
  errors.mean = std::abs(errors.mean);
  errors.spread = std::sqrt(errors.spread);
  return errors;
}

}  // namespace

TEST_CASE("a collision gives the restitution of the scene for both normal laws, from 0.05 to 1", "[restitution]") {
  for (const NormalLaw law : {NormalLaw::linear, NormalLaw::hertz})
    for (const double e : {0.05, 0.1, 0.2, 0.5, 0.8, 0.9, 0.95, 1.0}) {
      Errors by_step[3];
      const double steps[3] = {20, 50, 200};
      for (int k = 0; k < 3; ++k) by_step[k] = collide({law, e, 1.0, steps[k], false});
      report("%s e %.2f: mean error %.1e %.1e %.1e, worst %.1e %.1e %.1e at 20, 50, 200 steps a contact",
             name_of(law).data(), e, by_step[0].mean, by_step[1].mean, by_step[2].mean, by_step[0].worst,
             by_step[1].worst, by_step[2].worst);
      CHECK(by_step[0].worst < 0.012);
      CHECK(by_step[1].worst < 0.002);
      CHECK(by_step[2].worst < 2e-4);
      CHECK(by_step[1].mean < 2e-3);
      CHECK(by_step[2].mean < 1.5e-4);
    }
}

TEST_CASE("restitution converges in each collision: second order with the linear law, first with Hertz's dashpot",
          "[restitution]") {
  for (const NormalLaw law : {NormalLaw::linear, NormalLaw::hertz})
    for (const double e : {0.2, 0.5, 0.9, 1.0}) {
      const Errors coarse = collide({law, e, 1.0, 25, false, 1024}), fine = collide({law, e, 1.0, 200, false, 1024});
      const auto order = [&](double of_coarse, double of_fine) {
        return std::log(of_coarse / of_fine) / std::log(8.0);
      };
      const double spread = order(coarse.spread, fine.spread), worst = order(coarse.worst, fine.worst);
      report(
          "%s e %.1f: mean error %.2e at 25 and %.2e at 200 steps a contact; spread %.2e and %.2e, order %.2f; worst "
          "%.2e and %.2e, order %.2f",
          name_of(law).data(), e, coarse.mean, fine.mean, coarse.spread, fine.spread, spread, coarse.worst, fine.worst,
          worst);
      CHECK(spread > (e == 1.0 ? 2.0 : law == NormalLaw::linear ? 1.8 : 0.9));
      CHECK(worst > (e == 1.0 ? 2.0 : law == NormalLaw::linear ? 1.7 : 0.9));
    }
}

TEST_CASE("a collision gives the restitution of the scene for sizes from 1:1 to 1:20 and against a wall",
          "[restitution]") {
  for (const NormalLaw law : {NormalLaw::linear, NormalLaw::hertz})
    for (const double e : {0.1, 0.5, 0.9}) {
      double worst = 0.0, mean = 0.0;
      for (const double ratio : {1.0, 2.0, 5.0, 20.0}) {
        const Errors errors = collide({law, e, ratio, 50, false});
        worst = std::max(worst, errors.worst);
        mean = std::max(mean, errors.mean);
      }
      const Errors wall = collide({law, e, 1.0, 50, true});
      report("%s e %.1f: sizes 1:1 to 1:20: mean error %.1e, worst %.1e; wall %.1e, %.1e", name_of(law).data(), e, mean,
             worst, wall.mean, wall.worst);
      CHECK(worst < 0.002);
      CHECK(mean < 1e-3);
      CHECK(wall.worst < 0.002);
      CHECK(wall.mean < 1e-3);
    }
}

TEST_CASE("a grain at rest on the ground overlaps it by its weight over the stiffness, and does not creep",
          "[restitution]") {
  const double radius = 1e-3, mass = mass_of(density, radius), weight = mass * 9.81;
  for (const NormalLaw law : {NormalLaw::linear, NormalLaw::hertz})
    for (const double e : {0.1, 0.5, 0.9}) {
      const double e_star = 0.5 * young / (1.0 - poisson * poisson);
      const double overlap = law == NormalLaw::linear
                                 ? weight / stiffness
                                 : std::pow(weight / (4.0 / 3.0 * e_star * std::sqrt(radius)), 2.0 / 3.0);
      const double period =
          law == NormalLaw::linear ? pi * std::sqrt(mass / stiffness) : pi * std::sqrt(mass / (1.5 * weight / overlap));
      Scene scene = empty_scene({-0.01, -0.01, -0.01}, {0.01, 0.01, 0.01}, period / 50.0);
      scene.time.gravity = {0, 0, -9.81};
      scene.materials = {{"grain", density, young, poisson}};
      scene.contact.normal = law;
      PairLaw pair = pair_law("grain", "grain", e, 0.5);
      if (law == NormalLaw::linear)
        pair.normal_stiffness = stiffness;
      else
        scene.contact.tangential = TangentialLaw::mindlin;
      scene.contact.pairs.push_back(pair);
      add_plane(scene, "floor", "grain", {0, 0, 0}, {0, 0, 1});
      add_grain(scene, "grain", radius, {0, 0, radius - 0.5 * overlap});
      Simulation run(scene, 1);
      const int n = e < 0.6 ? 5000 : 40000;
      for (int i = 0; i < n; ++i) run.step();
      const double settled = state_of(run).position[0].z;
      for (int i = 0; i < n; ++i) run.step();
      const State end = state_of(run);
      const double error = std::abs((radius - end.position[0].z) / overlap - 1.0),
                   creep = std::abs(end.position[0].z - settled) / radius;
      report("%s e %.1f at rest: overlap off by %.1e of itself, creep %.1e radii, speed %.1e m/s", name_of(law).data(),
             e, error, creep, length(end.velocity[0]));
      CHECK(error < 1e-9);  // round-off of a coordinate over the overlap
      CHECK(creep < 1e-14);
      CHECK(length(end.velocity[0]) < 1e-12);
    }
}
