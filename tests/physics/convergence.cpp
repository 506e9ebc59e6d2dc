// Oblique impacts against steps per contact, from 5 to 160: the order in which their error falls, for each tangential law. Straight ones are
// in restitution.cpp; bench/scenes/convergence makes the whole table.
//
// Second order where friction slides throughout with the linear normal law, and where nothing damps; first where a dashpot reads
// velocities half a step late in a contact that sticks, and where Hertz's dashpot, which is only continuous, decides (kernels/contact/README.md).
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "tests/physics/laboratory.hpp"

using namespace moraine;
using namespace moraine::physics;

namespace {

// The grain and plate of Chung & Ooi (2011), tests 3 and 4, but slow: overlaps do not shorten the arm of friction, which would be another
// error of first order, a hundredth of the overlap over the radius.
constexpr double radius = 2.5e-3, density = 4000.0, young = 380e9, poisson = 0.23, friction = 0.092, speed = 0.039;
constexpr double angles[] = {5.0, 20.0, 60.0};  // [degrees] from the normal: sticks; slides in part; slides throughout
constexpr int n_angles = 3;

struct Laws {
  NormalLaw normal;
  TangentialLaw tangential;
};

double contact_time() {
  const double mass = mass_of(density, radius), e_star = 0.5 * young / (1.0 - poisson * poisson);
  return 2.868 * std::pow(mass * mass / (radius * e_star * e_star * speed), 0.2);
}

double across_at(int angle) { return speed * std::tan(angles[angle] * pi / 180.0); }

/// Grains that hit a plate at each angle, touching it at `n_moments` moments between two steps.
Scene shots(Laws laws, double restitution, double step, int n_moments) {
  const double spacing = 4.0 * radius;
  Scene scene = empty_scene({-0.02, -0.02, -0.01}, {spacing * n_moments + 0.02, spacing * n_angles + 0.02, 0.02}, step);
  scene.materials = {{"grain", density, young, poisson}};
  scene.contact.normal = laws.normal;
  scene.contact.tangential = laws.tangential;
  PairLaw law = pair_law("grain", "grain", restitution, friction);
  if (laws.normal == NormalLaw::linear)
    law.normal_stiffness = mass_of(density, radius) * std::pow(pi / contact_time(), 2);
  scene.contact.pairs = {law};
  add_plane(scene, "plate", "grain", {0, 0, 0}, {0, 0, 1});
  for (int angle = 0; angle < n_angles; ++angle)
    for (int i = 0; i < n_moments; ++i) {
      const double gap = speed * step * (2.0 + (i + 0.5) / n_moments);
      add_grain(scene, "grain", radius, {spacing * i, spacing * angle, radius + gap}, {across_at(angle), 0, -speed});
    }
  return scene;
}

State after_impact(Laws laws, double restitution, double steps, int n_moments) {
  Simulation run(shots(laws, restitution, contact_time() / steps, n_moments), 1);
  while (run.time() < 4.0 * contact_time()) run.step();
  return state_of(run);
}

/// Of tangential velocity and rim speed, over the tangential velocity before, at each angle.
struct ObliqueErrors {
  double mean_square[n_angles] = {}, worst[n_angles] = {};  // root of the mean square over the moments
};

ObliqueErrors errors_of(const State& found, const State& exact, int n_moments) {
  ObliqueErrors errors;
  for (int angle = 0; angle < n_angles; ++angle) {
    const auto of_exact = static_cast<std::size_t>(angle);
    for (int i = 0; i < n_moments; ++i) {
      const auto grain = static_cast<std::size_t>(angle * n_moments + i);
      const double velocity = found.velocity[grain].x - exact.velocity[of_exact].x;
      const double rim = radius * (found.spin[grain].y - exact.spin[of_exact].y);
      const double error = std::max(std::abs(velocity), std::abs(rim)) / across_at(angle);
      errors.worst[angle] = std::max(errors.worst[angle], error);
      errors.mean_square[angle] += error * error / n_moments;
    }
    errors.mean_square[angle] = std::sqrt(errors.mean_square[angle]);
  }
  return errors;
}

/// The order which theory gives, less what a fit over so few steps may miss.
double least_order(Laws laws, double restitution, int angle) {
  const bool slides = angle == 2;
  if (restitution == 1.0) return 1.7;
  if (slides) return laws.normal == NormalLaw::linear ? 1.8 : 1.3;
  return 0.85;
}

}  // namespace

TEST_CASE(
    "oblique impacts converge for every tangential law: second order where they slide or nothing damps, else first",
    "[convergence]") {
  constexpr int n_moments = 64;
  const std::vector<double> steps = {20, 40, 80, 160};
  for (const Laws laws : {Laws{NormalLaw::linear, TangentialLaw::spring}, Laws{NormalLaw::linear, TangentialLaw::power},
                          Laws{NormalLaw::hertz, TangentialLaw::mindlin}, Laws{NormalLaw::hertz, TangentialLaw::power}})
    for (const double restitution : {1.0, 0.7}) {
      const State exact = after_impact(laws, restitution, 6400, 1);
      const ObliqueErrors coarsest = errors_of(after_impact(laws, restitution, 5, n_moments), exact, n_moments);
      std::vector<ObliqueErrors> errors;
      for (const double n : steps)
        errors.push_back(errors_of(after_impact(laws, restitution, n, n_moments), exact, n_moments));
      for (int angle = 0; angle < n_angles; ++angle) {
        std::vector<double> x, y;
        for (std::size_t k = 0; k < steps.size(); ++k) {
          x.push_back(std::log(steps[k]));
          y.push_back(std::log(errors[k].mean_square[angle]));
        }
        const double order = -fit_slope(x, y).value;
        report(
            "%s with %s, restitution %.1f, %2.0f degrees: error %.1e at 5 steps a contact, %.1e at 20, %.1e at 160; "
            "order %.2f",
            name_of(laws.normal).data(), name_of(laws.tangential).data(), restitution, angles[angle],
            coarsest.worst[angle], errors.front().worst[angle], errors.back().worst[angle], order);
        CHECK(order > least_order(laws, restitution, angle));
        CHECK(coarsest.worst[angle] < 0.25);
        CHECK(errors.front().worst[angle] < 0.05);
        CHECK(errors.back().worst[angle] < 0.005);
      }
    }
}
