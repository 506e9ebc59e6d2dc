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

void Cells::sort(const Particles& particles, const Box& domain, const std::array<bool, 3>& periodic, double reach,
                 int n_threads) {
  reach_ = reach;
  const std::int32_t n = particles.size();
  Box box = bounds_of(particles, n_threads);
  if (box.low.x > box.high.x) box = {domain.low, domain.low};
  std::array<int, 3> counts_by_axis{};
  // Not many more cells than grains: a cell is read each time, filled or not.
  const double max_cells = 2.0 * n + 64.0;
  double width = reach;
  for (;;) {
    double total = 1.0;
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<std::size_t>(axis);
      if (periodic[a]) {
        box.low[axis] = domain.low[axis];
        box.high[axis] = domain.high[axis];
      }
      const double size = box.high[axis] - box.low[axis];
      const double count = std::max(1.0, periodic[a] ? std::floor(size / width) : std::floor(size / width) + 1.0);
      counts_by_axis[a] = static_cast<int>(std::min(count, 1e6));
      total *= count;
    }
    if (total <= max_cells || !(width < 1e300)) break;
    width *= std::max(1.05, std::cbrt(total / max_cells));
  }
  periodic_ = periodic;
  axes_ = {0, 1, 2};
  std::stable_sort(axes_.begin(), axes_.end(), [&](int a, int b) {
    return counts_by_axis[static_cast<std::size_t>(a)] > counts_by_axis[static_cast<std::size_t>(b)];
  });
  low_ = box.low;
  for (int role = 0; role < 3; ++role) {
    const int axis = axes_[static_cast<std::size_t>(role)];
    const auto a = static_cast<std::size_t>(axis);
    counts_[static_cast<std::size_t>(role)] = counts_by_axis[a];
    wraps_[static_cast<std::size_t>(role)] = periodic[a];
    inverse_width_[axis] = periodic[a] ? counts_by_axis[a] / (box.high[axis] - box.low[axis]) : 1.0 / width;
  }

  // Two levels: grains to slow layers, keeping their order (each thread counts and places its own share), then each layer by
  // itself along its cells.
  const auto n_layers = static_cast<std::size_t>(counts_[0]);
  const auto layer_size = static_cast<std::size_t>(counts_[1]) * static_cast<std::size_t>(counts_[2]);
  const auto threads = static_cast<std::size_t>(n_threads);
  std::vector<std::int32_t> cell(static_cast<std::size_t>(n));
  std::vector<std::int32_t> in_layer(static_cast<std::size_t>(n));
  std::vector<std::int32_t> counts(threads * n_layers, 0);
  std::vector<std::int32_t> layer_begin(n_layers + 1, 0);
  parallel(n_threads, [&](int thread) {
    const Range share = share_of(n, thread, n_threads);
    std::int32_t* const count = counts.data() + static_cast<std::size_t>(thread) * n_layers;
    for (std::int64_t i = share.begin; i < share.end; ++i) {
      std::int32_t& c = cell[static_cast<std::size_t>(i)];
      c = -1;
      if (!particles.is_here(i)) continue;
      const std::array<int, 3> where = cell_of(particles.position(i));
      c = (where[0] * counts_[1] + where[1]) * counts_[2] + where[2];
      ++count[where[0]];
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
  cell_of_.resize(static_cast<std::size_t>(sum));
  cell_begin_.assign(n_layers * layer_size + 1, 0);
  parallel(n_threads, [&](int thread) {
    const Range share = share_of(n, thread, n_threads);
    std::int32_t* const place = counts.data() + static_cast<std::size_t>(thread) * n_layers;
    for (std::int64_t i = share.begin; i < share.end; ++i) {
      const std::int32_t c = cell[static_cast<std::size_t>(i)];
      if (c < 0) continue;
      in_layer[static_cast<std::size_t>(place[static_cast<std::size_t>(c) / layer_size]++)] =
          static_cast<std::int32_t>(i);
    }
    barrier();
    std::vector<std::int32_t> next(layer_size);
    const Range layers = share_of(static_cast<std::int64_t>(n_layers), thread, n_threads);
    for (auto layer = static_cast<std::size_t>(layers.begin); layer < static_cast<std::size_t>(layers.end); ++layer) {
      const std::size_t first_cell = layer * layer_size;
      std::fill(next.begin(), next.end(), 0);
      for (std::int32_t k = layer_begin[layer]; k < layer_begin[layer + 1]; ++k)
        ++next[static_cast<std::size_t>(cell[static_cast<std::size_t>(in_layer[static_cast<std::size_t>(k)])]) -
               first_cell];
      std::int32_t begin = layer_begin[layer];
      for (std::size_t c = 0; c < layer_size; ++c) {
        cell_begin_[first_cell + c] = begin;
        const std::int32_t count = next[c];
        next[c] = begin;
        begin += count;
      }
      for (std::int32_t k = layer_begin[layer]; k < layer_begin[layer + 1]; ++k) {
        const std::int32_t i = in_layer[static_cast<std::size_t>(k)];
        const std::int32_t c = cell[static_cast<std::size_t>(i)];
        const auto place_of = static_cast<std::size_t>(next[static_cast<std::size_t>(c) - first_cell]++);
        order_[place_of] = i;
        cell_of_[place_of] = c;
      }
    }
  });
  cell_begin_.back() = sum;
}

int Cells::runs_after(std::int32_t i, Run* runs) const {
  const int cell = cell_of_[static_cast<std::size_t>(i)];
  const int n_middle = counts_[1], n_fast = counts_[2];
  const std::array<int, 3> where = {cell / (n_fast * n_middle), cell / n_fast % n_middle, cell % n_fast};
  return runs_near(where, where[0] * n_middle + where[1], i + 1, runs);
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

/// Runs of the grains from `first_grain` on, in rows from `first_row` on, in the cells around one.
int Cells::runs_near(const std::array<int, 3>& cell, int first_row, std::int32_t first_grain, Run* runs) const {
  const int n_slow = counts_[0], n_middle = counts_[1], n_fast = counts_[2];
  const int slow = cell[0], middle = cell[1], fast = cell[2];
  int n = 0;
  std::array<int, 3> step{};  // image steps by axis
  const auto add = [&](int row, int first, int last) {
    if (first > last) return;
    const std::int32_t begin = std::max(cell_begin_[static_cast<std::size_t>(row * n_fast + first)], first_grain);
    const std::int32_t end = cell_begin_[static_cast<std::size_t>(row * n_fast + last + 1)];
    if (begin < end) runs[n++] = {{begin, end}, image::code(step[0], step[1], step[2])};
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
      const int row = s * n_middle + m;
      if (row < first_row) continue;
      step[static_cast<std::size_t>(axes_[1])] = step_middle;
      step[static_cast<std::size_t>(axes_[2])] = 0;
      add(row, std::max(fast - 1, 0), std::min(fast + 1, n_fast - 1));
      if (wraps_[2] && fast == 0) {
        step[static_cast<std::size_t>(axes_[2])] = 1;
        add(row, n_fast - 1, n_fast - 1);
      }
      if (wraps_[2] && fast == n_fast - 1) {
        step[static_cast<std::size_t>(axes_[2])] = -1;
        add(row, 0, 0);
      }
    }
  }
  return n;
}

std::size_t Cells::memory() const {
  return (order_.capacity() + cell_begin_.capacity() + cell_of_.capacity()) * sizeof(std::int32_t);
}

}  // namespace moraine
