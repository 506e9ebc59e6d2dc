// A bed that gas is slowly turned up under: its pressure drop, and when it begins to float.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <numeric>

#include "tests/physics/laboratory.hpp"

using namespace moraine;
using namespace moraine::physics;

namespace {

/// Grains and gas of the Ergun bed of the reference data: with a void fraction of 0.451 they float at 0.01454 m/s.
struct Bed {
  double diameter = 1e-3, density = 2000.0, gas_density = 10.0, viscosity = 1.5e-3, gravity = 9.81;
  double spacing = 2e-3;                // [m] of cells
  std::array<int, 3> cells{3, 3, 28};   // periodic across
  std::int64_t n_grains = 1500;         // 40 mm, 20 cells: the smear of the surface costs 0.7 of them
  double settling = 0.1, rising = 0.3;  // [s]
  double least = 0.002, most = 0.02;    // [m/s] the gas while the bed settles, and at the end of the ramp
  GasWeights weights = GasWeights::trilinear;
  GasModel model = GasModel::a;

  double area() const { return cells[0] * cells[1] * spacing * spacing; }
  double volume() const { return pi / 6.0 * diameter * diameter * diameter; }
  /// [Pa] what carries the grains, their buoyancy off.
  double weight() const {
    return static_cast<double>(n_grains) * volume() * (density - gas_density) * gravity / area();
  }
  double end() const { return settling + rising; }
  double superficial(double time) const { return least + (most - least) * std::max(0.0, time - settling) / rising; }
  /// [Pa/m] Ergun (1952).
  double ergun(double void_fraction, double speed) const {
    const double solids = 1.0 - void_fraction, e3 = void_fraction * void_fraction * void_fraction;
    return 150.0 * viscosity * solids * solids / (e3 * diameter * diameter) * speed +
           1.75 * gas_density * solids / (e3 * diameter) * speed * speed;
  }
  /// [m/s] where Ergun's gradient carries the grains.
  double onset(double void_fraction) const {
    double low = 0.0, high = 10.0;
    for (int halving = 0; halving < 100; ++halving) {
      const double middle = 0.5 * (low + high);
      (ergun(void_fraction, middle) < (1.0 - void_fraction) * (density - gas_density) * gravity ? low : high) = middle;
    }
    return low;
  }
  Scene scene() const;
};

Scene Bed::scene() const {
  Scene s = empty_scene({0, 0, 0}, {cells[0] * spacing, cells[1] * spacing, cells[2] * spacing}, 2.5e-5);
  s.domain.periodic = {true, true, false};
  s.time.gravity = {0, 0, -gravity};
  s.materials = {{"grain", density, 0.0, 0.3}};
  PairLaw law = pair_law("grain", "grain", 0.6, 0.3);
  law.normal_stiffness = 20.0;
  s.contact.pairs = {law};
  ParticleGroup group;
  group.material = "grain";
  group.diameter.value = diameter;
  const double room = static_cast<double>(n_grains) * volume() / area() / 0.56;
  group.fill = RandomFill{BoxRegion{{{0, 0, 0}, {s.domain.high.x, s.domain.high.y, room}}}, {}, n_grains};
  s.particles = {group};
  add_plane(s, "floor", "grain", {0, 0, 0}, {0, 0, 1});
  Gas gas;
  gas.cells = cells;
  gas.density = gas_density;
  gas.viscosity = viscosity;
  gas.step = 5e-4;
  gas.drag = DragLaw::ergun;
  gas.weights = weights;
  gas.model = model;
  GasBoundary floor, top;
  floor.kind = GasBoundary::Kind::velocity;
  floor.face = 4;
  floor.velocity = {0, 0, most};
  floor.ramp = {{settling, least / most}, {end(), 1.0}};
  top.kind = GasBoundary::Kind::pressure;
  top.face = 5;
  gas.boundaries = {floor, top};
  s.gas = gas;
  Probe drop;
  drop.kind = Probe::Kind::pressure_drop;
  drop.name = "drop";
  drop.interval = 1.0;
  s.output.probes = {drop};
  return s;
}

/// Volume of a sphere of radius r about z below a height.
double volume_below(double z, double r, double height) {
  const double h = std::clamp(height - (z - r), 0.0, 2.0 * r);
  return pi * h * h * (r - h / 3.0);
}

/// Of the grains between two heights.
double void_fraction(const Simulation& run, const Bed& bed, double low, double high) {
  double solid = 0.0;
  for (const Vec3& p : state_of(run).position)
    solid += volume_below(p.z, 0.5 * bed.diameter, high) - volume_below(p.z, 0.5 * bed.diameter, low);
  return 1.0 - solid / (bed.area() * (high - low));
}

/// What a ramp has shown.
struct Ramp {
  double void_fraction = 0.0;                           // inside the bed at rest
  double onset = 0.0;                                   // [m/s] where the line of the fixed bed meets the weight
  double plateau = 0.0, lowest = 1e300, highest = 0.0;  // [-] pressure drop over weight, beyond the onset
  double fixed = 0.0;  // [-] slope of the fixed bed over Ergun's, with the void fraction inside
};

Ramp ramp_of(const Bed& bed) {
  Simulation run(bed.scene(), std::min(2, n_cores()));
  Ramp found;
  while (run.time() < bed.settling) run.step();
  // away from the floor and the surface, where grains lie otherwise
  found.void_fraction = void_fraction(run, bed, 4 * bed.diameter, 32 * bed.diameter);
  const double ergun = bed.onset(found.void_fraction);
  std::vector<double> slopes, plateau;
  for (double next = bed.settling; next < bed.end(); next += 2e-3) {
    while (run.time() < next) run.step();
    const double speed = bed.superficial(run.time()), drop = run.probe_row(0)[2] / bed.weight();
    if (speed > 0.4 * ergun && speed < 0.8 * ergun) slopes.push_back(drop / speed);
    if (speed > 1.1 * ergun) plateau.push_back(drop);
  }
  const auto mean = [](const std::vector<double>& values) {
    return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
  };
  found.plateau = mean(plateau);
  found.lowest = *std::min_element(plateau.begin(), plateau.end());
  found.highest = *std::max_element(plateau.begin(), plateau.end());
  found.onset = found.plateau / mean(slopes);
  found.fixed = mean(slopes) * ergun;
  report(
      "%s weights, model %s: void fraction %.4f, floats at %.5f m/s (Ergun %.5f: %+.1f %%); pressure drop beyond "
      "%.4f of the weight (%.4f to %.4f)",
      bed.weights == GasWeights::cell ? "cell" : "trilinear", bed.model == GasModel::a ? "A" : "B", found.void_fraction,
      found.onset, ergun, 100.0 * (found.onset / ergun - 1.0), found.plateau, found.lowest, found.highest);
  CHECK(std::abs(found.onset / ergun - 1.0) < 0.05);
  CHECK(std::abs(found.plateau - 1.0) < 0.02);
  CHECK(found.lowest > 0.96);
  CHECK(found.highest < 1.04);
  return found;
}

}  // namespace

TEST_CASE("gas turned up under a bed makes it float where Ergun says, and then carries its weight", "[gas]") {
  ramp_of(Bed{});
}

TEST_CASE("so it does with all weights, in both models, in a slow ramp under a deep bed", "[.long][gas]") {
  for (const GasModel model : {GasModel::a, GasModel::b})
    for (const GasWeights weights : {GasWeights::cell, GasWeights::trilinear}) {
      Bed bed;
      bed.model = model;
      bed.weights = weights;
      bed.cells = {4, 4, 40};
      bed.n_grains = 4000;
      bed.rising = 1.0;
      ramp_of(bed);
    }
}
