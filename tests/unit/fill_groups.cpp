#include <catch2/catch.hpp>

#include "fill_scenes.hpp"
#include "kernels/search/surface.hpp"

using namespace moraine;
using namespace moraine::fill_tests;

TEST_CASE("a count of random grains is kept exactly, and known beforehand", "[fill]") {
  Scene scene = box_scene({0.1, 0.1, 0.1});
  scene.particles.push_back(group_of(0.004));
  scene.particles[0].fill = random_count(BoxRegion{{{0.02, 0.02, 0.02}, {0.08, 0.08, 0.08}}}, 500);
  const std::vector<GrainSeed> grains = make_grains(scene, 1);
  CHECK(grains.size() == 500);
  CHECK(count_grains(scene) == 500);
  for (const GrainSeed& grain : grains)
    for (int k = 0; k < 3; ++k) {
      CHECK(grain.position[k] >= 0.022);
      CHECK(grain.position[k] <= 0.078);
    }
}

TEST_CASE("grains stay inside cylinders and spheres", "[fill]") {
  Scene scene = box_scene({0.1, 0.1, 0.2});
  for (const double fraction : {0.1, 0.5}) {
    scene.particles = {group_of(0.004)};
    scene.particles[0].fill = random_fraction(CylinderRegion{{0.05, 0.05, 0.02}, 2, 0.03, 0.1}, fraction);
    for (const GrainSeed& grain : make_grains(scene, 1)) {
      CHECK(std::hypot(grain.position.x - 0.05, grain.position.y - 0.05) <= 0.028);
      CHECK(grain.position.z >= 0.022);
      CHECK(grain.position.z <= 0.118);
    }
    scene.particles[0].fill = random_fraction(SphereRegion{{0.05, 0.05, 0.1}, 0.04}, fraction);
    const std::vector<GrainSeed> grains = make_grains(scene, 1);
    CHECK(overlapping_pairs(scene, grains) == 0);
    for (const GrainSeed& grain : grains) CHECK(length(grain.position - Vec3{0.05, 0.05, 0.1}) <= 0.038);
  }
}

TEST_CASE("random grains keep clear of the walls that cut their region", "[fill]") {
  Scene scene = box_scene({0.1, 0.1, 0.1});
  scene.walls.push_back({"slope", "glass", PlaneShape{{0.05, 0, 0.03}, normalized({-1, 0, 2})}});
  scene.walls.push_back({"pipe", "glass", CylinderShape{{0.05, 0.05, 0}, {0, 0, 1}, 0.02, 0.1}});
  scene.walls.push_back({"later", "glass", PlaneShape{{0, 0, 0.09}, {0, 0, 1}}, false, false, 1.0});
  for (const double fraction : {0.1, 0.3}) {
    scene.particles = {group_of(0.004)};
    scene.particles[0].fill = random_fraction(BoxRegion{scene.domain.box()}, fraction);
    const std::vector<GrainSeed> grains = make_grains(scene, 1);
    CHECK(overlapping_pairs(scene, grains) == 0);
    for (const GrainSeed& grain : grains) {
      CHECK(dot(grain.position - Vec3{0.05, 0, 0.03}, normalized({-1, 0, 2})) >= 0.002);
      CHECK(std::abs(std::hypot(grain.position.x - 0.05, grain.position.y - 0.05) - 0.02) >= 0.002);
    }
  }
}

TEST_CASE("random grains keep clear of mesh walls, on either side", "[fill]") {
  // A funnel of 4 trapezoids: from 0.1 m wide at z = 0.08 to 0.02 m at z = 0.03.
  TriangleMesh funnel;
  for (const double z : {0.08, 0.03})
    for (const auto& [x, y] : {std::pair{-1.0, -1.0}, {1.0, -1.0}, {1.0, 1.0}, {-1.0, 1.0}}) {
      const double half = z == 0.08 ? 0.05 : 0.01;
      funnel.vertices.push_back({0.05 + half * x, 0.05 + half * y, z});
    }
  for (std::int32_t i = 0; i < 4; ++i) {
    const std::int32_t j = (i + 1) % 4;
    funnel.triangles.push_back({i, j, i + 4});
    funnel.triangles.push_back({j, j + 4, i + 4});
  }
  Scene scene = box_scene({0.1, 0.1, 0.1});
  scene.walls.push_back({"hopper", "glass", MeshShape{"hopper.stl", funnel}});
  for (const double fraction : {0.1, 0.4}) {
    scene.particles = {group_of(0.004)};
    scene.particles[0].fill = random_fraction(BoxRegion{scene.domain.box()}, fraction);
    const std::vector<GrainSeed> grains = make_grains(scene, 1);
    CHECK(overlapping_pairs(scene, grains) == 0);
    int n_near = 0;
    for (const GrainSeed& grain : grains) {
      double nearest = 1.0;
      for (const auto& t : funnel.triangles) {
        const auto corner = [&](std::size_t k) { return funnel.vertices[static_cast<std::size_t>(t[k])]; };
        nearest = std::min(nearest, length(grain.position -
                                           closest_point_on_triangle(grain.position, corner(0), corner(1), corner(2))));
      }
      CHECK(nearest >= 0.002);
      n_near += nearest < 0.004;
    }
    CHECK(n_near > 50);
  }
}

TEST_CASE("later groups make way for earlier ones, whatever kind each is", "[fill]") {
  Scene scene = box_scene({0.06, 0.06, 0.06}, {true, true, false});
  ParticleGroup boulder = group_of(0.02);
  ListedGrains list;
  list.grains.resize(2);
  list.grains[0].position = {0.03, 0.03, 0.03};
  list.grains[1].position = {0.001, 0.059, 0.012};
  boulder.fill = list;
  ParticleGroup lattice = group_of(0.005);
  lattice.fill =
      LatticeFill{LatticeFill::Kind::cubic, BoxRegion{{{0, 0, 0}, {0.06, 0.06, 0.02}}}, 0.0, 0.0, std::nullopt};
  ParticleGroup sand = group_of(0.003);
  sand.fill = random_fraction(BoxRegion{scene.domain.box()}, 0.28);
  ParticleGroup dust = group_of(0.0015);
  dust.fill = random_fraction(BoxRegion{scene.domain.box()}, 0.02);
  scene.particles = {boulder, lattice, sand, dust};
  FillReport report;
  const std::vector<GrainSeed> grains = make_grains(scene, 1, &report);
  CHECK(overlapping_pairs(scene, grains) == 0);
  CHECK_THAT(report.text, Catch::Contains("sites left out where other grains are"));
  CHECK(solid_volume(grains) / scene.domain.box().volume() > 0.28 + 0.02);
}

TEST_CASE("a cubic lattice fills a box to the last site", "[fill]") {
  Scene scene = box_scene({0.05, 0.04, 0.03});
  scene.particles.push_back(group_of(0.01));
  scene.particles[0].fill =
      LatticeFill{LatticeFill::Kind::cubic, BoxRegion{scene.domain.box()}, 0.01, 0.0, std::nullopt};
  CHECK(make_grains(scene, 1).size() == 60);
  CHECK(count_grains(scene) == 60);
}

TEST_CASE("a hexagonal lattice in a periodic box has twelve neighbours around each grain", "[fill]") {
  const double a = 0.01;
  Scene scene = box_scene({6 * a, 6 * a * std::sqrt(3.0) / 2, 4 * a * std::sqrt(2.0 / 3.0)}, {true, true, true});
  scene.particles.push_back(group_of(a * (1 - 1e-9)));
  scene.particles[0].fill =
      LatticeFill{LatticeFill::Kind::hexagonal, BoxRegion{scene.domain.box()}, a, 0.0, std::nullopt};
  const std::vector<GrainSeed> grains = make_grains(scene, 1);
  REQUIRE(grains.size() == 6 * 6 * 4);
  CHECK(overlapping_pairs(scene, grains) == 0);
  for (const GrainSeed& grain : grains) {
    int n_near = 0;
    for (const GrainSeed& other : grains)
      n_near += &other != &grain && length(nearest(scene.domain, other.position, grain.position)) < 1.01 * a;
    CHECK(n_near == 12);
  }
}

TEST_CASE("jitter moves lattice grains without letting them overlap", "[fill]") {
  for (const auto kind : {LatticeFill::Kind::cubic, LatticeFill::Kind::hexagonal}) {
    Scene scene = box_scene({0.1, 0.1, 0.1}, {false, true, false});
    scene.particles.push_back(group_of(0.006));
    LatticeFill fill{kind, BoxRegion{scene.domain.box()}, 0.01, 0.0, std::nullopt};
    scene.particles[0].fill = fill;
    const std::vector<GrainSeed> regular = make_grains(scene, 1);
    fill.jitter = 1.0;
    scene.particles[0].fill = fill;
    const std::vector<GrainSeed> moved = make_grains(scene, 1);
    REQUIRE(moved.size() == regular.size());
    CHECK(overlapping_pairs(scene, moved) == 0);
    int n_moved = 0;
    for (std::size_t i = 0; i < moved.size(); ++i) {
      const double distance = length(nearest(scene.domain, moved[i].position, regular[i].position));
      CHECK(distance <= 0.002 * (1 + 1e-12));
      n_moved += distance > 0.0;
    }
    CHECK(n_moved > static_cast<int>(regular.size()) / 2);
  }
}

TEST_CASE("the momentum of a group is exactly its mass times the velocity asked for", "[fill]") {
  Scene scene = box_scene({0.2, 0.2, 0.2});
  ParticleGroup group = group_of(0.0);
  group.diameter.kind = SizeDistribution::Kind::uniform;
  group.diameter.low = 0.002;
  group.diameter.high = 0.006;
  group.velocity = {1.0, -2.0, 0.5};
  group.velocity_deviation = 0.7;
  group.fill = random_count(BoxRegion{scene.domain.box()}, 20000);
  scene.particles.push_back(group);
  const std::vector<GrainSeed> grains = make_grains(scene, 1);
  ExactSum3 momentum;
  ExactSum mass;
  double squares = 0.0;
  for (const GrainSeed& grain : grains) {
    const double m = std::pow(grain.radius, 3);
    momentum.add(m * grain.velocity);
    mass.add(m);
    squares += squared_length(grain.velocity - group.velocity);
  }
  const Vec3 mean = momentum.value() / mass.value();
  CHECK(length(mean - group.velocity) < 1e-14);
  // Standard error of a variance: sqrt(2 / n) of it; n is 3 times the grains.
  CHECK(squares / (3.0 * 20000) == Approx(0.49).epsilon(5 * std::sqrt(2.0 / 60000)));
}

TEST_CASE("listed grains keep what the list gives and take the rest from their group", "[fill]") {
  Scene scene = box_scene({1, 1, 1}, {true, false, false});
  scene.materials.push_back({"steel", 7800.0, 0.0, 0.3});
  ParticleGroup group = group_of(0.1);
  group.material = "steel";
  group.velocity = {0, 0, 3};
  group.angular_velocity = {1, 2, 3};
  ListedGrains list;
  list.source = "start.csv";
  list.grains.resize(2);
  list.grains[0].position = {0.5, 0.5, 0.5};
  list.grains[1].position = {1.25, 0.5, 0.5};
  list.grains[1].velocity = {9, 9, 9};
  list.grains[1].radius = 0.03;
  group.fill = list;
  scene.particles = {group};
  std::vector<GrainSeed> grains = make_grains(scene, 1);
  CHECK(grains[1].radius == 0.05);
  CHECK(grains[1].velocity == Vec3{0, 0, 3});
  CHECK(grains[1].angular_velocity == Vec3{1, 2, 3});
  CHECK(grains[1].material == 1);
  CHECK(grains[1].position == Vec3{0.25, 0.5, 0.5});
  list.grains[0].radius = 0.02;
  list.has_radius = list.has_velocity = true;
  scene.particles[0].fill = list;
  grains = make_grains(scene, 1);
  CHECK(grains[1].radius == 0.03);
  CHECK(grains[1].velocity == Vec3{9, 9, 9});
}

TEST_CASE("a listed grain outside the domain is named", "[fill]") {
  Scene scene = box_scene({1, 1, 1});
  scene.particles.push_back(group_of(0.1));
  ListedGrains list;
  list.source = "start.csv";
  list.grains.resize(2);
  list.grains[0].position = {0.5, 0.5, 0.5};
  list.grains[1].position = {0.5, -0.25, 0.5};
  scene.particles[0].fill = list;
  CHECK_THROWS_WITH(make_grains(scene, 1),
                    "particles[0].fill: grain 2 of start.csv at (0.5, -0.25, 0.5) m lies outside the domain");
}

TEST_CASE("a fraction that no packing reaches is an error that names group and fractions", "[fill]") {
  Scene scene = box_scene({0.04, 0.04, 0.04});
  scene.particles.push_back(group_of(0.004));
  scene.particles[0].fill = random_fraction(BoxRegion{scene.domain.box()}, 0.7);
  try {
    make_grains(scene, 1);
    FAIL("nothing was thrown");
  } catch (const SceneError& error) {
    REQUIRE(error.problems.size() == 1);
    CHECK(error.problems[0].key == "particles[0].fill");
    CHECK_THAT(error.problems[0].message, Catch::Contains("0.70") && Catch::Contains("was reached"));
  }
}

TEST_CASE("a lattice with fewer sites than the count asked for is an error", "[fill]") {
  Scene scene = box_scene({0.05, 0.04, 0.03});
  scene.particles.push_back(group_of(0.01));
  scene.particles[0].fill = LatticeFill{LatticeFill::Kind::cubic, BoxRegion{scene.domain.box()}, 0.01, 0.0, 61};
  CHECK_THROWS_WITH(make_grains(scene, 1), Catch::Contains("61 grains asked, but the lattice has only 60 free sites"));
}

TEST_CASE("the grains of a two-dimensional scene lie in one layer", "[fill]") {
  Scene scene = box_scene({0.1, 0.1, 0.004}, {true, false, false});
  scene.domain.dimensions = 2;
  scene.particles.push_back(group_of(0.004));
  scene.particles[0].velocity_deviation = 0.1;
  // Of the volume 0.1 to 0.5: of the area 0.15 to 0.75; discs jam at 0.84.
  for (const double fraction : {0.1, 0.4, 0.5}) {
    scene.particles[0].fill = random_fraction(BoxRegion{scene.domain.box()}, fraction);
    const std::vector<GrainSeed> grains = make_grains(scene, 1);
    CHECK(solid_volume(grains) / scene.domain.box().volume() == Approx(fraction).epsilon(0.005));
    CHECK(overlapping_pairs(scene, grains) == 0);
    for (const GrainSeed& grain : grains) {
      CHECK(grain.position.z == 0.002);
      CHECK(grain.velocity.z == 0.0);
    }
  }
  for (const auto kind : {LatticeFill::Kind::cubic, LatticeFill::Kind::hexagonal}) {
    scene.particles[0].fill = LatticeFill{kind, BoxRegion{scene.domain.box()}, 0.0, 0.5, std::nullopt};
    const std::vector<GrainSeed> grains = make_grains(scene, 1);
    CHECK(grains.size() >= 24 * 24);
    CHECK(overlapping_pairs(scene, grains) == 0);
  }
}
