// Scenes at the edge: from stiff to soft, from elastic to dead, at rest for long, in corners and on edges.
#include <catch2/catch.hpp>

#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include "engine/run/simulation.hpp"
#include "tests/stability/cases.hpp"
#include "tests/support/flow_scenes.hpp"

using namespace moraine;
using cases::advance;
using cases::advance_past_restart;
using cases::largest_speed;
using cases::report;
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
      const double v0 = 0.1, touch = 0.002 * radius / v0;  // [s] when they meet
      advance(simulation, static_cast<int>(touch / simulation.time_step()));
      advance_past_restart(simulation, s, 50);  // of an elastic contact
      // to the end of the contact and beyond: overdamped ones creep apart
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
  advance_past_restart(simulation, s, static_cast<int>(2.0 / simulation.time_step()));
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
  advance_past_restart(simulation, s, 1000);  // while it bounces
  advance_past_restart(simulation, s, 39000);
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

namespace {

/// What a grain can be shot at, its highest point at the origin.
enum class Target { edge, vertex, sheet, thin_wall };

std::string name_of(Target target) {
  return target == Target::edge     ? "edge"
         : target == Target::vertex ? "vertex"
         : target == Target::sheet  ? "sheet"
                                    : "thin wall";
}

TriangleMesh mesh_of(Target target) {
  const double w = 0.05;
  if (target == Target::vertex)  // the top of a pyramid
    return {{{0, 0, 0}, {w, w, -w}, {-w, w, -w}, {-w, -w, -w}, {w, -w, -w}},
            {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 1}}};
  if (target == Target::edge)  // a roof whose ridge lies along y
    return {{{0, -w, 0}, {0, w, 0}, {w, -w, -w}, {w, w, -w}, {-w, -w, -w}, {-w, w, -w}},
            {{0, 2, 1}, {1, 2, 3}, {0, 1, 4}, {1, 5, 4}}};
  TriangleMesh sheet{{{-w, -w, 0}, {w, -w, 0}, {w, w, 0}, {-w, w, 0}}, {{0, 1, 2}, {0, 2, 3}}};
  if (target == Target::sheet) return sheet;
  for (int k = 0; k < 4; ++k)  // a second face, a fiftieth of a radius below
    sheet.vertices.push_back(sheet.vertices[static_cast<std::size_t>(k)] - Vec3{0, 0, 0.02 * radius});
  sheet.triangles.push_back({4, 6, 5});
  sheet.triangles.push_back({4, 7, 6});
  return sheet;
}

/// [m] of a point above the target; below zero it is inside or through.
double height_above(Target target, Vec3 x) {
  if (target == Target::edge) return x.z + std::abs(x.x);
  if (target == Target::vertex) return x.z + std::max(std::abs(x.x), std::abs(x.y));
  return x.z;
}

Scene shot(Target target, Vec3 from, double speed, double stiffness) {
  Scene s = scene_of({{from, {0, 0, -speed}, {}}});
  s.contact.pairs[0].restitution = 1.0;
  s.contact.pairs[0].friction = 0.0;
  s.contact.pairs[0].normal_stiffness = stiffness;
  scenes::add_wall(s, "target", MeshShape{"target.stl", mesh_of(target)});
  return s;
}

struct Flight {
  std::string error;  // that ended it; empty where it came to its end
  Vec3 velocity;
};

/// Flies for so many steps, or until an error ends the run. Its centre is above the target all the time.
Flight fly(Simulation& run, Target target, std::int64_t n_steps) {
  Flight flight;
  try {
    for (std::int64_t i = 0; i < n_steps; ++i) {
      run.step();
      REQUIRE(height_above(target, vector_of(run.snapshot({"position"}), Field::position, 0)) > 0.0);
    }
  } catch (const RunError& error) {
    flight.error = error.what();
  }
  flight.velocity = vector_of(run.snapshot({"velocity"}), Field::velocity, 0);
  return flight;
}

/// Flies as far as the target and back; a second run, restored just before they touch, must end alike, by the same error if by one.
Flight shoot(Target target, const Scene& scene, double distance, double speed) {
  Simulation run(scene, 1);
  const double dt = run.time_step();
  const auto there = static_cast<std::int64_t>((distance - radius) / (speed * dt));
  const auto back = there + static_cast<std::int64_t>(3.0 * scene.time.steps_per_contact) + 3;
  const Flight before = fly(run, target, std::max<std::int64_t>(0, there - 1));
  if (!before.error.empty()) return before;
  Simulation restored(scene, 2, run.checkpoint());
  const Flight flight = fly(run, target, back), other = fly(restored, target, back);
  CHECK(other.error == flight.error);
  CHECK(restored.state_hash() == run.state_hash());
  return flight;
}

}  // namespace

TEST_CASE("a grain shot at an edge or a vertex of a mesh bounces off and gains no energy") {
  for (const Target target : {Target::edge, Target::vertex})
    for (const double offset : {0.0, 1e-9, 1e-4, 2e-3}) {
      INFO(name_of(target) << ", " << offset << " m off");
      const Scene s = shot(target, {offset, 0.3 * offset, 0.008}, 1.0, 1e4);
      const Flight flight = shoot(target, s, 0.008, 1.0);
      CHECK(flight.error.empty());
      CHECK(length(flight.velocity) == Approx(1.0).epsilon(2e-3));
      if (offset < 1e-8) CHECK(flight.velocity.z == Approx(1.0).epsilon(1e-3));
    }
}

namespace {

/// Shots of 100 m/s at every target, from its middle to 2 mm beside it, for springs of each stiffness [N/m].
void check_shots(std::initializer_list<double> stiffnesses, const std::function<void(const Flight&)>& check) {
  const double speed = 100.0, distance = 0.02;
  for (const Target target : {Target::edge, Target::vertex, Target::sheet, Target::thin_wall})
    for (const double offset : {0.0, 1e-9, 1e-4, 2e-3})
      for (const double stiffness : stiffnesses) {
        INFO(name_of(target) << ", " << offset << " m off, " << stiffness << " N/m");
        check(shoot(target, shot(target, {offset, 0.3 * offset, distance}, speed, stiffness), distance, speed));
      }
}

}  // namespace

TEST_CASE(
    "a grain shot at 100 m/s at an edge, a vertex, a sheet and a thin wall bounces off springs that can bear it") {
  check_shots({1e7, 1e8}, [](const Flight& flight) {  // overlaps of 0.23 and 0.07 radii
    CHECK(flight.error.empty());
    CHECK(length(flight.velocity) == Approx(100.0).epsilon(2e-3));
    CHECK(flight.velocity.z > 0.0);
  });
}

TEST_CASE(
    "a grain shot at 100 m/s at an edge, a vertex, a sheet and a thin wall of springs that cannot bear it ends the run "
    "by name before it is through") {
  check_shots({1e2, 1e4},  // overlaps of 72 and 7.2 radii
              [](const Flight& flight) { CHECK_THAT(flight.error, Catch::Contains("grain 0")); });
}

TEST_CASE("a fast grain does not tunnel through a thin wall: it bounces, or the run stops and says why") {
  int n_bounced = 0, n_stopped = 0;
  for (const Target target : {Target::sheet, Target::thin_wall})
    for (const double speed : {1.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 10000.0}) {
      INFO(name_of(target) << ", " << speed << " m/s");
      const Flight flight = shoot(target, shot(target, {0.01, 0.005, 0.02}, speed, 1e4), 0.02, speed);
      if (flight.error.empty()) {
        CHECK(flight.velocity.z > 0.0);
        ++n_bounced;
      } else {
        CHECK_THAT(flight.error, Catch::Contains("grain 0"));
        ++n_stopped;
      }
    }
  CHECK(n_bounced > 0);
  CHECK(n_stopped > 0);
}

namespace {

/// Momentum and angular momentum, and the sums of their sizes over the grains.
struct Momenta {
  Vec3 momentum, angular;
  double size = 0.0, angular_size = 0.0;
};

Momenta momenta_of(const Simulation& run) {
  const Image image = run.snapshot();
  const double mass = 2500.0 * 4.0 / 3.0 * std::numbers::pi * std::pow(radius, 3);
  Momenta sum;
  for (std::size_t i = 0; i < image.n_grains; ++i) {
    const Vec3 v = vector_of(image, Field::velocity, i), w = vector_of(image, Field::angular_velocity, i);
    // positions half a step back, where the velocities are: torque of equal and opposite forces is then exact
    const Vec3 x = vector_of(image, Field::position, i) - (run.step_number() ? 0.5 * run.time_step() : 0.0) * v;
    const Vec3 l = mass * cross(x, v) + 0.4 * mass * radius * radius * w;
    sum.momentum += mass * v;
    sum.angular += l;
    sum.size += mass * length(v);
    sum.angular_size += length(l);
  }
  return sum;
}

/// A cube of 125 grains that fall towards its middle, while the whole flies and turns.
std::vector<Grain> cluster(double infall, double drift, double turn) {
  shapes::Dice dice(81);
  std::vector<Grain> grains;
  for (int x = 0; x < 5; ++x)
    for (int y = 0; y < 5; ++y)
      for (int z = 0; z < 5; ++z) {
        const Vec3 p = 2.02 * radius * Vec3{x - 2.0, y - 2.0, z - 2.0};
        const Vec3 v = -infall * p + 0.1 * dice.direction() + drift * Vec3{0.3, 0.2, 0.1} + cross({0, 0, turn}, p);
        grains.push_back({p, v, 20.0 * dice.direction()});
      }
  return grains;
}

/// Grains that stick to each other stay together, so that they have contacts all the time.
void check_sticky_cluster(std::int64_t n_steps) {
  Scene s = scene_of(cluster(4.0, 0.05, 5.0));
  s.contact.cohesion = CohesionLaw::linear;
  s.contact.pairs[0].cohesion_force = 1.0;  // [N], 77 times the weight that each would have
  s.contact.pairs[0].cohesion_range = 0.2 * radius;
  cases::add_probe(s, Probe::Kind::contacts, "contacts");
  Simulation run(s, 1);
  const Momenta before = momenta_of(run);
  advance_past_restart(run, s, n_steps);
  const Momenta after = momenta_of(run);
  const double n_contacts = run.probe_row(0)[0];
  const double drift = length(after.momentum - before.momentum) / before.size;
  const double angular_drift = length(after.angular - before.angular) / before.angular_size;
  report("cluster of 125 that stick, %lld steps: momentum kept to %.1e, angular momentum to %.1e; %.0f contacts",
         static_cast<long long>(n_steps), drift, angular_drift, n_contacts);
  CHECK(drift < 1e-12);
  CHECK(angular_drift < 1e-10);
  CHECK(n_contacts > 250);
}

}  // namespace

TEST_CASE("a cluster without gravity keeps its momentum, and its angular momentum as far as contact points are one") {
  for (const TangentialLaw law : {TangentialLaw::viscous, TangentialLaw::spring, TangentialLaw::power}) {
    Scene s = scene_of(cluster(4.0, 1.0, 0.0));
    s.contact.tangential = law;
    s.contact.pairs[0].tangential_viscosity = 0.5;
    Simulation simulation(s, 2);
    const Momenta before = momenta_of(simulation);
    advance_past_restart(simulation, s, 1000);  // while they collide
    advance(simulation, 4000);
    const Momenta after = momenta_of(simulation);
    CHECK(length(after.momentum - before.momentum) < 1e-12 * before.size);
    CHECK(length(after.angular - before.angular) < 1e-10 * before.angular_size);
  }
}

TEST_CASE("a cluster that holds together keeps its momentum and angular momentum to round-off") {
  check_sticky_cluster(5000);
}

TEST_CASE("a cluster that holds together keeps its momentum and angular momentum to round-off for a million steps",
          "[.long][long]") {
  check_sticky_cluster(1000000);
}

namespace {

/// A boulder with its centre at the origin, and fine grains of the same material, `ratio` times smaller.
Scene boulder_scene(double ratio, const std::vector<Grain>& fines) {
  Scene s = scene_of(fines);
  s.particles[0].diameter.value = 2 * radius / ratio;
  s.particles.push_back(scene_of({{{0, 0, 0}, {}, {}}}).particles[0]);
  s.contact.pairs[0].normal_stiffness = 1e4 / ratio;
  return s;
}

}  // namespace

TEST_CASE("a fine grain leaves a boulder with the restitution that it has with its like, head-on and at a slant") {
  for (const double ratio : {3.0, 10.0, 100.0})
    for (const double restitution : {0.3, 0.9}) {
      INFO("1:" << ratio << ", restitution " << restitution);
      const double fine = radius / ratio, apart = 1.001 * (radius + fine);
      // one comes from above, one at 45 degrees from the side, with friction
      Scene s = boulder_scene(ratio, {{{0, 0, apart}, {0, 0, -0.5}, {}}, {{-apart, 0, 0}, {0.5, 0.5, 0}, {}}});
      s.contact.pairs[0].restitution = restitution;
      s.time.steps_per_contact = 100.0;
      s.output.energy = true;
      Simulation run(s, 1);
      advance_past_restart(run, s, 60);
      advance(run, 600);
      const Image image = run.snapshot();
      const Vec3 from_above = vector_of(image, Field::velocity, 0), slanting = vector_of(image, Field::velocity, 1),
                 boulder = vector_of(image, Field::velocity, 2);
      const double cube = ratio * ratio * ratio;
      report("1:%.0f, restitution %.1f: %.4f head-on, %.4f at a slant", ratio, restitution,
             (from_above.z - boulder.z) / 0.5, (boulder.x - slanting.x) / 0.5);
      CHECK((from_above.z - boulder.z) / 0.5 == Approx(restitution).epsilon(0.01));
      // while it slides the contact goes around the boulder, the further the larger the fine grain
      CHECK((boulder.x - slanting.x) / 0.5 == Approx(restitution).epsilon(0.05));
      CHECK(slanting.y > 0.0);
      CHECK(slanting.y < 0.5);
      // what the fines have given the boulder has
      const Vec3 momentum = from_above + slanting + cube * boulder;
      CHECK(length(momentum - Vec3{0.5, 0.5, -0.5}) < 1e-12 * cube);
      const EnergyLedger ledger = run.energy();
      CHECK(std::abs(ledger.error()) < 2e-3 * ledger.initial);
    }
}

TEST_CASE("fines between a boulder and the walls of a corner come to rest, load and all, and do not jitter") {
  // A boulder in a corner of three planes; fines trickle into the gaps below it, and some bear it.
  const double ratio = 10.0, fine = radius / ratio;
  std::vector<Grain> fines;
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j < 8; ++j) fines.push_back({{(1.1 + 2.2 * i) * fine, (1.1 + 2.2 * j) * fine, 1.1 * fine}, {}, {}});
  Scene s = boulder_scene(ratio, fines);
  std::get<ListedGrains>(s.particles[1].fill).grains[0].position = {1.02 * radius, 1.02 * radius, 1.3 * radius};
  s.domain.low = {-0.001, -0.001, -0.001};
  s.domain.high = {4 * radius, 4 * radius, 4 * radius};
  s.time.gravity = {-2.0, -2.0, -9.81};
  s.time.damping = 100.0;
  for (const Vec3 normal : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}})
    scenes::add_wall(s, "wall" + std::to_string(s.walls.size()), PlaneShape{{0, 0, 0}, normal});
  Simulation run(s, 1);
  advance_past_restart(run, s, 2000);
  advance(run, 450000);
  const std::vector<double> before = run.snapshot().find(Field::position)->reals;
  for (int k = 0; k < 5; ++k) {
    CHECK(largest_speed(run) < 1e-12);
    advance(run, 10000);
  }
  const std::vector<double> after = run.snapshot().find(Field::position)->reals;
  double most = 0.0;
  for (std::size_t k = 0; k < after.size(); ++k) most = std::max(most, std::abs(after[k] - before[k]));
  report("fines under a boulder, 50,000 steps at rest: moved by at most %.1e m", most);
  CHECK(most < 1e-13);
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
  advance_past_restart(simulation, s, static_cast<int>(0.01 / simulation.time_step()));
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

/// A grain of speed 1 hits the first of two that touch, along their line, all without dashpots: the three speeds afterwards. The springs
/// are oscillators of frequencies 1 and sqrt(3) (times sqrt(k/m)) until one of them is free, and the other goes on alone.
std::array<double, 3> cradle_of_three() {
  const double fast = std::numbers::sqrt3;
  // overlaps of the first and the second contact, with their rates, in units of time sqrt(m/k)
  const auto first = [&](double t) { return 0.5 * (std::sin(t) + std::sin(fast * t) / fast); };
  const auto second = [&](double t) { return 0.5 * (std::sin(t) - std::sin(fast * t) / fast); };
  double low = 1.0, high = 3.0;  // the first contact ends in between
  for (int i = 0; i < 100; ++i) (first(0.5 * (low + high)) > 0.0 ? low : high) = 0.5 * (low + high);
  const double end = low, rate = 0.5 * (std::cos(end) - std::cos(fast * end)), left = second(end);
  const double first_rate = 0.5 * (std::cos(end) + std::cos(fast * end));
  // rates: v1 - v2 and v2 - v3; momentum: v1 + v2 + v3 = 1
  const double v2 = (1.0 - first_rate + rate) / 3.0, v1 = v2 + first_rate, v3 = v2 - rate;
  // then the second contact alone, frequency sqrt(2), gives back what it holds
  const double apart = std::sqrt(rate * rate + 2.0 * left * left), middle = 0.5 * (v2 + v3);
  return {v1, middle - 0.5 * apart, middle + 0.5 * apart};
}

}  // namespace

TEST_CASE("a grain that hits two that touch at the same time parts them with the speeds of three soft spheres") {
  const std::array<double, 3> exact = cradle_of_three();
  for (const double steps : {20.0, 50.0, 200.0}) {
    const double gap = 1e-3 * radius;
    Scene s =
        scene_of({{{-2.0 * radius - gap, 0, 0}, {1, 0, 0}, {}}, {{0, 0, 0}, {}, {}}, {{2.0 * radius, 0, 0}, {}, {}}});
    s.contact.pairs[0].restitution = 1.0;
    s.contact.pairs[0].normal_stiffness = 1e6;
    s.time.steps_per_contact = steps;
    Simulation run(s, 1);
    advance(run, static_cast<int>(gap / run.time_step()));
    advance_past_restart(run, s, static_cast<int>(4.0 * steps));
    double worst = 0.0;
    const Image image = run.snapshot({"velocity"});
    for (std::size_t i = 0; i < 3; ++i)
      worst = std::max(worst, std::abs(vector_of(image, Field::velocity, i).x - exact[i]));
    report("cradle of three, %.0f steps a contact: speeds within %.1e of %.5f, %.5f, %.5f", steps, worst, exact[0],
           exact[1], exact[2]);
    CHECK(worst < 3.0 / (steps * steps));
  }
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
  advance_past_restart(simulation, s, settle / 30);  // while it falls
  advance(simulation, settle - settle / 30);
  const std::vector<double> before = simulation.snapshot().find(Field::position)->reals;
  for (int k = 0; k < 10; ++k) {
    CHECK(largest_speed(simulation) < 1e-12);  // round-off: an energy of 1e-23 of m g r
    advance_past_restart(simulation, s, rest / 10, k == 5 ? 300 : 0);
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
  advance_past_restart(simulation, s, 200);  // some 15 to the contact, 100 in it
  advance(simulation, 200);
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
