#include "comm/subdomains.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace moraine {

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
/// Weights are summed as integers of this part of a unit, so that the order of the points does not matter.
constexpr double weight_units = 256.0;

/// Boundaries in the width of the narrowest part: with whole ones only, parts of some twenty grains across are 15 % uneven.
constexpr int boundaries_per_width = 16;

/// The grid whose boundaries may be cut along: cells of each axis, by the place of their lower boundary.
struct Grid {
  Vec3 low, width;
  std::array<int, 3> counts{1, 1, 1};
  std::array<int, 3> fewest{1, 1, 1};  // cells that make the narrowest part

  int cell_of(Vec3 p, int axis) const {
    const auto a = static_cast<std::size_t>(axis);
    const double c = std::floor((p[axis] - low[axis]) / width[axis]);
    return static_cast<int>(std::clamp(c, 0.0, static_cast<double>(counts[a] - 1)));
  }
  double boundary(int cell, int axis) const { return low[axis] + cell * width[axis]; }
};

Grid make_grid(const World& world, std::span<const WeightedPoint> points, const CutSpace& space) {
  Box bounds = Box::empty();
  for (const WeightedPoint& point : points) bounds.include(point.position);
  std::array<double, 6> edges = {-bounds.low.x, -bounds.low.y, -bounds.low.z,
                                 bounds.high.x, bounds.high.y, bounds.high.z};
  world.max(edges);
  Grid grid;
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    double low = -edges[a], high = edges[a + 3];
    if (space.periodic[a] || !(low <= high)) {
      low = space.domain.low[axis];
      high = space.domain.high[axis];
    }
    constexpr double most = 1 << 20;
    grid.low[axis] = low;
    grid.counts[a] =
        static_cast<int>(std::clamp(std::floor(boundaries_per_width * (high - low) / space.cell_width), 1.0, most));
    grid.width[axis] = std::max((high - low) / grid.counts[a], std::numeric_limits<double>::min());
    grid.fewest[a] =
        static_cast<int>(std::clamp(std::ceil(space.cell_width / grid.width[axis] * (1.0 - 1e-12)), 1.0, most));
  }
  return grid;
}

/// A box of cells that is still to be cut into parts.
struct Piece {
  std::array<int, 3> first{}, end{};  // cells
  int part_begin = 0, part_end = 0;
  std::int32_t node = 0;
  int axis = -1;              // along which it is being cut; -1: it is not
  std::size_t histogram = 0;  // where its work by cell starts
  int n_parts() const { return part_end - part_begin; }
};

/// The longest axis with room for two parts; -1 where there is none.
int axis_to_cut(const Piece& piece, const Grid& grid) {
  int best = -1;
  double longest = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    const int n = piece.end[a] - piece.first[a];
    const double length = n * grid.width[axis];
    if (n >= 2 * grid.fewest[a] && length > longest * (1.0 + 1e-9)) {
      longest = length;
      best = axis;
    }
  }
  return best;
}

/// The boundary, at least `fewest` cells from either end, at which the work below comes nearest to its share.
int best_boundary(std::span<const std::int64_t> work, double share, int fewest) {
  std::int64_t total = 0;
  for (const std::int64_t w : work) total += w;
  const double wanted = share * static_cast<double>(total);
  const auto first = static_cast<std::size_t>(fewest), last = work.size() - first;
  int best = fewest;
  double least = infinite;
  std::int64_t below = 0;
  for (std::size_t c = 1; c <= last; ++c) {
    below += work[c - 1];
    if (c < first) continue;
    // in empty space the boundary nearest to the middle of it would do as well; the first is as good
    const double off = std::abs(static_cast<double>(below) - wanted);
    if (off < least) {
      least = off;
      best = static_cast<int>(c);
    }
  }
  return best;
}

bool is_nothing(const Box& box) { return !(box.low.x < box.high.x); }

}  // namespace

Subdomains Subdomains::cut(const World& world, int n_parts, std::span<const WeightedPoint> points,
                           const CutSpace& space) {
  Subdomains result;
  result.periodic_ = space.periodic;
  result.domain_ = space.domain;
  if (n_parts <= 1) return result;
  const Grid grid = make_grid(world, points, space);
  const Box nothing{{0, 0, 0}, {0, 0, 0}};
  result.boxes_.assign(static_cast<std::size_t>(n_parts), nothing);

  // All pieces of a level are cut at once, with one sum over the ranks.
  std::vector<Piece> pieces(1);
  pieces[0].end = grid.counts;
  pieces[0].part_end = n_parts;
  std::vector<std::int32_t> piece_of(points.size(), 0);
  const auto box_of = [&](const Piece& piece) {
    Box box;
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<std::size_t>(axis);
      const bool is_open = !space.periodic[a];
      box.low[axis] = piece.first[a] > 0 ? grid.boundary(piece.first[a], axis)
                      : is_open          ? -infinite
                                         : space.domain.low[axis];
      box.high[axis] = piece.end[a] < grid.counts[a] ? grid.boundary(piece.end[a], axis)
                       : is_open                     ? infinite
                                                     : space.domain.high[axis];
    }
    return box;
  };
  while (!pieces.empty()) {
    std::size_t n_cells = 0;
    for (Piece& piece : pieces) {
      piece.axis = piece.n_parts() > 1 ? axis_to_cut(piece, grid) : -1;
      piece.histogram = n_cells;
      if (piece.axis >= 0) {
        const auto a = static_cast<std::size_t>(piece.axis);
        n_cells += static_cast<std::size_t>(piece.end[a] - piece.first[a]);
      }
    }
    std::vector<std::int64_t> work(n_cells, 0);
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (piece_of[i] < 0) continue;
      const Piece& piece = pieces[static_cast<std::size_t>(piece_of[i])];
      if (piece.axis < 0) continue;
      const int cell = grid.cell_of(points[i].position, piece.axis) - piece.first[static_cast<std::size_t>(piece.axis)];
      work[piece.histogram + static_cast<std::size_t>(cell)] += std::llround(points[i].weight * weight_units);
    }
    if (n_cells > 0) world.sum(work);
    std::vector<Piece> next;
    std::vector<std::int32_t> lower_of(pieces.size(), -1);
    std::vector<int> boundary_of(pieces.size(), 0);
    for (std::size_t p = 0; p < pieces.size(); ++p) {
      const Piece& piece = pieces[p];
      Cut& node = result.tree_[static_cast<std::size_t>(piece.node)];
      if (piece.axis < 0) {  // one part, or no room for several: the others stay empty
        node.lower = piece.part_begin;
        result.boxes_[static_cast<std::size_t>(piece.part_begin)] = box_of(piece);
        continue;
      }
      const auto a = static_cast<std::size_t>(piece.axis);
      const int n_below = piece.n_parts() / 2;
      const auto n = static_cast<std::size_t>(piece.end[a] - piece.first[a]);
      const int at = piece.first[a] + best_boundary(std::span(work).subspan(piece.histogram, n),
                                                    static_cast<double>(n_below) / piece.n_parts(), grid.fewest[a]);
      Piece lower = piece, upper = piece;
      lower.end[a] = upper.first[a] = at;
      lower.part_end = upper.part_begin = piece.part_begin + n_below;
      lower.node = static_cast<std::int32_t>(result.tree_.size());
      upper.node = lower.node + 1;
      node.axis = piece.axis;
      node.at = grid.boundary(at, piece.axis);
      node.lower = lower.node;
      node.upper = upper.node;
      result.tree_.resize(result.tree_.size() + 2);  // `node` is gone
      lower_of[p] = static_cast<std::int32_t>(next.size());
      boundary_of[p] = at;
      next.push_back(lower);
      next.push_back(upper);
      result.is_cut_[a] = true;
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (piece_of[i] < 0) continue;
      const auto p = static_cast<std::size_t>(piece_of[i]);
      piece_of[i] = lower_of[p] < 0
                        ? -1
                        : lower_of[p] + (grid.cell_of(points[i].position, pieces[p].axis) >= boundary_of[p] ? 1 : 0);
    }
    pieces = std::move(next);
  }
  for (const Box& box : result.boxes_)
    for (int axis = 0; axis < 3; ++axis)
      if (result.is_cut(axis) && space.periodic[static_cast<std::size_t>(axis)] && !is_nothing(box))
        result.narrowest_ = std::min(result.narrowest_, box.high[axis] - box.low[axis]);
  return result;
}

bool Subdomains::is_empty(int part) const { return is_nothing(box(part)); }

bool Subdomains::spans(int part, int axis) const {
  if (!periodic_[static_cast<std::size_t>(axis)]) return false;
  const Box& own = box(part);
  return own.high[axis] - own.low[axis] >= period()[axis] * (1.0 - 1e-12);
}

int Subdomains::owner(Vec3 position) const {
  const Cut* node = tree_.data();
  while (node->axis >= 0)
    node = &tree_[static_cast<std::size_t>(position[node->axis] < node->at ? node->lower : node->upper)];
  return node->lower;
}

double Subdomains::squared_gap(const Box& own, const Box& there, const std::array<int, 3>& steps) const {
  double squared = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    const int step = steps[static_cast<std::size_t>(axis)];
    const double by = step == 0 ? 0.0 : step * period()[axis];  // no 0 * infinity
    // Written so that the two boxes may change places (with negated steps) and every bit of the result stays.
    const double above = (there.low[axis] - own.high[axis]) - by, below = (own.low[axis] - there.high[axis]) + by;
    const double gap = std::max({0.0, above, below});
    squared += gap * gap;
  }
  return squared;
}

void Subdomains::add_near(int part, double reach, const std::array<int, 3>& steps, std::int32_t node, const Box& within,
                          std::vector<Near>& found) const {
  if (!(squared_gap(box(part), within, steps) < reach * reach)) return;
  const Cut& cut = tree_[static_cast<std::size_t>(node)];
  if (cut.axis < 0) {
    if (cut.lower != part) found.push_back({cut.lower, steps});
    return;
  }
  Box below = within, above = within;
  below.high[cut.axis] = above.low[cut.axis] = cut.at;
  add_near(part, reach, steps, cut.lower, below, found);
  add_near(part, reach, steps, cut.upper, above, found);
}

std::vector<Subdomains::Near> Subdomains::near(int part, double reach) const {
  std::vector<Near> found;
  if (is_empty(part)) return found;
  std::array<int, 3> most{};
  Box all;
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    most[a] = periodic_[a] && is_cut_[a] ? 1 : 0;
    all.low[axis] = periodic_[a] ? domain_.low[axis] : -infinity_;
    all.high[axis] = periodic_[a] ? domain_.high[axis] : infinity_;
  }
  for (int x = -most[0]; x <= most[0]; ++x)
    for (int y = -most[1]; y <= most[1]; ++y)
      for (int z = -most[2]; z <= most[2]; ++z) add_near(part, reach, {x, y, z}, 0, all, found);
  std::stable_sort(found.begin(), found.end(), [](const Near& a, const Near& b) { return a.part < b.part; });
  return found;
}

std::vector<int> Subdomains::linked(int part) const {
  int home = part;  // of an empty part
  while (home > 0 && is_empty(home)) --home;
  if (home != part) return {home};
  std::vector<int> found;
  double reach =
      1e-100;  // faces of cuts are the same number on both sides; those across a period are so but for rounding
  for (int axis = 0; axis < 3; ++axis)
    if (periodic_[static_cast<std::size_t>(axis)]) reach = std::max(reach, 1e-9 * period()[axis]);
  for (const Near& other : near(part, reach)) {
    int n_overlapping = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const int step = other.steps[static_cast<std::size_t>(axis)];
      const double by = step == 0 ? 0.0 : step * period()[axis];
      const Box &own = box(part), &there = box(other.part);
      const double begin = std::max(own.low[axis] + by, there.low[axis]),
                   end = std::min(own.high[axis] + by, there.high[axis]);
      n_overlapping += end - begin > reach ? 1 : 0;
    }
    if (n_overlapping >= 2 && (found.empty() || found.back() != other.part)) found.push_back(other.part);
  }
  for (int empty = part + 1; empty < size() && is_empty(empty); ++empty) found.push_back(empty);
  std::sort(found.begin(), found.end());
  return found;
}

int Subdomains::most_hops() const {
  const auto n = boxes_.size();
  std::vector<std::vector<int>> links(n);
  for (std::size_t part = 0; part < n; ++part) links[part] = linked(static_cast<int>(part));
  const auto hops_from = [&](std::size_t source) {  // breadth first
    std::vector<int> hops(n, -1);
    std::vector<std::size_t> queue = {source};
    hops[source] = 0;
    for (std::size_t next = 0; next < queue.size(); ++next)
      for (const int other : links[queue[next]]) {
        const auto o = static_cast<std::size_t>(other);
        if (hops[o] >= 0) continue;
        hops[o] = hops[queue[next]] + 1;
        queue.push_back(o);
      }
    return *std::max_element(hops.begin(), hops.end());
  };
  constexpr std::size_t few = 128, n_tried = 8;
  if (n > few) {  // by way of the part in the middle of things
    int least = std::numeric_limits<int>::max();
    for (std::size_t k = 0; k < n_tried; ++k) least = std::min(least, 2 * hops_from(k * n / n_tried));
    return least;
  }
  int most = 0;
  for (std::size_t part = 0; part < n; ++part) most = std::max(most, hops_from(part));
  return most;
}

double squared_distance(Vec3 point, const Box& box) {
  if (is_nothing(box)) return infinite;
  double squared = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    const double gap = std::max({0.0, box.low[axis] - point[axis], point[axis] - box.high[axis]});
    squared += gap * gap;
  }
  return squared;
}

}  // namespace moraine
