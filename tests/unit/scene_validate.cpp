#include <catch2/catch.hpp>

#include <algorithm>

#include "engine/scene/checks.hpp"
#include "engine/scene/scene.hpp"
#include "kernels/base/random.hpp"
#include "kernels/contact/sweep.hpp"

using namespace moraine;

namespace {

/// A sound scene, built as Python or a test would.
Scene sound() {
  Scene scene;
  scene.domain = {{0, 0, 0}, {1, 1, 1}};
  scene.time.end = 1.0;
  scene.materials = {{"glass", 2500.0}, {"steel"}};
  PairLaw law;
  law.between = {"glass", "glass"};
  law.normal_stiffness = 1000.0;
  scene.contact.pairs = {law};
  ParticleGroup group;
  group.material = "glass";
  group.diameter.value = 0.1;
  group.fill = RandomFill{BoxRegion{scene.domain.box()}, {}, 5};
  scene.particles = {group};
  return scene;
}

ListedGrains listed(std::vector<Vec3> positions) {
  ListedGrains out;
  for (const Vec3 position : positions) out.grains.push_back({position, {}, {}, 0.0, 0});
  return out;
}

/// The message about a key; empty where there is none.
std::string about(const Scene& scene, const std::string& key) {
  for (const Problem& problem : validate(scene))
    if (problem.key == key) return problem.message;
  return "";
}

}  // namespace

TEST_CASE("a sound scene has no problems") { CHECK(validate(sound()).empty()); }

TEST_CASE("a scene from default structs names everything that it lacks") {
  std::vector<std::string> keys;
  for (const Problem& problem : validate(Scene{})) keys.push_back(problem.key);
  for (const char* key : {"domain.high[0]", "domain.high[1]", "domain.high[2]", "time.end", "material", "particles"})
    CHECK(std::count(keys.begin(), keys.end(), key) == 1);
}

TEST_CASE("numbers that are not finite are found wherever they are") {
  Scene scene = sound();
  scene.domain.low.y = std::nan("");
  scene.time.gravity.x = infinity;
  scene.particles[0].velocity.z = infinity;
  CHECK_FALSE(about(scene, "domain.low").empty());
  CHECK_FALSE(about(scene, "time.gravity").empty());
  CHECK_FALSE(about(scene, "particles[0].velocity").empty());
}

TEST_CASE("a periodic domain narrower than the largest grain is refused") {
  Scene scene = sound();
  scene.domain.periodic = {true, false, false};
  scene.domain.high.x = 0.1;
  scene.particles[0].fill = listed({{0.05, 0.5, 0.5}});
  CHECK(about(scene, "domain.periodic[0]").empty());
  scene.domain.high.x = 0.099;
  CHECK(about(scene, "domain.periodic[0]") ==
        "is true, but the domain is 0.099 m wide along x and the largest grain (particles[0]) has a diameter of 0.1 m: "
        "it would touch "
        "itself; make the domain at least that wide");
}

TEST_CASE("walls need a pair law with the grains, mirrors do not") {
  Scene scene = sound();
  scene.walls = {{"floor", "steel", PlaneShape{}}};
  CHECK_FALSE(about(scene, "contact.pair").empty());
  scene.walls[0].symmetry = true;
  CHECK(about(scene, "contact.pair").empty());
}

TEST_CASE("a wall's material needs no density, a grain's does") {
  Scene scene = sound();
  CHECK(about(scene, "material[1].density").empty());
  scene.materials[0].density = 0.0;
  CHECK(about(scene, "material[0].density") == "is 0; expected a number greater than 0 [kg/m3]");
}

TEST_CASE("exactly the combinations of laws that are compiled are accepted") {
  for (const NormalLaw normal : {NormalLaw::linear, NormalLaw::hertz})
    for (const TangentialLaw tangential : {TangentialLaw::none, TangentialLaw::viscous, TangentialLaw::spring,
                                           TangentialLaw::mindlin, TangentialLaw::power})
      for (const RollingLaw rolling : {RollingLaw::none, RollingLaw::constant, RollingLaw::spring})
        for (const CohesionLaw cohesion :
             {CohesionLaw::none, CohesionLaw::jkr, CohesionLaw::sjkr, CohesionLaw::linear, CohesionLaw::liquid_bridge})
          for (const bool rotation : {true, false}) {
            Scene scene = sound();
            scene.contact.normal = normal;
            scene.contact.tangential = tangential;
            scene.contact.rolling = rolling;
            scene.contact.cohesion = cohesion;
            scene.contact.rotation = rotation;
            CAPTURE(normal, tangential, rolling, cohesion, rotation);
            const bool is_accepted = about(scene, "contact.tangential").empty() &&
                                     about(scene, "contact.rolling").empty() &&
                                     about(scene, "contact.cohesion").empty();
            CHECK(is_accepted == is_listed({normal, tangential, rotation, false, false, rolling, cohesion}));
          }
}

TEST_CASE("a cylinder may be infinitely long, a negative length is refused") {
  Scene scene = sound();
  scene.contact.pairs.push_back(scene.contact.pairs[0]);
  scene.contact.pairs[1].between = {"steel", "glass"};
  scene.walls = {{"pipe", "steel", CylinderShape{{0.5, 0.5, 0}, {0, 0, 1}, 0.4, infinity}}};
  CHECK(validate(scene).empty());
  std::get<CylinderShape>(scene.walls[0].shape).length = -1.0;
  CHECK_FALSE(about(scene, "wall[0].cylinder.length").empty());
}

TEST_CASE("more grains than can fit into a region are refused with the number that can") {
  Scene scene = sound();
  scene.particles[0].fill = RandomFill{BoxRegion{scene.domain.box()}, {}, 2000};
  CHECK(about(scene, "particles[0].fill.count") ==
        "is 2000: the grains would fill 1.05 of the region, more than 0.74; at most 1413 can fit");
}

TEST_CASE("touching grains and grains that overlap by a fifth are accepted, beyond it they are not") {
  Scene scene = sound();
  scene.particles[0].fill = listed({{0.5, 0.5, 0.5}, {0.6, 0.5, 0.5}, {0.5, 0.5911, 0.5}});
  CHECK(validate(scene).empty());
  scene.particles[0].fill = listed({{0.5, 0.5, 0.5}, {0.6, 0.5, 0.5}, {0.5, 0.5889, 0.5}});
  CHECK(about(scene, "particles[0].fill.positions") ==
        "grain 0 of particles[0] and grain 2 of particles[0] overlap by 0.0111 m, 22 % of the smaller radius; at most "
        "20 % is allowed at "
        "the start (1 pair beyond it)");
}

TEST_CASE("overlap through a periodic border and between groups is seen") {
  Scene scene = sound();
  scene.particles.push_back(scene.particles[0]);
  scene.particles[0].fill = listed({{0.02, 0.5, 0.5}});
  scene.particles[1].fill = listed({{0.97, 0.5, 0.5}});
  CHECK(validate(scene).empty());
  scene.domain.periodic = {true, false, false};
  CHECK_FALSE(about(scene, "particles[1].fill.positions").empty());
}

TEST_CASE("a listed grain deep in a flat wall is named") {
  Scene scene = sound();
  scene.walls = {{"floor", "glass", PlaneShape{{0, 0, 0.1}, {0, 0, 2}}}};
  scene.particles[0].fill = listed({{0.5, 0.5, 0.5}, {0.5, 0.5, 0.13}});
  CHECK(about(scene, "particles[0].fill.positions") ==
        "grain 1 of particles[0] reaches 0.02 m, 40 % of its radius, into wall \"floor\"; at most 20 % is allowed at "
        "the start (1 grain "
        "beyond it)");
  scene.walls[0].from = 0.5;  // not there yet
  CHECK(validate(scene).empty());
}

TEST_CASE(
    "the search for overlaps finds what comparing all pairs finds, for every range of sizes and every periodicity") {
  bool any = false;
  for (const double ratio : {1.0, 3.0, 40.0})
    for (const bool is_periodic : {false, true})
      for (const double largest : {0.02, 0.1, 0.45}) {
        const Domain domain{{-0.3, 0.1, 0.2}, {0.7, 1.1, 2.2}, {is_periodic, is_periodic, false}};
        std::vector<checks::ListedSphere> spheres;
        for (std::uint64_t i = 0; i < 600; ++i) {
          const auto random = [&](std::uint64_t draw) { return random_uniform(7, i, RandomPurpose::position, draw); };
          const Vec3 size = domain.box().size();
          spheres.push_back({domain.low + Vec3{size.x * random(0), size.y * random(1), size.z * random(2)},
                             largest * std::pow(ratio, -random(3))});
        }
        std::int64_t expected = 0;
        double worst = 0.0;
        for (std::size_t i = 0; i < spheres.size(); ++i)
          for (std::size_t j = i + 1; j < spheres.size(); ++j) {
            Vec3 d = spheres[i].centre - spheres[j].centre;
            for (int axis = 0; axis < 2 && is_periodic; ++axis) d[axis] -= std::round(d[axis]);
            const double overlap = spheres[i].radius + spheres[j].radius - length(d);
            const double relative = overlap / std::min(spheres[i].radius, spheres[j].radius);
            if (relative > 0.2) ++expected, worst = std::max(worst, relative);
          }
        const checks::OverlapReport report = checks::find_overlaps(spheres, domain, 0.2);
        CAPTURE(ratio, is_periodic, largest);
        any = any || expected > 0;
        CHECK(report.count == expected);
        CHECK(report.relative == Approx(worst));
      }
  CHECK(any);
}

TEST_CASE("meshes far outside the domain bring a warning about millimetres") {
  Scene scene = sound();
  MeshShape mesh{"hopper.stl", {{{100, 0, 0}, {200, 0, 0}, {100, 100, 0}}, {{0, 1, 2}}}};
  scene.walls = {{"hopper", "glass", mesh}};
  const std::vector<Problem> problems = validate(scene);
  REQUIRE(problems.size() == 1);
  CHECK(problems[0].is_warning);
  CHECK(problems[0].message.find("millimetres") != std::string::npos);
}

TEST_CASE("only layouts of ranks and threads are accepted") {
  Scene scene = sound();
  for (const char* good : {"auto", "1x1", "2x4", "128x16"}) {
    scene.run.layout = good;
    CHECK(validate(scene).empty());
  }
  for (const char* bad : {"", "4", "x", "2x", "x4", "0x4", "2x0", "2x4x1", "-1x2", "2X4", "axb"}) {
    scene.run.layout = bad;
    CHECK(about(scene, "run.layout") ==
          std::string("is \"") + bad + "\"; expected \"auto\" or ranks x threads such as \"2x4\"");
  }
}
