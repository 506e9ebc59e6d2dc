// Cells at least as wide as two grains can be apart and still be a pair, and the order of the grains along them.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "engine/particles/particles.hpp"
#include "kernels/base/box.hpp"
#include "kernels/search/pair_filter.hpp"

namespace moraine {

/// Periodic image of a grain, two to either side along each axis. Code 0 is the grain itself. With `shift` of the code,
/// x_a - x_b + shift is the separation of a from that image of b.
namespace image {
constexpr std::uint8_t code(int x, int y, int z) {
  return static_cast<std::uint8_t>((x + 5) % 5 + 5 * ((y + 5) % 5) + 25 * ((z + 5) % 5));
}
constexpr std::array<int, 3> steps(std::uint8_t code) {
  const auto signed_step = [](int digit) { return digit > 2 ? digit - 5 : digit; };
  return {signed_step(code % 5), signed_step(code / 5 % 5), signed_step(code / 25)};
}
constexpr std::uint8_t inverse(std::uint8_t c) {
  const auto s = steps(c);
  return code(-s[0], -s[1], -s[2]);
}
/// The image's image.
constexpr std::uint8_t sum(std::uint8_t c, std::uint8_t d) {
  const auto s = steps(c), t = steps(d);
  return code(s[0] + t[0], s[1] + t[1], s[2] + t[2]);
}
/// The code of a pair of which one grain (b or a) has been brought back by whole periods: x(new) = x(old) + by * period. The separation
/// x_a - x_b + shift stays: where x_a grows by a period, the shift falls by one; as x_b grows, it grows.
constexpr std::uint8_t shifted(std::uint8_t c, const std::array<int, 3>& by, bool is_b) {
  const auto s = steps(c);
  const int sign = is_b ? 1 : -1;
  return code(s[0] + sign * by[0], s[1] + sign * by[1], s[2] + sign * by[2]);
}
/// Of a grain and its own image, the one of the two codes that stands for both.
constexpr bool is_positive(std::uint8_t c) {
  const auto s = steps(c);
  return s[0] != 0 ? s[0] > 0 : s[1] != 0 ? s[1] > 0 : s[2] > 0;
}
inline constexpr std::size_t n_codes = 125;
}  // namespace image

/// Centres of grains, as they lie in records or in an array of their own; one that is nowhere has no number for x.
struct Centres {
  const double* first = nullptr;
  std::int64_t stride = 0;  // doubles from one to the next
  std::int32_t n = 0;
  Vec3 operator[](std::int64_t i) const {
    const double* const p = first + i * stride;
    return {p[0], p[1], p[2]};
  }
  bool is_here(std::int64_t i) const { return first[i * stride] == first[i * stride]; }
  static Centres of(const Particles& particles) { return {particles.records(), particles.stride(), particles.size()}; }
};

/// Cells over the grains; axes by role: slow (most cells), middle, fast (neighbours in memory). Wide layers are cut along the middle and
/// the fast axis into columns, which are walked one after the other, each from layer to layer along the slow axis.
class Cells {
 public:
  /// Lays the cells out for grains whose centres may come nearer than `reach` [m], and finds the sorted order of the grains
  /// (those that have left are left out).
  void sort(const Centres& centres, const Box& domain, const std::array<bool, 3>& periodic, double reach,
            int n_threads);

  /// order()[i] is the present place of the grain that comes to place i.
  const std::vector<std::int32_t>& order() const { return order_; }

  using Run = GrainRun;  // by places in sorted order
  class Walk;
  /// Runs of all grains that may be nearer than `reach` [m] to a point that is no grain of these, however far that is. Replaces what is
  /// in `runs`.
  void runs_within(Vec3 point, double reach, std::vector<Run>& runs) const;
  static constexpr int max_runs = 27;

  /// Centres may come nearer than this [m].
  double reach() const { return reach_; }
  /// True where the domain was periodic in the directions of all steps of that image code.
  bool has_image(std::uint8_t code) const {
    const auto s = image::steps(code);
    return (s[0] == 0 || periodic_[0]) && (s[1] == 0 || periodic_[1]) && (s[2] == 0 || periodic_[2]);
  }

  /// All grains lie in it; where the domain was periodic it is as wide as that [m].
  const Box& box() const { return box_; }
  bool is_periodic(int axis) const { return periodic_[static_cast<std::size_t>(axis)]; }
  /// Number of cells along the slow, middle and fast axis.
  const std::array<int, 3>& counts() const { return counts_; }
  int n_columns() const { return n_columns_; }
  /// True where the grains at one end of that axis, by role, see those at the other.
  const std::array<bool, 3>& wraps() const { return wraps_; }
  /// Calls f(grains) for the pieces of a row of cells, from `first` to `last` along the fast axis: one in each column.
  template <typename Function>
  void for_each_piece(int slow, int middle, int first, int last, Function f) const {
    while (first <= last) {
      const Strip& strip = strips_[1][static_cast<std::size_t>(first)];
      const int stop = std::min(last, strip.begin + strip.width - 1);
      const auto begin = static_cast<std::size_t>(index_of(slow, middle, first));
      f(Range{cell_begin_[begin], cell_begin_[begin + static_cast<std::size_t>(stop - first) + 1]});
      first = stop + 1;
    }
  }
  /// Grains that are near each other within one column are no further apart in sorted order.
  std::int32_t furthest_in_column() const { return furthest_in_column_; }
  std::size_t memory() const;

 private:
  /// The cells of one axis that belong to the same columns.
  struct Strip {
    std::int32_t begin = 0, width = 1, number = 0;
  };
  static std::vector<Strip> strips_of(int n_cells);
  std::array<int, 3> cell_of(Vec3 p) const;
  /// Runs of all grains in a cell and those around it; at most max_runs.
  int runs_around(const std::array<int, 3>& cell, Run* runs) const;
  /// Place of a cell in the order of memory.
  std::int32_t index_of(int slow, int middle, int fast) const {
    const Strip& m = strips_[0][static_cast<std::size_t>(middle)];
    const Strip& f = strips_[1][static_cast<std::size_t>(fast)];
    return counts_[0] * (m.begin * counts_[2] + m.width * f.begin) + (slow * m.width + middle - m.begin) * f.width +
           fast - f.begin;
  }
  /// Number of a column's layer in the order of memory.
  std::int32_t layer_of(const std::array<int, 3>& cell) const {
    const Strip& m = strips_[0][static_cast<std::size_t>(cell[1])];
    const Strip& f = strips_[1][static_cast<std::size_t>(cell[2])];
    return (m.number * (strips_[1].back().number + 1) + f.number) * counts_[0] + cell[0];
  }
  void lay_out(const Centres& centres, const Box& domain, int n_threads);
  std::vector<std::int32_t> layer_cells() const;

  std::array<int, 3> axes_{0, 1, 2};  // which axis is slow, middle, fast
  std::array<int, 3> counts_{1, 1, 1};
  std::array<bool, 3> wraps_{};               // by role
  std::array<bool, 3> periodic_{};            // by axis
  std::array<std::vector<Strip>, 2> strips_;  // of each middle, and of each fast cell
  int n_columns_ = 1;
  std::int32_t furthest_in_column_ = 0;
  double reach_ = 0.0;
  Box box_;
  Vec3 inverse_width_;
  std::vector<std::int32_t> order_;
  std::vector<std::int32_t> cell_begin_;  // of each cell, and the end
};

/// Asks for grains one after the other, in sorted order: those of a cell have the same runs around them.
class Cells::Walk {
 public:
  explicit Walk(const Cells& cells) : cells_(cells) {}
  /// Runs of grains that may be near grain i (by sorted place), which lies at `position`, and come after it. At most max_runs.
  int runs_after(std::int32_t i, Vec3 position, Run* runs);

 private:
  const Cells& cells_;
  std::int32_t begin_ = 0, end_ = 0;  // of the cell
  Run around_[max_runs];
  int n_around_ = 0;
};

}  // namespace moraine
