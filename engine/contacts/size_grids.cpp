#include "engine/contacts/size_grids.hpp"

#include <algorithm>

namespace moraine {

void SizeGrids::build(const Particles& particles, const SizeClasses& classes, const Box& domain,
                      const std::array<bool, 3>& periodic, std::span<const Vec3> image_shift, double skin,
                      int n_threads) {
  image_shift_.assign(image_shift.begin(), image_shift.end());
  skin_ = skin;
  filter_ = pair_filter();
  grids_.clear();
  grids_.resize(static_cast<std::size_t>(classes.size()));
  std::vector<std::vector<std::int32_t>> members(grids_.size());
  for (std::int32_t i = 0; i < particles.size(); ++i)
    members[static_cast<std::size_t>(classes.of(particles.radius(i)))].push_back(i);
  for (std::size_t c = 0; c < grids_.size(); ++c) {
    Grid& grid = grids_[c];
    const std::size_t n = members[c].size();
    grid.largest = classes.limit(static_cast<int>(c));
    std::vector<double> centres(3 * n);
    for (std::size_t k = 0; k < n; ++k) {
      const Vec3 position = particles.position(members[c][k]);
      for (int axis = 0; axis < 3; ++axis) centres[3 * k + static_cast<std::size_t>(axis)] = position[axis];
    }
    grid.cells.sort({centres.data(), 3, static_cast<std::int32_t>(n)}, domain, periodic, 2.0 * grid.largest + skin,
                    n_threads);
    grid.grains.resize(n);
    const std::size_t row = n + 8;  // room for a vector behind the last
    grid.coordinates.resize_discarding(4 * row);
    double* const values = grid.coordinates.data();
    std::fill_n(values, 4 * row, 0.0);
    for (std::size_t k = 0; k < n; ++k) {
      const std::int32_t i = members[c][static_cast<std::size_t>(grid.cells.order()[k])];
      grid.grains[k] = i;
      for (std::size_t column = 0; column < 4; ++column) values[column * row + k] = particles.record(i)[column];
    }
    grid.spheres = {values, values + row, values + 2 * row, values + 3 * row};
  }
}

}  // namespace moraine
