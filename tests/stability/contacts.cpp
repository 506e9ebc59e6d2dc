// Few grains at the edge: heavy on light, large on small, in a wedge, spinning, hit without end, by walls that change their speed at once,
// in a box that is hardly wider than they are.
#include <optional>

#include "kernels/base/sphere.hpp"
#include "tests/stability/cases.hpp"

using namespace moraine;
using namespace moraine::cases;

namespace {

constexpr double gravity = 9.81;

GrainSeed grain_at(Vec3 position, Vec3 velocity = {}, Vec3 spin = {}) {
  GrainSeed grain;
  grain.position = position;
  grain.velocity = velocity;
  grain.angular_velocity = spin;
  return grain;
}

/// [N] on the wall that a probe of its force looks at.
Vec3 wall_force(Simulation& run, std::size_t probe) {
  const std::vector<double> row = run.probe_row(probe);
  return {row[0], row[1], row[2]};
}

void add_force_probe(Scene& scene, const std::string& wall) {
  add_probe(scene, Probe::Kind::wall_force, "force_" + wall, wall);
}

}  // namespace

TEST_CASE(
    "a grain a hundred times as heavy as the one below it comes to rest on it, each overlap as deep as its load") {
  const double d = 0.01, light = 100.0, heavy = 1e4, stiffness = 1e5;
  Scene s = empty_scene({-0.1, -0.1, 0}, {0.1, 0.1, 0.1}, light, stiffness, 0.5, 0.5);
  s.materials.push_back({"heavy", heavy, 0.0, 0.3});
  for (const char* other : {"grain", "heavy"}) {
    PairLaw law = s.contact.pairs[0];
    law.between = {"heavy", other};
    s.contact.pairs.push_back(law);
  }
  s.time.gravity = {0, 0, -gravity};
  add_grains(s, d, {grain_at({0, 0, 0.5 * d})});
  add_grains(s, d, {grain_at({0, 0, 1.55 * d})}, "heavy");
  add_plane(s, "floor", {0, 0, 0}, {0, 0, 1});
  Simulation run(s, 1);
  advance_past_restart(run, s, static_cast<std::int64_t>(1.0 / run.time_step()));
  const Image image = run.snapshot();
  const double low = vector_of(image, Field::position, 0).z, high = vector_of(image, Field::position, 1).z;
  const double weight = sphere_volume(0.5 * d) * gravity;
  CHECK(largest_speed(run) < 1e-9);
  CHECK((low + d - high) * stiffness == Approx(heavy * weight).epsilon(1e-6));
  CHECK((0.5 * d - low) * stiffness == Approx((heavy + light) * weight).epsilon(1e-6));
}

TEST_CASE(
    "a grain a hundred times as wide, a million times as heavy, rests on four small ones, which bear a quarter each") {
  const double small = 1e-3, large = 0.1, apart = 4e-3, stiffness = 1e5;
  Scene s = empty_scene({-0.1, -0.1, 0}, {0.1, 0.1, 0.2}, 2500.0, stiffness, 0.5, 0.5);
  s.time.gravity = {0, 0, -gravity};
  s.time.damping = 300.0;
  add_grains(s, small,
             {grain_at({apart, 0, 0.5 * small}), grain_at({-apart, 0, 0.5 * small}), grain_at({0, apart, 0.5 * small}),
              grain_at({0, -apart, 0.5 * small})});
  const double reach = 0.5 * (small + large);
  add_grains(s, large, {grain_at({0, 0, 0.5 * small + std::sqrt(reach * reach - apart * apart)})});
  add_plane(s, "floor", {0, 0, 0}, {0, 0, 1});
  add_force_probe(s, "floor");
  Simulation run(s, 1);
  advance_past_restart(run, s, static_cast<std::int64_t>(0.15 / run.time_step()), 1000);
  const double weight = 2500.0 * gravity * (sphere_volume(0.5 * large) + 4 * sphere_volume(0.5 * small));
  const Image before = run.snapshot();
  CHECK(largest_speed(run) < 1e-9);
  CHECK(std::abs(wall_force(run, 0).z) == Approx(weight).epsilon(1e-6));
  for (std::size_t i = 0; i < 4; ++i)
    CHECK((0.5 * small - vector_of(before, Field::position, i).z) * stiffness == Approx(0.25 * weight).epsilon(1e-4));
  advance(run, 20000);
  double creep = 0.0;
  const Image after = run.snapshot();
  for (std::size_t i = 0; i < 5; ++i)
    creep = std::max(creep, length(vector_of(after, Field::position, i) - vector_of(before, Field::position, i)));
  report("under load: creep %.1e m in 20000 steps", creep);
  CHECK(creep < 1e-10);
}

TEST_CASE(
    "a grain in the wedge of two meshes presses on both as the closed form says, with friction within its bounds") {
  const double d = 0.01, stiffness = 1e4, size = 0.1;
  for (const double friction : {0.0, 0.3}) {
    Scene s = empty_scene({-0.1, -0.1, -0.01}, {0.1, 0.1, 0.1}, 2500.0, stiffness, 0.3, friction);
    s.time.gravity = {0, 0, -gravity};
    s.time.damping = 5.0;
    add_grains(s, d, {grain_at({0.004, 0.0, 0.015}, {-0.1, 0.2, -0.2}, {5, 20, -10})});
    for (const double side : {1.0, -1.0}) {  // faces at 45 degrees that meet in the y axis
      TriangleMesh mesh;
      mesh.vertices = {{0, -size, 0}, {side * size, -size, size}, {side * size, size, size}, {0, size, 0}};
      mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
      WallDefinition wall;
      wall.name = side > 0.0 ? "right" : "left";
      wall.material = "grain";
      wall.shape = MeshShape{wall.name + ".stl", mesh};
      s.walls.push_back(wall);
    }
    add_force_probe(s, "right");
    add_force_probe(s, "left");
    Simulation run(s, 1);
    advance_past_restart(run, s, static_cast<std::int64_t>(3.0 / run.time_step()), 1000);
    const double weight = 2500.0 * gravity * sphere_volume(0.5 * d);
    const Vec3 right = wall_force(run, 0), left = wall_force(run, 1);
    report("friction %.1f: the walls bear %.6f of the weight, the right one %.4f", friction,
           std::abs(right.z + left.z) / weight, std::abs(right.z) / weight);
    CHECK(std::abs(right.z + left.z) == Approx(weight).epsilon(1e-4));
    CHECK(std::abs(right.x + left.x) < 1e-4 * weight);
    if (friction > 0.0) continue;
    CHECK(length(right) == Approx(weight / std::numbers::sqrt2).epsilon(1e-4));
    CHECK(length(left) == Approx(weight / std::numbers::sqrt2).epsilon(1e-4));
  }
}

TEST_CASE(
    "a spinning grain on a plane slips, then rolls with two sevenths of its rim's speed; about its contact it spins "
    "on") {
  const double d = 0.01, r = 0.5 * d, mu = 0.3, spin = 100.0, stiffness = 1e5;
  Scene s = empty_scene({-1, -1, 0}, {1, 1, 0.1}, 2500.0, stiffness, 0.5, mu);
  s.time.gravity = {0, 0, -gravity};
  const double sunk = 2500.0 * sphere_volume(0.5 * d) * gravity / stiffness;
  add_grains(s, d, {grain_at({0, 0, r - sunk}, {}, {0, spin, 0}), grain_at({0, 0.1, r - sunk}, {}, {0, 0, spin})});
  add_plane(s, "floor", {0, 0, 0}, {0, 0, 1});
  Simulation run(s, 1);
  const double rolling = 2.0 * r * spin / (7.0 * mu * gravity);  // [s] when slip ends
  advance(run, static_cast<std::int64_t>(0.5 * rolling / run.time_step()));
  Image image = run.snapshot();
  CHECK(vector_of(image, Field::velocity, 0).x == Approx(mu * gravity * run.time()).epsilon(0.01));
  CHECK(vector_of(image, Field::angular_velocity, 0).y ==
        Approx(spin - 2.5 * mu * gravity / r * run.time()).epsilon(0.01));
  advance_past_restart(run, s, static_cast<std::int64_t>(4.5 * rolling / run.time_step()));
  image = run.snapshot();
  CHECK(vector_of(image, Field::velocity, 0).x == Approx(2.0 / 7.0 * r * spin).epsilon(2e-3));
  CHECK(vector_of(image, Field::angular_velocity, 0).y * r == Approx(2.0 / 7.0 * r * spin).epsilon(2e-3));
  CHECK(vector_of(image, Field::angular_velocity, 1).z == Approx(spin).epsilon(1e-12));
  CHECK(length(vector_of(image, Field::velocity, 1)) < 1e-12);
}

TEST_CASE("a wall that changes its speed at once hits grains as a wall that always had it, and the ledger closes") {
  const double d = 0.01;
  for (const double restitution : {0.5, 1.0}) {
    Scene s = empty_scene({-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}, 2500.0, 1e5, restitution, 0.3);
    s.time.steps_per_contact = 200.0;
    s.output.energy = true;
    add_grains(s, d, {grain_at({0, 0, 0.501 * d}), grain_at({0.1, 0, 0.55 * d})});
    add_plane(s, "piston", {0, 0, 0}, {0, 0, 1});
    WallMotion jumps;  // at rest; then up with 1 m/s, down with 5, up with 2
    jumps.places = {{0.0, 0, 0, 0}, {0.01, 0, 0, 0}, {0.02, 0, 0, 0.01}, {0.021, 0, 0, 0.005}, {0.023, 0, 0, 0.009}};
    s.walls[0].motion = {jumps};
    Simulation run(s, 1);
    advance_past_restart(run, s, static_cast<std::int64_t>(0.019 / run.time_step()), 2000);
    Image image = run.snapshot();
    for (std::size_t i = 0; i < 2; ++i)
      CHECK(vector_of(image, Field::velocity, i).z == Approx(1.0 + restitution).epsilon(0.01));
    advance_past_restart(run, s, static_cast<std::int64_t>(0.006 / run.time_step()), 1000);
    image = run.snapshot();
    for (std::size_t i = 0; i < 2; ++i)  // they have flown away from all that
      CHECK(vector_of(image, Field::velocity, i).z == Approx(1.0 + restitution).epsilon(0.01));
    const EnergyLedger ledger = run.energy();
    CHECK(std::abs(ledger.error()) < 0.01 * ledger.wall_work);
  }
}

TEST_CASE("in a periodic box hardly wider than a grain a row passes an impact on as in a wide one") {
  const double d = 0.01;
  const auto last_velocity = [&](double width) {
    Scene s = empty_scene({-0.1, 0, 0}, {0.2, width, width}, 2500.0, 1e4, 0.9, 0.3);
    s.domain.periodic = {false, true, true};
    std::vector<GrainSeed> row{grain_at({-0.02, 0.5 * width, 0.5 * width}, {1, 0.3, -0.2}, {0, 10, 5})};
    for (int i = 0; i < 5; ++i) row.push_back(grain_at({1.001 * d * i, 0.5 * width, 0.5 * width}));
    add_grains(s, d, row);
    s.time.step = 2e-5;
    Simulation run(s, 1);
    advance_past_restart(run, s, 4000);
    return vector_of(run.snapshot(), Field::velocity, 5);
  };
  // A drift of 0.3 m/s takes a grain around the box before it meets the row where that has room; without it all boxes are alike.
  const Vec3 wide = last_velocity(10 * d);
  CHECK(wide.x > 0.1);
  for (const double width : {3.0, 2.0, 1.2, 1.01}) {
    INFO("width " << width << " d");
    CHECK(std::isfinite(last_velocity(width * d).x));
  }
  try {
    last_velocity(1.0 * d);
    FAIL("a grain that touches its own image was taken");
  } catch (const SceneError& error) {
    CHECK(error.problems[0].message.find("periodic") != std::string::npos);
  }
}

namespace {

/// Restitutions of one grain that meets a wall again and again, each time somewhere else between two steps.
struct Series {
  double mean = 0.0, deviation = 0.0, trend = 0.0, trend_error = 0.0;  // the trend: over the whole series
};

/// A grain between two walls, to which its speed is given back in the middle after each bounce.
class Bouncer {
 public:
  explicit Bouncer(Simulation run) : run_(std::move(run)) {}

  static Scene scene(double restitution) {
    Scene s = empty_scene({-0.05, -0.05, -0.05}, {0.05, 0.05, 0.05}, 2500.0, 1e5, restitution, 0.0);
    s.time.steps_per_contact = 20.0;
    add_grains(s, diameter, {grain_at({0, 0, 0}, {speed, 0, 0})});
    add_plane(s, "left", {-0.5 * gap, 0, 0}, {1, 0, 0});
    add_plane(s, "right", {0.5 * gap, 0, 0}, {-1, 0, 0});
    return s;
  }
  /// Restitution of the next bounce.
  double bounce() {
    for (;;) {
      run_.step();
      double* const velocity = static_cast<double*>(run_.view(Field::velocity)->values);
      const double v = velocity[0], x = static_cast<const double*>(run_.view(Field::position)->values)[0];
      if (v * before_ > 0.0 || std::abs(x) > 0.5 * (gap - diameter)) continue;  // still on its way, or touching
      const double value = std::abs(v / before_);
      velocity[0] = before_ = (v > 0.0 ? 1.0 : -1.0) * speed;
      run_.grains_changed();
      return value;
    }
  }
  /// The same, restored from a checkpoint in the middle of the way.
  Bouncer restored(const Scene& scene) const {
    Bouncer other(Simulation(scene, 2, run_.checkpoint()));
    other.before_ = before_;
    return other;
  }
  Hash128 hash() const { return run_.state_hash(); }

 private:
  static constexpr double diameter = 0.01, gap = 0.012, speed = 1.0;
  Simulation run_;
  double before_ = speed;  // velocity at which it came
};

/// `n` bounces; in the middle a second run goes on from a checkpoint for some of them.
Series bounces(int n, double restitution) {
  const Scene scene = Bouncer::scene(restitution);
  Bouncer grain(Simulation(scene, 1));
  Series all;
  double sum = 0.0, squares = 0.0, slope = 0.0;
  std::optional<Bouncer> beside;
  for (int bounce = 0; bounce < n; ++bounce) {
    if (bounce == n / 2) beside.emplace(grain.restored(scene));
    const double value = grain.bounce();
    const double at = (bounce + 0.5) / n - 0.5;
    sum += value, squares += value * value, slope += at * value;
    if (!beside) continue;
    CHECK(beside->bounce() == value);
    CHECK(beside->hash() == grain.hash());
    if (bounce == n / 2 + 10) beside.reset();
  }
  all.mean = sum / n;
  all.deviation = std::sqrt(std::max(0.0, squares / n - all.mean * all.mean));
  all.trend = 12.0 * slope / n;  // of a least-squares line
  all.trend_error = std::sqrt(12.0 / n) * all.deviation;
  return all;
}

void check_bounces(int n) {
  for (const double restitution : {0.3, 0.9, 1.0}) {
    const Series all = bounces(n, restitution);
    report("%d impacts, restitution %.1f: mean %.6f, deviation %.1e, trend %.1e +- %.1e", n, restitution, all.mean,
           all.deviation, all.trend, all.trend_error);
    CHECK(all.mean == Approx(restitution).margin(5e-3));
    CHECK(std::abs(all.trend) < 4.0 * all.trend_error + 1e-9);
  }
}

}  // namespace

TEST_CASE("the restitution of one grain has no trend over thousands of impacts") { check_bounces(2000); }

TEST_CASE("the restitution of one grain has no trend over a million impacts", "[.long][long]") {
  check_bounces(1000000);
}
