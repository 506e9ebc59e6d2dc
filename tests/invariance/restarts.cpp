// A run that goes on from a checkpoint is the run that was never broken.
#include <catch2/catch.hpp>

#include "tests/invariance/trace.hpp"
#include "tests/support/flow_scenes.hpp"

using namespace moraine;

TEST_CASE("a run restored from a checkpoint on other threads is the unbroken run, bit by bit") {
  for (auto& [name, scene, n_steps] : scenes::all()) {
    scene.output.energy = true;
    Simulation unbroken(scene, 2);
    for (const int n_threads : {1, 3, 7}) {
      INFO(name << ", to " << n_threads << " threads");
      for (int i = 0; i < n_steps / 4; ++i) unbroken.step();
      const Image image = unbroken.checkpoint();
      Simulation restored(scene, n_threads, image);
      CHECK(trace::difference(image, restored.checkpoint()) == "");
      CHECK(trace::difference(trace::record(unbroken, n_steps / 12, 100), trace::record(restored, n_steps / 12, 100)) ==
            "");
      CHECK(trace::difference(unbroken.checkpoint(), restored.checkpoint()) == "");
    }
  }
}

TEST_CASE("a run that is broken and restored at every step is the unbroken run, bit by bit") {
  for (auto& [name, scene, n_steps] : scenes::all()) {
    scene.output.energy = true;
    INFO(name);
    Simulation unbroken(scene, 1);
    for (int i = 0; i < n_steps * 2 / 3; ++i) unbroken.step();
    Simulation broken(scene, 1, unbroken.checkpoint());
    for (int i = 0; i < 250; ++i) {
      unbroken.step();
      broken.step();
      const Image image = broken.checkpoint();
      const Image expected = unbroken.checkpoint();
      INFO("step " << unbroken.step_number());
      REQUIRE(trace::difference(expected, image) == "");
      REQUIRE_NOTHROW(broken = Simulation(scene, 1 + i % 4, image));
      REQUIRE(trace::difference(expected, broken.checkpoint()) == "");
    }
    CHECK(trace::ledger_bits(unbroken.energy()) == trace::ledger_bits(broken.energy()));
  }
}

TEST_CASE("a run goes on in the precision that it had, and says so where another is asked for") {
  const Scene in_double = scenes::settled_bed(), in_mixed = scenes::in_mixed_precision(scenes::settled_bed());
  for (const bool is_mixed : {false, true}) {
    const Scene& own = is_mixed ? in_mixed : in_double;
    const Scene& other = is_mixed ? in_double : in_mixed;
    Simulation run(own, 1);
    for (int i = 0; i < 50; ++i) run.step();
    const Image image = run.checkpoint();
    CHECK_NOTHROW(Simulation(own, 2, image));
    try {
      Simulation(other, 1, image);
      FAIL("a checkpoint of another precision was taken");
    } catch (const SceneError& error) {
      const std::string had = is_mixed ? "mixed" : "double", wants = is_mixed ? "double" : "mixed";
      CHECK(error.problems[0].key == "run.precision");
      CHECK(error.problems[0].message ==
            "is \"" + wants + "\", but the checkpoint is of a run in " + had +
                " precision; a run goes on in the precision it had: set run.precision = \"" + had +
                "\", or begin a new run with its grains (particles.fill.file)");
    }
  }
}

TEST_CASE("a run restored while its gate opens and grains leave through the outlet is the unbroken run, bit by bit") {
  for (Scene scene : {scenes::hopper(0.02), scenes::flat()}) {
    scene.output.energy = true;
    Simulation unbroken(scene, 3);
    for (int i = 0; i < 480; ++i) unbroken.step();
    Simulation broken(scene, 2, unbroken.checkpoint());
    std::uint64_t left = unbroken.n_left();
    int n_times = 0;
    for (int i = 0; i < 4500; ++i) {
      unbroken.step();
      broken.step();
      const bool has_left = unbroken.n_left() != left;
      left = unbroken.n_left();
      if (!has_left && i > 40) continue;
      ++n_times;
      const Image image = unbroken.checkpoint();
      INFO("step " << unbroken.step_number());
      REQUIRE(trace::difference(image, broken.checkpoint()) == "");
      REQUIRE_NOTHROW(broken = Simulation(scene, 1 + i % 3, image));
      REQUIRE(trace::difference(image, broken.checkpoint()) == "");
    }
    CHECK(left > 10);
    CHECK(trace::difference(unbroken.checkpoint(), broken.checkpoint()) == "");
  }
}

TEST_CASE(
    "a run whose walls a program moves goes on at any step, between its calls as well, once the program is there "
    "again") {
  Scene scene = scenes::driven();
  scene.output.energy = true;
  Simulation unbroken(scene, 1);
  trace::drive(unbroken);
  for (int i = 0; i < 600; ++i) unbroken.step();
  Simulation broken(scene, 2, unbroken.checkpoint());
  CHECK_THROWS_WITH(broken.step(), Catch::Contains("after a restart as well"));
  for (int i = 0; i < 60; ++i) {
    broken = Simulation(scene, 1 + i % 3, unbroken.checkpoint());
    trace::drive(broken);
    unbroken.step();
    broken.step();
    INFO("step " << unbroken.step_number());
    REQUIRE(trace::difference(unbroken.checkpoint(), broken.checkpoint()) == "");
    REQUIRE(trace::ledger_bits(unbroken.energy()) == trace::ledger_bits(broken.energy()));
  }
}
