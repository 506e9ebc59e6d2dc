#include "engine/contacts/cells.hpp"

#include <algorithm>
#include <cmath>

#include "engine/threads.hpp"

namespace moraine {

namespace {

Box bounds_of(const Particles& particles, int n_threads) {
  std::vector<Box> boxes(static_cast<std::size_t>(n_threads), Box::empty());
  parallel(n_threads, [&](int thread) {
    const Range share = share_of(particles.size(), thread, n_threads);
    Box box = Box::empty();
    for (std::int64_t i = share.begin; i < share.end; ++i)
      if (particles.is_here(i)) box.include(particles.position(i));
    boxes[static_cast<std::size_t>(thread)] = box;
  });
  Box all = Box::empty();
  for (const Box& box : boxes) {
    if (box.low.x > box.high.x) continue;
    all.include(box.low);
    all.include(box.high);
  }
  return all;
}

}  // namespace

std::array<int, 3> Cells::cell_of(Vec3 p) const {
  std::array<int, 3> cell{};
  for (int role = 0; role < 3; ++role) {
    const int axis = axes_[static_cast<std::size_t>(role)];
    const double c = (p[axis] - low_[axis]) * inverse_width_[axis];
    cell[static_cast<std::size_t>(role)] =
        std::clamp(static_cast<int>(c), 0, counts_[static_cast<std::size_t>(role)] - 1);
  }
  return cell;
}

/// Columns are about this many cells wide, so that a layer of one, with what its pairs give, fits in the second-level cache beside the next.
constexpr int column_width = 32;

std::vector<Cells::Strip> Cells::strips_of(int n_cells) {
  const int n_strips = std::max(1, (n_cells + column_width / 2) / column_width);
  std::vector<Strip> strips(static_cast<std::size_t>(n_cells));
  for (int number = 0; number < n_strips; ++number) {
    const Range cells = share_of(n_cells, number, n_strips);
    for (std::int64_t c = cells.begin; c < cells.end; ++c)
      strips[static_cast<std::size_t>(c)] = {static_cast<std::int32_t>(cells.begin),
                                             static_cast<std::int32_t>(cells.size()), number};
  }
  return strips;
}

/// Decides how wide the cells are, and the part of each axis.
void Cells::lay_out(const Particles& particles, const Box& domain, int n_threads) {
  Box box = bounds_of(particles, n_threads);
  if (box.low.x > box.high.x) box = {domain.low, domain.low};
  std::array<int, 3> counts_by_axis{};
  // Not many more cells than grains: a cell is read each time, filled or not.
  const double max_cells = 2.0 * particles.size() + 64.0;
  double width = reach_;
  for (;;) {
    double total = 1.0;
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<std::size_t>(axis);
      if (periodic_[a]) {
        box.low[axis] = domain.low[axis];
        box.high[axis] = domain.high[axis];
      }
      const double size = box.high[axis] - box.low[axis];
      const double count = std::max(1.0, periodic_[a] ? std::floor(size / width) : std::floor(size / width) + 1.0);
      counts_by_axis[a] = static_cast<int>(std::min(count, 1e6));
      total *= count;
    }
    if (total <= max_cells || !(width < 1e300)) break;
    width *= std::max(1.05, std::cbrt(total / max_cells));
  }
  axes_ = {0, 1, 2};
  std::stable_sort(axes_.begin(), axes_.end(), [&](int a, int b) {
    return counts_by_axis[static_cast<std::size_t>(a)] > counts_by_axis[static_cast<std::size_t>(b)];
  });
  low_ = box.low;
  for (int role = 0; role < 3; ++role) {
    const int axis = axes_[static_cast<std::size_t>(role)];
    const auto a = static_cast<std::size_t>(axis);
    counts_[static_cast<std::size_t>(role)] = counts_by_axis[a];
    wraps_[static_cast<std::size_t>(role)] = periodic_[a];
    inverse_width_[axis] = periodic_[a] ? counts_by_axis[a] / (box.high[axis] - box.low[axis]) : 1.0 / width;
  }
  strips_ = {strips_of(counts_[1]), strips_of(counts_[2])};
  n_columns_ = (strips_[0].back().number + 1) * (strips_[1].back().number + 1);
}

/// The first cell of each layer of each column, and the end.
std::vector<std::int32_t> Cells::layer_cells() const {
  std::vector<std::int32_t> first;
  for (int middle = 0; middle < counts_[1]; middle += strips_[0][static_cast<std::size_t>(middle)].width)
    for (int fast = 0; fast < counts_[2]; fast += strips_[1][static_cast<std::size_t>(fast)].width)
      for (int slow = 0; slow < counts_[0]; ++slow) first.push_back(index_of(slow, middle, fast));
  first.push_back(counts_[0] * counts_[1] * counts_[2]);
  return first;
}

void Cells::sort(const Particles& particles, const Box& domain, const std::array<bool, 3>& periodic, double reach,
                 int n_threads) {
  reach_ = reach;
  periodic_ = periodic;
  lay_out(particles, domain, n_threads);

  // Two levels: grains to layers of columns, keeping their order (each thread counts and places its own share), then each layer by
  // itself along its cells.
  const std::int32_t n = particles.size();
  const std::vector<std::int32_t> first_cell = layer_cells();
  const std::size_t n_layers = first_cell.size() - 1;
  const auto threads = static_cast<std::size_t>(n_threads);
  std::vector<std::int32_t> cell(static_cast<std::size_t>(n)), layer_of_grain(static_cast<std::size_t>(n));
  std::vector<std::int32_t> in_layer(static_cast<std::size_t>(n));
  std::vector<std::int32_t> counts(threads * n_layers, 0);
  std::vector<std::int32_t> layer_begin(n_layers + 1, 0);
  parallel(n_threads, [&](int thread) {
    const Range share = share_of(n, thread, n_threads);
    std::int32_t* const count = counts.data() + static_cast<std::size_t>(thread) * n_layers;
    for (std::int64_t i = share.begin; i < share.end; ++i) {
      std::int32_t& layer = layer_of_grain[static_cast<std::size_t>(i)];
      layer = -1;
      if (!particles.is_here(i)) continue;
      const std::array<int, 3> where = cell_of(particles.position(i));
      cell[static_cast<std::size_t>(i)] = index_of(where[0], where[1], where[2]);
      layer = layer_of(where);
      ++count[layer];
    }
  });
  std::int32_t sum = 0;
  for (std::size_t layer = 0; layer < n_layers; ++layer) {
    layer_begin[layer] = sum;
    for (std::size_t thread = 0; thread < threads; ++thread) {
      const std::int32_t c = counts[thread * n_layers + layer];
      counts[thread * n_layers + layer] = sum;
      sum += c;
    }
  }
  layer_begin[n_layers] = sum;
  order_.resize(static_cast<std::size_t>(sum));
  cell_begin_.assign(static_cast<std::size_t>(first_cell.back()) + 1, 0);
  parallel(n_threads, [&](int thread) {
    const Range share = share_of(n, thread, n_threads);
    std::int32_t* const place = counts.data() + static_cast<std::size_t>(thread) * n_layers;
    for (std::int64_t i = share.begin; i < share.end; ++i) {
      const std::int32_t layer = layer_of_grain[static_cast<std::size_t>(i)];
      if (layer >= 0) in_layer[static_cast<std::size_t>(place[layer]++)] = static_cast<std::int32_t>(i);
    }
    barrier();
    std::vector<std::int32_t> next;
    const Range layers = share_of(static_cast<std::int64_t>(n_layers), thread, n_threads);
    for (auto layer = static_cast<std::size_t>(layers.begin); layer < static_cast<std::size_t>(layers.end); ++layer) {
      const std::int32_t first = first_cell[layer];
      next.assign(static_cast<std::size_t>(first_cell[layer + 1] - first), 0);
      const auto cell_in_layer = [&](std::int32_t k) {
        return static_cast<std::size_t>(cell[static_cast<std::size_t>(in_layer[static_cast<std::size_t>(k)])] - first);
      };
      for (std::int32_t k = layer_begin[layer]; k < layer_begin[layer + 1]; ++k) ++next[cell_in_layer(k)];
      std::int32_t begin = layer_begin[layer];
      for (std::size_t c = 0; c < next.size(); ++c) {
        cell_begin_[static_cast<std::size_t>(first) + c] = begin;
        const std::int32_t count = next[c];
        next[c] = begin;
        begin += count;
      }
      for (std::int32_t k = layer_begin[layer]; k < layer_begin[layer + 1]; ++k)
        order_[static_cast<std::size_t>(next[cell_in_layer(k)]++)] = in_layer[static_cast<std::size_t>(k)];
    }
  });
  cell_begin_.back() = sum;

  furthest_in_column_ = 0;
  for (std::size_t layer = 0; layer < n_layers; ++layer) {
    const bool is_last = (layer + 1) % static_cast<std::size_t>(counts_[0]) == 0;
    furthest_in_column_ = std::max(furthest_in_column_, layer_begin[layer + (is_last ? 1 : 2)] - layer_begin[layer]);
  }
}

int Cells::runs_after(std::int32_t i, Vec3 position, Run* runs) const {
  const std::array<int, 3> where = cell_of(position);
  return runs_near(where, index_of(where[0], where[1], where[2]), i + 1, runs);
}

int Cells::runs_around(Vec3 point, Run* runs) const {
  // The point may lie outside the cells; further than one cell outside, nothing is near.
  std::array<int, 3> cell{};
  for (std::size_t role = 0; role < 3; ++role) {
    const int axis = axes_[role];
    const double c = std::floor((point[axis] - low_[axis]) * inverse_width_[axis]);
    if (!(c >= -2.0 && c <= counts_[role] + 1.0)) return 0;
    cell[role] = static_cast<int>(c);
    if (wraps_[role]) cell[role] = std::clamp(cell[role], 0, counts_[role] - 1);
  }
  return runs_near(cell, 0, 0, runs);
}

/// Runs of the grains from `first_grain` on, in the cells around one from `first_cell` on.
int Cells::runs_near(const std::array<int, 3>& cell, std::int32_t first_cell, std::int32_t first_grain,
                     Run* runs) const {
  const int n_slow = counts_[0], n_middle = counts_[1], n_fast = counts_[2];
  const int slow = cell[0], middle = cell[1], fast = cell[2];
  int n = 0;
  std::array<int, 3> step{};  // image steps by axis
  const auto add = [&](int s, int m, int first, int last) {
    while (first <= last) {  // from column to column
      const Strip& strip = strips_[1][static_cast<std::size_t>(first)];
      const int stop = std::min(last, strip.begin + strip.width - 1);
      const auto cells_end = static_cast<std::size_t>(index_of(s, m, stop)) + 1;
      const std::size_t cells_begin = cells_end - 1 - static_cast<std::size_t>(stop - first);
      first = stop + 1;
      if (cells_end <= static_cast<std::size_t>(first_cell)) continue;
      const std::int32_t begin = std::max(cell_begin_[cells_begin], first_grain), end = cell_begin_[cells_end];
      if (begin < end) runs[n++] = {{begin, end}, image::code(step[0], step[1], step[2])};
    }
  };
  for (int ds = -1; ds <= 1; ++ds) {
    int s = slow + ds, step_slow = 0;
    if (s < 0 || s >= n_slow) {
      if (!wraps_[0]) continue;
      step_slow = s < 0 ? 1 : -1;
      s += step_slow * n_slow;
    }
    step[static_cast<std::size_t>(axes_[0])] = step_slow;
    for (int dm = -1; dm <= 1; ++dm) {
      int m = middle + dm, step_middle = 0;
      if (m < 0 || m >= n_middle) {
        if (!wraps_[1]) continue;
        step_middle = m < 0 ? 1 : -1;
        m += step_middle * n_middle;
      }
      step[static_cast<std::size_t>(axes_[1])] = step_middle;
      step[static_cast<std::size_t>(axes_[2])] = 0;
      add(s, m, std::max(fast - 1, 0), std::min(fast + 1, n_fast - 1));
      if (wraps_[2] && fast == 0) {
        step[static_cast<std::size_t>(axes_[2])] = 1;
        add(s, m, n_fast - 1, n_fast - 1);
      }
      if (wraps_[2] && fast == n_fast - 1) {
        step[static_cast<std::size_t>(axes_[2])] = -1;
        add(s, m, 0, 0);
      }
    }
  }
  return n;
}

std::size_t Cells::memory() const { return (order_.capacity() + cell_begin_.capacity()) * sizeof(std::int32_t); }

}  // namespace moraine
