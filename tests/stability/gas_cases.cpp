// Gas that is hard on its solver and on the exchange with grains: next to nothing, next to no room, jets at 100 m/s, void
// fractions that jump from cell to cell, a liquid, cells as small as grains. Each goes on well through a restart, or ends with an
// error that names the cure.
#include <cmath>

#include "tests/stability/laboratory.hpp"

using namespace moraine;
using namespace moraine::hard;

namespace {

/// A small bed on a floor through which gas comes in at so many m/s.
Scene bed(double speed) {
  Scene s = scenes::fluidised_bed();
  s.domain.high = {0.08, 0.06, 0.3};
  s.particles = {scenes::lattice({{0, 0, 0}, {0.08, 0.06, 0.07}}, 1.03 * scenes::d)};
  s.walls.clear();
  scenes::add_wall(s, "box", BoxShape{s.domain.box()}, "steel");
  s.output.probes.clear();
  s.gas->cells = {4, 3, 15};
  s.gas->boundaries.erase(s.gas->boundaries.begin() + 1);  // the jet
  s.gas->boundaries[0].velocity = {0, 0, speed};
  s.gas->boundaries[0].ramp.clear();
  return s;
}

/// Runs it through a restart, and looks that nothing has run away.
void check_sound(const Scene& scene, int n_steps, double fastest) {
  Simulation simulation(scene, 2);
  advance_through_restart(simulation, scene, n_steps);
  CHECK(largest_speed(simulation) < fastest);
  const GasTotals gas = *simulation.gas_totals();
  CHECK(gas.imbalance < 1e-5);
  CHECK(gas.momentum_error < 1e-9);
  CHECK(simulation.n_grains() == simulation.n_born() - simulation.n_left());
}

}  // namespace

TEST_CASE("gas that is nearly a vacuum leaves grains to fall as if there were none") {
  Scene s = bed(0.0);
  s.gas->density = 1e-6;
  s.gas->viscosity = 1e-9;
  s.particles[0].velocity_deviation = 0.0;
  Scene without = s;
  without.gas.reset();
  check_sound(s, 200, 1.0);
  Simulation a(s, 1), b(without, 1);
  advance(a, 200);
  advance(b, 200);
  CHECK(largest_difference(positions(a), positions(b)) < 1e-6 * scenes::d);
}

TEST_CASE("cells that are nearly packed, beside empty ones, pass gas on without running away") {
  // Face-centred cubic layers: a void fraction of 0.27 in the bed and 1 in the cells above.
  Scene s = bed(0.5);
  std::get<LatticeFill>(s.particles[0].fill).kind = LatticeFill::Kind::hexagonal;
  std::get<LatticeFill>(s.particles[0].fill).spacing = 1.0005 * scenes::d;
  std::get<LatticeFill>(s.particles[0].fill).jitter = 0.0;
  s.particles[0].velocity_deviation = 0.0;
  check_sound(s, 200, 1.0);
  Simulation simulation(s, 1);
  advance(simulation, 50);
  CHECK(simulation.gas_totals()->least_void_fraction < 0.36);
}

TEST_CASE("a jet of 100 m/s into a bed is borne, or ends with the gas step that would do") {
  for (const double gas_step : {2e-4, 4e-5}) {
    INFO("gas step " << gas_step);
    Scene s = bed(0.5);
    GasBoundary jet = s.gas->boundaries[0];
    jet.part = Box{{0.02, 0.02, -1.0}, {0.06, 0.04, 1.0}};
    jet.velocity = {0, 0, 100.0};
    s.gas->boundaries.insert(s.gas->boundaries.begin() + 1, jet);
    s.gas->step = gas_step;
    s.outlets = {{"top", 5}};
    std::string said = "it went through";
    try {
      check_sound(s, 400, 100.0);
    } catch (const RunError& error) {
      said = error.what();
      CHECK_THAT(said, Catch::Contains("gas.step") || Catch::Contains("grain"));
    }
    WARN(said);
  }
}

TEST_CASE("a void fraction that falls from 1 to 0.35 from one cell to the next is borne, in and across the flow") {
  for (const Vec3 wind : {Vec3{0, 0, 3}, Vec3{3, 0, 0}}) {
    Scene s = bed(0.0);
    s.domain.periodic = {true, true, false};
    s.walls.clear();
    scenes::add_wall(s, "floor", PlaneShape{{0, 0, 0}, {0, 0, 1}}, "steel");
    s.particles = {scenes::lattice({{0, 0, 0}, {0.04, 0.06, 0.3}}, 1.0005 * scenes::d)};
    std::get<LatticeFill>(s.particles[0].fill).kind = LatticeFill::Kind::hexagonal;
    std::get<LatticeFill>(s.particles[0].fill).jitter = 0.0;
    s.gas->velocity = wind;
    s.gas->boundaries[0].velocity = {0, 0, wind.z};
    check_sound(s, 200, 5.0);
  }
}

TEST_CASE("grains sink in a liquid, a thousand times as dense as air, at the speed that drag and buoyancy allow") {
  Scene s = scenes::basic();
  s.domain.high = {0.08, 0.08, 0.3};
  s.domain.periodic = {true, true, false};
  s.time.gravity = {0, 0, -9.81};
  ListedGrains one;
  one.grains = {{{0.041, 0.039, 0.25}, {}, {}, 0.0, 0}};
  ParticleGroup group;
  group.material = "glass";
  group.diameter.value = 0.005;
  group.fill = one;
  s.particles = {group};
  scenes::add_wall(s, "floor", PlaneShape{{0, 0, 0}, {0, 0, 1}}, "steel");
  s.gas = scenes::air({2, 2, 8});
  s.gas->density = 1000.0;
  s.gas->viscosity = 1e-3;
  s.gas->drag = DragLaw::schiller_naumann;
  GasBoundary top;
  top.kind = GasBoundary::Kind::pressure;
  top.face = 5;
  s.gas->boundaries = {top};
  s.gas->moves_gas = false;
  Simulation simulation(s, 1);
  advance_through_restart(simulation, s, 8000);
  // terminal velocity by the drag law of Schiller & Naumann 1933, by iteration
  double v = 0.3;
  for (int i = 0; i < 100; ++i) {
    const double re = 1000.0 * v * 0.005 / 1e-3;
    const double c = re < 1000.0 ? 24.0 / re * (1.0 + 0.15 * std::pow(re, 0.687)) : 0.44;
    v = std::sqrt(4.0 / 3.0 * 0.005 * 9.81 * 1.5 / c);
  }
  CHECK(-velocity(simulation, 0).z == Approx(v).epsilon(0.02));
}

TEST_CASE("a bed in a liquid, coupled both ways, comes apart and settles without running away") {
  Scene s = bed(0.01);
  s.gas->density = 1000.0;
  s.gas->viscosity = 1e-3;
  for (Material& material : s.materials) material.density *= 5.0;  // glass again
  check_sound(s, 300, 1.0);
}

TEST_CASE("cells as small as a grain are borne with smoothing, and what a cell cannot hold is counted") {
  Scene s = bed(0.6);
  s.gas->cells = {8, 6, 30};
  s.gas->weights = GasWeights::smoothed;
  s.gas->smoothing = scenes::d;
  check_sound(s, 100, 2.0);
  s.gas->weights = GasWeights::trilinear;
  s.gas->smoothing = 0.0;
  try {
    check_sound(s, 60, 5.0);
  } catch (const SceneError& error) {
    CHECK_THAT(error.what(), Catch::Contains("gas"));
  }
}
