// Cohesion: force over gap, pull-off, rupture and sticking against closed forms.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <functional>

#include "tests/physics/laboratory.hpp"

using namespace moraine;
using namespace moraine::physics;

namespace {

constexpr double radius = 1e-3, density = 2500.0;

/// Two grains (or a grain and a plane) along x, the first of which moves.
Scene two_bodies(CohesionLaw cohesion, NormalLaw normal, bool at_wall, double gap, double speed, double step,
                 double restitution = 1.0) {
  Scene scene = empty_scene({-0.02, -0.02, -0.02}, {0.02, 0.02, 0.02}, step);
  scene.output.fields = {"position", "velocity", "force"};
  scene.output.energy = true;
  scene.materials = {{"grain", density, 1e7, 0.25}};
  scene.contact.normal = normal;
  scene.contact.tangential = normal == NormalLaw::linear ? TangentialLaw::spring : TangentialLaw::mindlin;
  scene.contact.cohesion = cohesion;
  PairLaw law = pair_law("grain", "grain", restitution, 0.0);
  if (normal == NormalLaw::linear) law.normal_stiffness = 1000.0;
  scene.contact.pairs = {law};
  if (at_wall) {
    add_plane(scene, "wall", "grain", {0, 0, 0}, {1, 0, 0});
    add_grain(scene, "grain", radius, {radius + gap, 0, 0}, {speed, 0, 0});
  } else {
    add_grain(scene, "grain", radius, {radius + 0.5 * gap, 0, 0}, {0.5 * speed, 0, 0});
    add_grain(scene, "grain", radius, {-radius - 0.5 * gap, 0, 0}, {-0.5 * speed, 0, 0});
  }
  return scene;
}

double reduced_young() { return 0.5 * 1e7 / (1.0 - 0.25 * 0.25); }
double reduced_radius(bool at_wall) { return at_wall ? radius : 0.5 * radius; }
double reduced_mass(bool at_wall) { return (at_wall ? 1.0 : 0.5) * mass_of(density, radius); }

double gap_of(const State& s, bool at_wall) {
  return at_wall ? s.position[0].x - radius : s.position[0].x - s.position[1].x - 2.0 * radius;
}

/// Pulls the bodies apart at a speed that stays (they are so heavy) and calls f(gap, force on the first towards the other).
void pull_apart(Scene scene, bool at_wall, double until, const std::function<void(double, double)>& f) {
  scene.materials[0].density = 1e15;
  scene.output.energy = false;
  Simulation run(scene, 1);
  double gap = gap_of(state_of(run), at_wall);
  while (gap < until) {
    run.step();
    const State state = state_of(run);
    f(gap, -state.force[0].x);  // forces belong to the positions before the step
    gap = gap_of(state, at_wall);
  }
}

double integral(const std::function<double(double)>& f, double low, double high) {
  constexpr int n = 20000;
  double sum = 0.0;
  for (int i = 0; i < n; ++i) sum += f(low + (i + 0.5) * (high - low) / n);
  return sum * (high - low) / n;
}

}  // namespace

TEST_CASE("a JKR contact pulls as Johnson, Kendall and Roberts say, at most 3/2 pi W R*, and tears off beyond contact",
          "[cohesion]") {
  const double w = 0.5, young = reduced_young();
  for (const bool at_wall : {false, true}) {
    const double r = reduced_radius(at_wall);
    Scene scene = two_bodies(CohesionLaw::jkr, NormalLaw::hertz, at_wall, -4e-6, 2e-3, 1e-6);
    scene.contact.pairs[0].work_of_adhesion = w;
    const double pull_off = 1.5 * pi * w * r;
    const double a_break = std::cbrt(pi * w * r * r / (8.0 * young));  // d(overlap)/da = 0
    const auto gap_of_a = [&](double a) { return -(a * a / r - std::sqrt(2.0 * pi * w * a / young)); };
    double worst = 0.0, largest = 0.0, last = 0.0, touch = -1.0;
    pull_apart(scene, at_wall, 2.0 * gap_of_a(a_break), [&](double gap, double pull) {
      if (pull == 0.0) return;
      last = gap;
      largest = std::max(largest, pull);
      double low = a_break, high = 20.0 * a_break;  // the contact radius that belongs to this gap
      for (int i = 0; i < 100; ++i) (gap_of_a(0.5 * (low + high)) > gap ? low : high) = 0.5 * (low + high);
      const double a = low,
                   expected = std::sqrt(8.0 * pi * w * young * a * a * a) - 4.0 * young * a * a * a / (3.0 * r);
      worst = std::max(worst, std::abs(pull - expected) / pull_off);
      if (touch < 0.0 && gap > 0.0) touch = pull;
    });
    report(
        "%s: force within %.1e of the pull-off force; that is %.6f of 3/2 pi W R*; tears off at %.4f of its range; at "
        "no overlap %.4f (8/9)",
        at_wall ? "grain and plane" : "two grains", worst, largest / pull_off, last / gap_of_a(a_break),
        touch / pull_off);
    CHECK(worst < 1e-6);
    CHECK(largest == Approx(pull_off).epsilon(1e-4));
    CHECK(last == Approx(gap_of_a(a_break)).epsilon(2e-3));
    CHECK(touch == Approx(8.0 / 9.0 * pull_off).epsilon(2e-3));
  }
}

TEST_CASE("an elastic JKR impact loses 7.09 (W^5 R*^4/E*^2)^(1/3) and sticks below it", "[cohesion]") {
  // Thornton & Ning (1998), equation 70
  const double w = 0.2;
  for (const bool at_wall : {false, true}) {
    const double lost =
        7.09 * std::cbrt(std::pow(w, 5.0) * std::pow(reduced_radius(at_wall), 4.0) / std::pow(reduced_young(), 2.0));
    const double sticking = std::sqrt(2.0 * lost / reduced_mass(at_wall));
    for (const double speed : {0.9 * sticking, 1.5 * sticking, 4.0 * sticking}) {
      Scene scene = two_bodies(CohesionLaw::jkr, NormalLaw::hertz, at_wall, 1e-8, -speed, 1e-7);
      scene.contact.pairs[0].work_of_adhesion = w;
      Simulation run(scene, 1);
      double gap = 0.0;
      for (int i = 0; i < 40000; ++i) {
        run.step();
        if (i % 200 == 0 && (gap = gap_of(state_of(run), at_wall)) > 2e-5) break;
      }
      const EnergyLedger ledger = run.energy();
      const double before = 0.5 * reduced_mass(at_wall) * speed * speed;
      report("%s at %.1f of the sticking speed: gap %.1e m, restitution^2 %.4f (%.4f), ledger open by %.1e",
             at_wall ? "plane" : "grains", speed / sticking, gap, ledger.kinetic / before,
             std::max(0.0, 1.0 - lost / before), ledger.error() / before);
      if (speed < sticking) {
        CHECK(gap < 1e-5);
      } else {
        CHECK(gap > 2e-5);
        CHECK(ledger.kinetic == Approx(before - lost).epsilon(0.005));
        CHECK(ledger.lost_normal == Approx(lost).epsilon(0.005));
      }
      CHECK(std::abs(ledger.error()) < 0.005 * before);
    }
  }
}

TEST_CASE("a liquid bridge pulls as Willett et al. say, breaks at (1 + theta/2) V^(1/3), and forms on touch only",
          "[cohesion]") {
  const double tension = 0.072, angle = 0.5, volume = 1e-12;
  const double rupture = (1.0 + 0.5 * angle) * std::cbrt(volume);
  for (const NormalLaw normal : {NormalLaw::linear, NormalLaw::hertz})
    for (const bool at_wall : {false, true}) {
      const double r = 2.0 * reduced_radius(at_wall), f_0 = 2.0 * pi * r * tension * std::cos(angle);
      const auto expected = [&](double gap) {
        const double s = std::max(gap, 0.0) * std::sqrt(r / volume);
        return f_0 / (1.0 + 1.05 * s + 2.5 * s * s);
      };
      Scene scene = two_bodies(CohesionLaw::liquid_bridge, normal, at_wall, -1e-7, 5e-2, 1e-6);
      PairLaw& law = scene.contact.pairs[0];
      law.surface_tension = tension;
      law.contact_angle = angle;
      law.liquid_volume = volume;
      double worst = 0.0, last = 0.0;
      pull_apart(scene, at_wall, 1.2 * rupture, [&](double gap, double pull) {
        if (pull == 0.0 || gap < 0.0) return;
        worst = std::max(worst, std::abs(pull - expected(gap)) / f_0);
        last = gap;
      });
      CHECK(worst < 1e-9);
      CHECK(last == Approx(rupture).epsilon(1e-3));

      // An elastic impact loses the work that it takes to draw the bridge out, and comes in without one.
      const double lost = integral(expected, 0.0, rupture), speed = std::sqrt(2.0 * 1.6 * lost / reduced_mass(at_wall));
      Scene impact = two_bodies(CohesionLaw::liquid_bridge, normal, at_wall, 0.5 * rupture, -speed, 2e-7);
      impact.contact.pairs = scene.contact.pairs;
      Simulation run(impact, 1);
      run.step();
      CHECK(state_of(run).force[0] == Vec3{});
      while (gap_of(state_of(run), at_wall) < 1.1 * rupture && run.step_number() < 100000)
        for (int i = 0; i < 50; ++i) run.step();
      const EnergyLedger ledger = run.energy();
      report(
          "%s, %s: force within %.1e; breaks at %.5f of (1 + theta/2) V^(1/3); an impact loses %.5f of the work to "
          "rupture, ledger open by %.1e",
          normal == NormalLaw::linear ? "linear" : "Hertz", at_wall ? "grain and plane" : "two grains", worst,
          last / rupture, (1.6 * lost - ledger.kinetic) / lost, ledger.error() / lost);
      CHECK(1.6 * lost - ledger.kinetic == Approx(lost).epsilon(0.01));
      CHECK(std::abs(ledger.error()) < 0.01 * lost);
    }
}

TEST_CASE("linear cohesion draws over its range without a loss and holds grains together", "[cohesion]") {
  const double force = 1e-3, range = 1e-4;
  for (const bool at_wall : {false, true}) {
    Scene scene = two_bodies(CohesionLaw::linear, NormalLaw::linear, at_wall, -1e-7, 5e-2, 1e-6);
    scene.contact.pairs[0].cohesion_force = force;
    scene.contact.pairs[0].cohesion_range = range;
    double worst = 0.0;
    pull_apart(scene, at_wall, 1.3 * range, [&](double gap, double pull) {
      if (gap > 0.0) worst = std::max(worst, std::abs(pull - force * std::max(0.0, 1.0 - gap / range)) / force);
    });
    CHECK(worst < 1e-9);
    // Started at a gap, bodies fall together and swing back to it.
    Scene swing = two_bodies(CohesionLaw::linear, NormalLaw::linear, at_wall, 0.5 * range, 0.0, 1e-7);
    swing.contact.pairs = scene.contact.pairs;
    Simulation run(swing, 1);
    double widest = 0.0, narrowest = 1.0;
    for (int i = 0; i < 100000; ++i) {
      run.step();
      if (i < 50000 || i % 20 != 0) continue;
      const double gap = gap_of(state_of(run), at_wall);
      widest = std::max(widest, gap);
      narrowest = std::min(narrowest, gap);
    }
    const double well = 0.5 * force * range;
    const EnergyLedger ledger = run.energy();
    report("%s: swings from %.2e to %.5f of its start; ledger open by %.1e of the well's depth",
           at_wall ? "plane" : "grains", narrowest, widest / (0.5 * range), ledger.error() / well);
    CHECK(narrowest < 0.0);
    CHECK(widest == Approx(0.5 * range).epsilon(0.02));
    CHECK(std::abs(ledger.error()) < 0.01 * well);
  }
}

TEST_CASE("simplified JKR pulls by its energy density times the circle of contact", "[cohesion]") {
  const double k = 2e5;
  for (const bool at_wall : {false, true}) {
    Scene scene = two_bodies(CohesionLaw::sjkr, NormalLaw::hertz, at_wall, -4e-6, 1e-3, 1e-6);
    scene.contact.pairs[0].cohesion_energy_density = k;
    double worst = 0.0, largest = 0.0;
    pull_apart(scene, at_wall, 1e-7, [&](double gap, double pull) {
      const double overlap = std::max(-gap, 0.0), r = reduced_radius(at_wall);
      const double half = at_wall ? radius - overlap : radius - 0.5 * overlap;
      const double expected =
          k * pi * (radius * radius - half * half) - 4.0 / 3.0 * reduced_young() * std::sqrt(r * overlap) * overlap;
      worst = std::max(worst, std::abs(pull - expected) / (k * pi * 2.0 * radius * 4e-6));
      largest = std::max(largest, pull);
    });
    CHECK(worst < 1e-9);
    CHECK(largest > 0.0);
  }
}

TEST_CASE("Coulomb's limit knows the adhesion: a weightless grain that sticks to a plane holds against a side force",
          "[cohesion]") {
  // Thornton (1991): mu (F_n + 2 F_c) with JKR; the others press as hard as they pull.
  const double mu = 0.4, w = 0.2, pull_off = 1.5 * pi * w * radius;
  for (const double share : {0.9, 1.1}) {
    Scene scene = two_bodies(CohesionLaw::jkr, NormalLaw::hertz, true, -1e-6, 0.0, 2e-7, 0.3);
    scene.contact.rotation = false;
    scene.contact.pairs[0].friction = mu;
    scene.contact.pairs[0].work_of_adhesion = w;
    scene.time.gravity = {0, share * mu * 2.0 * pull_off / mass_of(density, radius), 0};
    scene.time.damping = 300.0;
    Simulation run(scene, 1);
    for (int i = 0; i < 40000; ++i) run.step();
    const double moved = state_of(run).position[0].y;
    report("side force %.1f of 2 mu F_c: moved %.2e radii", share, moved / radius);
    if (share < 1.0)
      CHECK(moved < 0.02 * radius);
    else
      CHECK(moved > 0.05 * radius);
  }
}
