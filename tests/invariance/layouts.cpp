// The same bits whatever the layout: threads, skin, what is written and counted beside.
#include <catch2/catch.hpp>

#include <set>

#include "tests/invariance/trace.hpp"
#include "tests/support/flow_scenes.hpp"

using namespace moraine;

namespace {

constexpr int every = 250;

}  // namespace

TEST_CASE("a scene gives the same hashes, probes and energies on 1, 3 and 7 threads") {
  for (auto& [name, scene, n_steps] : scenes::all()) {
    scene.output.energy = true;
    const std::vector<trace::Moment> one = trace::record(scene, 1, n_steps, every);
    std::set<std::string> hashes;
    for (const trace::Moment& moment : one) hashes.insert(moment.hash);
    CHECK(hashes.size() == one.size());
    for (const int n_threads : {3, 7}) {
      INFO(name << ", " << n_threads << " threads");
      CHECK(trace::difference(one, trace::record(scene, n_threads, n_steps, every)) == "");
    }
  }
}

TEST_CASE("threads that come and go at each rebuild change no bit of the state, the probes or the energies") {
  for (auto& [name, scene, n_steps] : scenes::all()) {
    INFO(name);
    scene.output.energy = true;
    const int n = n_steps / 4;
    Simulation simulation(scene, 2);
    simulation.force_threads([](std::uint64_t rebuild) { return 1 + static_cast<int>(rebuild * rebuild % 7 % 5); });
    CHECK(trace::difference(trace::record(scene, 1, n, every), trace::record(simulation, n, every)) == "");
  }
}

TEST_CASE("the skin changes how often the list is rebuilt, and no bit of the state, the probes or the energies") {
  for (auto& [name, scene, n_steps] : scenes::all()) {
    scene.output.energy = true;
    const int n = n_steps / 3;
    const std::vector<trace::Moment> chosen = trace::record(scene, 2, n, every);
    std::vector<std::uint64_t> rebuilds;
    for (const double skin : {0.02, 0.3, 1.0}) {
      INFO(name << ", skin " << skin << " diameters");
      scene.run.skin = skin * scenes::d;
      Simulation simulation(scene, 3);
      CHECK(trace::difference(chosen, trace::record(simulation, n, every)) == "");
      rebuilds.push_back(simulation.n_rebuilds());
    }
    CHECK(rebuilds.front() > rebuilds.back());
  }
}

TEST_CASE("a bound of the skin, as where memory is short, makes more rebuilds and changes no bit") {
  for (const Scene& scene : {scenes::gas(), scenes::periodic_flow()}) {
    Simulation free(scene, 2), bounded(scene, 2);
    bounded.bound_skin(0.0);  // that of the plan
    for (int i = 0; i < 3000; ++i) {
      free.step();
      bounded.step();
    }
    CHECK(bounded.n_rebuilds() > free.n_rebuilds());
    CHECK(bounded.state_hash() == free.state_hash());
  }
}

TEST_CASE("keeping the energy ledger changes no bit of the state") {
  for (auto& [name, scene, n_steps] : scenes::all()) {
    INFO(name);
    const int n = n_steps / 3;
    scene.output.energy = false;
    std::vector<trace::Moment> without = trace::record(scene, 2, n, every);
    scene.output.energy = true;
    std::vector<trace::Moment> with = trace::record(scene, 2, n, every);
    for (trace::Moment& moment : with) moment.ledger.values.clear();
    CHECK(trace::difference(without, with) == "");
  }
}

TEST_CASE("looking at a run changes no bit of it") {
  for (auto& [name, scene, n_steps] : scenes::all()) {
    INFO(name);
    const int n = n_steps / 3;
    scene.output.energy = true;
    Simulation watched(scene, 3);
    for (int i = 0; i < n; ++i) {
      watched.step();
      if (i % 7 == 0) trace::look(watched);
      if (i % 11 == 0) watched.checkpoint();
    }
    scene.output.probes.clear();
    scene.output.fields = {"force"};
    Simulation alone(scene, 3);
    for (int i = 0; i < n; ++i) alone.step();
    CHECK(watched.state_hash() == alone.state_hash());
    CHECK(trace::ledger_bits(watched.energy()) == trace::ledger_bits(alone.energy()));
  }
}

TEST_CASE("grains born are those inside and those that have left, at every output") {
  std::uint64_t most_left = 0;
  for (auto& [name, scene, n_steps] : scenes::all()) {
    INFO(name);
    for (const trace::Moment& moment : trace::record(scene, 3, n_steps, 50)) {
      REQUIRE(moment.n_born == moment.n_inside + moment.n_left);
      most_left = std::max(most_left, moment.n_left);
    }
  }
  CHECK(most_left > 20);
}

TEST_CASE("a grain that rolls over a periodic face onto other triangles keeps its floor, however wide the skin") {
  // Two grains on floors of many small triangles, thrown over faces of both directions again and again.
  Scene scene = scenes::basic();
  scene.domain.low = {0.0, 0.0, -0.01};
  scene.domain.high = {0.1, 0.08, 0.1};
  scene.domain.periodic = {true, true, false};
  scene.time.gravity = {0.0, 0.0, -9.81};
  std::vector<GrainSeed> grains;
  for (const double x : {0.02, 0.06}) {
    GrainSeed seed;
    seed.position = {x, x, 0.5 * scenes::d};
    seed.radius = 0.5 * scenes::d;
    seed.velocity = {x < 0.05 ? 1.0 : -0.6, 0.35, 0.0};
    grains.push_back(seed);
  }
  scene.particles = {scenes::listed(grains)};
  TriangleMesh floor;
  const int n = 24;
  for (int i = 0; i <= n; ++i)
    for (int k = 0; k <= n; ++k) floor.vertices.push_back({-0.01 + 0.12 * i / n, -0.01 + 0.10 * k / n, 0.0});
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k) {
      const int a = i * (n + 1) + k, b = a + n + 1;
      floor.triangles.push_back({a, b, a + 1});
      floor.triangles.push_back({b, b + 1, a + 1});
    }
  scenes::add_wall(scene, "floor", MeshShape{"floor.obj", floor}, "steel");
  scene.run.skin = 1e-5;
  Simulation narrow(scene, 1);
  scene.run.skin = 0.02;
  Simulation wide(scene, 1);
  for (int i = 0; i < 8000; ++i) {
    narrow.step();
    wide.step();
    if (i % 50 == 0) REQUIRE(narrow.state_hash() == wide.state_hash());
  }
  const FieldArray position = wide.snapshot().fields[0];
  for (const std::size_t grain : {0u, 1u})
    CHECK(position.reals[3 * grain + 2] == Approx(0.5 * scenes::d).epsilon(0.01));
  CHECK(wide.n_rebuilds() < 200);
}

TEST_CASE("runs in double and in mixed precision have different hashes even while they are the same") {
  Simulation in_double(scenes::gas(), 1), in_mixed(scenes::in_mixed_precision(scenes::gas()), 1);
  CHECK(in_double.snapshot().find(Field::position)->reals == in_mixed.snapshot().find(Field::position)->reals);
  CHECK_FALSE(in_double.state_hash() == in_mixed.state_hash());
}

TEST_CASE("walls that a program moves give the same bits on any threads and for any skin") {
  Scene scene = scenes::driven();
  scene.output.energy = true;
  Simulation one(scene, 1);
  trace::drive(one);
  const std::vector<trace::Moment> expected = trace::record(one, 900, 150);
  for (const int n_threads : {2, 5}) {
    scene.run.skin = 0.1 * n_threads * scenes::d;
    Simulation run(scene, n_threads);
    trace::drive(run);
    CHECK(trace::difference(expected, trace::record(run, 900, 150)) == "");
  }
}
