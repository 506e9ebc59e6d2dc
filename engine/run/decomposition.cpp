#include "engine/run/decomposition.hpp"

#include <vector>

namespace moraine {

double widest_skin(const Scene& scene, const Plan& plan) {
  return scene.run.skin > 0.0 ? scene.run.skin : 5.0 * plan.skin;  // the plan's is a tenth of the mean diameter
}

Subdomains decompose(const World& world, int n_parts, std::span<const Vec3> positions, std::span<const float> weights,
                     const Scene& scene, double largest_radius, double widest) {
  std::vector<WeightedPoint> points(positions.size());
  for (std::size_t i = 0; i < points.size(); ++i) points[i] = {positions[i], weights.empty() ? 1.0F : weights[i]};
  CutSpace space;
  space.domain = scene.domain.box();
  space.periodic = scene.domain.periodic;
  space.cell_width = 2.0 * largest_radius + widest;
  return Subdomains::cut(world, n_parts, points, space);
}

}  // namespace moraine
