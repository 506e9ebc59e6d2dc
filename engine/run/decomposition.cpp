#include "engine/run/decomposition.hpp"

#include <algorithm>
#include <vector>

namespace moraine {

Subdomains decompose(const World& world, int n_parts, std::span<const Vec3> positions, std::span<const float> weights,
                     const Scene& scene, double largest_radius, double widest_skin) {
  std::vector<WeightedPoint> points(positions.size());
  for (std::size_t i = 0; i < points.size(); ++i) points[i] = {positions[i], weights[i]};
  CutSpace space;
  space.domain = scene.domain.box();
  space.periodic = scene.domain.periodic;
  space.cell_width = 2.0 * largest_radius + widest_skin;
  return Subdomains::cut(world, n_parts, points, space);
}

double widest_skin(const Scene& scene, double mean_diameter) { return std::max(0.5 * mean_diameter, scene.run.skin); }

}  // namespace moraine
