// A bed at rest stays at rest.
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
  double kinetic = 0.0;  // largest of a grain, over that of a fall by a radius [-]
  double creep = 0.0;    // largest displacement of a grain [radii]
  double centre = 0.0;   // displacement of the centre of the bed [radii]
  std::size_t n_grains = 0;
};

/// Lets the bed settle for `settle` steps and watches it for `rest` steps.
Rest rest_of(NormalLaw law, bool rotation, int settle, int rest) {
  Simulation run(settling_bed(law, rotation), 1);
  for (int i = 0; i < settle; ++i) run.step();
  const State start = state_of(run);
  Rest found;
  for (int k = 0; k < 20; ++k) {
    for (int i = 0; i < rest / 20; ++i) run.step();
    for (const Vec3& v : state_of(run).velocity)
      found.kinetic = std::max(found.kinetic, 0.5 * squared_length(v) / (9.81 * grain_radius));
  }
  const State end = state_of(run);
  Vec3 centre;
  for (std::size_t i = 0; i < end.position.size(); ++i) {
    const Vec3 moved = end.position[i] - start.position[i];
    found.creep = std::max(found.creep, length(moved) / grain_radius);
    centre += moved;
  }
  found.n_grains = end.position.size();
  found.centre = length(centre) / static_cast<double>(found.n_grains) / grain_radius;
  report(
      "%s bed of %zu %s grains, %d steps at rest: kinetic energy of a grain at most %.1e of m g r, creep of a grain "
      "%.1e, of the centre %.1e radii",
      law == NormalLaw::linear ? "linear" : "Hertz", found.n_grains, rotation ? "rotating" : "plain", rest,
      found.kinetic, found.creep, found.centre);
  return found;
}

void check_rest(int rest) {
  for (const NormalLaw law : {NormalLaw::linear, NormalLaw::hertz}) {
    const Rest plain = rest_of(law, false, 300000, rest);
    CHECK(plain.kinetic < 1e-20);
    CHECK(plain.creep < 1e-12);
    // A grain held at two opposite points may turn about them for ever: nothing resists twisting. The bed rests all the same.
    const Rest rotating = rest_of(law, true, 400000, rest);
    CHECK(rotating.kinetic < 1e-5);
    CHECK(rotating.centre < 1e-3);
  }
}

}  // namespace

TEST_CASE("a settled bed stays at rest", "[rest]") { check_rest(100000); }

TEST_CASE("a settled bed stays at rest for a million steps", "[.long][rest]") { check_rest(1000000); }
