#include "engine/particles/pack_cells.hpp"

namespace moraine {

Vec3 PackSpace::wrapped(Vec3 p) const {
  for (int k = 0; k < 3; ++k) {
    if (!periodic[static_cast<std::size_t>(k)]) continue;
    const double low = box.low[k], high = box.high[k];
    if (p[k] < low || p[k] >= high) {
      p[k] -= (high - low) * std::floor((p[k] - low) / (high - low));
      if (p[k] < low || p[k] >= high) p[k] = low;  // rounding, right at a face
    }
  }
  return p;
}

CellLevels::CellLevels(const PackSpace& space, const Box& extent, std::span<const double> radii)
    : space_(space), extent_(extent) {
  for (int k = 0; k < 3; ++k)
    if (space.periodic[static_cast<std::size_t>(k)]) {
      extent_.low[k] = space.box.low[k];
      extent_.high[k] = space.box.high[k];
    }
  for (double radius : radii) largest_radius_ = std::max(largest_radius_, radius);
  std::vector<std::int64_t> n_grains;
  for (double radius : radii) {
    const auto level = static_cast<std::size_t>(level_of(radius));
    if (level >= levels_.size()) {
      levels_.resize(level + 1);
      n_grains.resize(level + 1);
    }
    levels_[level].largest_radius = std::max(levels_[level].largest_radius, radius);
    ++n_grains[level];
  }
  for (std::size_t i = 0; i < levels_.size(); ++i) {
    levels_[i].first_cell = n_cells_;
    if (n_grains[i] == 0) continue;
    size_level(levels_[i], n_grains[i]);
    n_cells_ += std::int64_t{levels_[i].n[0]} * levels_[i].n[1] * levels_[i].n[2];
  }
}

int CellLevels::level_of(double radius) const {
  return std::min(std::max(std::ilogb(largest_radius_ / radius), 0), 30);
}

void CellLevels::size_level(Level& level, std::int64_t n_grains) const {
  // Cells as wide as a grain; wider ones where that would make many more cells than grains.
  double edge = 2.1 * level.largest_radius;
  const Vec3 size = extent_.size();
  const auto count = [&](int k) { return std::clamp(std::floor(size[k] / edge), 1.0, 1e6); };
  while (count(0) * count(1) * count(2) > 2.0 * static_cast<double>(n_grains) + 8.0) edge *= 1.1;
  for (int k = 0; k < 3; ++k) {
    level.n[static_cast<std::size_t>(k)] = static_cast<int>(count(k));
    level.inverse_edge[k] = size[k] > 0.0 ? count(k) / size[k] : 0.0;
  }
}

std::int64_t CellLevels::cell_of(int number, Vec3 p) const {
  const Level& level = levels_[static_cast<std::size_t>(number)];
  std::array<std::int64_t, 3> cell{};
  for (int k = 0; k < 3; ++k) {
    const double place = std::floor((p[k] - extent_.low[k]) * level.inverse_edge[k]);
    const auto axis = static_cast<std::size_t>(k);
    cell[axis] = static_cast<std::int64_t>(std::clamp(place, 0.0, static_cast<double>(level.n[axis] - 1)));
  }
  return (cell[2] * level.n[1] + cell[1]) * level.n[0] + cell[0] + level.first_cell;
}

CellLevels::Span CellLevels::span_of(const Level& level, int axis, double p, double reach) const {
  const auto k = static_cast<std::size_t>(axis);
  const int n = level.n[k];
  // One part in 1e9 of a cell wider than asked, so that rounding loses nobody at a cell's edge.
  const double from = std::floor((p - reach - extent_.low[axis]) * level.inverse_edge[axis] - 1e-9);
  const double to = std::floor((p + reach - extent_.low[axis]) * level.inverse_edge[axis] + 1e-9);
  if (space_.periodic[k]) {
    if (to - from + 1.0 >= n) return {0, n};
    return {static_cast<int>(from), static_cast<int>(to) + 1};
  }
  const double last = n - 1;
  return {static_cast<int>(std::clamp(from, 0.0, last)), static_cast<int>(std::clamp(to, 0.0, last)) + 1};
}

}  // namespace moraine
