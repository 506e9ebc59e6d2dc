// The benchmark tests 1 to 4 of Chung & Ooi (2011), Granular Matter 13, 643: elastic impacts against Hertz's theory, restitution,
// and oblique impacts against the experiment of Kharaz, Gorham & Salman (2001), Powder Technol. 120, 281.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "tests/physics/laboratory.hpp"

using namespace moraine;
using namespace moraine::physics;

namespace {

struct Material3 {
  double density, young, poisson;
};

/// A grain with Hertz-Mindlin contacts over a wall of material "wall".
Scene impact_scene(const Material3& grain, const Material3& wall, double restitution, double friction, double step) {
  Scene scene = empty_scene({-1, -1, -1}, {1, 1, 1}, step);
  scene.materials = {{"grain", grain.density, grain.young, grain.poisson},
                     {"wall", wall.density, wall.young, wall.poisson}};
  scene.contact.normal = NormalLaw::hertz;
  scene.contact.tangential = TangentialLaw::mindlin;
  scene.contact.pairs = {pair_law("grain", "grain", restitution, friction),
                         pair_law("grain", "wall", restitution, friction)};
  return scene;
}

struct Curve {
  std::vector<std::vector<double>> force_of_time;     // [s], [N]
  std::vector<std::vector<double>> force_of_overlap;  // [m], [N], while it loads
  double max_force = 0.0, max_overlap = 0.0, duration = 0.0;
};

/// Runs an impact along z that begins at time 0; `overlap` tells how deep the grains are in each other.
template <typename Overlap>
Curve impact(const Scene& scene, double end, Overlap overlap) {
  Simulation run(scene, 1);
  Curve curve;
  const double dt = *scene.time.step;
  State before = state_of(run);
  double last = 0.0, earlier = 0.0;
  while (run.time() < end) {
    run.step();
    const State now = state_of(run);
    const double t = run.time() - dt, force = length(now.force[0]), depth = std::max(0.0, overlap(before));
    curve.force_of_time.push_back({t, force});
    if (force > curve.max_force) curve.force_of_overlap.push_back({depth, force});
    // the top of the parabola through three values, for what lies between the steps
    const double curvature = earlier - 2.0 * last + force;
    const double top = last > earlier && last >= force && curvature < 0.0
                           ? last - 0.125 * (force - earlier) * (force - earlier) / curvature
                           : force;
    curve.max_force = std::max(curve.max_force, top);
    curve.max_overlap = std::max(curve.max_overlap, depth);
    const double now_depth = overlap(now);
    if (depth > 0.0 && now_depth <= 0.0) curve.duration = t + dt * depth / (depth - now_depth);
    earlier = last;
    last = force;
    before = now;
  }
  return curve;
}

/// Largest difference between digitised points (in given units) and the curve, in percent of the largest force.
double worst_difference(const std::string& file, const std::vector<std::vector<double>>& curve, double x_unit,
                        double max_force) {
  double worst = 0.0;
  for (const std::vector<double>& point : read_numbers(data_file(file))) {
    const double x = point[0] * x_unit;
    if (x > curve.back()[0]) continue;
    worst = std::max(worst, std::abs(interpolate(curve, x) - 1e3 * point[1]));
  }
  return 100.0 * worst / max_force;
}

/// Rows of the oblique impact data: quantity, series, angle, value.
struct ObliquePoint {
  std::string quantity, series;
  double angle, value;
};
std::vector<ObliquePoint> oblique_data() {
  std::ifstream in(data_file("chung_ooi/test4_oblique.csv"));
  std::vector<ObliquePoint> points;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    ObliquePoint p;
    std::string angle, value;
    std::getline(words, p.quantity, ',');
    std::getline(words, p.series, ',');
    std::getline(words, angle, ',');
    std::getline(words, value, ',');
    p.angle = std::stod(angle);
    p.value = std::stod(value);
    points.push_back(p);
  }
  return points;
}

struct Oblique {
  double tangential_restitution, spin, rebound;  // [-], [rad/s], angle of the contact patch [degrees]
};

constexpr double oxide_radius = 2.5e-3, oblique_speed = 3.9, oblique_friction = 0.092, oblique_restitution = 0.98;

Oblique oblique_impact(double angle, const Material3& plate) {
  const double a = angle * pi / 180.0, vn = oblique_speed * std::cos(a), vt = oblique_speed * std::sin(a);
  Scene scene = impact_scene({4000, 380e9, 0.23}, plate, oblique_restitution, oblique_friction, 2e-8);
  add_plane(scene, "plate", "wall", {0, 0, 0}, {0, 0, 1});
  add_grain(scene, "grain", oxide_radius, {0, 0, oxide_radius + 2.3 * vn * 2e-8}, {vt, 0, -vn});
  Simulation run(scene, 1);
  for (int i = 0; i < 100 || state_of(run).position[0].z < oxide_radius; ++i) run.step();
  const State end = state_of(run);
  const double vt_out = end.velocity[0].x, w = end.spin[0].y;
  // Spin is about y, forward rolling positive here; the data count it negative. The rebound angle is that of the patch.
  return {vt_out / vt, -w, std::atan((vt_out - oxide_radius * w) / end.velocity[0].z) * 180.0 / pi};
}

}  // namespace

TEST_CASE("Chung-Ooi 1: two glass spheres head on follow Hertz", "[chung-ooi]") {
  const double radius = 0.01, speed = 10.0, dt = 40.34e-6 / 400.0;
  Scene scene = impact_scene({2800, 48e9, 0.2}, {2800, 48e9, 0.2}, 1.0, 0.35, dt);
  add_grain(scene, "grain", radius, {0, 0, -radius}, {0, 0, speed});
  add_grain(scene, "grain", radius, {0, 0, radius}, {0, 0, -speed});
  const Curve curve =
      impact(scene, 42e-6, [&](const State& s) { return 2 * radius - length(s.position[1] - s.position[0]); });
  const double force = 100 * std::abs(curve.max_force / 10696.9 - 1),
               depth = 100 * std::abs(curve.max_overlap / 274.11e-6 - 1);
  const double time = 100 * std::abs(curve.duration / 40.340e-6 - 1);
  report("test 1: F_max %.2f N (%.4f %%), overlap %.3f um (%.4f %%), contact %.3f us (%.4f %%)", curve.max_force, force,
         1e6 * curve.max_overlap, depth, 1e6 * curve.duration, time);
  CHECK(force < 0.02);
  CHECK(depth < 0.02);
  CHECK(time < 0.05);
  const double of_time = worst_difference("chung_ooi/test1_F_vs_t.csv", curve.force_of_time, 1e-6, curve.max_force);
  const double of_overlap =
      worst_difference("chung_ooi/test1_F_vs_delta.csv", curve.force_of_overlap, 1e-6, curve.max_force);
  report("test 1 against the digitised curves: F(t) within %.2f %%, F(delta) within %.2f %% of F_max", of_time,
         of_overlap);
  CHECK(of_time < 1.5);
  CHECK(of_overlap < 1.5);
}

TEST_CASE("Chung-Ooi 2: an aluminium sphere on a rigid plane follows Hertz", "[chung-ooi]") {
  const double radius = 0.1, dt = 731.66e-6 / 400.0;
  Scene scene = impact_scene({2699, 70e9, 0.3}, {0, 1e18, 0.3}, 1.0, 0.0, dt);
  add_plane(scene, "plane", "wall", {0, 0, 0}, {0, 0, 1});
  add_grain(scene, "grain", radius, {0, 0, radius}, {0, 0, -0.2});
  const Curve curve = impact(scene, 760e-6, [&](const State& s) { return radius - s.position[0].z; });
  const double force = 100 * std::abs(curve.max_force / 11369.9 - 1),
               depth = 100 * std::abs(curve.max_overlap / 49.717e-6 - 1);
  const double time = 100 * std::abs(curve.duration / 731.66e-6 - 1);
  report("test 2: F_max %.2f N (%.4f %%), overlap %.4f um (%.4f %%), contact %.3f us (%.4f %%)", curve.max_force, force,
         1e6 * curve.max_overlap, depth, 1e6 * curve.duration, time);
  CHECK(force < 0.02);
  CHECK(depth < 0.02);
  CHECK(time < 0.05);
  const double of_time = worst_difference("chung_ooi/test2_F_vs_t.csv", curve.force_of_time, 1e-6, curve.max_force);
  const double of_overlap =
      worst_difference("chung_ooi/test2_F_vs_delta.csv", curve.force_of_overlap, 1e-6, curve.max_force);
  report("test 2 against the digitised curves: F(t) within %.2f %%, F(delta) within %.2f %% of F_max", of_time,
         of_overlap);
  CHECK(of_time < 1.5);
  CHECK(of_overlap < 1.5);
}

TEST_CASE("Chung-Ooi 3: restitution comes out as it goes in", "[chung-ooi]") {
  double worst = 0.0;
  for (const double e : {0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0}) {
    const double dt = 1e-8;
    Scene scene = impact_scene({4000, 380e9, 0.23}, {4000, 380e9, 0.23}, e, 0.0, dt);
    add_plane(scene, "plate", "wall", {0, 0, 0}, {0, 0, 1});
    add_grain(scene, "grain", oxide_radius, {0, 0, oxide_radius + 2.3 * 3.9 * dt}, {0, 0, -3.9});
    Simulation run(scene, 1);
    for (int i = 0; i < 10000; ++i) run.step();
    const double out = state_of(run).velocity[0].z / 3.9;
    report("test 3: e in %.2f, out %.5f", e, out);
    worst = std::max(worst, std::abs(out - e));
  }
  CHECK(worst < 1e-3);  // known codes: 0.198, 0.500, 0.801 for 0.2, 0.5, 0.8
}

TEST_CASE("Chung-Ooi 4: oblique impacts rebound as measured, and slide as Coulomb says", "[chung-ooi]") {
  const Material3 oxide{4000, 380e9, 0.23};
  const double mu = oblique_friction, e = oblique_restitution;
  double worst_sliding = 0.0;
  for (const double angle : {50.0, 60.0, 70.0, 80.0, 85.0}) {
    const double a = angle * pi / 180.0, exact = 1.0 - mu * (1.0 + e) / std::tan(a);
    const double spin = 2.5 * mu * (1.0 + e) * oblique_speed * std::cos(a) / oxide_radius;
    const Oblique out = oblique_impact(angle, oxide);
    worst_sliding =
        std::max({worst_sliding, std::abs(out.tangential_restitution / exact - 1.0), std::abs(-out.spin / spin - 1.0)});
  }
  report("test 4: gross sliding branch within %.4f %% of 1 - mu (1 + e)/tan(theta)", 100 * worst_sliding);
  CHECK(worst_sliding < 4e-3);  // the arm of friction ends at the contact, not at the radius
  double worst_restitution = 0.0, worst_experiment = 0.0, worst_rebound = 0.0, worst_spin = 0.0,
         worst_measured_spin = 0.0;
  for (const ObliquePoint& point : oblique_data()) {
    if (point.series == "AlAlloy" || point.angle < 4.9) continue;
    const Oblique out = oblique_impact(point.angle, oxide);
    const double value = point.quantity == "et"      ? out.tangential_restitution
                         : point.quantity == "omega" ? out.spin
                                                     : out.rebound;
    report("test 4 %-7s %-10s at %6.2f degrees: %9.4f, data %9.4f", point.quantity.c_str(), point.series.c_str(),
           point.angle, value, point.value);
    if (point.quantity == "et") {
      double& worst = point.series == "Experiment" ? worst_experiment : worst_restitution;
      worst = std::max(worst, std::abs(value / point.value - 1.0));
    } else if (point.quantity == "omega") {
      // of the largest spin; the experiment's point at 5.9 degrees stands apart from theory and from Chung & Ooi alike
      double& worst = point.series == "Experiment" ? worst_measured_spin : worst_spin;
      if (point.series != "Experiment" || point.angle > 6.0)
        worst = std::max(worst, std::abs(value - point.value) / 617.0);
    } else {
      worst_rebound = std::max(worst_rebound, std::abs(value - point.value) / 90.0);
    }
  }
  report(
      "test 4: tangential restitution within %.2f %% of Chung & Ooi's, %.2f %% of the experiment; spin within %.1f and "
      "%.1f %% of "
      "the largest; rebound angle within %.2f %% of 90 degrees",
      100 * worst_restitution, 100 * worst_experiment, 100 * worst_spin, 100 * worst_measured_spin,
      100 * worst_rebound);
  CHECK(worst_restitution < 0.10);
  CHECK(worst_experiment < 0.10);
  CHECK(worst_rebound < 0.10);
  CHECK(worst_spin < 0.05);
  CHECK(worst_measured_spin < 0.10);
}
