// A bed that gas is slowly turned up under: its pressure drop, and when it begins to float.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <vector>

#include "tests/physics/laboratory.hpp"

using namespace moraine;
using namespace moraine::physics;

namespace {

/// Grains of 1 mm in air, which is turned up in steps, so that the springs of the bed have time to follow.
struct Bed {
  double diameter = 1e-3, density = 2000.0, gas_density = 1.2, viscosity = 1.8e-5, gravity = 9.81;
  double spacing = 2e-3;               // [m] of cells
  std::array<int, 3> cells{3, 3, 36};  // periodic across
  std::int64_t n_grains = 2000;        // 24 cells deep: the smear of the surface costs the pressure drop of 0.7 of them
  double settling = 0.2, change = 0.01, hold = 0.055;  // [s] before the gas is turned on; from level to level; on each
  std::vector<double> lying{0.65, 0.8};                // levels, of what Ergun's law says for a void fraction of 0.39
  double floating = 1.15, watched = 0.25;              // [s] on the last level
  GasWeights weights = GasWeights::trilinear;
  GasModel model = GasModel::a;
  std::uint64_t seed = 1;

  double area() const { return cells[0] * cells[1] * spacing * spacing; }
  double volume() const { return pi / 6.0 * diameter * diameter * diameter; }
  /// [Pa] what carries the grains, their buoyancy off.
  double weight() const {
    return static_cast<double>(n_grains) * volume() * (density - gas_density) * gravity / area();
  }
  double full_speed() const { return onset(0.39, 1.0); }
  double begin(std::size_t level) const { return settling + static_cast<double>(level) * (change + hold); }
  /// [Pa/m] Ergun (1952).
  double ergun(double void_fraction, double speed) const {
    const double solids = 1.0 - void_fraction, e3 = void_fraction * void_fraction * void_fraction;
    return 150.0 * viscosity * solids * solids / (e3 * diameter * diameter) * speed +
           1.75 * gas_density * solids / (e3 * diameter) * speed * speed;
  }
  /// [m/s] where `factor` times Ergun's gradient carries the grains.
  double onset(double void_fraction, double factor) const {
    const double needed = (1.0 - void_fraction) * (density - gas_density) * gravity;
    double low = 0.0, high = 10.0;
    for (int halving = 0; halving < 100; ++halving) {
      const double middle = 0.5 * (low + high);
      (factor * ergun(void_fraction, middle) < needed ? low : high) = middle;
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
  group.seed = seed;
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
  floor.velocity = {0, 0, full_speed()};
  floor.ramp = {{settling, 0.0}};
  for (std::size_t level = 0; level < lying.size(); ++level) {
    floor.ramp.push_back({begin(level) + change, lying[level]});
    floor.ramp.push_back({begin(level) + change + hold, lying[level]});
  }
  floor.ramp.push_back({begin(lying.size()) + change, floating});
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

struct Motion {
  double height = 0.0, velocity = 0.0;  // [m], [m/s] means of the grains
};
Motion motion(const Simulation& run) {
  const State state = state_of(run);
  Motion mean;
  for (std::size_t i = 0; i < state.position.size(); ++i) {
    mean.height += state.position[i].z / static_cast<double>(state.position.size());
    mean.velocity += state.velocity[i].z / static_cast<double>(state.position.size());
  }
  return mean;
}

/// Mean of the pressure drop over the weight until a time.
double carried(Simulation& run, const Bed& bed, double until) {
  double sum = 0.0;
  int n = 0;
  for (; run.time() < until; ++n) {
    run.step();
    sum += run.probe_row(0)[2] / bed.weight();
  }
  return sum / n;
}

void check_ramp(const Bed& bed) {
  Simulation run(bed.scene(), 1);
  const auto run_until = [&](double time) {
    while (run.time() < time) run.step();
  };
  // While the bed lies: the pressure drop over Ergun's, away from the floor and the surface, where grains lie otherwise.
  double factor = 0.0, held = 0.0;
  for (std::size_t level = 0; level < bed.lying.size(); ++level) {
    run_until(bed.begin(level) + bed.change + 0.5 * bed.hold);
    const double drop = carried(run, bed, bed.begin(level + 1));
    held = void_fraction(run, bed, 4 * bed.diameter, 40 * bed.diameter);
    const double needed = (1.0 - held) * (bed.density - bed.gas_density) * bed.gravity;
    factor +=
        drop * needed / bed.ergun(held, bed.lying[level] * bed.full_speed()) / static_cast<double>(bed.lying.size());
  }
  const double onset = bed.onset(held, factor), ergun = bed.onset(held, 1.0);
  // When it floats: the gas carries the weight, and what speeds the grains up.
  const Motion at_rest = motion(run);
  run_until(bed.begin(bed.lying.size()) + bed.change);
  const Motion before = motion(run);
  const double start = run.time(), drop = carried(run, bed, start + bed.watched);
  const Motion after = motion(run);
  const double gained = (after.velocity - before.velocity) / (run.time() - start) / bed.gravity * bed.density /
                        (bed.density - bed.gas_density);
  report(
      "seed %d, %s weights, model %s: void fraction %.4f, floats at %.4f m/s (Ergun %.4f: %+.1f %%); then the gas "
      "carries %.4f "
      "of the weight, speeds the grains up by %.4f of it; the bed rises by %.1f %%",
      static_cast<int>(bed.seed), bed.weights == GasWeights::cell ? "cell" : "trilinear",
      bed.model == GasModel::a ? "A" : "B", held, onset, ergun, 100.0 * (onset / ergun - 1.0), drop, gained,
      100.0 * (after.height / at_rest.height - 1.0));
  CHECK(std::abs(at_rest.velocity) < 0.03 * bed.full_speed());
  CHECK(std::abs(onset / ergun - 1.0) < 0.05);
  CHECK(std::abs(drop - gained - 1.0) < 0.02);
  CHECK(after.height > 1.02 * at_rest.height);
}

}  // namespace

TEST_CASE("gas turned up under a bed makes it float where Ergun says, and then carries its weight", "[gas]") {
  check_ramp(Bed{});
}

TEST_CASE("so do beds of other grains", "[.long][gas]") {
  for (const std::uint64_t seed : {2, 3, 4, 5, 6, 7, 8}) {
    Bed bed;
    bed.seed = seed;
    check_ramp(bed);
  }
}

TEST_CASE("so it does with all weights, in both models, turned up slowly under a deeper bed", "[.long][gas]") {
  for (const GasModel model : {GasModel::a, GasModel::b})
    for (const GasWeights weights : {GasWeights::cell, GasWeights::trilinear}) {
      Bed bed;
      bed.model = model;
      bed.weights = weights;
      bed.cells = {4, 4, 48};
      bed.n_grains = 5000;
      bed.hold = 0.12;
      bed.watched = 0.5;
      check_ramp(bed);
    }
}
