// Overlaps among listed grains, by cells.
//
// Grains are put into levels by size, each level having half the diameter of the one above and a grid of its own with
// cells at least as wide as its largest grain. A grain looks for partners in its own level and in coarser ones: there,
// any partner's centre lies in one of the 27 cells around the grain's own place, because the sum of both radii is at
// most a cell's width. So one boulder among a million grains costs nothing.
#include <algorithm>

#include "engine/scene/checks.hpp"

namespace moraine::checks {

namespace {

/// The spheres of one level in a grid of cells, by counting sort.
class Level {
 public:
  Level(const std::vector<ListedSphere>& spheres, std::vector<std::int64_t> members, double width, const Domain& domain)
      : spheres_(spheres), domain_(domain) {
    choose_cells(members, width);
    sort(std::move(members));
  }

  /// Calls visit(index) for each sphere whose centre may be within one cell width of `place`; each once.
  template <class Visit>
  void near(Vec3 place, Visit&& visit) const {
    std::array<std::array<std::int64_t, 3>, 3> cells{};
    std::array<int, 3> n_cells{};
    for (int axis = 0; axis < 3; ++axis) n_cells[static_cast<std::size_t>(axis)] = neighbours(axis, place[axis], cells);
    for (int iz = 0; iz < n_cells[2]; ++iz)
      for (int iy = 0; iy < n_cells[1]; ++iy)
        for (int ix = 0; ix < n_cells[0]; ++ix) {
          const auto cell = static_cast<std::size_t>(
              (cells[2][static_cast<std::size_t>(iz)] * n_[1] + cells[1][static_cast<std::size_t>(iy)]) * n_[0] +
              cells[0][static_cast<std::size_t>(ix)]);
          for (std::int64_t k = start_[cell]; k < start_[cell + 1]; ++k) visit(order_[static_cast<std::size_t>(k)]);
        }
  }

  const std::vector<std::int64_t>& members() const { return order_; }

 private:
  void choose_cells(const std::vector<std::int64_t>& members, double width) {
    Box extent = Box::empty();
    for (const std::int64_t i : members) extent.include(spheres_[static_cast<std::size_t>(i)].centre);
    for (int axis = 0; axis < 3; ++axis)
      if (domain_.periodic[static_cast<std::size_t>(axis)])
        extent.low[axis] = domain_.low[axis], extent.high[axis] = domain_.high[axis];
    low_ = extent.low;
    // Wider cells where the grains are sparse, so that cells stay about as many as grains.
    const double most = 2.0 * static_cast<double>(members.size()) + 64.0;
    for (double cell = width;; cell *= 1.26) {
      double total = 1.0;
      for (int axis = 0; axis < 3; ++axis) {
        const double size = extent.high[axis] - extent.low[axis];
        const double n = std::max(1.0, std::floor(size / cell));
        total *= n;
        n_[static_cast<std::size_t>(axis)] = n < 1e6 ? static_cast<std::int64_t>(n) : 1000000;
        scale_[axis] = size > cell ? n / size : 1.0 / cell;
      }
      if (total <= most) return;
    }
  }

  std::int64_t cell_along(int axis, double x) const {
    return static_cast<std::int64_t>(std::floor((x - low_[axis]) * scale_[axis]));
  }

  void sort(std::vector<std::int64_t> members) {
    std::vector<std::size_t> cell_of(members.size());
    start_.assign(static_cast<std::size_t>(n_[0] * n_[1] * n_[2]) + 1, 0);
    for (std::size_t m = 0; m < members.size(); ++m) {
      std::int64_t cell = 0;
      for (int axis = 2; axis >= 0; --axis) {
        const std::int64_t n = n_[static_cast<std::size_t>(axis)];
        const double x = spheres_[static_cast<std::size_t>(members[m])].centre[axis];
        cell = cell * n + std::clamp<std::int64_t>(cell_along(axis, x), 0, n - 1);
      }
      cell_of[m] = static_cast<std::size_t>(cell);
      ++start_[cell_of[m] + 1];
    }
    for (std::size_t c = 1; c < start_.size(); ++c) start_[c] += start_[c - 1];
    std::vector<std::int64_t> next(start_.begin(), start_.end() - 1);
    order_.resize(members.size());
    for (std::size_t m = 0; m < members.size(); ++m) order_[static_cast<std::size_t>(next[cell_of[m]]++)] = members[m];
  }

  /// Distinct cells along one axis around x: up to three.
  int neighbours(int axis, double x, std::array<std::array<std::int64_t, 3>, 3>& cells) const {
    auto& row = cells[static_cast<std::size_t>(axis)];
    const std::int64_t n = n_[static_cast<std::size_t>(axis)];
    const std::int64_t middle = cell_along(axis, x);
    int count = 0;
    for (std::int64_t cell = middle - 1; cell <= middle + 1; ++cell) {
      std::int64_t c = cell;
      if (domain_.periodic[static_cast<std::size_t>(axis)]) c = (c % n + n) % n;
      if (c < 0 || c >= n || std::find(row.begin(), row.begin() + count, c) != row.begin() + count) continue;
      row[static_cast<std::size_t>(count++)] = c;
    }
    return count;
  }

  const std::vector<ListedSphere>& spheres_;
  const Domain& domain_;
  Vec3 low_, scale_;
  std::array<std::int64_t, 3> n_{};
  std::vector<std::int64_t> start_, order_;
};

Vec3 nearest_image(Vec3 d, const Domain& domain) {
  for (int axis = 0; axis < 3; ++axis) {
    if (!domain.periodic[static_cast<std::size_t>(axis)]) continue;
    const double width = domain.high[axis] - domain.low[axis];
    d[axis] -= width * std::round(d[axis] / width);
  }
  return d;
}

/// Spheres by level, largest first; level L holds radii in (largest / 2^(L+1), largest / 2^L].
std::vector<Level> make_levels(const std::vector<ListedSphere>& spheres, const Domain& domain) {
  double largest = 0.0;
  for (const ListedSphere& sphere : spheres) largest = std::max(largest, sphere.radius);
  std::vector<std::vector<std::int64_t>> members;
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    const auto level = static_cast<std::size_t>(std::max(0.0, std::floor(std::log2(largest / spheres[i].radius))));
    if (level >= members.size()) members.resize(level + 1);
    members[level].push_back(static_cast<std::int64_t>(i));
  }
  std::vector<Level> levels;
  for (std::size_t level = 0; level < members.size(); ++level) {
    const double width = 2.0 * largest * std::pow(0.5, static_cast<double>(level));
    if (!members[level].empty()) levels.emplace_back(spheres, std::move(members[level]), width * (1.0 + 1e-12), domain);
  }
  return levels;
}

}  // namespace

OverlapReport find_overlaps(const std::vector<ListedSphere>& spheres, const Domain& domain, double limit) {
  OverlapReport report;
  const auto compare = [&](std::int64_t i, std::int64_t j) {
    const ListedSphere &a = spheres[static_cast<std::size_t>(i)], &b = spheres[static_cast<std::size_t>(j)];
    const double reach = a.radius + b.radius;
    const double squared = squared_length(nearest_image(a.centre - b.centre, domain));
    if (squared >= reach * reach) return;
    const double overlap = reach - std::sqrt(squared);
    const double relative = overlap / std::min(a.radius, b.radius);
    if (!(relative > limit)) return;
    ++report.count;
    const std::int64_t first = std::min(i, j), second = std::max(i, j);
    const bool is_worse =
        relative > report.relative ||
        (relative == report.relative && std::pair(first, second) < std::pair(report.first, report.second));
    if (!is_worse) return;
    report.first = first, report.second = second;
    report.overlap = overlap, report.relative = relative;
  };
  const std::vector<Level> levels = make_levels(spheres, domain);
  for (std::size_t fine = 0; fine < levels.size(); ++fine)
    for (const std::int64_t i : levels[fine].members())
      for (std::size_t coarse = 0; coarse <= fine; ++coarse)
        levels[coarse].near(spheres[static_cast<std::size_t>(i)].centre, [&](std::int64_t j) {
          if (coarse < fine || j > i) compare(i, j);
        });
  return report;
}

}  // namespace moraine::checks
