// Scenes that are hard on contacts: load on small grains, long rest, wedges, spin, shear to and fro, a million impacts,
// deep compression, impacts of many at once. Each with the bound that it must keep, and restarted in the middle.
#include <cmath>
#include <numbers>

#include "tests/stability/laboratory.hpp"

using namespace moraine;
using namespace moraine::hard;

namespace {

/// A column on a floor, each overlap that which carries what is above it, at rest.
Scene column_at_rest(int n, double stiffness) {
  std::vector<Grain> grains;
  const double weight = mass_of(radius) * 9.81;
  double z = 0.0;
  for (int i = 0; i < n; ++i) {
    z += (i == 0 ? 1.0 : 2.0) * radius - weight * (n - i) / stiffness;
    grains.push_back({{0, 0, z}, {}, {}});
  }
  Scene s = scene_of(grains);
  s.domain.high.z = 2.1 * radius * n;
  s.time.gravity = {0, 0, -9.81};
  s.contact.pairs[0].normal_stiffness = stiffness;
  scenes::add_wall(s, "floor", PlaneShape{{0, 0, 0}, {0, 0, 1}});
  return s;
}

/// A column of so many grains that stays where it is for so many contact times.
void check_rest(int n_contact_times) {
  Scene s = column_at_rest(1000, 1e6);
  s.time.steps_per_contact = 20;
  Simulation simulation(s, 1);
  const std::vector<double> before = positions(simulation);
  advance_through_restart(simulation, s, 20LL * n_contact_times);
  CHECK(largest_difference(before, positions(simulation)) < 1e-11);
  CHECK(largest_speed(simulation) < 1e-8);
}

/// A mesh plane through the line x = z = 0 that rises to one side at so many degrees, of many triangles.
TriangleMesh slope(double degrees, bool is_left) {
  constexpr int n = 10;
  const double angle = degrees * std::numbers::pi / 180.0, size = 0.01;
  TriangleMesh mesh;
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j)
      mesh.vertices.push_back(
          {(is_left ? -1 : 1) * i * size * std::cos(angle), (j - n / 2) * size, i * size * std::sin(angle)});
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const int a = i * (n + 1) + j;
      mesh.triangles.push_back({a, a + 1, a + n + 1});
      mesh.triangles.push_back({a + 1, a + n + 2, a + n + 1});
    }
  return mesh;
}

/// Face-centred cubic, nearest neighbours `apart` from each other, periodic in all directions.
Scene lattice(int cells, double apart) {
  const double side = apart * std::numbers::sqrt2;
  std::vector<Grain> grains;
  for (int i = 0; i < cells; ++i)
    for (int j = 0; j < cells; ++j)
      for (int k = 0; k < cells; ++k)
        for (const Vec3 at : {Vec3{0, 0, 0}, Vec3{0.5, 0.5, 0}, Vec3{0.5, 0, 0.5}, Vec3{0, 0.5, 0.5}})
          grains.push_back({side * (Vec3{1.0 * i, 1.0 * j, 1.0 * k} + at + Vec3{0.1, 0.1, 0.1}), {}, {}});
  Scene s = scene_of(grains);
  s.domain.low = {0, 0, 0};
  s.domain.high = {cells * side, cells * side, cells * side};
  s.domain.periodic = {true, true, true};
  s.output.energy = true;
  return s;
}

/// A settled bed, its gravity tilted to and fro: energies at the end of each cycle.
struct Shear {
  std::vector<double> elastic, height;  // [J], [m] mean of the grains
  double kinetic = 0.0;                 // [J] at the end
};
Shear shear(int n_cycles, int steps_of_half) {
  Scene s = scenes::settled_bed();
  s.time.gravity = {0, 0, -9.81};
  s.domain.high.x = s.domain.high.y = 4 * 1.02 * scenes::d;
  std::get<LatticeFill>(s.particles[0].fill).region =
      BoxRegion{{{0, 0, 0}, {s.domain.high.x, s.domain.high.y, 6.2 * scenes::d}}};
  s.output.probes.clear();
  s.output.energy = true;
  for (PairLaw& pair : s.contact.pairs) pair.restitution = 0.3;
  Simulation run(s, 1);
  advance(run, 15000);
  Shear found;
  Image image = run.checkpoint();
  for (int half = 0; half < 2 * n_cycles; ++half) {
    s.time.gravity.x = (half % 2 == 0 ? 0.1 : -0.1) * 9.81;
    Simulation tilted(s, 1, image);
    advance(tilted, steps_of_half);
    const EnergyLedger energy = tilted.energy();
    if (half % 2 == 1) {
      found.elastic.push_back(energy.elastic_normal + energy.elastic_tangential);
      double sum = 0.0;
      const std::vector<double> places = positions(tilted);
      for (std::size_t k = 2; k < places.size(); k += 3) sum += places[k];
      found.height.push_back(3.0 * sum / static_cast<double>(places.size()));
    }
    found.kinetic = energy.kinetic + energy.rotational;
    image = tilted.checkpoint();
  }
  return found;
}

void check_shear(int n_cycles) {
  const Shear found = shear(n_cycles, 1000);
  const auto half = static_cast<std::size_t>(n_cycles / 2), last = static_cast<std::size_t>(n_cycles - 1);
  CHECK(found.elastic[last] < 1.5 * found.elastic[0]);
  CHECK(found.height[last] < found.height[half] + 0.01 * radius);
  CHECK(found.height[last] > found.height[half] - 0.3 * radius);
  CHECK(found.kinetic < 0.02 * 96 * mass_of(radius) * 9.81 * radius);  // of what lifts the bed by a radius
}

/// A grain between two walls a little further apart than it is wide: its speed after so many impacts, over that at first.
double speed_after_impacts(NormalLaw law, double n_impacts) {
  Scene s = scene_of({{{0, 0, 0}, {0, 0, 1}, {}}});
  s.contact.normal = law;
  if (law == NormalLaw::hertz) s.contact.tangential = TangentialLaw::mindlin;
  s.contact.pairs[0].restitution = 1.0;
  s.time.max_speed = 1.0;
  const double gap = 0.00017;
  scenes::add_wall(s, "floor", PlaneShape{{0, 0, -radius - 0.5 * gap}, {0, 0, 1}});
  scenes::add_wall(s, "lid", PlaneShape{{0, 0, radius + 0.5 * gap}, {0, 0, -1}});
  Simulation simulation(s, 1);
  const double cycle = simulation.plan().time_step.contact_time + gap;  // [s] from impact to impact, at 1 m/s
  const auto n_steps = static_cast<std::int64_t>(n_impacts * cycle / simulation.time_step());
  advance_through_restart(simulation, s, n_steps);
  double fastest = 0.0;  // in free flight
  for (int i = 0; i < 200; ++i) {
    simulation.step();
    fastest = std::max(fastest, std::abs(velocity(simulation, 0).z));
  }
  return fastest;
}

}  // namespace

TEST_CASE("a grain a million times as heavy rests on a small one, a hundred times smaller, and neither moves") {
  const double small = 0.0005, large = 0.05, stiffness = 3e6;
  const double under = (mass_of(small) + mass_of(large)) * 9.81 / stiffness, above = mass_of(large) * 9.81 / stiffness;
  Scene s =
      scene_of({{{0, 0, small - under}, {}, {}, small}, {{0, 0, 2 * small - under + large - above}, {}, {}, large}});
  s.time.gravity = {0, 0, -9.81};
  s.contact.pairs[0].normal_stiffness = stiffness;
  scenes::add_wall(s, "floor", PlaneShape{{0, 0, 0}, {0, 0, 1}});
  Simulation simulation(s, 1);
  const std::vector<double> before = positions(simulation);
  advance_through_restart(simulation, s, 100'000);
  CHECK(largest_difference(before, positions(simulation)) < 1e-3 * under);
  CHECK(largest_speed(simulation) < 1e-6);
}

TEST_CASE("a heavy grain, a hundred times as dense, lies on four light ones without pushing them apart or jittering") {
  std::vector<Grain> grains;
  for (const double x : {-radius, radius})
    for (const double y : {-radius, radius}) grains.push_back({{x, y, 0.999 * radius}, {}, {}});
  const double up = radius * (1.0 + std::numbers::sqrt2);
  grains.push_back({{0, 0, 0.999 * up}, {}, {}});
  Scene s = scene_of(grains);
  s.materials.push_back({"lead", 100 * density, 5e6, 0.3});
  std::get<ListedGrains>(s.particles[0].fill).has_material = false;
  ParticleGroup heavy = s.particles[0];
  heavy.material = "lead";
  auto& light_list = std::get<ListedGrains>(s.particles[0].fill).grains;
  auto& heavy_list = std::get<ListedGrains>(heavy.fill).grains;
  light_list.pop_back();
  heavy_list.erase(heavy_list.begin(), heavy_list.end() - 1);
  heavy_list.front().material = 1;
  s.particles.push_back(heavy);
  PairLaw law = s.contact.pairs[0];
  law.friction = 0.8;
  law.restitution = 0.3;
  law.normal_stiffness = 1e5;
  s.contact.pairs.clear();
  for (const char* a : {"glass", "lead"})
    for (const char* b : {"glass", "lead"})
      if (std::string(a) <= b) {
        law.between = {a, b};
        s.contact.pairs.push_back(law);
      }
  s.time.gravity = {0, 0, -9.81};
  scenes::add_wall(s, "floor", PlaneShape{{0, 0, 0}, {0, 0, 1}});
  Simulation simulation(s, 1);
  advance_through_restart(simulation, s, 60'000);
  CHECK(largest_speed(simulation) < 1e-6);
  CHECK(position(simulation, 4).z == Approx(up).epsilon(0.02));
  CHECK(std::abs(position(simulation, 4).x) < 1e-6);
}

TEST_CASE("a column of 1000 grains at rest does not creep") { check_rest(200); }

TEST_CASE("a column of 1000 grains at rest does not creep in 100,000 contact times", "[.long][long]") {
  check_rest(100'000);
}

TEST_CASE("a grain wedged between two meshes is held by both as a wedge holds it") {
  for (const double degrees : {30.0, 60.0, 80.0}) {
    INFO(degrees << " degrees");
    const double angle = degrees * std::numbers::pi / 180.0, height = radius / std::cos(angle);
    Scene s = scene_of({{{0, 0, height}, {0, 0, -0.1}, {}}});
    s.time.gravity = {0, 0, -9.81};
    s.contact.pairs[0].friction = 0.0;
    s.contact.pairs[0].restitution = 0.3;
    scenes::add_wall(s, "left", MeshShape{"left.stl", slope(degrees, true)});
    scenes::add_wall(s, "right", MeshShape{"right.stl", slope(degrees, false)});
    Simulation simulation(s, 1);
    advance_through_restart(simulation, s, 60'000);
    CHECK(largest_speed(simulation) < 1e-7);
    const double push = mass_of(radius) * 9.81 / (2.0 * std::cos(angle));
    const Vec3 p = position(simulation, 0);
    CHECK(std::abs(p.x) < 1e-9);
    CHECK(1e4 * (radius - p.z * std::cos(angle)) == Approx(push).epsilon(1e-4));
  }
}

TEST_CASE(
    "a grain that spins on a plane stays where it is about its axis, and rolls away at two sevenths about another") {
  const double weight = mass_of(radius) * 9.81;
  const auto run = [&](Vec3 spin, std::int64_t n_steps) {
    Scene s = scene_of({{{0, 0, radius - weight / 1e4}, {}, spin}});
    s.time.gravity = {0, 0, -9.81};
    scenes::add_wall(s, "floor", PlaneShape{{0, 0, 0}, {0, 0, 1}});
    Simulation simulation(s, 1);
    advance_through_restart(simulation, s, n_steps);
    return simulation;
  };
  const Simulation upright = run({0, 0, 200}, 20'000);
  CHECK(length(velocity(upright, 0)) < 1e-12);
  CHECK(vector_of(upright.snapshot(), Field::angular_velocity, 0).z == Approx(200).epsilon(1e-12));
  const Simulation rolling = run({0, 200, 0}, 20'000);
  const Vec3 v = velocity(rolling, 0), spin = vector_of(rolling.snapshot(), Field::angular_velocity, 0);
  CHECK(v.x == Approx(2.0 / 7.0 * 200 * radius).epsilon(1e-3));
  CHECK(spin.y * radius == Approx(v.x).epsilon(1e-3));
}

TEST_CASE("a dense bed that is sheared to and fro does not ratchet up energy") { check_shear(6); }

TEST_CASE("a dense bed that is sheared to and fro a thousand times does not ratchet up energy", "[.long][long]") {
  check_shear(1000);
}

TEST_CASE("two thousand impacts without loss leave a grain as fast as it was") {
  CHECK(speed_after_impacts(NormalLaw::linear, 2e3) == Approx(1.0).epsilon(0.01));
  CHECK(speed_after_impacts(NormalLaw::hertz, 2e3) == Approx(1.0).epsilon(0.01));
}

TEST_CASE("a million impacts without loss leave a grain as fast as it was", "[.long][long]") {
  CHECK(speed_after_impacts(NormalLaw::linear, 1e6) == Approx(1.0).epsilon(0.05));
  CHECK(speed_after_impacts(NormalLaw::hertz, 1e6) == Approx(1.0).epsilon(0.05));
}

TEST_CASE("a lattice compressed to an overlap of a tenth holds still, and has the energy of its springs") {
  const double overlap = 0.1 * radius;
  Scene s = lattice(4, 2.0 * radius - overlap);
  Simulation simulation(s, 1);
  const std::vector<double> before = positions(simulation);
  const double springs = 256 * 6 * 0.5 * 1e4 * overlap * overlap;
  CHECK(simulation.energy().elastic_normal == Approx(springs).epsilon(1e-9));
  advance_through_restart(simulation, s, 1000);
  CHECK(largest_difference(before, positions(simulation)) < 1e-9);
  CHECK(simulation.energy().elastic_normal == Approx(springs).epsilon(1e-6));
}

TEST_CASE("one grain against two that touch parts as the soft spheres of the linear law do, to second order") {
  // Overlaps of the two contacts: d'' = -w^2 (2 d - e), e'' = -w^2 (2 e - d), solved by their sum and difference.
  const double v = 1.0, w = std::sqrt(1e4 / mass_of(radius)), r3 = std::sqrt(3.0);
  const auto d = [&](double t) { return 0.5 * v * (std::sin(w * t) / w + std::sin(r3 * w * t) / (r3 * w)); };
  double low = 1.5 / w, high = 4.0 / w;  // the first contact ends between
  for (int i = 0; i < 200; ++i) (d(0.5 * (low + high)) > 0.0 ? low : high) = 0.5 * (low + high);
  const double t = low;
  const double v1 = v - 0.5 * v * ((1 - std::cos(w * t)) + (1 - std::cos(r3 * w * t)) / 3.0);
  const double e = 0.5 * v * (std::sin(w * t) / w - std::sin(r3 * w * t) / (r3 * w));
  const double rate = 0.5 * v * (std::cos(w * t) - std::cos(r3 * w * t));
  const double apart = std::sqrt(rate * rate + 2.0 * w * w * e * e);  // at which the second contact ends
  const double expected[3] = {v1, 0.5 * (v - v1 - apart), 0.5 * (v - v1 + apart)};
  double errors[2] = {0.0, 0.0};
  for (const int fine : {0, 1}) {
    Scene s = scene_of({{{-2.5 * radius, 0, 0}, {v, 0, 0}, {}}, {{0, 0, 0}, {}, {}}, {{2 * radius, 0, 0}, {}, {}}});
    s.contact.pairs[0].restitution = 1.0;
    s.time.steps_per_contact = fine ? 400 : 50;
    Simulation simulation(s, 1);
    advance_through_restart(simulation, s, static_cast<std::int64_t>(0.02 / simulation.time_step()));
    for (std::size_t i = 0; i < 3; ++i)
      errors[fine] = std::max(errors[fine], std::abs(velocity(simulation, i).x - expected[i]));
  }
  CHECK(errors[0] < 3e-3);
  CHECK(errors[1] < 0.1 * errors[0] + 1e-5);
}

TEST_CASE("a cluster without gravity keeps its momentum over a million steps", "[.long][long]") {
  shapes::Dice dice(5);
  std::vector<Grain> grains;
  for (int x = 0; x < 3; ++x)
    for (int y = 0; y < 3; ++y)
      for (int z = 0; z < 3; ++z) {
        const Vec3 p = 2.02 * radius * Vec3{x - 1.0, y - 1.0, z - 1.0};
        grains.push_back({p, -4.0 * p + 0.02 * dice.direction() + Vec3{0.003, 0.002, 0.001}, 20.0 * dice.direction()});
      }
  const Scene s = scene_of(grains);
  Simulation simulation(s, 1);
  const auto momentum = [&] {
    Vec3 sum;
    for (std::size_t i = 0; i < grains.size(); ++i) sum += velocity(simulation, i);
    return sum;
  };
  const Vec3 before = momentum();
  advance_through_restart(simulation, s, 1'000'000);
  CHECK(length(momentum() - before) < 1e-12);
}
