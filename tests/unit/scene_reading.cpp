#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "tests/unit/scene_text.hpp"

using namespace moraine;
using scene_text::read;

namespace {
Scene with(const std::string& more) { return read(scene_text::all + more); }
/// The small scene with its grains written otherwise.
ParticleGroup group(const std::string& keys) {
  return read(scene_text::domain + scene_text::time + scene_text::material + scene_text::pair + "[[particles]]\n" +
              keys)
      .particles[0];
}
}  // namespace

TEST_CASE("a scene that gives only what it must has the defaults of the structs for the rest") {
  const Scene scene = read(scene_text::all);
  const TimeControl time;
  CHECK(scene.title.empty());
  CHECK(scene.domain.box() == Box{{0, 0, 0}, {1, 1, 1}});
  CHECK(scene.domain.dimensions == 3);
  CHECK(scene.domain.periodic == std::array<bool, 3>{false, false, false});
  CHECK(scene.time.end == 2.0);
  CHECK_FALSE(scene.time.step.has_value());
  CHECK(scene.time.steps_per_contact == time.steps_per_contact);
  CHECK(scene.time.gravity == Vec3{});
  CHECK(scene.contact.normal == NormalLaw::linear);
  CHECK(scene.contact.tangential == TangentialLaw::spring);
  CHECK(scene.contact.rotation);
  CHECK(scene.run.layout == "auto");
  CHECK(scene.output.checkpoints_kept == Output{}.checkpoints_kept);
  CHECK_FALSE(scene.output.energy);
  CHECK_FALSE(scene.output.distributed);
  CHECK(scene.walls.empty());
}

TEST_CASE("domain, time and run are read key by key") {
  const Scene scene = read(R"(
title = "a box"
[domain]
low = [-1, 0.5, 0]
high = [1, 2, 3e0]
periodic = [true, false, true]
[time]
end = 3
step = 1e-5
steps_per_contact = 40
max_speed = 2.5
gravity = [0, 0, -9.81]
damping = 0.25
[run]
layout = "2x3"
balance = "cuts"
precision = "double"
skin = 0.001
max_overlap = 0.3
)" + scene_text::material + scene_text::pair +
                           scene_text::particles);
  CHECK(scene.title == "a box");
  CHECK(scene.domain.low == Vec3{-1, 0.5, 0});
  CHECK(scene.domain.high == Vec3{1, 2, 3});
  CHECK(scene.domain.periodic == std::array<bool, 3>{true, false, true});
  CHECK(scene.time.end == 3.0);
  CHECK(scene.time.step == 1e-5);
  CHECK(scene.time.steps_per_contact == 40.0);
  CHECK(scene.time.max_speed == 2.5);
  CHECK(scene.time.gravity == Vec3{0, 0, -9.81});
  CHECK(scene.time.damping == 0.25);
  CHECK(scene.run.layout == "2x3");
  CHECK(scene.run.skin == 0.001);
  CHECK(scene.run.balance == Balance::cuts);
  CHECK(scene.run.max_overlap == 0.3);
}

TEST_CASE("a step of \"auto\" leaves the choice to the engine") {
  CHECK_FALSE(read(scene_text::all, {"time.step=auto"}).time.step.has_value());
}

TEST_CASE("materials, laws and pairs are read key by key") {
  const Scene scene = read(scene_text::domain + scene_text::time + R"(
[[material]]
name = "glass"
density = 2500
young = 48e9
poisson = 0.2
[[material]]
name = "steel"
young = 2.1e11
[contact]
normal = "hertz"
tangential = "power"
rotation = false
[[contact.pair]]
between = ["glass", "glass"]
tangential_stiffness = 700
restitution = 0.9
friction = 0.3
tangential_damping = 0.25
tangential_displacement = 1e-6
[[contact.pair]]
between = ["steel", "glass"]
restitution = 0.8
[[particles]]
material = "glass"
diameter = 0.01
fill = { count = 3 }
[[wall]]
name = "floor"
material = "steel"
plane = { point = [0, 0, 0] }
)");
  REQUIRE(scene.materials.size() == 2);
  CHECK(scene.materials[0].young == 48e9);
  CHECK(scene.materials[0].poisson == 0.2);
  CHECK(scene.materials[1].density == 0.0);
  CHECK(scene.contact.normal == NormalLaw::hertz);
  CHECK(scene.contact.tangential == TangentialLaw::power);
  CHECK_FALSE(scene.contact.rotation);
  REQUIRE(scene.contact.pairs.size() == 2);
  const PairLaw* grains = scene.pair_law("glass", "glass");
  REQUIRE(grains);
  CHECK(grains->tangential_stiffness == 700.0);
  CHECK(grains->restitution == 0.9);
  CHECK(grains->friction == 0.3);
  CHECK(grains->tangential_damping == 0.25);
  CHECK(grains->tangential_displacement == 1e-6);
  CHECK(scene.pair_law("glass", "steel") == scene.pair_law("steel", "glass"));
  CHECK(scene.pair_law("glass", "steel")->restitution == 0.8);
  CHECK_FALSE(scene.pair_law("steel", "steel"));
}

TEST_CASE("a pair without names stands for every pair that can meet and that no other names") {
  const Scene scene = read(scene_text::domain + scene_text::time + R"(
[[material]]
name = "glass"
density = 2500
[[material]]
name = "sand"
density = 2650
[[material]]
name = "steel"
[[contact.pair]]
normal_stiffness = 1000
[[contact.pair]]
between = ["sand", "glass"]
normal_stiffness = 2000
[[particles]]
material = "glass"
diameter = 0.01
fill = { count = 3 }
[[particles]]
material = "sand"
diameter = 0.01
fill = { count = 3 }
[[wall]]
name = "box"
material = "steel"
box = {}
)");
  CHECK(scene.pair_law("glass", "sand")->normal_stiffness == 2000.0);
  CHECK(scene.pair_law("glass", "glass")->normal_stiffness == 1000.0);
  CHECK(scene.pair_law("sand", "sand")->normal_stiffness == 1000.0);
  CHECK(scene.pair_law("glass", "steel")->normal_stiffness == 1000.0);
  CHECK(scene.pair_law("sand", "steel")->normal_stiffness == 1000.0);
  CHECK_FALSE(scene.pair_law("steel", "steel"));
}

TEST_CASE("diameters are one, a range, or a distribution") {
  using Kind = SizeDistribution::Kind;
  CHECK(group("diameter = 0.004\nfill = { count = 1 }").diameter.value == 0.004);
  CHECK(group("diameter = 0.004\nfill = { count = 1 }").diameter.kind == Kind::single);

  const SizeDistribution range = group("diameter = [0.01, 0.02]\nfill = { count = 1 }").diameter;
  CHECK(range.kind == Kind::uniform);
  CHECK(range.low == 0.01);
  CHECK(range.high == 0.02);

  const SizeDistribution normal =
      group(
          "diameter = { distribution = \"normal\", mean = 0.01, deviation = 0.001, low = 0.008, high = 0.012 }\n"
          "fill = { count = 1 }")
          .diameter;
  CHECK(normal.kind == Kind::normal);
  CHECK(normal.mean == 0.01);
  CHECK(normal.deviation == 0.001);
  CHECK(normal.low == 0.008);
  CHECK(normal.high == 0.012);

  const SizeDistribution list =
      group("diameter = { distribution = \"list\", values = [0.01, 0.02], weights = [3, 1] }\nfill = { count = 1 }")
          .diameter;
  CHECK(list.kind == Kind::list);
  CHECK(list.values == std::vector<double>{0.01, 0.02});
  CHECK(list.weights == std::vector<double>{3, 1});
}

TEST_CASE("bounds of a normal and a lognormal distribution are three deviations away where none are given") {
  const auto sizes = [](const std::string& kind, double deviation) {
    return group("diameter = { distribution = \"" + kind + "\", mean = 0.01, deviation = " + std::to_string(deviation) +
                 " }\nfill = { count = 1 }")
        .diameter;
  };
  CHECK(sizes("normal", 0.001).low == Approx(0.007));
  CHECK(sizes("normal", 0.001).high == Approx(0.013));
  CHECK(sizes("normal", 0.005).low == Approx(0.001));  // a tenth of the mean, not a negative diameter
  const double sigma = std::sqrt(std::log1p(0.01)), median = 0.01 / std::sqrt(1.01);
  CHECK(sizes("lognormal", 0.001).low == Approx(median * std::exp(-3 * sigma)));
  CHECK(sizes("lognormal", 0.001).high == Approx(median * std::exp(3 * sigma)));
}

TEST_CASE("every other key of a group is read, and material and seed have defaults") {
  const ParticleGroup plain = group("diameter = 0.01\nfill = { count = 1 }");
  CHECK(plain.material == "glass");
  CHECK(plain.seed == 1);
  const ParticleGroup full = group(
      "material = \"glass\"\ndiameter = 0.01\nvelocity = [1, 2, 3]\nvelocity_deviation = 0.1\n"
      "angular_velocity = [4, 5, 6]\nseed = 17\nfill = { count = 1 }");
  CHECK(full.velocity == Vec3{1, 2, 3});
  CHECK(full.velocity_deviation == 0.1);
  CHECK(full.angular_velocity == Vec3{4, 5, 6});
  CHECK(full.seed == 17);
}

TEST_CASE("a random fill without a region fills the domain") {
  const auto fill = std::get<RandomFill>(group("diameter = 0.01\nfill = { solid_fraction = 0.4 }").fill);
  CHECK(std::get<BoxRegion>(fill.region).box == Box{{0, 0, 0}, {1, 1, 1}});
  CHECK(fill.solid_fraction == 0.4);
  CHECK_FALSE(fill.count.has_value());
}

TEST_CASE("a box that lacks a corner takes the domain's") {
  const auto fill = std::get<RandomFill>(
      group("diameter = 0.01\nfill = { count = 1e3, region = { box = { low = [0, 0, 0.5] } } }").fill);
  CHECK(std::get<BoxRegion>(fill.region).box == Box{{0, 0, 0.5}, {1, 1, 1}});
  CHECK(fill.count == 1000);
}

TEST_CASE("regions are boxes, cylinders and spheres") {
  const auto cylinder = std::get<CylinderRegion>(
      std::get<RandomFill>(
          group("diameter = 0.01\nfill = { count = 1, region = { cylinder = { base = [0.1, 0.5, 0.5], axis = \"x\", "
                "radius = 0.3, length = 0.7 } } }")
              .fill)
          .region);
  CHECK(cylinder.base == Vec3{0.1, 0.5, 0.5});
  CHECK(cylinder.axis == 0);
  CHECK(cylinder.radius == 0.3);
  CHECK(cylinder.length == 0.7);
  const auto sphere = std::get<SphereRegion>(
      std::get<RandomFill>(
          group(
              "diameter = 0.01\nfill = { count = 1, region = { sphere = { centre = [0.5, 0.5, 0.5], radius = 0.2 } } }")
              .fill)
          .region);
  CHECK(sphere.centre == Vec3{0.5, 0.5, 0.5});
  CHECK(sphere.radius == 0.2);
}

TEST_CASE("a lattice fill has a kind, a spacing, a jitter and a limit") {
  const auto plain = std::get<LatticeFill>(group("diameter = 0.01\nfill = { lattice = \"cubic\" }").fill);
  CHECK(plain.kind == LatticeFill::Kind::cubic);
  CHECK(plain.spacing == 0.0);
  const auto full = std::get<LatticeFill>(
      group("diameter = 0.01\nfill = { lattice = \"hexagonal\", spacing = 0.02, jitter = 0.5, count = 7 }").fill);
  CHECK(full.kind == LatticeFill::Kind::hexagonal);
  CHECK(full.spacing == 0.02);
  CHECK(full.jitter == 0.5);
  CHECK(full.count == 7);
}

TEST_CASE("grains listed in the scene have their places, and spin and material of their group") {
  const auto fill = std::get<ListedGrains>(
      group("diameter = 0.01\nangular_velocity = [0, 0, 3]\nfill = { positions = [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]] }")
          .fill);
  REQUIRE(fill.grains.size() == 2);
  CHECK(fill.grains[1].position == Vec3{0.4, 0.5, 0.6});
  CHECK(fill.grains[1].angular_velocity == Vec3{0, 0, 3});
  CHECK(fill.grains[1].material == 0);
  CHECK_FALSE(fill.has_radius);
  CHECK_FALSE(fill.has_velocity);
}

TEST_CASE("grains of a file may be of several materials, unless their group names one") {
  const scene_text::Directory directory;
  directory.write("grains.csv", "x,y,z,r,material\n0.2,0.5,0.5,0.1,sand\n0.8,0.5,0.5,0.1,glass\n");
  const std::string text = scene_text::domain + scene_text::time + scene_text::material +
                           "[[material]]\nname = \"sand\"\ndensity = 2600\n" + scene_text::pair +
                           "[[particles]]\nfill = { file = \"grains.csv\" }\n";
  const Scene scene = read_scene_text(text, "scene.toml", {}, directory.path());
  CHECK(scene.particles[0].material.empty());
  CHECK(std::get<ListedGrains>(scene.particles[0].fill).grains[0].material == 1);
  CHECK(scene.contact.pairs.size() == 3);
  const Scene one = read_scene_text(text, "scene.toml", {"particles[0].material=glass"}, directory.path());
  CHECK(one.particles[0].material == "glass");
  CHECK(std::get<ListedGrains>(one.particles[0].fill).grains[0].material == 0);
}

TEST_CASE("in two dimensions a place may be given by x and y and lies halfway through the domain") {
  const Scene scene = read("[domain]\nlow = [0, 0, 0]\nhigh = [1, 1, 0.02]\ndimensions = 2\n" + scene_text::time +
                           scene_text::material + scene_text::pair +
                           "[[particles]]\ndiameter = 0.01\nfill = { positions = [[0.1, 0.2]] }\n");
  CHECK(std::get<ListedGrains>(scene.particles[0].fill).grains[0].position == Vec3{0.1, 0.2, 0.01});
}

TEST_CASE("every shape of wall is read, with the domain for a box without corners") {
  const Scene scene = with(R"(
[[wall]]
name = "floor"
plane = { point = [0, 0, 0.1], normal = [0, 1, 1] }
frictionless = true
from = 0.5
until = 1.5
[[wall]]
name = "mirror"
plane = { point = [0, 0, 0], normal = "x" }
symmetry = true
[[wall]]
name = "box"
box = {}
[[wall]]
name = "pipe"
cylinder = { base = [0.5, 0.5, 0], axis = "-z", radius = 0.4, length = inf }
[[wall]]
name = "funnel"
cone = { base = [0.5, 0.5, 0], radius_base = 0.1, radius_top = 0.4, length = 0.5 }
[[wall]]
name = "lid"
disc = { centre = [0.5, 0.5, 0.5], normal = [0, 0, 1], radius = 0.4, hole_radius = 0.1 }
)");
  REQUIRE(scene.walls.size() == 6);
  CHECK(std::get<PlaneShape>(scene.walls[0].shape).normal == Vec3{0, 1, 1});
  CHECK(scene.walls[0].frictionless);
  CHECK(scene.walls[0].from == 0.5);
  CHECK(scene.walls[0].until == 1.5);
  CHECK(scene.walls[0].material == "glass");
  CHECK(scene.walls[1].symmetry);
  CHECK(std::get<PlaneShape>(scene.walls[1].shape).normal == Vec3{1, 0, 0});
  CHECK(scene.walls[1].until == infinity);
  CHECK(std::get<BoxShape>(scene.walls[2].shape).box == Box{{0, 0, 0}, {1, 1, 1}});
  CHECK(std::get<CylinderShape>(scene.walls[3].shape).axis == Vec3{0, 0, -1});
  CHECK(std::get<CylinderShape>(scene.walls[3].shape).length == infinity);
  CHECK(std::get<ConeShape>(scene.walls[4].shape).radius_top == 0.4);
  CHECK(std::get<ConeShape>(scene.walls[4].shape).radius_base == 0.1);
  CHECK(std::get<DiscShape>(scene.walls[5].shape).hole_radius == 0.1);
}

TEST_CASE("outlets are faces of the domain or boxes") {
  const Scene scene = with(
      "[[outlet]]\nname = \"below\"\nface = \"z-low\"\n[[outlet]]\nname = \"hole\"\nbox = { high = [1, 1, 0.1] }\n");
  REQUIRE(scene.outlets.size() == 2);
  CHECK(std::get<int>(scene.outlets[0].where) == 4);
  CHECK(std::get<Box>(scene.outlets[1].where) == Box{{0, 0, 0}, {1, 1, 0.1}});
}

TEST_CASE("output is read key by key") {
  const Scene scene = with(
      "[output]\ndirectory = \"out\"\nsnapshots = 0.1\ncheckpoints = 0.5\ncheckpoints_kept = 3\n"
      "fields = [\"position\", \"velocity\"]\nenergy = true\ndistributed = true\n");
  CHECK(scene.output.directory == "out");
  CHECK(scene.output.snapshot_interval == 0.1);
  CHECK(scene.output.checkpoint_interval == 0.5);
  CHECK(scene.output.checkpoints_kept == 3);
  CHECK(scene.output.fields == std::vector<std::string>{"position", "velocity"});
  CHECK(scene.output.energy);
  CHECK(scene.output.distributed);
}

TEST_CASE("probes are read key by key, are named by their kind where they have no name, and look at the domain") {
  const Scene scene = with(R"(
[[wall]]
name = "floor"
plane = { point = [0, 0, 0] }
[[probe]]
kind = "mass"
interval = 0.01
[[probe]]
kind = "wall_pressure"
name = "pressure"
wall = "floor"
axis = "x"
bins = 20
interval = 0.1
[[probe]]
kind = "profile"
region = { low = [0.4, 0.4, 0], high = [0.6, 0.6, 1] }
interval = 0.1
)");
  REQUIRE(scene.output.probes.size() == 3);
  CHECK(scene.output.probes[0].kind == Probe::Kind::mass);
  CHECK(scene.output.probes[0].name == "mass");
  CHECK(scene.output.probes[0].interval == 0.01);
  CHECK(scene.output.probes[0].region == Box{{0, 0, 0}, {1, 1, 1}});
  CHECK(scene.output.probes[1].wall == "floor");
  CHECK(scene.output.probes[1].axis == 0);
  CHECK(scene.output.probes[1].bins == 20);
  CHECK(scene.output.probes[2].axis == 2);
  CHECK(scene.output.probes[2].region == Box{{0.4, 0.4, 0}, {0.6, 0.6, 1}});
}

TEST_CASE("an energy probe switches the ledger on, unless the scene says no") {
  const std::string probe = "[[probe]]\nkind = \"energy\"\ninterval = 0.1\n";
  CHECK(with(probe).output.energy);
  CHECK(scene_text::complaint(scene_text::all + "[output]\nenergy = false\n" + probe).find("output.energy = true") !=
        std::string::npos);
}

TEST_CASE("warnings are handed out, located, and do not stop the scene") {
  std::vector<SceneMessage> warnings;
  const Scene scene =
      read_scene_text(scene_text::all + "[[wall]]\nname = \"far\"\nfrom = 0\nplane = { point = [0, 0, 0] }\n",
                      "scene.toml", {"time.steps_per_contact=10"}, {}, &warnings);
  REQUIRE(warnings.size() == 1);
  CHECK(warnings[0].is_warning);
  CHECK(warnings[0].text() ==
        "--set 1: warning: key \"time.steps_per_contact\": is 10; with fewer than 15 steps a contact gains or "
        "loses energy, 50 are usual");
  CHECK(scene.time.steps_per_contact == 10.0);
}

TEST_CASE("the reference lists every key once, with its unit and default") {
  const std::string reference = scene_key_reference();
  CHECK(reference.find("## particles.fill.region.cylinder") != std::string::npos);
  CHECK(reference.find("| `steps_per_contact` | number | - | 50 |") != std::string::npos);
  CHECK(reference.find("| `end` | number | s | required |") != std::string::npos);
  std::vector<std::string> headings;
  for (std::size_t at = reference.find("\n## "); at != std::string::npos; at = reference.find("\n## ", at + 1))
    headings.push_back(reference.substr(at + 4, reference.find('\n', at + 1) - at - 4));
  CHECK(headings.size() > 20);
  std::sort(headings.begin(), headings.end());
  CHECK(std::adjacent_find(headings.begin(), headings.end()) == headings.end());
}
