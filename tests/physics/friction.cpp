// Coulomb friction in a single impact: a contact that slides from its begin to its end is pushed back by mu F_n throughout.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "tests/physics/laboratory.hpp"

using namespace moraine;
using namespace moraine::physics;

namespace {

constexpr double radius = 1e-3, density = 2500.0, friction = 0.3, restitution = 0.5;

struct Sliding {
  double forward = 0.0;  // impulse of friction along the motion, over mu times the normal impulse
  double impulse = 0.0;  // of friction against the motion, over the same
};

/// A grain that meets a plane at 80 degrees from its normal; `phase` shifts the moment of touch between two steps.
Sliding slide(NormalLaw normal, TangentialLaw tangential, double phase) {
  const double v_n = 0.5, v_t = v_n * std::tan(80.0 * pi / 180.0), step = 2e-6;
  Scene scene = empty_scene({-0.1, -0.1, -0.01}, {0.1, 0.1, 0.1}, step);
  scene.materials = {{"grain", density, 1e8, 0.25}};
  scene.contact.normal = normal;
  scene.contact.tangential = tangential;
  PairLaw law = pair_law("grain", "grain", restitution, friction);
  if (normal == NormalLaw::linear) law.normal_stiffness = 1e4;
  if (normal == NormalLaw::hertz && tangential == TangentialLaw::spring) law.tangential_stiffness = 3e3;
  scene.contact.pairs = {law};
  add_plane(scene, "floor", "grain", {0, 0, 0}, {0, 0, 1});
  add_grain(scene, "grain", radius, {0, 0, radius + (2.0 + phase) * step * v_n}, {v_t, 0, -v_n});
  Simulation run(scene, 1);
  double forward = 0.0, against = 0.0, limit = 0.0;
  for (int i = 0; i < 400; ++i) {
    run.step();
    const Vec3 f = state_of(run).force[0];
    limit += friction * std::max(f.z, 0.0);
    (f.x > 0.0 ? forward : against) += std::abs(f.x);
  }
  return {forward / limit, against / limit};
}

}  // namespace

TEST_CASE("friction of a contact that slides is mu F_n against the motion, from its begin to its end", "[friction]") {
  struct Choice {
    NormalLaw normal;
    TangentialLaw tangential;
    const char* name;
  };
  for (const Choice& laws : {Choice{NormalLaw::linear, TangentialLaw::spring, "linear, spring"},
                             Choice{NormalLaw::linear, TangentialLaw::power, "linear, power"},
                             Choice{NormalLaw::hertz, TangentialLaw::spring, "Hertz, spring"},
                             Choice{NormalLaw::hertz, TangentialLaw::mindlin, "Hertz, Mindlin"},
                             Choice{NormalLaw::hertz, TangentialLaw::power, "Hertz, power"}}) {
    double forward = 0.0, least = 1.0;
    for (const double phase : {0.05, 0.2, 0.4, 0.6, 0.8, 0.95, 0.99, 0.999}) {
      const Sliding s = slide(laws.normal, laws.tangential, phase);
      forward = std::max(forward, s.forward);
      least = std::min(least, s.impulse);
    }
    report("%s: friction's impulse at least %.4f of mu times the normal impulse; pushed along the motion %.4f",
           laws.name, least, forward);
    CHECK(forward < 1e-12);
    CHECK(least > 0.99);
  }
}

namespace {

/// Tangential velocity and spin after an oblique impact on a plane, for many moments of touch between two steps at once.
std::vector<std::array<double, 2>> oblique(NormalLaw normal, TangentialLaw tangential, double angle, double steps,
                                           int n_phases) {
  const double v_n = 0.5, v_t = v_n * std::tan(angle * pi / 180.0), mass = mass_of(density, radius);
  const double e_star = 0.5 * 1e8 / (1.0 - 0.0625);
  const double time = normal == NormalLaw::linear
                          ? pi * std::sqrt(mass / 1e4)
                          : 2.868 * std::pow(mass * mass / (radius * e_star * e_star * v_n), 0.2);
  const double step = time / steps;
  Scene scene = empty_scene({-0.1, -0.1, -0.01}, {0.1, 4e-3 * n_phases, 0.1}, step);
  scene.materials = {{"grain", density, 1e8, 0.25}};
  scene.contact.normal = normal;
  scene.contact.tangential = tangential;
  PairLaw law = pair_law("grain", "grain", 0.7, friction);
  if (normal == NormalLaw::linear) law.normal_stiffness = 1e4;
  scene.contact.pairs = {law};
  add_plane(scene, "floor", "grain", {0, 0, 0}, {0, 0, 1});
  for (int i = 0; i < n_phases; ++i)
    add_grain(scene, "grain", radius, {0, 4e-3 * i, radius + (1.0 + (i + 0.5) / n_phases) * step * v_n},
              {v_t, 0, -v_n});
  Simulation run(scene, 1);
  while (run.time() < 3.0 * time) run.step();
  const State end = state_of(run);
  std::vector<std::array<double, 2>> out;
  for (std::size_t i = 0; i < end.velocity.size(); ++i)
    out.push_back({end.velocity[i].x / v_t, radius * end.spin[i].y / v_t});
  return out;
}

}  // namespace

TEST_CASE("oblique impacts converge, wherever between two steps they begin, that stick and that slide in turn",
          "[friction]") {
  for (const auto& [normal, tangential] :
       {std::pair{NormalLaw::linear, TangentialLaw::spring}, std::pair{NormalLaw::hertz, TangentialLaw::mindlin}})
    for (const double angle : {10.0, 35.0, 45.0, 60.0}) {
      const std::array<double, 2> exact = oblique(normal, tangential, angle, 6400, 1)[0];
      double worst[2] = {0.0, 0.0};
      for (const int k : {0, 1})
        for (const auto& found : oblique(normal, tangential, angle, k == 0 ? 50 : 400, 64))
          worst[k] = std::max({worst[k], std::abs(found[0] - exact[0]), std::abs(found[1] - exact[1])});
      const double order = std::log(worst[0] / worst[1]) / std::log(8.0);
      report(
          "%s %s at %2.0f degrees: velocity and spin within %.1e of the first velocity at 50, %.1e at 400 steps a "
          "contact, order %.2f",
          name_of(normal).data(), name_of(tangential).data(), angle, worst[0], worst[1], order);
      CHECK(worst[0] < 0.015);
      CHECK(order > (normal == NormalLaw::linear && angle == 60.0 ? 1.5 : 0.9));
    }
}
