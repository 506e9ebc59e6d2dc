// Energy: leapfrog keeps it without trend, and the ledger explains where it went.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "tests/physics/laboratory.hpp"

using namespace moraine;
using namespace moraine::physics;

namespace {

/// An elastic frictionless box of n^3 Hertz grains, in motion.
Scene elastic_box(int n, double step) {
  const double radius = 1e-3, pitch = 2.3e-3, size = n * pitch;
  Scene scene = empty_scene({0, 0, 0}, {size, size, size}, step);
  scene.materials = {{"grain", 2500, 1e7, 0.25}};
  scene.contact.normal = NormalLaw::hertz;
  scene.contact.tangential = TangentialLaw::none;
  scene.contact.rotation = false;
  scene.contact.pairs = {pair_law("grain", "grain", 1.0, 0.0)};
  scene.output.energy = true;
  WallDefinition box;
  box.name = "box";
  box.material = "grain";
  box.shape = BoxShape{{{0, 0, 0}, {size, size, size}}};
  scene.walls.push_back(box);
  ParticleGroup group;
  group.material = "grain";
  group.diameter.value = 2.0 * radius;
  group.fill = LatticeFill{LatticeFill::Kind::cubic, BoxRegion{{{0, 0, 0}, {size, size, size}}}, pitch, 0.5, {}};
  group.velocity_deviation = 0.3;
  scene.particles.push_back(group);
  return scene;
}

/// Time of a contact at the mean speed.
double box_contact_time() {
  const double radius = 1e-3, mass = mass_of(2500, radius), e = 0.5 * 1e7 / (1.0 - 0.0625);
  return 2.868 * std::pow(0.25 * mass * mass / (0.5 * radius * e * e * 0.3), 0.2);
}

struct Drift {
  double spread = 0.0;  // root mean square of the relative error
  Slope slope;          // of the relative error, per sample
  double last = 0.0;
  // Collisions leave errors of either sign, so that the energy walks at random: what it moves by from sample to sample, and the
  // standard error of that.
  double mean_step = 0.0, error_of_mean = 0.0;
};

Drift drift_of(int n, double steps_per_contact, double time, int samples, int threads) {
  const double step = box_contact_time() / steps_per_contact;
  Simulation run(elastic_box(n, step), threads);
  const auto between = std::max<std::int64_t>(1, std::llround(time / step / samples));
  std::vector<double> x, y;
  Drift drift;
  const double initial = run.energy().total();
  for (int i = 0; i < samples; ++i) {
    for (std::int64_t k = 0; k < between; ++k) run.step();
    x.push_back(i);
    y.push_back(run.energy().total() / initial - 1.0);
    drift.spread += y.back() * y.back() / samples;
  }
  drift.spread = std::sqrt(drift.spread);
  drift.slope = fit_slope(x, y);
  drift.last = y.back();
  const double n_steps = static_cast<double>(samples - 1);
  double squares = 0.0;
  for (std::size_t i = 1; i < y.size(); ++i) {
    drift.mean_step += (y[i] - y[i - 1]) / n_steps;
    squares += (y[i] - y[i - 1]) * (y[i] - y[i - 1]);
  }
  drift.error_of_mean = std::sqrt((squares / n_steps - drift.mean_step * drift.mean_step) / n_steps);
  return drift;
}

struct Laws {
  NormalLaw normal;
  TangentialLaw tangential;
  bool rotation, damping;
};

/// A little heap that collapses in a corner of walls.
Scene collapse(const Laws& laws, double step) {
  const double radius = 2e-3;
  Scene scene = empty_scene({-0.03, -0.03, -0.01}, {0.05, 0.05, 0.06}, step);
  scene.materials = {{"grain", 2500, 1e7, 0.25}};
  scene.time.gravity = {0, 0, -9.81};
  scene.time.damping = laws.damping ? 2.0 : 0.0;
  scene.contact.normal = laws.normal;
  scene.contact.tangential = laws.tangential;
  scene.contact.rotation = laws.rotation;
  PairLaw law = pair_law("grain", "grain", 0.6, 0.4);
  if (laws.normal == NormalLaw::linear) law.normal_stiffness = 5000.0;
  if (laws.tangential == TangentialLaw::viscous) law.tangential_viscosity = 0.2;
  if (laws.normal == NormalLaw::hertz && laws.tangential == TangentialLaw::spring) law.tangential_stiffness = 1500.0;
  scene.contact.pairs = {law};
  scene.output.energy = true;
  add_plane(scene, "floor", "grain", {0, 0, 0}, {0, 0, 1});
  add_plane(scene, "side", "grain", {-0.011, 0, 0}, {1, 0, 0.3});
  add_plane(scene, "back", "grain", {0, -0.011, 0}, {0, 1, 0});
  for (int i = 0; i < 40; ++i) {
    const auto random = [&](int k) {
      return 0.35e-3 * (static_cast<double>((i * 7919 + k * 104729) % 1000) / 500.0 - 1.0);
    };
    const int layer = i / 8, place = i % 8;
    add_grain(scene, "grain", radius * (1.0 - 0.05 * (i % 3)),
              {-4e-3 + 4.7e-3 * (place % 3) + random(1), -4e-3 + 4.7e-3 * (place / 3) + random(2),
               3e-3 + 4.7e-3 * layer + random(3)},
              {0.1 * (i % 5), -0.05 * (i % 4), 0}, laws.rotation ? Vec3{10.0 * (i % 3), -15.0 * (i % 2), 5.0} : Vec3{});
  }
  return scene;
}

/// Ledger errors over the energy lost, and the ledger itself.
struct Closure {
  double error = 0.0;  // largest over the run
  double last = 0.0;   // at its end
  EnergyLedger ledger;
};
Closure close(const Laws& laws, double step, double time) {
  Simulation run(collapse(laws, step), 1);
  Closure closure;
  for (std::int64_t i = 1; run.time() < time; ++i) {
    run.step();
    if (i % 100 == 0) closure.error = std::max(closure.error, std::abs(run.energy().error()));
  }
  closure.ledger = run.energy();
  const EnergyLedger& e = closure.ledger;
  closure.error /= e.lost();
  closure.last = std::abs(e.error()) / e.lost();
  return closure;
}

}  // namespace

TEST_CASE(
    "in an elastic frictionless box of Hertz grains the energy error falls with the square of the step and has no "
    "trend",
    "[energy]") {
  const double time = 40 * box_contact_time();
  const Drift coarse = drift_of(10, 25, time, 40, 1), fine = drift_of(10, 50, time, 40, 1);
  const double order = std::log2(coarse.spread / fine.spread);
  report("1000 Hertz grains: energy error %.2e at 25 and %.2e at 50 steps a contact, order %.2f", coarse.spread,
         fine.spread, order);
  report("trend over %.0f steps at 50 a contact: %.1e +- %.1e of the energy", 40 * 50.0, fine.slope.value * 40,
         fine.slope.error * 40);
  CHECK(order > 1.7);
  CHECK(fine.spread < 1e-3);
}

TEST_CASE("over 1e5 steps the energy of an elastic box of 1000 Hertz grains shows no trend", "[.long][energy]") {
  double spreads[2];
  int k = 0;
  for (const double steps : {25.0, 50.0}) {
    const Drift drift = drift_of(10, steps, 1e5 / steps * box_contact_time(), 400, std::min(4, n_cores()));
    report("1e5 steps, %.0f a contact: relative error %.2e rms, last %.1e; trend over the run %.2e +- %.1e", steps,
           drift.spread, drift.last, drift.mean_step * 399, drift.error_of_mean * 399);
    CHECK(std::abs(drift.mean_step) < 3.0 * drift.error_of_mean);
    CHECK(drift.spread < 1e-3);
    spreads[k++] = drift.spread;
  }
  report("order %.2f", std::log2(spreads[0] / spreads[1]));
  CHECK(std::log2(spreads[0] / spreads[1]) > 1.7);
}

TEST_CASE("the ledger closes for every combination of laws, better with a shorter step", "[energy]") {
  const double step = 4e-6;
  for (const NormalLaw normal : {NormalLaw::linear, NormalLaw::hertz})
    for (const TangentialLaw tangential : {TangentialLaw::none, TangentialLaw::viscous, TangentialLaw::spring,
                                           TangentialLaw::mindlin, TangentialLaw::power})
      for (const bool rotation : {true, false})
        for (const bool damping : {false, true}) {
          if (normal == NormalLaw::linear && tangential == TangentialLaw::mindlin) continue;
          const Laws laws{normal, tangential, rotation, damping};
          const Closure coarse = close(laws, step, 0.08), fine = close(laws, step / 4, 0.08);
          const EnergyLedger& e = fine.ledger;
          report(
              "%s %-7s %s %s: error over lost %.1e at dt, %.1e at dt/4, at the end %.1e and %.1e (lost: normal %.3g, "
              "tangential %.3g, friction %.3g, drag %.3g; "
              "rotational %.2g, tangential %.2g J)",
              name_of(normal).data(), name_of(tangential).data(), rotation ? "rotating" : "plain   ",
              damping ? "damped" : "      ", coarse.error, fine.error, coarse.last, fine.last, e.lost_normal,
              e.lost_tangential, e.lost_friction, e.lost_drag, e.rotational, e.elastic_tangential);
          CHECK(fine.error < 1.5e-3);
          CHECK(fine.error < 0.7 * coarse.error);
          CHECK(e.lost_normal > 0.0);
          CHECK(e.lost_friction >= 0.0);
        }
}
