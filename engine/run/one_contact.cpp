#include "engine/run/one_contact.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/contacts/law_table.hpp"
#include "engine/particles/sizes.hpp"
#include "engine/run/plan.hpp"
#include "engine/scene/lists.hpp"
#include "kernels/base/sphere.hpp"
#include "kernels/contact/reference/reference.hpp"

namespace moraine {

namespace {

/// Smallest diameter of the grains of one material [m]; infinite where it has none.
double smallest_diameter(const Scene& scene, const std::string& material) {
  double smallest = infinity;
  const int index = scene.material_index(material);
  for (const ParticleGroup& group : scene.particles) {
    const auto* listed = std::get_if<ListedGrains>(&group.fill);
    if (listed && listed->has_radius) {
      const ListFacts facts = facts_of(*listed);
      if (const auto m = static_cast<std::size_t>(index); facts.uses(m))
        smallest = std::min(smallest, facts.of_material[m].smallest);
    } else if (group.material == material) {
      smallest = std::min(smallest, DiameterSampler(group.diameter).smallest());
    }
  }
  return smallest;
}

/// So many steps end any impact that ends; overdamped ones creep.
constexpr int most_steps = 200'000;

}  // namespace

std::vector<ContactCase> contact_cases(const Scene& scene) {
  struct Kind {
    std::string material;
    double diameter, inverse_mass;
  };
  std::vector<Kind> kinds;
  for (const Material& material : scene.materials)
    if (const double d = smallest_diameter(scene, material.name); d < infinity)
      kinds.push_back({material.name, d, 1.0 / (material.density * sphere_volume(0.5 * d))});
  std::vector<ContactCase> cases;
  for (const Kind& a : kinds) {
    const auto add = [&](const std::string& other, double inverse_mass, double curvature, const std::string& words) {
      cases.push_back({pair_parameters(scene, a.material, other), a.inverse_mass, inverse_mass, 2.0 / a.diameter,
                       curvature, fmt::format("{} (d {:.4g} m) with {}", a.material, a.diameter, words)});
    };
    for (const Kind& b : kinds)
      add(b.material, b.inverse_mass, 2.0 / b.diameter, fmt::format("{} (d {:.4g} m)", b.material, b.diameter));
    for (const WallDefinition& wall : scene.walls)
      if (wall.symmetry)
        add(a.material, a.inverse_mass, 2.0 / a.diameter, "its mirror image");
      else
        add(wall.material, 0.0, 0.0, fmt::format("wall \"{}\" ({})", wall.name, wall.material));
  }
  return cases;
}

double restitution_of_impact(const Scene& scene, const ContactCase& bodies, double speed, double dt, double phase) {
  ReferenceContact contact;
  contact.normal = {1.0, 0.0, 0.0};
  contact.a.inverse_mass = bodies.inverse_mass_a;
  contact.b.inverse_mass = bodies.inverse_mass_b;
  contact.a.curvature = bodies.curvature_a;
  contact.b.curvature = bodies.curvature_b;
  LawChoice laws = law_choice(scene);  // attraction would make grains stick, and says nothing of the step
  laws.cohesion = CohesionLaw::none;
  laws.rolling = RollingLaw::none;
  const double s = bodies.inverse_mass_a + bodies.inverse_mass_b;
  double overlap = -phase * speed * dt, v = -speed;  // of a, seen from b; half a step behind, as in a run
  for (int step = 0; step < most_steps; ++step) {
    if (overlap > 0.0) {
      contact.overlap = overlap;
      contact.a.velocity = {v, 0.0, 0.0};
      const ReferenceForce force = reference_contact(laws, bodies.parameters, contact, dt);
      v += dt * s * force.force.x;
    } else if (v > 0.0) {
      return v / speed;
    }
    overlap -= v * dt;
  }
  return 0.0;
}

ImpactError impact_error(const Scene& scene, double dt) {
  constexpr int n_phases = 8;
  const double speed = expected_speed(scene);
  ImpactError worst;
  for (const ContactCase& bodies : contact_cases(scene)) {
    ContactCase elastic = bodies;
    elastic.parameters[Parameter::damping] = 0.0;
    const double exact = restitution_of_impact(scene, bodies, speed, 0.01 * dt, 0.5);
    for (int i = 0; i < n_phases; ++i) {
      const double phase = (i + 0.5) / n_phases;
      const double off = std::abs(restitution_of_impact(scene, bodies, speed, dt, phase) - exact);
      if (off > worst.restitution || worst.pair.empty()) {
        worst.restitution = off;
        worst.exact = exact;
        worst.pair = bodies.words;
      }
      const double e = restitution_of_impact(scene, elastic, speed, dt, phase), change = std::abs(e * e - 1.0);
      if (change > worst.energy || worst.energy_pair.empty()) {
        worst.energy = change;
        worst.energy_pair = bodies.words;
      }
    }
  }
  return worst;
}

}  // namespace moraine
