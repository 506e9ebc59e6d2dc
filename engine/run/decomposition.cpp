#include "engine/run/decomposition.hpp"

#include <vector>

namespace moraine {

namespace {

CutSpace space_of(const Scene& scene, double largest_radius, double widest) {
  CutSpace space;
  space.domain = scene.domain.box();
  space.periodic = scene.domain.periodic;
  space.cell_width = 2.0 * largest_radius + widest;
  return space;
}

}  // namespace

double widest_skin(const Scene& scene, const Plan& plan) {
  return scene.run.skin > 0.0 ? scene.run.skin : 5.0 * plan.skin;  // the plan's is a tenth of the mean diameter
}

Subdomains decompose(const World& world, int n_parts, std::span<const Vec3> positions, std::span<const float> weights,
                     const Scene& scene, double largest_radius, double widest) {
  std::vector<WeightedPoint> points(positions.size());
  for (std::size_t i = 0; i < points.size(); ++i) points[i] = {positions[i], weights.empty() ? 1.0F : weights[i]};
  return Subdomains::cut(world, n_parts, points, space_of(scene, largest_radius, widest));
}

Subdomains decompose_evenly(const World& world, int n_parts, const Scene& scene, double largest_radius, double widest) {
  std::vector<WeightedPoint> points;
  if (world.is_root()) {
    constexpr int n = 64;
    const Box box = scene.domain.box();
    const Vec3 cell = box.size() / static_cast<double>(n);
    // Corners weigh nothing, and say how far space goes.
    points = {{box.low, 0.0F}, {box.high, 0.0F}};
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)
        for (int k = 0; k < n; ++k)
          points.push_back({box.low + Vec3{(i + 0.5) * cell.x, (j + 0.5) * cell.y, (k + 0.5) * cell.z}, 1.0F});
  }
  return Subdomains::cut(world, n_parts, points, space_of(scene, largest_radius, widest));
}

}  // namespace moraine
