// Momentum and angular momentum, and how a granular gas cools.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "tests/physics/laboratory.hpp"

using namespace moraine;
using namespace moraine::physics;

namespace {

constexpr double density = 2500.0, radius = 1e-3, stiffness = 2e4;

double contact_time() { return pi * std::sqrt(0.5 * mass_of(density, radius) / stiffness); }

/// A gas in a periodic box of n^3 grains with that solid fraction and speed [m/s] per component.
Scene gas(int n, double solid_fraction, double restitution, double friction, double speed, double step) {
  const double side = n * std::cbrt(4.0 / 3.0 * pi / solid_fraction) * radius;
  Scene scene = empty_scene({0, 0, 0}, {side, side, side}, step);
  scene.output.fields = {"position", "velocity"};
  scene.domain.periodic = {true, true, true};
  scene.materials = {{"grain", density, 0.0, 0.3}};
  scene.contact.tangential = friction > 0.0 ? TangentialLaw::spring : TangentialLaw::none;
  scene.contact.rotation = friction > 0.0;
  PairLaw law = pair_law("grain", "grain", restitution, friction);
  law.normal_stiffness = stiffness;
  scene.contact.pairs = {law};
  ParticleGroup group;
  group.material = "grain";
  group.diameter.value = 2.0 * radius;
  group.fill = LatticeFill{
      LatticeFill::Kind::cubic, BoxRegion{{{0, 0, 0}, {side, side, side}}}, side / n * (1.0 - 1e-9), 0.8, {}};
  group.velocity_deviation = speed;
  group.angular_velocity = friction > 0.0 ? Vec3{100, -50, 20} : Vec3{};
  scene.particles.push_back(group);
  return scene;
}

Vec3 mean_velocity(const State& state) {
  Vec3 sum;
  for (const Vec3& v : state.velocity) sum += v;
  return (1.0 / static_cast<double>(state.velocity.size())) * sum;
}

/// Granular temperature about the mean: <|v - mean|^2>/3.
double temperature(const State& state) {
  const Vec3 mean = mean_velocity(state);
  double sum = 0.0;
  for (const Vec3& v : state.velocity) sum += squared_length(v - mean);
  return sum / 3.0 / static_cast<double>(state.velocity.size());
}

}  // namespace

TEST_CASE("a frictional, rotating, periodic gas keeps its momentum", "[momentum]") {
  Simulation run(gas(8, 0.25, 0.8, 0.5, 0.5, contact_time() / 30), 1);
  const Vec3 start = mean_velocity(state_of(run));
  const double speed = std::sqrt(temperature(state_of(run)));
  double worst = 0.0;
  for (int k = 0; k < 20; ++k) {
    for (int i = 0; i < 500; ++i) run.step();
    worst = std::max(worst, length(mean_velocity(state_of(run)) - start) / speed);
  }
  report(
      "512 grains, 10000 steps: mean velocity changed by %.1e of the fluctuation, temperature fell to %.2f of its "
      "start",
      worst, temperature(state_of(run)) / (speed * speed));
  CHECK(temperature(state_of(run)) < 0.9 * speed * speed);
  CHECK(worst < 1e-13);
}

TEST_CASE("two grains that collide obliquely keep their momentum and angular momentum", "[momentum]") {
  for (const TangentialLaw law : {TangentialLaw::viscous, TangentialLaw::spring, TangentialLaw::power}) {
    Scene scene = empty_scene({-0.05, -0.05, -0.05}, {0.05, 0.05, 0.05}, contact_time() / 50);
    scene.materials = {{"grain", density, 0.0, 0.3}};
    scene.contact.tangential = law;
    PairLaw pair = pair_law("grain", "grain", 0.7, 0.4);
    pair.normal_stiffness = stiffness;
    if (law == TangentialLaw::viscous) pair.tangential_viscosity = 0.5;
    scene.contact.pairs = {pair};
    const double r1 = radius, r2 = 1.7 * radius, m1 = mass_of(density, r1), m2 = mass_of(density, r2);
    add_grain(scene, "grain", r1, {-2e-3, 0.6e-3, 0}, {1.0, 0.2, 0.3}, {200, 50, -400});
    add_grain(scene, "grain", r2, {2e-3, 0, 0.3e-3}, {-0.7, 0.1, 0}, {-50, 150, 300});
    // velocities and positions lie half a step apart: the arm is that of the middle of the free flight
    const auto angular = [&](const State& s, double half) {
      const auto of = [&](std::size_t i, double m, double r) {
        return m * cross(s.position[i] - half * s.velocity[i], s.velocity[i]) + 0.4 * m * r * r * s.spin[i];
      };
      return of(0, m1, r1) + of(1, m2, r2);
    };
    const auto linear = [&](const State& s) { return m1 * s.velocity[0] + m2 * s.velocity[1]; };
    Simulation run(scene, 1);
    const State start = state_of(run);
    for (int i = 0; i < 1000; ++i) run.step();
    const State end = state_of(run);
    const double change = length(end.velocity[0] - start.velocity[0]);
    const double momentum = length(linear(end) - linear(start)) / (m1 * 1.0);
    const double spin = length(angular(end, 0.5 * run.time_step()) - angular(start, 0.0)) / length(angular(start, 0.0));
    report("oblique collision, law %d: momentum kept to %.1e, angular momentum to %.1e", static_cast<int>(law),
           momentum, spin);
    CHECK(change > 0.3);
    CHECK(momentum < 1e-14);
    CHECK(spin < 1e-13);
  }
}

TEST_CASE("a granular gas cools by Haff's law", "[.long][momentum]") {
  const double restitution = 0.9, fraction = 0.05, speed = 2.0, d = 2.0 * radius;
  Simulation run(gas(20, fraction, restitution, 0.0, speed, contact_time() / 25), std::min(4, n_cores()));
  // let the start from a lattice be forgotten (a few collisions a grain), then measure from there
  const double g0 = (1.0 - 0.5 * fraction) / std::pow(1.0 - fraction, 3);
  const auto rate = [&](double t) {
    return 4.0 * (1.0 - restitution * restitution) * fraction * g0 * std::sqrt(t) / (std::sqrt(pi) * d);
  };
  const double warm_up = 0.5 / rate(speed * speed);
  while (run.time() < warm_up) run.step();
  const double start = run.time(), t0 = temperature(state_of(run)), haff = rate(t0);
  double worst = 0.0;
  for (int k = 1; k <= 10; ++k) {
    while (run.time() < start + 0.3 * k / haff) run.step();
    const double found = temperature(state_of(run)) / t0, exact = 1.0 / std::pow(1.0 + haff * (run.time() - start), 2);
    report("Haff: t/t0 %.2f, T/T0 %.4f, law %.4f (%+.1f %%)", haff * (run.time() - start), found, exact,
           100 * (found / exact - 1));
    worst = std::max(worst, std::abs(found / exact - 1));
  }
  CHECK(worst < 0.08);
}
