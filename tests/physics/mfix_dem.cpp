// The verification cases DEM01 to DEM04 of MFiX (Garg, Galvin, Li & Pannala 2012, Powder Technol. 220, 122; files in
// tests/dem of the MFiX distribution). Known errors of that code are its own regression results.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>

#include "tests/physics/laboratory.hpp"

using namespace moraine;
using namespace moraine::physics;

namespace {

constexpr double gravity = 9.80665;

/// A grain of d 0.2 m, rho 2600 that falls from 0.5 m onto a plane.
struct Drop {
  static constexpr double radius = 0.1, height = 0.5, density = 2600.0;
  double stiffness, restitution;

  double mass() const { return mass_of(density, radius); }
  double frequency() const { return std::sqrt(stiffness / mass()); }
  double damping() const {
    const double log = std::log(restitution);
    return -log / std::sqrt(pi * pi + log * log);
  }
  double contact_time() const { return pi / (frequency() * std::sqrt(1.0 - damping() * damping())); }

  Scene scene(double step) const {
    Scene scene = empty_scene({-1, -1, -1}, {1, 1, 1}, step);
    scene.time.gravity = {0, 0, -gravity};
    scene.run.max_overlap = 1.0;  // the softest grain sinks in by more than half its radius
    scene.materials = {{"grain", density, 0.0, 0.3}};
    scene.contact.tangential = TangentialLaw::none;
    scene.contact.rotation = false;
    PairLaw law = pair_law("grain", "grain", restitution, 0.0);
    law.normal_stiffness = stiffness;
    scene.contact.pairs.push_back(law);
    add_plane(scene, "floor", "grain", {0, 0, 0}, {0, 0, 1});
    add_grain(scene, "grain", radius, {0, 0, height});
    return scene;
  }

  double touch_time() const { return std::sqrt(2.0 * (height - radius) / gravity); }

  /// Height and velocity in contact, `t` after it begins.
  std::array<double, 2> in_contact(double t) const {
    const double w = frequency(), b = damping(), wd = w * std::sqrt(1.0 - b * b), y = gravity / (w * w);
    const double v = -std::sqrt(2.0 * gravity * (height - radius));
    const double c = y, s = (b * w * y + v) / wd, decay = std::exp(-b * w * t);
    const double x = decay * (c * std::cos(wd * t) + s * std::sin(wd * t));
    const double dx = -b * w * x + decay * wd * (-c * std::sin(wd * t) + s * std::cos(wd * t));
    return {radius - y + x, dx};
  }

  /// When the grain leaves the plane, after it touched it: the root of y = radius on the way up.
  double leave_time() const {
    double low = 0.5 * contact_time(), high = 1.5 * contact_time();
    while (in_contact(high)[0] < radius) high += 0.1 * contact_time();
    for (int i = 0; i < 200; ++i) {
      const double middle = 0.5 * (low + high);
      (in_contact(middle)[0] < radius ? low : high) = middle;
    }
    return low;
  }

  /// Exact height until the grain falls back.
  double exact(double t) const {
    if (t < touch_time()) return height - 0.5 * gravity * t * t;
    const double since = t - touch_time(), leave = leave_time();
    if (since < leave) return in_contact(since)[0];
    const double flight = since - leave;
    return radius + in_contact(leave)[1] * flight - 0.5 * gravity * flight * flight;
  }
};

/// Largest error of the height relative to the exact one, from the fall to the top of the rebound.
double drop_error(const Drop& drop, double step) {
  Simulation run(drop.scene(step), 1);
  const double leave = drop.leave_time();
  const double end = drop.touch_time() + leave + drop.in_contact(leave)[1] / gravity;
  double worst = 0.0;
  while (run.time() < end) {
    run.step();
    const double exact = drop.exact(run.time());
    worst = std::max(worst, std::abs(state_of(run).position[0].z - exact) / exact);
  }
  return worst;
}

/// Heights of the first bounces.
std::vector<double> bounce_heights(const Drop& drop, double step, int n) {
  Simulation run(drop.scene(step), 1);
  std::vector<double> tops;
  double before = drop.height, now = drop.height;
  while (static_cast<int>(tops.size()) < n) {
    run.step();
    const double next = state_of(run).position[0].z;
    if (now >= before && now > next && now > drop.radius && run.step_number() > 2) {
      // the top of the parabola through three points
      const double curvature = before - 2.0 * now + next;
      tops.push_back(now - 0.125 * (next - before) * (next - before) / curvature);
    }
    before = now;
    now = next;
  }
  return tops;
}

/// The squeezed pair of DEM03: heights and velocities of both, and their rates.
struct Squeeze {
  static constexpr double radius = 5e-4, gap = 1.8e-3, stiffness = 1e3;
  static constexpr std::array<double, 2> density = {20000.0, 10000.0};
  double restitution;

  static double dashpot(double mass, double stiffness, double restitution) {
    const double log = std::log(restitution);
    return 2.0 * std::sqrt(mass * stiffness) * -log / std::sqrt(pi * pi + log * log);
  }
  using Values = std::array<double, 4>;  // y1, v1, y2, v2
  Values rates(const Values& y) const {
    const double m1 = mass_of(density[0], radius), m2 = mass_of(density[1], radius), reduced = m1 * m2 / (m1 + m2);
    const double low = radius - y[0], high = y[2] + radius - gap, middle = 2.0 * radius - (y[2] - y[0]);
    const double f_low = low > 0 ? stiffness * low - dashpot(m1, stiffness, restitution) * y[1] : 0.0;
    const double f_high = high > 0 ? stiffness * high + dashpot(m2, stiffness, restitution) * y[3] : 0.0;
    const double f_middle =
        middle > 0 ? stiffness * middle - dashpot(reduced, stiffness, restitution) * (y[3] - y[1]) : 0.0;
    return {y[1], (f_low - f_middle) / m1 - gravity, y[3], (f_middle - f_high) / m2 - gravity};
  }
  /// Runge-Kutta of fourth order with steps far below those of the run.
  Values advance(Values y, double time, int n) const {
    const double h = time / n;
    const auto plus = [](const Values& a, const Values& b, double f) {
      return Values{a[0] + f * b[0], a[1] + f * b[1], a[2] + f * b[2], a[3] + f * b[3]};
    };
    for (int i = 0; i < n; ++i) {
      const Values a = rates(y), b = rates(plus(y, a, 0.5 * h)), c = rates(plus(y, b, 0.5 * h)),
                   d = rates(plus(y, c, h));
      for (std::size_t k = 0; k < 4; ++k) y[k] += h / 6.0 * (a[k] + 2.0 * b[k] + 2.0 * c[k] + d[k]);
    }
    return y;
  }

  Scene scene(double step) const {
    Scene scene = empty_scene({-2e-3, -2e-3, -1e-3}, {2e-3, 2e-3, 3e-3}, step);
    scene.time.gravity = {0, 0, -gravity};
    scene.materials = {{"heavy", density[0], 0.0, 0.3}, {"light", density[1], 0.0, 0.3}};
    scene.contact.tangential = TangentialLaw::none;
    scene.contact.rotation = false;
    for (const auto& [a, b] : {std::pair{"heavy", "heavy"}, std::pair{"heavy", "light"}, std::pair{"light", "light"}}) {
      PairLaw law = pair_law(a, b, restitution, 0.0);
      law.normal_stiffness = stiffness;
      scene.contact.pairs.push_back(law);
    }
    add_plane(scene, "floor", "heavy", {0, 0, 0}, {0, 0, 1});
    add_plane(scene, "lid", "heavy", {0, 0, gap}, {0, 0, -1});
    // as given they overlap by exactly a fifth of the radius, the most that a scene may start with
    add_grain(scene, "heavy", radius, {0, 0, start[0]});
    add_grain(scene, "light", radius, {0, 0, start[2]});
    return scene;
  }
  static constexpr Values start = {0.45e-3, 0.0, 1.35e-3 + 1e-15, 0.0};
};

struct SlipToRoll {
  double speed, roll, time;  // u/u0, R w/u0, t_s mu g/u0
};

SlipToRoll slip_to_roll(double friction, double step) {
  constexpr double radius = 5e-4, u0 = 0.1, density = 1e4, stiffness = 1e4;
  Scene scene = empty_scene({-1, -0.01, -0.01}, {1, 0.01, 0.01}, step);
  scene.time.gravity = {0, 0, -gravity};
  scene.materials = {{"grain", density, 0.0, 0.3}};
  PairLaw law = pair_law("grain", "grain", 1.0, friction);
  law.normal_stiffness = stiffness;
  law.tangential_damping = 0.5;
  law.restitution = 0.9;
  scene.contact.pairs.push_back(law);
  add_plane(scene, "floor", "grain", {0, 0, 0}, {0, 0, 1});
  const double overlap = mass_of(density, radius) * gravity / stiffness;
  add_grain(scene, "grain", radius, {0, 0, radius - overlap}, {u0, 0, 0});
  Simulation run(scene, 1);
  const double t_slip = 2.0 * u0 / (7.0 * friction * gravity);
  double slip_before = u0, stop = 0.0;
  while (run.time() < 1.5 * t_slip) {
    run.step();
    const State now = state_of(run);
    const double slip = now.velocity[0].x - radius * now.spin[0].y;
    if (stop == 0.0 && slip <= 0.0)
      stop = run.time() - 0.5 * step - step * slip / (slip - slip_before);  // velocities lie half a step back
    slip_before = slip;
  }
  const State end = state_of(run);
  return {end.velocity[0].x / u0, radius * end.spin[0].y / u0, stop * friction * gravity / u0};
}

}  // namespace

TEST_CASE("MFIX DEM01: a grain falls, touches and rebounds as the closed form says", "[mfix]") {
  // Largest error of the height in MFiX's own results for e = 0.6 to 1, in percent; its steps are 70.7 to a contact.
  struct Row {
    double stiffness, mfix[5];
  };
  constexpr Row rows[] = {{1e4, {5.75, 4.89, 8.25, 12.38, 0.0}},
                          {2.5e4, {1.70, 1.72, 1.79, 1.71, 1.74}},
                          {5e4, {1.03, 1.02, 1.11, 1.07, 1.05}},
                          {1e5, {1.55, 0.81, 0.72, 0.69, 0.70}}};
  double worst_coarse = 0.0, worst_fine = 0.0;  // against MFiX's
  for (const Row& row : rows)
    for (int k = 0; k < 5; ++k) {
      const double restitution = 0.6 + 0.1 * k;
      if (row.mfix[k] == 0.0) continue;  // would sink through the floor
      const Drop drop{row.stiffness, std::min(1.0, restitution)};
      const double coarse = 100 * drop_error(drop, drop.contact_time() / 70.7),
                   fine = 100 * drop_error(drop, drop.contact_time() / 200.0);
      report(
          "DEM01 k %.3g e %.1f: largest error of the height %.3f %% with MFiX's step (MFiX %.2f), %.3f %% at 200 steps "
          "a contact",
          row.stiffness, restitution, coarse, row.mfix[k], fine);
      worst_coarse = std::max(worst_coarse, coarse / row.mfix[k]);
      worst_fine = std::max(worst_fine, fine / row.mfix[k]);
    }
  report("DEM01 worst error over MFiX's: %.2f with its step, %.2f at 200 steps a contact", worst_coarse, worst_fine);
  CHECK(worst_coarse < 0.6);
  CHECK(worst_fine < 0.2);
}

TEST_CASE("MFIX DEM02: bounces reach the heights of a hard grain as the stiffness grows", "[mfix]") {
  for (const double steps_per_contact : {50.0, 200.0}) {
    double last_error = infinity;
    for (const double stiffness : {5e4, 5e5, 5e6}) {
      double first = 0.0, from_soft = 0.0;
      for (const double restitution : {0.5, 0.6, 0.7, 0.8, 0.9, 1.0}) {
        const Drop drop{stiffness, restitution};
        const std::vector<double> tops = bounce_heights(drop, drop.contact_time() / steps_per_contact, 1);
        const double hard = drop.radius + (drop.height - drop.radius) * restitution * restitution;
        const double up = drop.in_contact(drop.leave_time())[1], soft = drop.radius + 0.5 * up * up / gravity;
        first = std::max(first, std::abs(tops[0] - hard) / hard);
        from_soft = std::max(from_soft, std::abs(tops[0] - soft) / soft);
      }
      report(
          "DEM02 k %.0e, %3.0f steps a contact: first bounce within %.3f %% of the hard grain's, %.3f %% of the exact "
          "height",
          stiffness, steps_per_contact, 100 * first, 100 * from_soft);
      CHECK(first < last_error);
      CHECK(from_soft < (steps_per_contact > 100.0 ? 2e-4 : 1.5e-3));
      last_error = first;
    }
    CHECK(last_error < 0.007);  // 0.67 % is the softness of the spring itself; MFiX 0.16 to 0.70 %
  }
}

TEST_CASE("MFIX DEM02: every bounce keeps the restitution", "[mfix]") {
  for (const double restitution : {0.8, 0.9, 1.0}) {
    const Drop drop{5e6, restitution};
    const std::vector<double> tops = bounce_heights(drop, drop.contact_time() / 100.0, 6);
    double worst = 0.0;
    for (std::size_t k = 0; k < tops.size(); ++k) {
      const double hard =
          drop.radius + (drop.height - drop.radius) * std::pow(restitution, 2.0 * static_cast<double>(k + 1));
      worst = std::max(worst, std::abs(tops[k] - hard) / hard);
    }
    report("DEM02 e %.1f: six bounces within %.3f %% of h_k = r + (h - r) e^2k", restitution, 100 * worst);
    CHECK(worst < 0.01);
  }
}

TEST_CASE("MFIX DEM03: two stacked grains squeezed in a gap move as the two-body equation says", "[mfix]") {
  for (const double restitution : {0.5, 0.6, 0.7, 0.8, 0.9, 1.0}) {
    const Squeeze squeeze{restitution};
    const double contact = pi * std::sqrt(mass_of(1e4, Squeeze::radius) * 2.0 / 3.0 / Squeeze::stiffness);
    double errors[2] = {0.0, 0.0};
    for (const int half : {0, 1}) {
      const double step = contact / (half ? 100.0 : 50.0);
      Simulation run(squeeze.scene(step), 1);
      Squeeze::Values exact = Squeeze::start;
      while (run.time() < 1e-3) {
        run.step();
        exact = squeeze.advance(exact, step, 20);
        const State now = state_of(run);
        errors[half] = std::max({errors[half], std::abs(now.position[0].z - exact[0]) / exact[0],
                                 std::abs(now.position[1].z - exact[2]) / exact[2]});
      }
    }
    report(
        "DEM03 e %.1f: largest error of the heights %.4f %% at 50 steps a contact, %.4f %% at 100 (MFiX 0.002 to 0.087 "
        "%%)",
        restitution, 100 * errors[0], 100 * errors[1]);
    CHECK(errors[0] < 8.7e-4);
    CHECK(errors[1] < 0.7 * errors[0]);
  }
}

TEST_CASE("MFIX DEM04: a grain thrown on a rough plane slips, then rolls at 5/7 of its speed", "[mfix]") {
  double worst_speed = 0.0, worst_time = 0.0;
  for (const double friction : {0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0}) {
    const SlipToRoll end = slip_to_roll(friction, 2e-6);
    const double speed = std::max(std::abs(end.speed / (5.0 / 7.0) - 1.0), std::abs(end.roll / (5.0 / 7.0) - 1.0));
    const double time = std::abs(end.time / (2.0 / 7.0) - 1.0);
    report("DEM04 mu %.1f: u/u0 %.6f, R w/u0 %.6f (5/7 = 0.714286), t mu g/u0 %.6f (2/7 = 0.285714)", friction,
           end.speed, end.roll, end.time);
    worst_speed = std::max(worst_speed, speed);
    worst_time = std::max(worst_time, time);
  }
  report("DEM04 worst: speed and spin %.4f %% (MFiX 0.04), time %.3f %% (MFiX 0.57)", 100 * worst_speed,
         100 * worst_time);
  CHECK(worst_speed < 4e-4);
  CHECK(worst_time < 5.7e-3);
}
