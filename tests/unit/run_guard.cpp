// A run that cannot go on says which grain, where, why it is likely, and what to do; and stops before it does harm.
#include <catch2/catch.hpp>

#include "engine/run/simulation.hpp"
#include "tests/support/flow_scenes.hpp"

using namespace moraine;

namespace {

/// Grains of one radius at given places and velocities in a cube of 1 m.
Scene listed(const std::vector<GrainSeed>& grains) {
  Scene s = scenes::basic();
  s.domain.high = {1, 1, 1};
  s.particles = {scenes::listed(grains)};
  return s;
}

std::string error_of(const Scene& scene, int n_steps) {
  try {
    Simulation simulation(scene, 1);
    for (int i = 0; i < n_steps; ++i) simulation.step();
  } catch (const RunError& error) {
    return error.what();
  }
  return "no error";
}

std::string start_error_of(const Scene& scene) {
  try {
    Simulation(scene, 1);
  } catch (const SceneError& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("a grain that leaves through a face without an outlet is named with the face") {
  static constexpr const char* faces[] = {"x-low", "x-high", "y-low", "y-high", "z-low", "z-high"};
  for (int face = 0; face < 6; ++face) {
    GrainSeed grain, other;
    grain.position = {0.5, 0.5, 0.5};
    other.position = {0.25, 0.25, 0.25};
    grain.position[face / 2] = face % 2 ? 0.999 : 0.001;
    grain.velocity[face / 2] = face % 2 ? 10.0 : -10.0;
    const std::string text = error_of(listed({other, grain}), 10);
    INFO(text);
    CHECK(text.find("grain 1 (material glass, radius 0.005 m, at (") != std::string::npos);
    CHECK(text.find(std::string("has left the domain through ") + faces[face] +
                    " and there is no outlet: put an [[outlet]] with face = \"" + faces[face] +
                    "\" there, close the walls, or make the domain larger") != std::string::npos);
  }
  GrainSeed grain;
  grain.position = {0.5, 0.5, 0.0015};
  grain.velocity = {0.0, 0.0, -10.0};
  Scene s = listed({grain});
  s.time.step = 1e-4;
  CHECK(error_of(s, 10) ==
        "step 1, t = 0.0001 s: grain 0 (material glass, radius 0.005 m, at (0.5, 0.5, -0.0005) m, velocity (0, 0, -10) "
        "m/s) has left the "
        "domain through z-low and there is no outlet: put an [[outlet]] with face = \"z-low\" there, close the walls, "
        "or make the domain larger");
}

TEST_CASE("a grain too fast for its step is named, with how far it goes and what to do") {
  GrainSeed grain;
  grain.position = {0.5, 0.5, 0.5};
  grain.velocity = {200.0, 0.0, 0.0};
  Scene s = listed({grain});
  s.time.step = 1e-5;
  const std::string text = error_of(s, 10);
  CHECK(
      text.starts_with("step 0, t = 0 s: grain 0 (material glass, radius 0.005 m, at (0.502, 0.5, 0.5) m, velocity "
                       "(200, 0, 0) m/s) moves 0.4 "
                       "of its radius in one step: contacts would be missed\n  it touches nothing\n  likely cause: "));
  CHECK(text.find("set time.max_speed") != std::string::npos);
}

TEST_CASE("an overlap that runs away is named with both grains, its depth, the limit and the cure") {
  GrainSeed left, right;
  left.position = {0.49, 0.5, 0.5};
  right.position = {0.51, 0.5, 0.5};
  left.velocity = {8.0, 0.0, 0.0};
  right.velocity = {-8.0, 0.0, 0.0};
  const std::string text = error_of(listed({left, right}), 100);
  INFO(text);
  CHECK(text.find("overlap runs away: grain 0 (material glass") != std::string::npos);
  CHECK(text.find(" deep in grain 1 (material glass") != std::string::npos);
  CHECK(text.find("(limit run.max_overlap = 0.5)") != std::string::npos);
  CHECK(text.find("\n  it touches 1:\n    grain 1") != std::string::npos);
  CHECK(text.find("\n  likely cause: grains too soft for their load or speed (raise the stiffness; the step then "
                  "falls), or an impact faster "
                  "than foreseen (set time.max_speed), or grains put into each other or into a wall; the step 4e-05 s "
                  "is 32 to a contact") != std::string::npos);
}

TEST_CASE("a step too long for the contacts is the likely cause that is named, with the step to take") {
  Scene s = scenes::settled_bed();
  s.time.step = 1e-3;  // about one to a contact
  const std::string text = error_of(s, 2000);
  INFO(text);
  CHECK(text.find("grain ") != std::string::npos);
  CHECK(text.find("likely cause: the time step 0.001 s gives the shortest contact only 1.") != std::string::npos);
  CHECK(text.find("steps; use time.step = \"auto\" or at most ") != std::string::npos);
}

TEST_CASE("grains or walls put into each other stop a run before it starts, with the deepest allowed overlap") {
  GrainSeed left, right;
  left.position = {0.5, 0.5, 0.5};
  right.position = {0.507, 0.5, 0.5};
  CHECK(start_error_of(listed({left, right})) ==
        "particles[0].fill.positions: grain 0 of particles[0] and grain 1 of particles[0] overlap by 0.003 m, 60 % of "
        "the smaller radius; at "
        "most 20 % is allowed at the start (1 pair beyond it)");
  left.position = {0.5, 0.5, 0.003};
  Scene s = listed({left});
  scenes::add_wall(s, "floor", PlaneShape{{0, 0, 0}, {0, 0, 1}});
  CHECK(start_error_of(s) ==
        "particles[0].fill.positions: grain 0 of particles[0] reaches 0.002 m, 40 % of its radius, into wall "
        "\"floor\"; at most 20 % is allowed "
        "at the start (1 grain beyond it)");
  left.position = {0.5, 0.5, 0.0045};
  CHECK(start_error_of([&] {
          Scene allowed = listed({left});
          scenes::add_wall(allowed, "floor", PlaneShape{{0, 0, 0}, {0, 0, 1}});
          return allowed;
        }()) == "no error");
}

TEST_CASE("a state that is not a number stops the run in the next step and names the grain") {
  const Scene s = scenes::gas();
  for (const Field field : {Field::velocity, Field::angular_velocity}) {
    Simulation simulation(s, 1);
    for (int i = 0; i < 10; ++i) simulation.step();
    Image image = simulation.checkpoint();
    for (FieldArray& array : image.fields)
      if (array.field == field) array.reals[3 * 17 + 1] = std::nan("");
    Simulation broken(s, 1, image);
    std::string text = "no error";
    try {
      for (int i = 0; i < 3000; ++i) broken.step();
    } catch (const RunError& error) {
      text = error.what();
    }
    INFO(text);
    if (field == Field::velocity) CHECK(text.find("the velocity of grain 17 (material glass") != std::string::npos);
    CHECK(text.find("is not finite") != std::string::npos);
  }
}

TEST_CASE("a grain on a periodic face is inside the domain whatever the rounding of the period") {
  // Domains whose width, taken off the upper face, gives a place just below the lower one.
  shapes::Dice dice(71);
  int n_tried = 0;
  for (int trial = 0; trial < 4000 && n_tried < 20; ++trial) {
    const double low = dice.uniform(0.05, 0.3), high = low + dice.uniform(0.2, 0.7);
    if (!(high - (high - low) < low)) continue;
    const double start = high - 0x1p-10;
    if (start + 0x1p-10 != high) continue;
    ++n_tried;
    GrainSeed grain;
    grain.position = {start, 0.5, 0.5};
    grain.velocity = {0x1p5, 0.0, 0.0};
    Scene s = listed({grain});
    s.domain.low.x = low;
    s.domain.high.x = high;
    s.domain.periodic = {true, false, false};
    s.time.step = 0x1p-15;
    Simulation simulation(s, 1);
    REQUIRE_NOTHROW(simulation.step());
    const Image image = simulation.snapshot();
    CHECK(image.find(Field::position)->reals[0] == low);
  }
  CHECK(n_tried == 20);
}

TEST_CASE("grains of a second material keep their own law when all of the first have left and the run is restored") {
  GrainSeed glass, left, right;
  glass.position = {0.5, 0.5, 0.001};
  glass.velocity = {0.0, 0.0, -5.0};
  left.position = {0.494, 0.5, 0.5};
  right.position = {0.508, 0.5, 0.5};
  left.velocity = {1.0, 0.0, 0.0};
  right.velocity = {-1.0, 0.0, 0.0};
  Scene s = listed({glass});
  s.particles.push_back(listed({left, right}).particles[0]);
  s.particles[1].material = "steel";
  s.outlets.push_back({"out", 4});
  Simulation unbroken(s, 1);
  for (int i = 0; i < 20; ++i) unbroken.step();
  REQUIRE(unbroken.n_left() == 1);
  Simulation restored(s, 1, unbroken.checkpoint());
  for (int i = 0; i < 2000; ++i) {
    unbroken.step();
    restored.step();
  }
  CHECK(unbroken.snapshot().find(Field::velocity)->reals[0] ==
        Approx(-0.8).epsilon(0.01));  // restitution of steel; glass has 0.7
  CHECK(unbroken.state_hash() == restored.state_hash());
}

TEST_CASE("two-dimensional grains do not meet their own images through the thickness") {
  GrainSeed grain;
  grain.position = {0.5, 0.5, 0.0};
  grain.velocity = {0.1, 0.0, 0.0};
  Scene s = listed({grain});
  s.domain.dimensions = 2;
  s.domain.low = {0, 0, -0.002};
  s.domain.high = {1, 1, 0.002};
  s.domain.periodic = {true, true, false};
  Simulation simulation(s, 1);
  REQUIRE_NOTHROW([&] {
    for (int i = 0; i < 100; ++i) simulation.step();
  }());
  CHECK(simulation.snapshot().n_grains == 1);
}
