// Walls that move: what they do to grains, against closed forms and the balance of energy.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "tests/physics/laboratory.hpp"

using namespace moraine;
using namespace moraine::physics;

namespace {

constexpr double radius = 1e-3;

Scene scene_with_floor(std::vector<WallMotion> motion, double step = 2e-6) {
  Scene scene = empty_scene({-0.1, -0.1, -0.01}, {0.1, 0.1, 0.05}, step);
  scene.time.gravity = {0, 0, -9.81};
  scene.materials = {{"grain", 2500, 1e8, 0.25}};
  PairLaw law = pair_law("grain", "grain", 0.5, 0.6);
  law.normal_stiffness = 1e4;
  scene.contact.pairs = {law};
  add_plane(scene, "floor", "grain", {0, 0, 0}, {0, 0, 1});
  scene.walls[0].motion = std::move(motion);
  return scene;
}

WallMotion rotation(double speed, Vec3 origin = {}) {
  WallMotion m;
  m.kind = WallMotion::Kind::rotate;
  m.speed = speed;
  m.origin = origin;
  return m;
}

WallMotion vibration(double amplitude, double frequency, double phase = 0.0) {
  WallMotion m;
  m.kind = WallMotion::Kind::vibrate;
  m.amplitude = amplitude;
  m.frequency = frequency;
  m.phase = phase;
  return m;
}

double weight() { return mass_of(2500, radius) * 9.81; }

}  // namespace

TEST_CASE("a ball that rolls on a turntable circles with two sevenths of its speed", "[walls]") {
  // Weltner 1979, Am. J. Phys. 47, 984: rolling without slip on a table of angular velocity Omega, the centre obeys
  // dv/dt = 2/7 Omega x v, wherever it is.
  const double omega = 9.0, slow = 2.0 / 7.0 * omega;
  Scene scene = scene_with_floor({rotation(omega)});
  const double rest = radius - weight() / 1e4;
  const Vec3 start{0.01, 0, rest};
  add_grain(scene, "grain", radius, start, {0, omega * start.x, 0});  // at rest on the table, without spin
  Simulation run(scene, 1);
  const double v = omega * start.x, r = v / slow;
  const Vec3 centre{start.x - r, 0, rest};
  double worst = 0.0;
  for (int i = 1; i <= 400000; ++i) {
    run.step();
    if (i % 10000 != 0) continue;
    const double angle = slow * run.time();
    const Vec3 expected = centre + r * Vec3{std::cos(angle), std::sin(angle), 0};
    worst = std::max(worst, length(state_of(run).position[0] - expected) / r);
  }
  report("turntable: a third of a circle of radius %.3g m, off by %.1e of it at most", r, worst);
  CHECK(worst < 2e-3);
}

TEST_CASE("a grain that sticks to a wall that turns goes around with it, and its spring with both", "[walls]") {
  Scene scene = scene_with_floor({rotation(20.0)});
  scene.contact.rotation = false;
  scene.time.gravity.z = -98.1;
  scene.contact.pairs[0].tangential_stiffness = 1.0;  // soft: what its spring does shows
  const Vec3 start{0.004, 0, radius - 10.0 * weight() / 1e4};
  add_grain(scene, "grain", radius, start, {0, 0.08, 0});
  Simulation run(scene, 1);
  const int n_steps = static_cast<int>(std::lround(2.0 * pi / 20.0 / run.time_step()));
  for (int i = 0; i < n_steps; ++i) run.step();
  // The centripetal force is a deflection of the spring, m w^2 r / k_t: it stays where the wall's turn takes it.
  const double deflection = mass_of(2500, radius) * 400.0 * 0.004 / 1.0;
  const State state = state_of(run);
  report("one turn of a wall at 20 rad/s: the grain is back within %.1e m (its spring is stretched by %.1e m)",
         length(state.position[0] - start), deflection);
  // A spring that did not turn would have to be led around: the grain would be 2 pi deflections ahead after a turn.
  CHECK(length(state.position[0] - start) < 2.0 * deflection);
  CHECK(std::abs(length(Vec3{state.velocity[0].x, state.velocity[0].y, 0}) - 0.08) < 1e-3);
}

TEST_CASE("what moving walls do is in the ledger, the better the smaller the step", "[walls]") {
  std::vector<double> errors;
  for (const double step : {4e-6, 2e-6, 1e-6}) {
    WallMotion slide;
    slide.velocity = {0.3, 0.0, 0.0};
    slide.ramp = {{0.0, 0.0}, {0.02, 1.0}, {0.05, -0.5}};
    Scene scene = scene_with_floor({vibration(3e-4, 60.0), slide, rotation(5.0, {0.01, 0.0, 0.0})}, step);
    scene.output.energy = true;
    add_grain(scene, "grain", radius, {0, 0, 1.5e-3}, {0.1, 0, 0});
    add_grain(scene, "grain", radius, {0.01, 0.002, radius}, {0, 0, 0}, {0, 100, 0});
    add_grain(scene, "grain", radius, {-0.02, 0.01, 4e-3}, {0.2, -0.3, -0.3});
    Simulation run(scene, 1);
    double worst = 0.0, work = 0.0;
    for (int i = 1; i <= static_cast<int>(std::lround(0.08 / step)); ++i) {
      run.step();
      if (i % 50 != 0) continue;
      const EnergyLedger ledger = run.energy();
      worst = std::max(worst, std::abs(ledger.error()));
      work = std::max(work, std::abs(ledger.wall_work));
    }
    errors.push_back(worst / work);
    report("shaken, pushed and turned floor, step %.0e s: %.1e of the walls' work of %.2e J is not accounted for", step,
           errors.back(), work);
  }
  CHECK(errors.back() < 8e-3);
  CHECK(errors[2] < 0.65 * errors[0]);
}

TEST_CASE(
    "a closed cylinder that turns about its own axis is not looked for anew, however far, but by grains that go far",
    "[walls]") {
  const auto drum = [](double speed) {
    Scene scene = scene_with_floor({});
    scene.walls.clear();
    scene.run.skin = 0.2 * radius;
    WallDefinition wall;
    wall.name = "drum";
    wall.material = "grain";
    wall.shape = CylinderShape{{0.01, -0.05, 0.02}, {0, 1, 0}, 0.02, 0.1};
    if (speed != 0.0) {
      WallMotion m = rotation(speed, {0.01, 0, 0.02});
      m.axis = {0, 1, 0};
      wall.motion = {m};
    }
    scene.walls.push_back(wall);
    add_grain(scene, "grain", radius, {0.01, 0, radius});
    add_grain(scene, "grain", radius, {0.013, 0.01, 2e-3});
    return scene;
  };
  const Scene scene = drum(10.0);
  Simulation turning(scene, 1);
  double path = 0.0;  // [m] of the fastest grain of each moment
  for (int i = 0; i < 20000; ++i) {
    turning.step();
    if (i % 10 != 0) continue;
    double fastest = 0.0;
    for (const Vec3 v : state_of(turning).velocity) fastest = std::max(fastest, length(v));
    path += 10.0 * fastest * turning.time_step();
  }
  const double wall_path = 10.0 * 0.02 * turning.time();
  CHECK(path < 0.5 * wall_path);
  // Each search follows on a whole skin that a grain has gone since the search before, or the rebuild.
  CHECK(static_cast<double>(turning.n_wall_searches()) <= 1.02 * path / scene.run.skin);
  CHECK(state_of(turning).spin[0].y > 1.0);  // it has set the grain spinning, wall and grain touching at the bottom
}

TEST_CASE("a grain at rest is met by a wall that comes from afar, as a wall at rest is by a grain", "[walls]") {
  const auto run = [](double wall, double grain) {
    Scene scene = scene_with_floor({});
    scene.time.gravity = {};
    WallMotion push;
    push.velocity = {0, 0, wall};
    if (wall != 0.0) scene.walls[0].motion = {push};
    add_grain(scene, "grain", radius, {0, 0, 5e-3}, {0, 0, grain});
    return Simulation(scene, 1);
  };
  Simulation pushed = run(0.1, 0.0), bounced = run(0.0, -0.1);
  while (pushed.time() < 0.08) pushed.step();
  while (bounced.time() < 0.08) bounced.step();
  CHECK(pushed.n_wall_searches() > 5);  // no grain moved until the wall was there
  CHECK(state_of(pushed).velocity[0].z == Approx(0.1 + state_of(bounced).velocity[0].z).epsilon(1e-9));
  CHECK(state_of(pushed).velocity[0].z > 0.14);
}

TEST_CASE("a servo presses with the force that it is told, light or heavy", "[walls]") {
  for (const double mass : {0.0, 1e-3}) {
    Scene scene = scene_with_floor({});
    WallDefinition lid;
    lid.name = "lid";
    lid.material = "grain";
    lid.shape = PlaneShape{{0, 0, 6e-3}, {0, 0, -1}};
    WallMotion servo;
    servo.kind = WallMotion::Kind::servo;
    servo.force = 0.02;
    servo.gain = 1.0;
    servo.max_speed = 0.05;
    servo.mass = mass;
    lid.motion = {servo};
    scene.walls.push_back(lid);
    Probe probe;
    probe.kind = Probe::Kind::wall_force;
    probe.name = probe.wall = "lid";
    probe.interval = 1.0;
    scene.output.probes = {probe};
    add_grain(scene, "grain", radius, {0, 0, radius});
    add_grain(scene, "grain", radius, {0, 0, 3 * radius});
    Simulation run(scene, 1);
    while (run.time() < 0.3) run.step();
    const std::vector<double> row = run.probe_row(0);
    report("servo of mass %.0e kg: pushed by %.5f N, wanted 0.02 N; it has moved by %.3e m", mass, row[2], row[7]);
    CHECK(row[2] == Approx(0.02).epsilon(1e-3));
    CHECK(row[7] < -1.9e-3);  // down to the second grain
  }
}

namespace {

/// Where a grain is at 0.05 s that a floor throws up, whose motion is in the scene, or is told by a function every so many steps.
Vec3 thrown(double step, std::uint64_t every) {
  WallMotion motion = vibration(4e-4, 50.0, 0.4);
  const double omega = 100.0 * pi;
  const bool is_told = every > 0;
  WallMotion script;
  script.kind = WallMotion::Kind::script;
  script.max_speed = 0.2;
  Scene scene = scene_with_floor({is_told ? script : motion}, step);
  // The function gives velocities only: its path begins where the floor is described.
  if (is_told) std::get<PlaneShape>(scene.walls[0].shape).point.z = motion.amplitude * std::sin(motion.phase);
  add_grain(scene, "grain", radius, {0, 0, radius + 4e-4}, {0.1, 0, 0});
  Simulation run(scene, 1);
  if (is_told)
    run.set_wall_motion(
        "floor",
        [&](double t) {
          return WallRates{{0, 0, motion.amplitude * omega * std::cos(omega * t + motion.phase)}, {}};
        },
        every);
  while (run.time() < 0.05 - 0.5 * step) run.step();
  return state_of(run).position[0];
}

}  // namespace

TEST_CASE("a floor moved by a function of time throws a grain as one moved by the scene does, to the second order",
          "[walls]") {
  double before = 0.0;
  for (const double step : {8e-6, 4e-6, 2e-6}) {
    const double off = length(thrown(step, 1) - thrown(step, 0));
    report("floor told by a function, step %.0e s: off by %.2e m after 0.05 s", step, off);
    if (before > 0.0) CHECK(off < before / 3.0);
    before = off;
  }
  CHECK(before < 2e-9);
  CHECK(length(thrown(2e-6, 10) - thrown(2e-6, 0)) < 1e-5);
}

TEST_CASE("a script's turns add up to the turn that they are, and stretch nothing", "[walls]") {
  ScriptState script;
  script.origin = script.centre = {0.1, -0.2, 0.3};
  script.velocity = {0.3, 0.2, -0.1};
  script.spin = {1.0, -2.0, 3.0};
  const int n = 100000;
  const double dt = 1e-4;
  for (int i = 0; i < n; ++i) script = advanced(script, dt);
  const Vec3 arm{0.05, 0.07, -0.02};
  const Vec3 expected = script.origin + n * dt * script.velocity +
                        turn_about(normalized(script.spin), n * dt * length(script.spin)).turn(arm);
  CHECK(length(script.pose.to_world(script.origin + arm) - expected) < 1e-11);
  CHECK(length(script.pose.to_home(script.pose.to_world(arm)) - arm) < 1e-15);
}
