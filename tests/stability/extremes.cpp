// Scenes at the edge: from stiff to soft, from elastic to dead, at rest for long, in corners and on edges.
#include <catch2/catch.hpp>

#include <cmath>
#include <numbers>

#include "engine/run/simulation.hpp"
#include "tests/stability/cases.hpp"
#include "tests/support/flow_scenes.hpp"

using namespace moraine;
using cases::advance;
using cases::largest_speed;
using cases::vector_of;

namespace {

constexpr double radius = 0.005;

struct Grain {
  Vec3 position, velocity, angular_velocity;
};

Scene scene_of(const std::vector<Grain>& grains) {
  Scene s;
  s.time.end = 100.0;
  s.materials = {{"glass", 2500.0, 5e6, 0.3}};
  PairLaw p;
  p.between = {"glass", "glass"};
  p.normal_stiffness = 1e4;
  p.restitution = 0.8;
  p.friction = 0.4;
  s.contact.pairs = {p};
  s.domain.low = {-1, -1, -1};
  s.domain.high = {1, 1, 1};
  ListedGrains list;
  for (const Grain& grain : grains)
    list.grains.push_back({grain.position, grain.velocity, grain.angular_velocity, 0.0, 0});
  list.has_velocity = true;
  ParticleGroup group;
  group.material = "glass";
  group.diameter.value = 2 * radius;
  group.fill = list;
  s.particles = {group};
  return s;
}

TriangleMesh corner_of_three(double size) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0},       {size, 0, 0},    {0, size, 0},   {0, 0, size},
                   {size, size, 0}, {size, 0, size}, {0, size, size}};
  mesh.triangles = {{0, 1, 4}, {0, 4, 2}, {0, 3, 5}, {0, 5, 1}, {0, 2, 6}, {0, 6, 3}};
  return mesh;
}

}  // namespace

TEST_CASE("an impact keeps its restitution from soft to stiff over six decades and from 0.01 to 1") {
  for (const double stiffness : {1e2, 1e4, 1e6, 1e8})
    for (const double restitution : {0.01, 0.1, 0.5, 0.9, 1.0}) {
      INFO("stiffness " << stiffness << ", restitution " << restitution);
      Scene s = scene_of({{{-radius * 1.001, 0, 0}, {0.05, 0, 0}, {}}, {{radius * 1.001, 0, 0}, {-0.05, 0, 0}, {}}});
      s.contact.pairs[0].normal_stiffness = stiffness;
      s.contact.pairs[0].restitution = restitution;
      Simulation simulation(s, 1);
      // to the end of the contact and beyond: overdamped ones creep apart
      const double v0 = 0.1;
      double last = 0.0;
      for (int i = 0; i < 2000; ++i) {
        advance(simulation, 50);
        const Image image = simulation.snapshot();
        const double v = (vector_of(image, Field::velocity, 1) - vector_of(image, Field::velocity, 0)).x;
        const double gap = (vector_of(image, Field::position, 1) - vector_of(image, Field::position, 0)).x - 2 * radius;
        last = v;
        if (gap > 0.0 && v > 0.0) break;
      }
      // A dashpot that pulls at the end of a contact takes a little more; it may never give.
      CHECK(last / v0 <= restitution + 0.02);
      if (restitution > 0.05) CHECK(last / v0 == Approx(restitution).epsilon(0.03).margin(0.01));
    }
}

TEST_CASE("a column of 100 grains comes to rest and stays there") {
  std::vector<Grain> grains;
  for (int i = 0; i < 100; ++i) grains.push_back({{0, 0, radius * (1.0 + 2.0 * i)}, {}, {}});
  Scene s = scene_of(grains);
  s.domain.high.z = 2.0;
  s.time.gravity = {0, 0, -9.81};
  s.time.damping = 20.0;  // long waves in a column are damped by little else
  s.contact.pairs[0].normal_stiffness = 1e5;
  s.contact.pairs[0].restitution = 0.3;
  scenes::add_wall(s, "floor", PlaneShape{{0, 0, 0}, {0, 0, 1}});
  Simulation simulation(s, 1);
  advance(simulation, static_cast<int>(2.0 / simulation.time_step()));
  CHECK(largest_speed(simulation) < 1e-6);
  // each spring carries what is above it
  const double weight = 2500.0 * 4.0 / 3.0 * std::numbers::pi * std::pow(radius, 3) * 9.81;
  const Image image = simulation.snapshot();
  for (std::size_t i = 0; i < 100; ++i) {
    const double below = i == 0 ? -radius : vector_of(image, Field::position, i - 1).z;
    const double overlap = below + 2 * radius - vector_of(image, Field::position, i).z;
    REQUIRE(overlap * 1e5 == Approx(weight * (100.0 - static_cast<double>(i))).epsilon(1e-4));
  }
}

TEST_CASE("a grain wedged into a corner of three mesh walls rests on all three") {
  const double c = 0.0052;
  Scene s = scene_of({{{c, c, c}, {0.1, -0.3, -0.1}, {10, 20, -30}}});
  s.time.gravity = {-9.81, -9.81, -9.81};
  s.domain.low = {-0.01, -0.01, -0.01};
  s.domain.high = {0.1, 0.1, 0.1};
  scenes::add_wall(s, "corner", MeshShape{"corner.stl", corner_of_three(0.09)});
  Simulation simulation(s, 1);
  advance(simulation, 40000);
  CHECK(largest_speed(simulation) < 1e-7);
  const double weight = 2500.0 * 4.0 / 3.0 * std::numbers::pi * std::pow(radius, 3) * 9.81;
  const Vec3 p = vector_of(simulation.snapshot(), Field::position, 0);
  // friction may carry a part of the weight, as it was when the grain came to rest
  for (int axis = 0; axis < 3; ++axis) {
    const double push = 1e4 * (radius - p[axis]);
    CHECK(push > 0.15 * weight);
    CHECK(push < 1.9 * weight);
  }
}

TEST_CASE("a grain shot at an edge or a vertex of a mesh bounces off and gains no energy") {
  for (const bool is_vertex : {false, true})
    for (const double offset : {0.0, 1e-9, 1e-4, 2e-3}) {
      INFO((is_vertex ? "vertex" : "edge") << ", " << offset << " m off");
      // A roof whose ridge lies along y; a pyramid whose top is at the origin.
      TriangleMesh mesh;
      if (is_vertex) {
        mesh.vertices = {
            {0, 0, 0}, {0.05, 0.05, -0.05}, {-0.05, 0.05, -0.05}, {-0.05, -0.05, -0.05}, {0.05, -0.05, -0.05}};
        mesh.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 1}};
      } else {
        mesh.vertices = {{0, -0.05, 0},       {0, 0.05, 0},          {0.05, -0.05, -0.05},
                         {0.05, 0.05, -0.05}, {-0.05, -0.05, -0.05}, {-0.05, 0.05, -0.05}};
        mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {0, 1, 4}, {1, 5, 4}};
      }
      Scene s = scene_of({{{offset, 0.3 * offset, 0.008}, {0, 0, -1.0}, {}}});
      s.contact.pairs[0].restitution = 1.0;
      s.contact.pairs[0].friction = 0.0;
      scenes::add_wall(s, "mesh", MeshShape{"mesh.stl", mesh});
      Simulation simulation(s, 1);
      advance(simulation, static_cast<int>(0.02 / simulation.time_step()));
      const Image image = simulation.snapshot();
      const Vec3 v = vector_of(image, Field::velocity, 0), x = vector_of(image, Field::position, 0);
      CHECK(x.z > -std::abs(x.x) - (is_vertex ? std::abs(x.y) : 0.0));  // above the roof
      CHECK(length(v) == Approx(1.0).epsilon(2e-3));
      if (offset < 1e-8) CHECK(v.z == Approx(1.0).epsilon(1e-3));
    }
}

TEST_CASE("a fast grain does not tunnel through a thin wall: it bounces, or the run stops and says why") {
  int n_bounced = 0, n_stopped = 0;
  for (const double speed : {1.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 10000.0}) {
    INFO("speed " << speed << " m/s");
    TriangleMesh sheet;
    sheet.vertices = {{-0.5, -0.5, 0}, {0.5, -0.5, 0}, {0.5, 0.5, 0}, {-0.5, 0.5, 0}};
    sheet.triangles = {{0, 1, 2}, {0, 2, 3}};
    Scene s = scene_of({{{0.1, 0.05, 0.02}, {0, 0, -speed}, {}}});
    scenes::add_wall(s, "sheet", MeshShape{"sheet.stl", sheet});
    Simulation simulation(s, 1);
    try {
      for (int i = 0; i < static_cast<int>(0.1 / speed / simulation.time_step()) + 200; ++i) {
        simulation.step();
        REQUIRE(vector_of(simulation.snapshot(), Field::position, 0).z > 0.0);
      }
      CHECK(vector_of(simulation.snapshot(), Field::velocity, 0).z > 0.0);
      ++n_bounced;
    } catch (const RunError& error) {
      CHECK(std::string(error.what()).find("grain 0") != std::string::npos);
      ++n_stopped;
    }
  }
  CHECK(n_bounced > 0);
  CHECK(n_stopped > 0);
}

TEST_CASE("a cluster without gravity keeps its momentum, and its angular momentum as far as contact points are one") {
  shapes::Dice dice(81);
  std::vector<Grain> grains;
  for (int x = 0; x < 5; ++x)
    for (int y = 0; y < 5; ++y)
      for (int z = 0; z < 5; ++z) {
        const Vec3 p = 2.02 * radius * Vec3{x - 2.0, y - 2.0, z - 2.0};
        grains.push_back({p, -4.0 * p + 0.1 * dice.direction() + Vec3{0.3, 0.2, 0.1}, 20.0 * dice.direction()});
      }
  for (const TangentialLaw law : {TangentialLaw::viscous, TangentialLaw::spring, TangentialLaw::power}) {
    Scene s = scene_of(grains);
    s.contact.tangential = law;
    s.contact.pairs[0].tangential_viscosity = 0.5;
    Simulation simulation(s, 2);
    const auto totals = [&] {
      const Image image = simulation.snapshot();
      const double mass = 2500.0 * 4.0 / 3.0 * std::numbers::pi * std::pow(radius, 3);
      Vec3 momentum, angular;
      double size = 0.0, angular_size = 0.0;
      for (std::size_t i = 0; i < image.n_grains; ++i) {
        const Vec3 v = vector_of(image, Field::velocity, i), w = vector_of(image, Field::angular_velocity, i);
        // positions half a step back, where the velocities are: torque of equal and opposite forces is then exact
        const Vec3 x =
            vector_of(image, Field::position, i) - (simulation.step_number() ? 0.5 * simulation.time_step() : 0.0) * v;
        const Vec3 l = mass * cross(x, v) + 0.4 * mass * radius * radius * w;
        momentum += mass * v;
        angular += l;
        size += mass * length(v);
        angular_size += length(l);
      }
      return std::tuple(momentum, angular, size, angular_size);
    };
    const auto [p0, l0, size, angular_size] = totals();
    advance(simulation, 5000);
    const auto [p1, l1, size1, angular_size1] = totals();
    CHECK(length(p1 - p0) < 1e-12 * size);
    CHECK(length(l1 - l0) < 1e-10 * angular_size);
  }
}

TEST_CASE("Newton's cradle passes an impact on: the last grain leaves with nearly all of the speed") {
  std::vector<Grain> grains{{{-2.5 * radius, 0, 0}, {1, 0, 0}, {}}};
  for (int i = 0; i < 4; ++i) grains.push_back({{2.002 * radius * i, 0, 0}, {}, {}});
  Scene s = scene_of(grains);
  s.contact.normal = NormalLaw::hertz;
  s.contact.tangential = TangentialLaw::mindlin;
  s.contact.pairs[0].restitution = 1.0;
  s.materials[0].young = 1e8;
  Simulation simulation(s, 1);
  advance(simulation, static_cast<int>(0.01 / simulation.time_step()));
  const Image image = simulation.snapshot();
  double momentum = 0.0, energy = 0.0;
  for (std::size_t i = 0; i < 5; ++i) {
    const double v = vector_of(image, Field::velocity, i).x;
    momentum += v;
    energy += v * v;
  }
  CHECK(momentum == Approx(1.0).epsilon(1e-12));
  CHECK(energy == Approx(1.0).epsilon(1e-3));
  CHECK(vector_of(image, Field::velocity, 4).x > 0.97);
}

namespace {

/// A bed that has had `settle` steps to come to rest neither moves nor creeps in `rest` further ones. Some of its grains lie alone on
/// the floor, where they would roll for ever if bulk viscosity did not slow them down.
void check_rest(int settle, int rest) {
  Scene s = scenes::settled_bed();
  s.time.gravity = {0, 0, -9.81};
  s.time.damping = 10.0;
  s.domain.high.x = s.domain.high.y = 4 * 1.02 * scenes::d;
  auto& fill = std::get<LatticeFill>(s.particles[0].fill);
  fill.region = BoxRegion{{{0, 0, 0}, {s.domain.high.x, s.domain.high.y, 6.2 * scenes::d}}};
  Simulation simulation(s, 1);
  advance(simulation, settle);
  const std::vector<double> before = simulation.snapshot().find(Field::position)->reals;
  for (int k = 0; k < 10; ++k) {
    CHECK(largest_speed(simulation) < 1e-12);  // round-off: an energy of 1e-23 of m g r
    advance(simulation, rest / 10);
  }
  const std::vector<double> after = simulation.snapshot().find(Field::position)->reals;
  double most = 0.0;
  for (std::size_t k = 0; k < after.size(); ++k) most = std::max(most, std::abs(after[k] - before[k]));
  CHECK(most < 1e-13);
}

}  // namespace

TEST_CASE("a bed at rest stays at rest") { check_rest(120000, 50000); }

namespace {

/// One grain falls on another: what is left of the speed, over the initial one.
double restitution(Precision precision, NormalLaw normal, double diameter, double given) {
  Scene s = scene_of({{{0, 0, 0}, {}, {}}, {{1.001 * diameter, 0, 0}, {-0.5, 0, 0}, {}}});
  s.materials[0].young = 1e8;
  s.contact.normal = normal;
  s.contact.tangential = normal == NormalLaw::hertz ? TangentialLaw::mindlin : TangentialLaw::spring;
  s.contact.pairs[0].restitution = given;
  s.particles[0].diameter.value = diameter;
  s.time.steps_per_contact = 100.0;
  // the same softness for grains of all sizes: k grows with the diameter (k d^2/(m v^2) is the same)
  s.contact.pairs[0].normal_stiffness = 1e6 * diameter;
  s.domain.low = {-4 * diameter, -4 * diameter, -4 * diameter};
  s.domain.high = {4 * diameter, 4 * diameter, 4 * diameter};
  s.run.precision = precision;
  Simulation simulation(s, 1);
  advance(simulation, 400);
  const Image image = simulation.snapshot();
  return (vector_of(image, Field::velocity, 1).x - vector_of(image, Field::velocity, 0).x) / 0.5;
}

}  // namespace

TEST_CASE(
    "in mixed precision an impact keeps the restitution that it has in double, for grains of a metre as of a "
    "micrometre") {
  for (const NormalLaw normal : {NormalLaw::linear, NormalLaw::hertz})
    for (const double diameter : {1.0, 1e-2, 1e-4, 1e-6})
      for (const double given : {0.3, 0.9, 1.0}) {
        INFO(moraine::name_of(normal) << ", diameter " << diameter << ", restitution " << given);
        const double in_double = restitution(Precision::double_, normal, diameter, given);
        const double in_mixed = restitution(Precision::mixed, normal, diameter, given);
        CHECK(in_double == Approx(given).margin(0.01));
        CHECK(std::abs(in_mixed - in_double) < 1e-6);
      }
}

TEST_CASE("a bed at rest stays at rest for a million steps", "[.long][long]") { check_rest(120000, 1000000); }
