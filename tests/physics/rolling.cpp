// Rolling resistance: spheres on a plane, against closed forms (Ai, Chen, Rotter & Ooi 2011 test the same).
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "tests/physics/laboratory.hpp"

using namespace moraine;
using namespace moraine::physics;

namespace {

constexpr double radius = 0.05, density = 2000.0, stiffness = 1e6, g = 9.81;

struct Laws {
  RollingLaw rolling = RollingLaw::spring;
  double mu_r = 0.1, damping = 0.3;
  NormalLaw normal = NormalLaw::linear;
};

/// A sphere that rests on a plane (it overlaps by its weight) and rolls along x with `speed`; `slope` tilts gravity.
Scene sphere_on_plane(const Laws& laws, double speed, double slope = 0.0) {
  Scene scene = empty_scene({-10, -1, -1}, {10, 1, 1}, 1e-4);
  scene.output.fields = {"position", "velocity", "angular_velocity", "force"};
  scene.output.energy = true;
  scene.time.gravity = {g * std::sin(slope), 0, -g * std::cos(slope)};
  scene.materials = {{"grain", density, 1e9, 0.25}};
  scene.contact.rolling = laws.rolling;
  scene.contact.normal = laws.normal;
  scene.contact.tangential = laws.normal == NormalLaw::linear ? TangentialLaw::spring : TangentialLaw::mindlin;
  PairLaw law = pair_law("grain", "grain", 0.5, 0.8);
  if (laws.normal == NormalLaw::linear) law.normal_stiffness = stiffness;
  law.rolling_friction = laws.mu_r;
  law.rolling_damping = laws.damping;
  scene.contact.pairs = {law};
  add_plane(scene, "floor", "grain", {0, 0, 0}, {0, 0, 1});
  const double weight = mass_of(density, radius) * g * std::cos(slope);
  const double young = 0.5 * 1e9 / (1.0 - 0.25 * 0.25);
  const double overlap = laws.normal == NormalLaw::linear
                             ? weight / stiffness
                             : std::pow(weight / (4.0 / 3.0 * young * std::sqrt(radius)), 2.0 / 3.0);
  add_grain(scene, "grain", radius, {0, 0, radius - overlap}, {speed, 0, 0}, {0, speed / radius, 0});
  return scene;
}

double spin_of(const Simulation& run) { return state_of(run).spin[0].y; }
double place_of(const Simulation& run) { return state_of(run).position[0].x; }

}  // namespace

TEST_CASE("a sphere that rolls on a plane stops after 7 v^2 / (10 mu_r g) and then stays where it is", "[rolling]") {
  for (const RollingLaw rolling : {RollingLaw::constant, RollingLaw::spring})
    for (const NormalLaw normal : {NormalLaw::linear, NormalLaw::hertz})
      for (const double mu_r : {0.05, 0.2}) {
        const double speed = 0.5, distance = 0.7 * speed * speed / (mu_r * g);
        Simulation run(sphere_on_plane({rolling, mu_r, 0.3, normal}, speed), 1);
        const double swing = std::sqrt(2.25 * stiffness * mu_r * mu_r / (1.4 * mass_of(density, radius)));  // [1/s]
        const int until_rest = static_cast<int>((1.4 * speed / (mu_r * g) + 30.0 / (0.3 * swing)) / 1e-4);
        for (int i = 0; i < until_rest; ++i) run.step();
        const double stopped = place_of(run);
        double fastest = 0.0;
        for (int i = 0; i < 5000; ++i) {
          run.step();
          if (i % 100 == 0) fastest = std::max(fastest, std::abs(spin_of(run)));
        }
        const EnergyLedger ledger = run.energy();
        const double start = 0.7 * mass_of(density, radius) * speed * speed;
        report(
            "%s, %s, mu_r = %.2f: stops after %.5f m (%.5f); then spins at most %.1e rad/s, creeps %.1e m; ledger open "
            "by %.1e",
            rolling == RollingLaw::spring ? "spring" : "constant", normal == NormalLaw::linear ? "linear" : "Hertz",
            mu_r, stopped, distance, fastest, std::abs(place_of(run) - stopped), ledger.error() / start);
        CHECK(stopped == Approx(distance).epsilon(0.01));
        CHECK(fastest < 1e-9);
        CHECK(std::abs(place_of(run) - stopped) < 1e-9 * radius);
        CHECK(std::abs(ledger.error()) < 0.01 * start);
        CHECK(ledger.lost_friction == Approx(start).epsilon(0.05));
      }
}

TEST_CASE("a sphere on a slope rests up to tan(slope) = mu_r and rolls beyond", "[rolling]") {
  const double mu_r = 0.2;
  for (const double share : {0.5, 0.95, 1.05, 1.5}) {
    const double slope = std::atan(share * mu_r);
    Simulation run(sphere_on_plane({RollingLaw::spring, mu_r}, 0.0, slope), 1);
    const auto advance = [&](int n) {
      for (int i = 0; i < n; ++i) run.step();
      return state_of(run);
    };
    const State early = advance(5000), late = advance(5000);
    const double moved = late.position[0].x - early.position[0].x, gained = late.velocity[0].x - early.velocity[0].x;
    const double expected = std::max(0.0, 5.0 / 7.0 * g * (std::sin(slope) - mu_r * std::cos(slope)) * 0.5);
    report("tan(slope) = %.2f mu_r: in half a second it moves %.2e m and gains %.5f m/s (%.5f)", share, moved, gained,
           expected);
    if (share < 1.0) {
      CHECK(std::abs(gained) < 1e-9);
      CHECK(std::abs(moved) < 1e-9 * radius);
    } else {
      CHECK(gained == Approx(expected).epsilon(0.01));
    }
  }
}

TEST_CASE("below its limit a rolling spring swings and dies down as the damped oscillator", "[rolling]") {
  // (I + m r^2) theta'' + 2 eta sqrt((I + m r^2) k_r) theta' + k_r theta = 0
  const double mu_r = 0.02, damping = 0.1, mass = mass_of(density, radius);
  const double k_r = 2.25 * stiffness * mu_r * mu_r * radius * radius, inertia = 1.4 * mass * radius * radius;
  const double omega = std::sqrt(k_r / inertia), damped = omega * std::sqrt(1.0 - damping * damping);
  const double largest = mu_r * radius * mass * g / k_r;  // angle at which it yields
  Scene scene = sphere_on_plane({RollingLaw::spring, mu_r, damping}, 0.5 * largest * omega * radius);
  Simulation run(scene, 1);
  double last = spin_of(run);
  std::vector<double> crossings, peaks;
  double peak = 0.0;
  while (crossings.size() < 5) {
    run.step();
    const double spin = spin_of(run);
    peak = std::max(peak, std::abs(spin));
    if ((spin > 0.0) != (last > 0.0)) {
      crossings.push_back(run.time());
      peaks.push_back(peak);
      peak = 0.0;
    }
    last = spin;
  }
  const double half_period = (crossings[4] - crossings[0]) / 4.0;
  const double decay = std::log(peaks[1] / peaks[4]) / 3.0;
  report("half period %.5e s (%.5e), logarithmic decrement of half a period %.4f (%.4f)", half_period, pi / damped,
         decay, pi * damping / std::sqrt(1.0 - damping * damping));
  CHECK(half_period == Approx(pi / damped).epsilon(0.005));
  CHECK(decay == Approx(pi * damping / std::sqrt(1.0 - damping * damping)).epsilon(0.02));
}

TEST_CASE("two spheres that roll on each other slow down by mu_r R* F_n", "[rolling]") {
  // Pressed together by two planes without friction, spinning against each other so that their surfaces do not slide.
  for (const RollingLaw rolling : {RollingLaw::constant, RollingLaw::spring}) {
    Scene scene = empty_scene({-1, -1, -1}, {1, 1, 1}, 1e-5);
    scene.output.fields = {"position", "velocity", "angular_velocity"};
    scene.materials = {{"grain", density, 0, 0.25}};
    scene.contact.rolling = rolling;
    PairLaw law = pair_law("grain", "grain", 1.0, 0.5);
    law.normal_stiffness = stiffness;
    law.rolling_friction = 0.1;
    scene.contact.pairs = {law};
    const double press = 1e-4, spin = 30.0;
    add_plane(scene, "low", "grain", {-2.0 * radius + 1.5 * press, 0, 0}, {1, 0, 0});
    add_plane(scene, "high", "grain", {2.0 * radius - 1.5 * press, 0, 0}, {-1, 0, 0});
    for (WallDefinition& wall : scene.walls) wall.frictionless = true;
    add_grain(scene, "grain", radius, {-radius + 0.5 * press, 0, 0}, {}, {0, 0, spin});
    add_grain(scene, "grain", radius, {radius - 0.5 * press, 0, 0}, {}, {0, 0, -spin});
    Simulation run(scene, 1);
    for (int i = 0; i < 2000; ++i) run.step();
    const State state = state_of(run);
    const double torque = 0.1 * 0.5 * radius * stiffness * press;
    const double slower = torque / (0.4 * mass_of(density, radius) * radius * radius) * run.time();
    report("slower by %.5f and %.5f rad/s (%.5f)", spin - state.spin[0].z, spin + state.spin[1].z, slower);
    CHECK(spin - state.spin[0].z == Approx(slower).epsilon(0.005));
    CHECK(spin + state.spin[1].z == Approx(slower).epsilon(0.005));
  }
}

TEST_CASE("where a sphere that rolls against spring and dashpot comes to rest has a limit for short steps",
          "[rolling]") {
  // So fast at first that the dashpot alone is beyond the limit: what the spring holds when it begins to hold must not depend on the step. Soft,
  // so that much of the way is rolled on it.
  const double mu_r = 0.2, damping = 0.5, mass = mass_of(density, radius);
  const double limit = mu_r * radius * mass * g, k_r = limit / 0.5, inertia = 1.4 * mass * radius * radius;
  const double dashpot = 2.0 * damping * std::sqrt(inertia * k_r);
  const auto rest = [&](double step) {
    Scene scene = sphere_on_plane({RollingLaw::spring, mu_r, damping}, 2.0 * limit / dashpot * radius);
    scene.contact.pairs[0].rolling_stiffness = k_r;
    scene.time.step = step;
    Simulation run(scene, 1);
    while (run.time() < 0.5) run.step();
    return place_of(run);
  };
  const double coarse = rest(4e-4), finer = rest(1e-4), finest = rest(2.5e-5);
  report("from 4e-4 to 1e-4 s the place changes by %.1e m, from there to 2.5e-5 s by %.1e m, of %.5f m", coarse - finer,
         finer - finest, finest);
  CHECK(std::abs(coarse - finer) < 1e-4 * finest);
  CHECK(std::abs(finer - finest) < std::abs(coarse - finer) / 3.0);
}
