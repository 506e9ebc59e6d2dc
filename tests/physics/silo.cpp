// A flat-bottomed silo: wall pressure against Janssen (1895), discharge against Beverloo, Leniger & van de Velde (1961).
//
// Scaled down so that a run takes minutes: soft grains (overlap at the bottom below 1 % of a radius), a column of some ten
// diameters across.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "tests/physics/laboratory.hpp"

using namespace moraine;
using namespace moraine::physics;

namespace {

constexpr double diameter = 4e-3, density = 2500.0, young = 2e7, gravity = 9.81;

struct Silo {
  double radius = 12 * diameter;  // of the cylinder [m]
  double height = 40 * diameter;  // filled at random up to here [m]
  double orifice = 0.0;           // diameter [m]; 0: closed
  double open_at = 0.0;           // [s]
  double fill_fraction = 0.5;
};

Scene silo_scene(const Silo& silo) {
  const double below = 6 * diameter;
  Scene scene = empty_scene({-1.05 * silo.radius, -1.05 * silo.radius, -below},
                            {1.05 * silo.radius, 1.05 * silo.radius, 1.05 * silo.height}, 1.5e-5);
  scene.output.fields = {"position", "velocity"};
  scene.time.gravity = {0, 0, -gravity};
  scene.time.step = std::nullopt;
  scene.time.steps_per_contact = 25;
  scene.time.max_speed = 1.0;
  scene.materials = {{"grain", density, young, 0.25}};
  scene.contact.normal = NormalLaw::hertz;
  scene.contact.tangential = TangentialLaw::mindlin;
  scene.contact.pairs = {pair_law("grain", "grain", 0.7, 0.5)};
  WallDefinition wall;
  wall.name = "wall";
  wall.material = "grain";
  wall.shape = CylinderShape{{0, 0, 0}, {0, 0, 1}, silo.radius, 1.05 * silo.height};
  scene.walls.push_back(wall);
  WallDefinition floor;
  floor.name = "floor";
  floor.material = "grain";
  floor.shape = DiscShape{{0, 0, 0}, {0, 0, 1}, silo.radius, 0.5 * silo.orifice};
  scene.walls.push_back(floor);
  if (silo.orifice > 0.0) {
    WallDefinition gate = floor;
    gate.name = "gate";
    gate.shape = DiscShape{{0, 0, 0}, {0, 0, 1}, 0.5 * silo.orifice, 0.0};
    gate.until = silo.open_at;
    scene.walls.push_back(gate);
    scene.outlets.push_back({"out", 4});
  }
  ParticleGroup group;
  group.material = "grain";
  group.diameter.kind = SizeDistribution::Kind::uniform;
  group.diameter.low = 0.9 * diameter;
  group.diameter.high = 1.1 * diameter;
  group.fill = RandomFill{CylinderRegion{{0, 0, 0}, 2, silo.radius, silo.height}, silo.fill_fraction, {}};
  scene.particles.push_back(group);
  return scene;
}

/// Vertical force on a wall [N], from probe number `probe`.
double force_on(Simulation& run, std::size_t probe) { return run.probe_row(probe)[2]; }

}  // namespace

TEST_CASE("before it opens the floor of a silo bears what Janssen says", "[.long][silo]") {
  Silo silo;
  silo.radius = 6 * diameter;
  silo.height = 60 * diameter;
  Scene scene = silo_scene(silo);
  Probe floor;
  floor.kind = Probe::Kind::wall_force;
  floor.name = "floor";
  floor.wall = "floor";
  Probe wall = floor;
  wall.name = wall.wall = "wall";
  Probe pressure;
  pressure.kind = Probe::Kind::wall_pressure;
  pressure.name = "pressure";
  pressure.wall = "wall";
  pressure.bins = 12;
  scene.output.probes = {floor, wall, pressure};
  for (Probe& probe : scene.output.probes) probe.interval = 0.1;
  Simulation run(scene, std::min(4, n_cores()));
  const double weight = static_cast<double>(run.n_grains()) * mass_of(density, 0.5 * diameter) * (1 + 0.01) * gravity;
  while (run.time() < 1.2) run.step();
  const State state = state_of(run);
  double top = 0.0, speed = 0.0;
  for (std::size_t i = 0; i < state.position.size(); ++i) {
    top = std::max(top, state.position[i].z);
    speed = std::max(speed, length(state.velocity[i]));
  }
  const double on_floor = -force_on(run, 0), on_wall = -force_on(run, 1);
  const std::vector<double> wall_pressure = run.probe_row(2);
  const double area = pi * silo.radius * silo.radius, d = 2 * silo.radius;
  // stress in the column from the forces themselves: below z it is the weight above less what the wall bore above. K is measured
  // as wall pressure over vertical stress in the lower half; the floor must then bear Janssen's share with that K.
  double wall_normal = 0.0;
  const double bin = 1.05 * silo.height / static_cast<double>(wall_pressure.size());
  for (const double p : wall_pressure) wall_normal += p * bin * pi * d;
  const double mobilised = on_wall / wall_normal;  // friction on the wall over normal force
  report(
      "Janssen: %llu grains, column %.1f diameters high, top speed %.1e m/s; floor bears %.3f of the weight, wall "
      "%.3f; wall friction mobilised %.2f",
      static_cast<unsigned long long>(run.n_grains()), top / diameter, speed, on_floor / weight, on_wall / weight,
      mobilised);
  CHECK(std::abs((on_floor + on_wall) / weight - 1.0) < 0.02);
  // Fit of K: the mean wall pressure over the mean vertical stress, both from the run, layer by layer from above.
  double above = 0.0, ratio = 0.0, weights = 0.0;
  const double layer_weight = weight * bin / top;
  for (std::size_t b = wall_pressure.size(); b-- > 0;) {
    const double z = bin * static_cast<double>(b);
    if (z > top) continue;
    const double share = std::min(1.0, (top - z) / bin);
    const double friction = mobilised * wall_pressure[b] * bin * pi * d;
    const double middle = (above + 0.5 * (share * layer_weight - friction)) / area;
    if (z > 2 * d * 0.25 && share == 1.0) {
      ratio += wall_pressure[b];
      weights += middle;
    }
    above += share * layer_weight - friction;
  }
  const double k = ratio / weights, bulk = weight / (area * top * gravity);
  const double length_scale = d / (4.0 * mobilised * k),
               janssen = bulk * gravity * length_scale * (1.0 - std::exp(-top / length_scale));
  report("Janssen: K = %.3f, floor pressure %.1f Pa, Janssen's %.1f Pa (%+.1f %%), hydrostatic %.1f Pa", k,
         on_floor / area, janssen, 100 * (on_floor / area / janssen - 1), weight / area);
  CHECK(std::abs(on_floor / area / janssen - 1) < 0.10);
  CHECK(on_floor < 0.8 * weight);
}

TEST_CASE("a silo discharges by Beverloo's law", "[.long][silo]") {
  std::vector<double> diameters, flows;  // W / (rho_b sqrt(g)) [m^(5/2)]
  for (const double ratio : {6.5, 8.0, 10.0, 12.0}) {
    Silo silo;
    silo.radius = 13 * diameter;
    silo.height = 36 * diameter;
    silo.orifice = ratio * diameter;
    silo.open_at = 0.4;
    Scene scene = silo_scene(silo);
    Probe mass;
    mass.kind = Probe::Kind::mass;
    mass.name = "mass";
    mass.interval = 0.1;
    scene.output.probes = {mass};
    Simulation run(scene, std::min(4, n_cores()));
    const double grain = mass_of(density, 0.5 * diameter) * 1.01;
    while (run.time() < silo.open_at) run.step();
    // bulk density of the settled bed, away from floor and surface
    const State settled = state_of(run);
    double top = 0.0, inside = 0.0;
    for (const Vec3& p : settled.position) top = std::max(top, p.z);
    for (const Vec3& p : settled.position)
      if (p.z > 0.15 * top && p.z < 0.75 * top && p.x * p.x + p.y * p.y < 0.64 * silo.radius * silo.radius)
        inside += grain;
    const double bulk = inside / (pi * 0.64 * silo.radius * silo.radius * 0.6 * top);
    while (run.time() < silo.open_at + 0.25) run.step();
    std::vector<double> t, left;
    const double stop = 0.45 * static_cast<double>(run.n_born());
    while (static_cast<double>(run.n_left()) < stop && run.time() < silo.open_at + 1.4) {
      for (int i = 0; i < 200; ++i) run.step();
      t.push_back(run.time());
      left.push_back(grain * static_cast<double>(run.n_left()));
    }
    const Slope rate = fit_slope(t, left);
    flows.push_back(rate.value / (bulk * std::sqrt(gravity)));
    diameters.push_back(silo.orifice);
    report("Beverloo: D/d %4.1f, %llu grains, bulk density %.0f kg/m3, W = %.4f kg/s over %.2f s", ratio,
           static_cast<unsigned long long>(run.n_born()), bulk, rate.value, t.back() - t.front());
  }
  // As Beverloo, Leniger and van de Velde did it: flow^(2/5) against D is a straight line, whose slope gives C, and whose zero k.
  std::vector<double> roots, x, y;
  for (const double flow : flows) roots.push_back(std::pow(flow, 0.4));
  const Slope slope = fit_slope(diameters, roots);
  const auto mean = [](const std::vector<double>& v) {
    double sum = 0.0;
    for (const double value : v) sum += value / static_cast<double>(v.size());
    return sum;
  };
  const double k = (mean(diameters) - mean(roots) / slope.value) / diameter, constant = std::pow(slope.value, 2.5);
  for (std::size_t i = 0; i < flows.size(); ++i) {
    x.push_back(std::log(diameters[i] - k * diameter));
    y.push_back(std::log(flows[i]));
  }
  const Slope exponent = fit_slope(x, y);
  report("Beverloo: C = %.3f, k = %.2f, exponent with that k %.3f +- %.3f (published: 0.55 to 0.65, 1 to 2, 5/2)",
         constant, k, exponent.value, exponent.error);
  CHECK(std::abs(exponent.value / 2.5 - 1.0) < 0.05);
  CHECK(k > 1.0);
  CHECK(k < 2.0);
  CHECK(constant > 0.55);
  CHECK(constant < 0.65);
}
