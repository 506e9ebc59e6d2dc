// A bed at rest stays at rest.
//
// A grain that touches nothing but a level floor may roll for ever, and one held at two opposite points may turn about them: the
// contact laws resist neither. What ends such motion is bulk viscosity, which acts on spin as on velocity; with it
// a bed comes to rest down to round-off.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "tests/physics/laboratory.hpp"

using namespace moraine;
using namespace moraine::physics;

namespace {

/// Grains dropped into a small box with friction and bulk viscosity.
Scene settling_bed(NormalLaw normal, bool rotation) {
  const double radius = 2e-3, side = 0.024;
  Scene scene = empty_scene({0, 0, 0}, {side, side, 0.06}, 1e-5);
  scene.output.fields = {"position", "velocity"};
  scene.time.gravity = {0, 0, -9.81};
  scene.time.damping = 20.0;
  scene.materials = {{"grain", 2500, 5e6, 0.25}};
  scene.contact.normal = normal;
  scene.contact.tangential = normal == NormalLaw::linear ? TangentialLaw::spring : TangentialLaw::mindlin;
  scene.contact.rotation = rotation;
  PairLaw law = pair_law("grain", "grain", 0.5, 0.5);
  if (normal == NormalLaw::linear) law.normal_stiffness = 3000.0;
  scene.contact.pairs = {law};
  WallDefinition box;
  box.name = "box";
  box.material = "grain";
  box.shape = BoxShape{{{0, 0, 0}, {side, side, 0.06}}};
  scene.walls.push_back(box);
  ParticleGroup group;
  group.material = "grain";
  group.diameter.kind = SizeDistribution::Kind::uniform;
  group.diameter.low = 1.8 * radius;
  group.diameter.high = 2.0 * radius;
  group.fill = LatticeFill{LatticeFill::Kind::cubic, BoxRegion{{{0, 0, 0}, {side, side, 0.03}}}, 4.4e-3, 0.9, {}};
  scene.particles.push_back(group);
  return scene;
}

constexpr double grain_radius = 2e-3;

struct Rest {
  double kinetic = 0.0;  // largest of a grain, spin and all, over that of a fall by a radius [-]
  double creep = 0.0;    // largest displacement of a grain [radii]
};

/// Lets the bed settle for `settle` steps and watches it for `rest` steps.
Rest rest_of(NormalLaw law, bool rotation, int settle, int rest) {
  Simulation run(settling_bed(law, rotation), 1);
  for (int i = 0; i < settle; ++i) run.step();
  const State start = state_of(run);
  Rest found;
  for (int k = 0; k < 20; ++k) {
    for (int i = 0; i < rest / 20; ++i) run.step();
    const State now = state_of(run);
    for (std::size_t i = 0; i < now.velocity.size(); ++i) {
      const double spin = rotation ? 0.4 * grain_radius * grain_radius * squared_length(now.spin[i]) : 0.0;
      found.kinetic = std::max(found.kinetic, 0.5 * (squared_length(now.velocity[i]) + spin) / (9.81 * grain_radius));
    }
  }
  const State end = state_of(run);
  for (std::size_t i = 0; i < end.position.size(); ++i)
    found.creep = std::max(found.creep, length(end.position[i] - start.position[i]) / grain_radius);
  report(
      "%s bed of %zu %s grains, %d steps at rest: kinetic energy of a grain at most %.1e of m g r, creep of a grain "
      "%.1e radii",
      law == NormalLaw::linear ? "linear" : "Hertz", end.position.size(), rotation ? "rotating" : "plain", rest,
      found.kinetic, found.creep);
  return found;
}

void check_rest(int rest) {
  for (const NormalLaw law : {NormalLaw::linear, NormalLaw::hertz}) {
    for (const bool rotation : {false, true}) {
      const Rest found = rest_of(law, rotation, 400000, rest);
      CHECK(found.kinetic < 1e-20);
      CHECK(found.creep < 1e-9);  // what is left of the slowest mode after the settling
    }
  }
}

}  // namespace

TEST_CASE("a grain that rolls on a level floor goes on for ever, and slows down by bulk viscosity alone", "[rest]") {
  for (const NormalLaw normal : {NormalLaw::linear, NormalLaw::hertz})
    for (const double damping : {0.0, 3.0}) {
      constexpr double speed = 0.1, twist = 40.0;
      Scene scene = empty_scene({-1, -0.01, -0.01}, {1, 0.01, 0.01}, 1e-5);
      scene.time.gravity = {0, 0, -9.81};
      scene.time.damping = damping;
      scene.materials = {{"grain", 2500, 5e6, 0.25}};
      scene.contact.normal = normal;
      scene.contact.tangential = normal == NormalLaw::linear ? TangentialLaw::spring : TangentialLaw::mindlin;
      PairLaw law = pair_law("grain", "grain", 0.5, 0.5);
      law.normal_stiffness = 3000.0;
      scene.contact.pairs = {law};
      add_plane(scene, "floor", "grain", {0, 0, 0}, {0, 0, 1});
      // at rest in its overlap; it rolls, and turns about the vertical
      const double weight = mass_of(2500, grain_radius) * 9.81, e_star = 0.5 * 5e6 / (1.0 - 0.0625);
      const double overlap = normal == NormalLaw::linear
                                 ? weight / law.normal_stiffness
                                 : std::pow(weight / (4.0 / 3.0 * e_star * std::sqrt(grain_radius)), 2.0 / 3.0);
      const double height = grain_radius - overlap;
      add_grain(scene, "grain", grain_radius, {0, 0, height}, {speed, 0, 0}, {0, speed / height, twist});
      Simulation run(scene, 1);
      while (run.time() < 1.0) run.step();
      const State end = state_of(run);
      // velocities lie half a step back
      const double left = std::exp(-damping * (run.time() - 0.5 * run.time_step()));
      report("%s, bulk viscosity %.0f 1/s: after 1 s speed %.12f, twist %.12f of %.12f", name_of(normal).data(),
             damping, end.velocity[0].x / speed, end.spin[0].z / twist, left);
      CHECK(end.velocity[0].x / speed == Approx(left).epsilon(1e-8));
      CHECK(height * end.spin[0].y / speed == Approx(left).epsilon(1e-8));
      CHECK(end.spin[0].z / twist == Approx(left).epsilon(1e-8));
    }
}

TEST_CASE("a settled bed stays at rest", "[rest]") { check_rest(100000); }

TEST_CASE("a settled bed stays at rest for a million steps", "[.long][rest]") { check_rest(1000000); }
