#include "engine/contacts/cells.hpp"

#include <algorithm>
#include <cmath>

#include "engine/threads.hpp"

namespace moraine {

namespace {

Box bounds_of(const Centres& centres, int n_threads) {
  std::vector<Box> boxes(static_cast<std::size_t>(n_threads), Box::empty());
  parallel(n_threads, [&](int thread) {
    const Range share = share_of(centres.n, thread, n_threads);
    Box box = Box::empty();
    for (std::int64_t i = share.begin; i < share.end; ++i)
      if (centres.is_here(i)) box.include(centres[i]);
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
    const double c = (p[axis] - box_.low[axis]) * inverse_width_[axis];
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
void Cells::lay_out(const Centres& centres, const Box& domain, int n_threads) {
  Box box = bounds_of(centres, n_threads);
  if (box.low.x > box.high.x) box = {domain.low, domain.low};
  std::array<int, 3> counts_by_axis{};
  // Not many more cells than grains: a cell is read each time, filled or not.
  const double max_cells = 2.0 * centres.n + 64.0;
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
  box_ = box;
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

void Cells::sort(const Centres& centres, const Box& domain, const std::array<bool, 3>& periodic, double reach,
                 int n_threads) {
  reach_ = reach;
  periodic_ = periodic;
  lay_out(centres, domain, n_threads);

  // Two levels: grains to layers of columns, keeping their order (each thread counts and places its own share), then each layer by
  // itself along its cells.
  const std::int32_t n = centres.n;
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
      if (!centres.is_here(i)) continue;
      const std::array<int, 3> where = cell_of(centres[i]);
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

int Cells::runs_around(const std::array<int, 3>& cell, Run* runs) const {
  const int n_slow = counts_[0], n_middle = counts_[1], n_fast = counts_[2];
  const auto [slow, middle, fast] = cell;
  int n = 0;
  std::array<int, 3> step{};  // image steps by axis
  const auto add = [&](int s, int m, int first, int last) {
    if (first > last) return;
    for_each_piece(s, m, first, last, [&](Range grains) {
      if (!grains.empty()) runs[n++] = {grains, image::code(step[0], step[1], step[2])};
    });
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

int Cells::Walk::runs_after(std::int32_t i, Vec3 position, Run* runs) {
  if (i < begin_ || i >= end_) {
    const std::array<int, 3> cell = cells_.cell_of(position);
    const auto place = static_cast<std::size_t>(cells_.index_of(cell[0], cell[1], cell[2]));
    begin_ = cells_.cell_begin_[place];
    end_ = cells_.cell_begin_[place + 1];
    n_around_ = cells_.runs_around(cell, around_);
  }
  int n = 0;
  for (int r = 0; r < n_around_; ++r) {
    const Range& grains = around_[r].grains;
    if (grains.end > i + 1) runs[n++] = {{std::max<std::int64_t>(grains.begin, i + 1), grains.end}, around_[r].image};
  }
  return n;
}

void Cells::runs_within(Vec3 point, double reach, std::vector<Run>& runs) const {
  runs.clear();
  reach *= 1.0 + 1e-9;  // room for rounding, here and where grains were put into cells
  // Everything in widths of a cell from the low corner, by role; where the domain is periodic, cells go on beyond its faces.
  std::array<double, 3> centre{}, width{};
  for (std::size_t role = 0; role < 3; ++role) {
    const int axis = axes_[role];
    width[role] = 1.0 / inverse_width_[axis];
    centre[role] = point[axis] - box_.low[axis];
  }
  const auto cells_between = [&](std::size_t role, double half) {
    const double low = std::floor((centre[role] - half) / width[role] - 1e-9);
    const double high = std::floor((centre[role] + half) / width[role] + 1e-9);
    const double n = counts_[role];
    const double first = wraps_[role] ? -2.0 * n : 0.0, last = wraps_[role] ? 3.0 * n - 1.0 : n - 1.0;
    if (!(high >= first && low <= last)) return Range{0, 0};
    return Range{static_cast<std::int64_t>(std::max(low, first)), static_cast<std::int64_t>(std::min(high, last)) + 1};
  };
  const auto gap_to = [&](std::size_t role, std::int64_t cell) {
    const double low = static_cast<double>(cell) * width[role];
    return std::max({0.0, low - centre[role], centre[role] - low - width[role]});
  };
  const auto period_of = [&](std::size_t role, std::int64_t cell) {
    const std::int64_t n = counts_[role];
    return static_cast<int>((cell + 2 * n) / n - 2);
  };
  std::array<int, 3> step{};  // image steps by axis
  const Range slow_cells = cells_between(0, reach);
  for (std::int64_t slow = slow_cells.begin; slow < slow_cells.end; ++slow) {
    const int slow_period = period_of(0, slow);
    step[static_cast<std::size_t>(axes_[0])] = -slow_period;
    const double slow_gap = gap_to(0, slow), slow_left = reach * reach - slow_gap * slow_gap;
    const Range middle_cells = cells_between(1, std::sqrt(std::max(0.0, slow_left)));
    for (std::int64_t middle = middle_cells.begin; middle < middle_cells.end; ++middle) {
      const int middle_period = period_of(1, middle);
      step[static_cast<std::size_t>(axes_[1])] = -middle_period;
      const double middle_gap = gap_to(1, middle), left = slow_left - middle_gap * middle_gap;
      const Range fast_cells = cells_between(2, std::sqrt(std::max(0.0, left)));
      for (std::int64_t fast = fast_cells.begin; fast < fast_cells.end;) {
        const int fast_period = period_of(2, fast);
        step[static_cast<std::size_t>(axes_[2])] = -fast_period;
        const std::int64_t origin = std::int64_t{fast_period} * counts_[2];
        const std::int64_t end = std::min<std::int64_t>(fast_cells.end, origin + counts_[2]);
        for_each_piece(static_cast<int>(slow - std::int64_t{slow_period} * counts_[0]),
                       static_cast<int>(middle - std::int64_t{middle_period} * counts_[1]),
                       static_cast<int>(fast - origin), static_cast<int>(end - 1 - origin), [&](Range grains) {
                         if (!grains.empty()) runs.push_back({grains, image::code(step[0], step[1], step[2])});
                       });
        fast = end;
      }
    }
  }
}

std::size_t Cells::memory() const { return (order_.capacity() + cell_begin_.capacity()) * sizeof(std::int32_t); }

}  // namespace moraine
