// The time step that explains itself: what bounds it, what it makes of an impact, and when a run no longer keeps to it.
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "engine/run/one_contact.hpp"
#include "engine/run/simulation.hpp"
#include "engine/run/step_watch.hpp"
#include "tests/support/flow_scenes.hpp"

using namespace moraine;

namespace {

/// Two grains that fly at each other, `gap` apart [m], each at half of `speed` [m/s].
Scene impact(NormalLaw normal, double restitution, double speed, double gap) {
  Scene s = scenes::basic();
  s.domain.low = {-1, -1, -1};
  s.domain.high = {1, 1, 1};
  s.time.step.reset();
  s.contact.normal = normal;
  s.contact.tangential = normal == NormalLaw::hertz ? TangentialLaw::mindlin : TangentialLaw::spring;
  s.contact.pairs[0].restitution = restitution;
  s.particles = {scenes::listed({{{-0.5 * (scenes::d + gap), 0, 0}, {0.5 * speed, 0, 0}, {}, 0.0, 0},
                                 {{0.5 * (scenes::d + gap), 0, 0}, {-0.5 * speed, 0, 0}, {}, 0.0, 0}})};
  return s;
}

double speed_after(const Scene& scene, int n_steps) {
  Simulation simulation(scene, 1);
  for (int i = 0; i < n_steps; ++i) simulation.step();
  const Image image = simulation.snapshot();
  const std::vector<double>& v = image.find(Field::velocity)->reals;
  return v[3] - v[0];
}

}  // namespace

TEST_CASE("what a step makes of an impact is what a run makes of it") {
  for (const NormalLaw normal : {NormalLaw::linear, NormalLaw::hertz})
    for (const double phase : {0.1, 0.5, 0.8}) {
      const double speed = 0.7, dt = 1.1e-4;  // some twenty steps a contact
      INFO(name_of(normal) << ", phase " << phase);
      Scene scene = impact(normal, 0.8, speed, (2.0 + phase) * speed * dt);
      scene.time.step = dt;
      const ContactCase bodies = contact_cases(scene).front();
      CHECK(speed_after(scene, 120) / speed ==
            Approx(restitution_of_impact(scene, bodies, speed, dt, phase)).epsilon(1e-9));
    }
}

TEST_CASE("the error that a step will make shrinks with it, and is that of the worst pair") {
  Scene scene = impact(NormalLaw::linear, 0.5, 1.0, 0.001);
  const double shortest = choose_time_step(scene).contact_time;
  const ImpactError coarse = impact_error(scene, shortest / 20.0), fine = impact_error(scene, shortest / 200.0);
  CHECK(coarse.exact == Approx(0.5).epsilon(0.005));
  CHECK(fine.restitution < 0.3 * coarse.restitution);
  CHECK(fine.energy < 0.1 * coarse.energy);
  CHECK_THAT(coarse.pair, Catch::Contains("glass (d 0.01 m) with glass (d 0.01 m)"));
}

TEST_CASE("the automatic step names what bounds it: the stiffest contact, the Rayleigh time, travel or the gas") {
  const auto first = [](const Scene& scene) { return choose_time_step(scene).limits.front().words; };
  Scene scene = impact(NormalLaw::linear, 0.8, 1.0, 0.001);
  scenes::add_wall(scene, "floor", PlaneShape{{0, 0, -0.5}, {0, 0, 1}}, "steel");
  scene.contact.pairs[1].normal_stiffness = 1e6;
  CHECK(first(scene) == "glass (d 0.01 m) with wall \"floor\" (steel)");
  CHECK(choose_time_step(scene).step == Approx(choose_time_step(scene).contact_time / 50.0));

  Scene slow = impact(NormalLaw::hertz, 0.8, 1e-7, 0.001);
  CHECK_THAT(first(slow), Catch::StartsWith("0.2 of the Rayleigh time of glass (d 0.01 m)"));
  const double shear = 5e6 / 2.6,
               rayleigh = std::numbers::pi * 0.005 * std::sqrt(2500.0 / shear) / (0.1631 * 0.3 + 0.8766);
  CHECK(choose_time_step(slow).step == Approx(0.2 * rayleigh));

  const Scene fast = impact(NormalLaw::linear, 0.8, 400.0, 0.001);
  CHECK(first(fast) == "0.05 of the smallest radius travelled at 200 m/s");
  CHECK(choose_time_step(fast).step == Approx(0.05 * 0.005 / 200.0));

  Scene windy = impact(NormalLaw::linear, 0.8, 1.0, 0.001);
  windy.gas = scenes::air({4, 4, 4});
  windy.gas->step = 1e-6;
  CHECK_THAT(first(windy), Catch::StartsWith("the gas step"));
  CHECK(make_plan(windy, 1).gas_steps == 1);
}

TEST_CASE("the skin is a tenth of the diameter that most grains have, however large a few others are") {
  Scene scene = scenes::basic();
  scene.domain.high = {1, 1, 1};
  const auto group = [](std::int64_t count, double diameter) {
    ParticleGroup made;
    made.material = "glass";
    made.diameter.value = diameter;
    RandomFill fill;
    fill.region = BoxRegion{{{0, 0, 0}, {1, 1, 1}}};
    fill.count = count;
    made.fill = fill;
    return made;
  };
  scene.particles = {group(10, 0.1), group(990, 0.01)};
  CHECK(make_plan(scene, 1).skin == Approx(0.1 * (10 * 0.1 + 990 * 0.01) / 1000));
  scene.particles.pop_back();
  CHECK(make_plan(scene, 1).skin == Approx(0.01));
}

TEST_CASE("a run with grains faster than its step was chosen for says so once, with numbers, and goes on") {
  Scene scene = impact(NormalLaw::hertz, 0.9, 4.0, 0.001);
  scene.time.max_speed = 0.5;
  Simulation simulation(scene, 1);
  CHECK(simulation.n_known_warnings() == 0);
  for (int i = 0; i < 100; ++i) simulation.step();
  REQUIRE(simulation.n_known_warnings() == 1);
  CHECK_THAT(simulation.known_warnings().front(),
             Catch::Contains("up to 2 m/s, faster than the 0.5 m/s") &&
                 Catch::Contains("37.9 steps instead of 50.0"));  // 50 (1/4)^(1/5)
  CHECK(simulation.step_warnings() == simulation.known_warnings());
}

TEST_CASE("a grain that goes far in a step is warned of before it is stopped") {
  Scene scene = impact(NormalLaw::linear, 0.9, 1.0, 0.5);
  scene.time.step = 1.2e-3;  // 0.12 of the radius
  scene.particles[0].diameter.value = scenes::d;
  Simulation simulation(scene, 1);
  for (int i = 0; i < 20; ++i) simulation.step();
  REQUIRE(simulation.n_known_warnings() == 1);
  CHECK_THAT(simulation.known_warnings().front(),
             Catch::Contains("0.12 of the smallest radius") && Catch::Contains("time.step = 0.0005"));
}
