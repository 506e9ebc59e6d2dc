// Inlets and outlets: exact rates, no overlap at birth, debts that are kept, and a balance that closes.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "kernels/base/sphere.hpp"
#include "tests/physics/laboratory.hpp"

using namespace moraine;
using namespace moraine::physics;

namespace {

constexpr double radius = 1e-3;

/// An empty box of two materials with an outlet in its floor.
Scene box_scene() {
  Scene scene = empty_scene({0, 0, 0}, {0.04, 0.04, 0.1}, 2e-5);
  scene.time.gravity = {0, 0, -9.81};
  scene.materials = {{"glass", 2500, 1e7, 0.25}, {"steel", 7800, 1e7, 0.25}};
  for (auto [a, b] : {std::pair{"glass", "glass"}, {"glass", "steel"}, {"steel", "steel"}}) {
    PairLaw law = pair_law(a, b, 0.5, 0.3);
    law.normal_stiffness = 500.0;
    scene.contact.pairs.push_back(law);
  }
  scene.particles.clear();
  WallDefinition sides;
  sides.name = "sides";
  sides.material = "glass";
  sides.shape = BoxShape{{{0, 0, -1}, {0.04, 0.04, 0.2}}};
  scene.walls = {sides};
  scene.outlets = {{"floor", 4}};
  Probe mass;
  mass.kind = Probe::Kind::mass;
  mass.name = "mass";
  mass.interval = 1.0;
  Probe depth = mass;
  depth.kind = Probe::Kind::contacts;
  depth.name = "contacts";
  scene.output.probes = {mass, depth};
  return scene;
}

Inlet inlet(const std::string& name, const std::string& material = "glass") {
  Inlet in;
  in.name = name;
  in.material = material;
  in.diameter.value = 2.0 * radius;
  in.where = BoxRegion{{{0, 0, 0.06}, {0.04, 0.04, 0.09}}};
  in.velocity = {0, 0, -0.5};
  return in;
}

double value(Simulation& run, const std::string& column) {
  const std::vector<std::string> names = run.probe_columns(0);
  const auto found = std::find(names.begin(), names.end(), column);
  REQUIRE(found != names.end());
  return run.probe_row(0)[static_cast<std::size_t>(found - names.begin())];
}

}  // namespace

TEST_CASE("an inlet gives floor(rate t) grains at any time", "[openings]") {
  for (const double rate : {137.0, 2000.0, 49999.0}) {
    Scene scene = box_scene();
    scene.time.gravity = {};
    Inlet in = inlet("in");
    in.velocity = {0, 0, -5.0};  // out of the way
    in.diameter.value = 3e-4;
    in.number_rate = rate;
    in.from = 0.003;
    in.until = 0.012;
    scene.inlets = {in};
    scene.time.step = 5e-6;
    Simulation run(scene, 1);
    for (int i = 0; i < 2600; ++i) {
      run.step();
      // births of a step are those owed at its beginning
      const double elapsed = std::min(run.time() - run.time_step(), 0.012) - 0.003;
      REQUIRE(static_cast<double>(run.n_born()) == std::max(0.0, std::floor(rate * elapsed + 1e-9)));
    }
  }
}

TEST_CASE("an inlet of mass owes less than one grain at any time, and never gives too much", "[openings]") {
  Scene scene = box_scene();
  Inlet in = inlet("in", "steel");
  in.diameter.kind = SizeDistribution::Kind::uniform;
  in.diameter.low = 1e-3;
  in.diameter.high = 2e-3;
  in.mass_rate = 0.02;
  scene.inlets = {in};
  Simulation run(scene, 1);
  const double largest = mass_of(7800, 1e-3);
  for (int i = 0; i < 4000; ++i) {
    run.step();
    if (i % 20 != 0) continue;
    const double due = 0.02 * (run.time() - run.time_step());
    const double given = value(run, "mass born [kg]");
    REQUIRE(given <= due * (1.0 + 1e-8));
    REQUIRE(due - given < largest);
  }
  CHECK(run.n_born() > 80);
}

TEST_CASE("nothing overlaps at birth, and a region is filled to its count, mass or solid fraction", "[openings]") {
  Scene scene = box_scene();
  scene.time.gravity = {};
  scene.outlets.clear();
  Inlet in = inlet("in");
  in.velocity = {};
  in.diameter.kind = SizeDistribution::Kind::uniform;
  in.diameter.low = 2e-3;
  in.diameter.high = 4e-3;
  const double volume = 0.04 * 0.04 * 0.03;
  for (int kind = 0; kind < 3; ++kind) {
    Inlet filled = in;
    if (kind == 0) filled.fill_count = 400;
    if (kind == 1) filled.fill_mass = 0.2 * volume * 2500.0;
    if (kind == 2) filled.fill_solid_fraction = 0.22;
    scene.inlets = {filled};
    Simulation run(scene, 2);
    for (int i = 0; i < 2000; ++i) run.step();
    const double largest = mass_of(2500, 2e-3), inside = value(run, "mass inside [kg]");
    if (kind == 0) CHECK(run.n_born() == 400);
    if (kind == 1) CHECK(inside <= *filled.fill_mass * (1.0 + 1e-8));
    if (kind == 1) CHECK(inside > *filled.fill_mass - largest);
    if (kind == 2) CHECK(inside <= 0.22 * volume * 2500.0);
    if (kind == 2) CHECK(inside > 0.22 * volume * 2500.0 - largest);
    CHECK(run.probe_row(1)[0] == 0.0);  // no contact at all
    if (kind == 0) CHECK(run.take_notes().empty());
  }
}

TEST_CASE("an inlet without room says so, keeps its debt, and pays it when there is room", "[openings]") {
  Scene scene = box_scene();
  scene.time.gravity = {};
  Inlet in = inlet("in");
  in.velocity = {};
  in.number_rate = 20000.0;
  in.until = 0.02;
  in.where = BoxRegion{{{0.01, 0.01, 0.06}, {0.018, 0.018, 0.068}}};
  scene.inlets = {in};
  Outlet sweep{"sweep", Box{{0, 0, 0.05}, {0.04, 0.04, 0.1}}};
  sweep.from = 0.03;
  scene.outlets.push_back(sweep);
  Simulation run(scene, 1);
  while (run.time() < 0.025) run.step();
  CHECK(run.n_born() < 60);  // of eight by eight by eight millimetres
  CHECK(static_cast<double>(run.n_born()) + value(run, "owed at in") == 400.0);
  const std::vector<std::string> notes = run.take_notes();
  REQUIRE(notes.size() == 1);
  CHECK(notes[0].find("inlet \"in\" finds no room for") == 0);
  while (run.time() < 0.06) run.step();  // what lies there is taken away
  CHECK(run.n_born() == 400);
  CHECK(value(run, "owed at in") == 0.0);
}

TEST_CASE("outlets take what crosses or enters them, and grains of a region at a time; each species balances",
          "[openings]") {
  Scene scene = box_scene();
  scene.outlets.clear();
  Inlet glass = inlet("glass"), steel = inlet("steel", "steel");
  glass.number_rate = 3000.0;
  steel.number_rate = 1000.0;
  scene.inlets = {glass, steel};
  TriangleMesh net;
  net.vertices = {{0.02, 0, 0.05}, {0.04, 0, 0.05}, {0.02, 0.02, 0.05}, {0.04, 0.02, 0.05}};
  net.triangles = {{0, 1, 2}, {1, 3, 2}};
  Outlet cut{"cut", Box{{0, 0, 0.02}, {0.04, 0.04, 0.04}}};
  cut.from = 0.15;
  cut.is_once = true;
  scene.outlets = {{"disc", DiscShape{{0.01, 0.01, 0.05}, {0, 0, 1}, 0.01, 0.0}},
                   {"net", MeshShape{"", net}},
                   {"pipe", CylinderRegion{{0.01, 0.03, 0.03}, 2, 0.008, 0.02}},
                   {"ball", SphereRegion{{0.03, 0.03, 0.03}, 0.008}},
                   {"plane", PlaneShape{{0, 0, 0.01}, {0, 0, 1}}},
                   cut};
  Simulation run(scene, 2);
  std::uint64_t left_before = 0;
  while (run.time() < 0.2) {
    const std::uint64_t left = run.n_left();
    run.step();
    if (run.time() >= 0.15 && left_before == 0) left_before = run.n_left() - left;
    if (run.step_number() % 500 != 0) continue;
    for (const char* species : {"glass ", "steel "})
      for (const char* what : {"", "mass "}) {
        const std::string unit = *what ? " [kg]" : "", name = std::string(species) + what;
        REQUIRE(value(run, name + "born" + unit) ==
                Approx(value(run, name + "inside" + unit) + value(run, name + "left" + unit)).epsilon(1e-15));
      }
  }
  CHECK(left_before > 20);  // those in the box, all at once
  double through = 0.0;
  for (const char* name : {"disc", "net", "pipe", "ball", "plane", "cut"}) {
    const double n = value(run, std::string("left through ") + name);
    report("left through %s: %.0f", name, n);
    CHECK(n > 5.0);
    through += n;
  }
  CHECK(through == static_cast<double>(run.n_left()));
  // Little gets around the net, by collisions; nothing behind the plane.
  const State state = state_of(run);
  int n_below_net = 0;
  for (const Vec3 x : state.position) {
    CHECK(x.z >= 0.01);
    n_below_net += x.z < 0.0495 && x.x > 0.02 && x.y < 0.02 ? 1 : 0;
  }
  CHECK(n_below_net <= 3);
}

TEST_CASE("grains that are recycled come back one for one, of the same sizes and materials", "[openings]") {
  Scene scene = box_scene();
  Inlet fill = inlet("fill"), more = inlet("more", "steel"), back = inlet("back");
  fill.diameter.kind = SizeDistribution::Kind::uniform;
  fill.diameter.low = 1.5e-3;
  fill.diameter.high = 2.5e-3;
  fill.number_rate = more.number_rate = 3000.0;
  fill.until = more.until = 0.05;
  back.interval = 1e-3;
  scene.inlets = {fill, more, back};
  scene.outlets[0].recycles = "back";
  Simulation run(scene, 2);
  while (run.time() < 0.3) run.step();
  CHECK(run.n_left() > 300);
  CHECK(value(run, "glass inside") + value(run, "steel inside") + value(run, "owed at back") <= 300.0);
  // those that left within the last millisecond wait for the next turn
  CHECK(value(run, "glass inside") + value(run, "steel inside") > 290.0);
  const double mass = value(run, "mass inside [kg]");
  Scene same = scene;
  same.outlets.clear();
  same.inlets.pop_back();
  same.time.gravity = {};
  Simulation never(same, 1);
  while (never.time() < 0.055) never.step();
  report("recycled %.0f times, mass inside %.6e kg of %.6e kg", static_cast<double>(run.n_left()), mass,
         value(never, "mass inside [kg]"));
  CHECK(mass <= value(never, "mass inside [kg]") * (1.0 + 1e-14));
  CHECK(mass > 0.95 * value(never, "mass inside [kg]"));
}

TEST_CASE("a list of grains is born at its places, those of them that are taken when they are free", "[openings]") {
  Scene scene = box_scene();
  scene.time.gravity = {};
  add_grain(scene, "glass", radius, {0.01, 0.01, 0.05}, {0, 0, 0.1});
  ListedGrains list;
  list.has_radius = list.has_velocity = true;
  for (int k = 0; k < 3; ++k) {
    GrainSeed seed;
    seed.position = {0.01 + 0.01 * k, 0.01, 0.051};
    seed.radius = radius;
    seed.velocity = {0, 0, -0.01 * k};
    list.grains.push_back(seed);
  }
  Inlet in = inlet("in");
  in.list = list;
  in.from = 0.001;
  scene.inlets = {in};
  Simulation run(scene, 1);
  while (run.time() < 0.002) run.step();
  CHECK(run.n_born() == 3);
  while (run.time() < 0.04) run.step();
  CHECK(run.n_born() == 4);
  const State state = state_of(run);
  CHECK(state.position[3].z == 0.051);  // the last one born rests where it was put
  CHECK(state.velocity[2].z == -0.02);
}
