// Walls: a plane cut into triangles acts as one plane, a funnel the more like a cone the more of them there are, and a mirror as the other
// half.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/walls/walls.hpp"
#include "tests/physics/laboratory.hpp"
#include "tests/support/surface_shapes.hpp"

using namespace moraine;
using namespace moraine::physics;

namespace {

constexpr double radius = 1e-3;

/// A turn about an oblique axis, so that no coordinate is special (Rodrigues).
Vec3 turned(Vec3 v) {
  const Vec3 axis = (1.0 / std::sqrt(5.25)) * Vec3{1.0, 2.0, 0.5};
  const double c = std::cos(0.7), s = std::sin(0.7);
  return c * v + s * cross(axis, v) + ((1.0 - c) * dot(axis, v)) * axis;
}

/// A square of side 2 `half` at z = 0, cut into 2 n^2 triangles whose diagonals alternate.
TriangleMesh square_mesh(int n, double half) {
  TriangleMesh mesh;
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i) mesh.vertices.push_back({half * (2.0 * i / n - 1.0), half * (2.0 * j / n - 1.0), 0.0});
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const std::int32_t a = j * (n + 1) + i, b = a + 1, c = a + n + 1, d = c + 1;
      if ((i + j) % 2 == 0) {
        mesh.triangles.push_back({a, b, d});
        mesh.triangles.push_back({a, d, c});
      } else {
        mesh.triangles.push_back({a, b, c});
        mesh.triangles.push_back({b, d, c});
      }
    }
  return mesh;
}

/// Grains that bounce, slide and roll over a floor; the floor is a plane (n = 0) or 2 n^2 triangles.
Scene floor_scene(NormalLaw normal, TangentialLaw tangential, int n, bool is_turned, bool is_moving = false) {
  Scene scene = empty_scene({-0.15, -0.15, -0.15}, {0.15, 0.15, 0.15}, 2e-6);
  scene.time.gravity = {0, 0, -9.81};
  scene.materials = {{"grain", 2500, 1e8, 0.25}};
  scene.contact.normal = normal;
  scene.contact.tangential = tangential;
  PairLaw law = pair_law("grain", "grain", 0.7, 0.3);
  if (normal == NormalLaw::linear) law.normal_stiffness = 1e4;
  scene.contact.pairs = {law};
  WallDefinition floor;
  floor.name = "floor";
  floor.material = "grain";
  if (n == 0)
    floor.shape = PlaneShape{{0, 0, 0}, {0, 0, 1}};
  else
    floor.shape = MeshShape{"", square_mesh(n, 0.095)};
  if (is_moving) {  // along itself, up and down, and about an oblique axis beside it
    floor.motion.resize(3);
    floor.motion[0].velocity = {0.05, 0.02, 0.0};
    floor.motion[1].kind = WallMotion::Kind::vibrate;
    floor.motion[1].amplitude = 1e-5;
    floor.motion[1].frequency = 50.0;
    floor.motion[2].kind = WallMotion::Kind::swing;
    floor.motion[2].origin = {0.02, 0.01, 0.0};
    floor.motion[2].axis = {0.3, 1.0, 2.0};
    floor.motion[2].amplitude = 0.03;
    floor.motion[2].frequency = 4.0;
  }
  scene.walls.push_back(floor);
  add_grain(scene, "grain", radius, {-0.031, 0.002, 3e-3}, {0.7, 0.31, -0.2}, {40, -20, 70});     // bounces
  add_grain(scene, "grain", radius, {0.01, -0.03, 0.999e-3}, {0.2, 0.4, 0.0});                    // slides, then rolls
  add_grain(scene, "grain", radius, {0.0, 0.03, 0.9995e-3}, {-0.3, 0.1, 0.0}, {-100, -300, 20});  // rolls
  add_grain(scene, "grain", radius, {0.05, 0.05, 0.9995e-3});                                     // rests
  if (!is_turned) return scene;
  scene.time.gravity = turned(scene.time.gravity);
  for (GrainSeed& grain : std::get<ListedGrains>(scene.particles[0].fill).grains)
    for (Vec3* v : {&grain.position, &grain.velocity, &grain.angular_velocity}) *v = turned(*v);
  if (n == 0)
    std::get<PlaneShape>(scene.walls[0].shape).normal = turned({0, 0, 1});
  else
    for (Vec3& vertex : std::get<MeshShape>(scene.walls[0].shape).mesh.vertices) vertex = turned(vertex);
  return scene;
}

/// How a grain is sent around a funnel.
struct Orbit {
  double speed;  // [m/s]
  double restitution, friction;
};

/// A grain that circles in a funnel, 0.02 to 0.1 m wide, bouncing, sliding and rolling; a cone (n_facets = 0), or facets with their corners
/// on it.
Scene funnel_scene(const Orbit& orbit, int n_facets) {
  constexpr double low = 0.02, high = 0.1, length = 0.1;
  Scene scene = empty_scene({-0.12, -0.12, -0.05}, {0.12, 0.12, 0.15}, 2e-5);
  scene.time.gravity = {0, 0, -9.81};
  scene.materials = {{"grain", 2500, 1e8, 0.25}};
  PairLaw law = pair_law("grain", "grain", orbit.restitution, orbit.friction);
  law.normal_stiffness = 1000.0;
  law.tangential_stiffness = 300.0;
  scene.contact.pairs = {law};
  WallDefinition funnel;
  funnel.name = "funnel";
  funnel.material = "grain";
  if (n_facets == 0) {
    funnel.shape = ConeShape{{0, 0, 0}, {0, 0, 1}, low, high, length};
  } else {
    const TriangleMesh mesh = shapes::sheet(n_facets, 8, true, [&](double u, double v) {
      const double r = low + (high - low) * v, angle = 2.0 * std::numbers::pi * u;
      return Vec3{r * std::cos(angle), r * std::sin(angle), length * v};
    });
    funnel.shape = MeshShape{"", mesh};
  }
  scene.walls.push_back(funnel);
  add_grain(scene, "grain", 2.0 * radius, {0.08, 0.0, 0.09}, {0.0, orbit.speed, 0.0});
  return scene;
}

/// Two grains that meet obliquely on both sides of the plane x = 0, or one and a mirror there.
Scene mirror_scene(NormalLaw normal, TangentialLaw tangential, bool is_half) {
  Scene scene = empty_scene({is_half ? 0.0 : -0.02, -0.02, -0.02}, {0.02, 0.02, 0.02}, 1e-6);
  scene.materials = {{"grain", 2500, 1e8, 0.25}};
  scene.contact.normal = normal;
  scene.contact.tangential = tangential;
  PairLaw law = pair_law("grain", "grain", 0.6, 0.5);
  if (normal == NormalLaw::linear) law.normal_stiffness = 1e4;
  scene.contact.pairs = {law};
  scene.output.energy = true;
  add_grain(scene, "grain", radius, {1.3e-3, 0, 0}, {-0.8, 0.3, -0.2}, {0, 30, -40});
  if (is_half) {
    WallDefinition mirror;
    mirror.name = "mirror";
    mirror.shape = PlaneShape{{0, 0, 0}, {1, 0, 0}};
    mirror.symmetry = true;
    scene.walls.push_back(mirror);
  } else {
    // a mirror image turns about the normal as the grain does, and about the other axes against it
    add_grain(scene, "grain", radius, {-1.3e-3, 0, 0}, {0.8, 0.3, -0.2}, {0, -30, 40});
  }
  return scene;
}

}  // namespace

TEST_CASE("a plane of 2, 200 or 20000 triangles moves a bouncing, sliding, rolling grain like a plane", "[walls]") {
  struct Choice {
    NormalLaw normal;
    TangentialLaw tangential;
  };
  for (const Choice& laws :
       {Choice{NormalLaw::linear, TangentialLaw::spring}, Choice{NormalLaw::hertz, TangentialLaw::mindlin},
        Choice{NormalLaw::linear, TangentialLaw::power}}) {
    for (const bool is_turned : {false, true}) {
      Simulation plane(floor_scene(laws.normal, laws.tangential, 0, is_turned), 1);
      constexpr int n_steps = 40000;
      for (int i = 0; i < n_steps; ++i) plane.step();
      const State exact = state_of(plane);
      for (const int n : {1, 10, 100}) {
        Simulation mesh(floor_scene(laws.normal, laws.tangential, n, is_turned), 1);
        for (int i = 0; i < n_steps; ++i) mesh.step();
        const State found = state_of(mesh);
        double position = 0.0, velocity = 0.0, spin = 0.0;
        for (std::size_t i = 0; i < exact.position.size(); ++i) {
          position = std::max(position, length(found.position[i] - exact.position[i]) / 0.03);
          velocity = std::max(velocity, length(found.velocity[i] - exact.velocity[i]) / 0.5);
          spin = std::max(spin, length(found.spin[i] - exact.spin[i]) / 500.0);
        }
        report("%s%s: %5d triangles against a plane: positions %.1e, velocities %.1e, spins %.1e (relative)",
               laws.normal == NormalLaw::hertz           ? "Hertz-Mindlin"
               : laws.tangential == TangentialLaw::power ? "linear, power"
                                                         : "linear, spring",
               is_turned ? ", turned" : "", 2 * n * n, position, velocity, spin);
        CHECK(position < 1e-10);
        // turned vertices are rounded, and every impact of a stiff grain amplifies that
        CHECK(velocity < (is_turned ? 2e-9 : 1e-10));
        CHECK(spin < (is_turned ? 2e-9 : 1e-10));
      }
    }
  }
}

TEST_CASE(
    "a grain circles in a funnel of facets as in a cone: what is between the paths falls with the square of their "
    "width",
    "[walls]") {
  constexpr int n_steps = 20000;  // 0.4 s, more than a turn
  double sum_of_orders = 0.0;
  const std::vector<Orbit> orbits = {
      {0.5, 0.5, 0.3}, {0.8, 0.5, 0.3}, {0.5, 0.9, 0.3}, {0.5, 0.5, 0.0}, {0.7, 0.5, 0.6}};
  for (const Orbit& orbit : orbits) {
    std::vector<Vec3> exact;
    Simulation cone(funnel_scene(orbit, 0), 1);
    for (int i = 0; i < n_steps; ++i) {
      if (i % 500 == 0) exact.push_back(state_of(cone).position[0]);
      cone.step();
    }
    std::vector<double> errors;
    for (const int n : {100, 200, 400, 800}) {
      Simulation mesh(funnel_scene(orbit, n), 1);
      double furthest = 0.0;
      for (int i = 0; i < n_steps; ++i) {
        if (i % 500 == 0)
          furthest = std::max(furthest, length(state_of(mesh).position[0] - exact[static_cast<std::size_t>(i / 500)]));
        mesh.step();
      }
      errors.push_back(furthest);
    }
    const double order = std::log2(errors.front() / errors.back()) / 3.0;
    sum_of_orders += order;
    report(
        "funnel, %.1f m/s, restitution %.1f, friction %.1f: off by %.2f, %.2f, %.2f, %.3f mm with 100, 200, 400, 800 "
        "facets",
        orbit.speed, orbit.restitution, orbit.friction, 1e3 * errors[0], 1e3 * errors[1], 1e3 * errors[2],
        1e3 * errors[3]);
    CHECK(errors.back() < 2e-4);  // of a way of some 0.2 m
  }
  const double order = sum_of_orders / static_cast<double>(orbits.size());
  report("funnel: mean order %.2f", order);
  CHECK(order > 1.6);
}

TEST_CASE("a plane of triangles that slides, shakes and turns moves grains as the plane that does so", "[walls]") {
  const auto run = [](int n) {
    Simulation simulation(floor_scene(NormalLaw::linear, TangentialLaw::spring, n, false, true), 1);
    for (int i = 0; i < 40000; ++i) simulation.step();
    return state_of(simulation);
  };
  const State exact = run(0);
  for (const int n : {1, 10, 100}) {
    const State found = run(n);
    double worst = 0.0;
    for (std::size_t i = 0; i < exact.position.size(); ++i)
      worst = std::max({worst, length(found.position[i] - exact.position[i]) / 0.03,
                        length(found.velocity[i] - exact.velocity[i]) / 0.5,
                        length(found.spin[i] - exact.spin[i]) / 500.0});
    report("moving: %5d triangles against a plane: largest difference %.1e (relative)", 2 * n * n, worst);
    CHECK(worst < 1e-10);
  }
}

TEST_CASE("a grain on a mesh of 100,352 triangles looks at as many of them as on one of 200 of the same size",
          "[walls]") {
  const auto count = [](int n) {
    Scene scene = floor_scene(NormalLaw::linear, TangentialLaw::spring, 1, false);
    std::get<MeshShape>(scene.walls[0].shape).mesh = square_mesh(n, 1e-3 * n);
    const Walls walls(scene);
    const std::vector<double> records = {1e-4, 2e-4, radius, radius, 2.3e-3, 1.1e-3, radius, radius};
    WallCandidates found;
    walls.find_candidates(records.data(), 4, 0, 2, 2e-4, 0.0, found);
    return found.triangles.size();
  };
  report("triangles that two grains look at: %zu of 200, %zu of 100,352", count(10), count(224));
  CHECK(count(10) == count(224));
  CHECK(count(224) < 40);
}

TEST_CASE("half of a symmetric collision with a mirror is the whole one", "[walls]") {
  for (const NormalLaw normal : {NormalLaw::linear, NormalLaw::hertz}) {
    const TangentialLaw tangential = normal == NormalLaw::linear ? TangentialLaw::spring : TangentialLaw::mindlin;
    Simulation full(mirror_scene(normal, tangential, false), 1), half(mirror_scene(normal, tangential, true), 1);
    double worst = 0.0, energy = 0.0;
    for (int i = 0; i < 3000; ++i) {
      full.step();
      half.step();
      if (i % 50 != 0) continue;
      const State f = state_of(full), h = state_of(half);
      worst = std::max({worst, length(f.position[0] - h.position[0]) / radius,
                        length(f.velocity[0] - h.velocity[0]) / 0.8, length(f.spin[0] - h.spin[0]) / 50.0});
      energy = std::max(energy, std::abs(0.5 * full.energy().total() - half.energy().total()) / half.energy().initial);
    }
    CHECK(state_of(half).velocity[0].x > 0.1);  // it has bounced
    report("%s: a grain and its mirror against two grains: largest difference %.1e, of the energy %.1e",
           normal == NormalLaw::linear ? "linear" : "Hertz", worst, energy);
    CHECK(worst < 1e-12);
    CHECK(energy < 1e-12);
  }
}

namespace {

/// A heap of grains that do not rotate, with friction between them, falls together in the corner of the planes x = 0 and y = 0: with
/// mirrors there, or with its images in the three other quarters.
Scene heap_scene(bool is_quarter) {
  const double low = is_quarter ? 0.0 : -0.05;
  Scene scene = empty_scene({low, low, -0.01}, {0.05, 0.05, 0.1}, 5e-6);
  scene.time.gravity = {0, 0, -9.81};
  scene.materials = {{"grain", 2500, 0.0, 0.25}};
  scene.contact.tangential = TangentialLaw::power;
  scene.contact.rotation = false;
  PairLaw law = pair_law("grain", "grain", 0.5, 0.6);
  law.normal_stiffness = 2e3;
  scene.contact.pairs = {law};
  add_plane(scene, "floor", "grain", {0, 0, 0}, {0, 0, 1});
  scene.walls.back().frictionless = true;
  for (const int axis : {0, 1}) {
    // grains are held together by the sides, towards the mirrors
    Vec3 point, normal;
    point[axis] = 0.0053;
    normal[axis] = -1.0;
    add_plane(scene, "side " + std::to_string(axis), "grain", point, normal);
    if (!is_quarter) add_plane(scene, "other side " + std::to_string(axis), "grain", -1.0 * point, -1.0 * normal);
    if (!is_quarter) continue;
    WallDefinition mirror;
    mirror.name = "mirror " + std::to_string(axis);
    mirror.shape = PlaneShape{{0, 0, 0}, -1.0 * normal};
    mirror.symmetry = true;
    scene.walls.push_back(mirror);
  }
  for (int quarter = 0; quarter < (is_quarter ? 1 : 4); ++quarter)
    for (int i = 0; i < 16; ++i) {
      const auto shift = [&](int k) {
        return 0.1e-3 * (static_cast<double>((i * 7919 + k * 104729) % 1000) / 500.0 - 1.0);
      };
      const double x = 1.35e-3 + 2.6e-3 * (i % 2) + shift(1), y = 1.35e-3 + 2.6e-3 * (i / 2 % 2) + shift(2);
      add_grain(scene, "grain", radius * (1.0 + 0.1 * (i % 3)),
                {quarter % 2 ? -x : x, quarter / 2 ? -y : y, 1.5e-3 + 2.7e-3 * (i / 4) + shift(3)},
                {quarter % 2 ? 0.2 : -0.2, quarter / 2 ? 0.1 : -0.1, -0.3});
    }
  return scene;
}

}  // namespace

// A grain i and the image j' of another grain are at least x_i + x_j apart, and x_i >= r_i, x_j >= r_j where both keep to their
// side: they could touch only where i and j press on the mirror at the same place, which one of them takes up. So a mirror in which
// grains meet nothing but their own image is that of a symmetric whole.
TEST_CASE("a heap between two mirrors moves as a quarter of the symmetric whole", "[walls]") {
  Simulation whole(heap_scene(false), 1), quarter(heap_scene(true), 1);
  double worst = 0.0;
  for (int i = 0; i < 12000; ++i) {
    whole.step();
    quarter.step();
    if (i % 100 != 0) continue;
    const State w = state_of(whole), q = state_of(quarter);
    for (std::size_t k = 0; k < q.position.size(); ++k)
      worst = std::max(worst, length(w.position[k] - q.position[k]) / radius);
  }
  report("16 grains and two mirrors against 64 grains, 0.06 s: positions differ by at most %.1e radii", worst);
  CHECK(worst < 1e-6);  // round-off, as it grows in a collapsing heap
}
