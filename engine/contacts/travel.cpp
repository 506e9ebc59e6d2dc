#include "engine/contacts/travel.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/threads.hpp"

namespace moraine {

namespace {

/// Blocks of two cells along each axis (the last of three where their number is odd, or all there is), by role as in Cells.
class Blocks {
 public:
  explicit Blocks(const Cells& cells) : cells_(cells) {
    for (std::size_t role = 0; role < 3; ++role) counts_[role] = std::max(1, cells.counts()[role] / 2);
  }
  /// Blocks lie in rows along the fast axis.
  int n_rows() const { return counts_[0] * counts_[1]; }
  int row_length() const { return counts_[2]; }

  /// Calls f(range of grains) for the grains of a block.
  template <typename Function>
  void for_each_run(int row, int place, Function f) const {
    const std::array<int, 3> block = {row / counts_[1], row % counts_[1], place};
    const auto begin = [&](std::size_t role) { return 2 * block[role]; };
    const auto end = [&](std::size_t role) {
      return block[role] == counts_[role] - 1 ? cells_.counts()[role] : begin(role) + 2;
    };
    for (int slow = begin(0); slow < end(0); ++slow)
      for (int middle = begin(1); middle < end(1); ++middle)
        cells_.for_each_piece(slow, middle, begin(2), end(2) - 1, f);
  }
  /// Calls f(block) for the block itself and neighbours of it, so that of any two neighbours one is called for the other. A block's number is
  /// row times row length plus place.
  template <typename Function>
  void for_each_neighbour(int row, int place, Function f) const {
    const std::array<int, 3> block = {row / counts_[1], row % counts_[1], place};
    for (int ahead = 13; ahead < 27; ++ahead) {  // 13: the block itself
      const std::array<int, 3> step = {ahead / 9 - 1, ahead / 3 % 3 - 1, ahead % 3 - 1};
      std::array<int, 3> other{};
      bool is_there = true;
      for (std::size_t role = 0; role < 3; ++role) {
        other[role] = block[role] + step[role];
        if (other[role] >= 0 && other[role] < counts_[role]) continue;
        is_there = is_there && cells_.wraps()[role];
        other[role] = (other[role] + counts_[role]) % counts_[role];
      }
      if (is_there) f((other[0] * counts_[1] + other[1]) * counts_[2] + other[2]);
    }
  }

 private:
  const Cells& cells_;
  std::array<int, 3> counts_{};
};

bool is_empty(const Box& spread) { return !(spread.low.x <= spread.high.x); }

/// Of two displacements, one of each.
double largest_difference_squared(const Box& a, const Box& b) {
  return squared_length({std::max(a.high.x - b.low.x, b.high.x - a.low.x),
                         std::max(a.high.y - b.low.y, b.high.y - a.low.y),
                         std::max(a.high.z - b.low.z, b.high.z - a.low.z)});
}

/// Squares of what Travelled has [m2].
struct Squares {
  double furthest = 0.0, difference = 0.0, border = 0.0;
  char padding[64] = {};  // threads write their own cache lines
  void include(const Squares& other) {
    furthest = std::max(furthest, other.furthest);
    difference = std::max(difference, other.difference);
    border = std::max(border, other.border);
  }
};

}  // namespace

void TravelWatch::begin(const Particles& particles, const Box& inner, int n_threads) {
  inner_ = inner;
  places_.resize(static_cast<std::size_t>(particles.size()));
  parallel(n_threads, [&](int thread) {
    const Range share = share_of(particles.size(), thread, n_threads);
    for (std::int64_t i = share.begin; i < share.end; ++i)
      places_[static_cast<std::size_t>(i)] = particles.position(static_cast<std::int32_t>(i));
  });
}

Travelled TravelWatch::measure(const Particles& particles, const Cells& cells, double skin, int n_threads) {
  const Blocks blocks(cells);
  const int length = blocks.row_length();
  spreads_.resize(static_cast<std::size_t>(blocks.n_rows()) * static_cast<std::size_t>(length));
  std::vector<Squares> squares(static_cast<std::size_t>(n_threads));
  parallel(n_threads, [&](int thread) {
    const Range rows = share_of(blocks.n_rows(), thread, n_threads);
    Squares most;
    for (auto row = static_cast<int>(rows.begin); row < rows.end; ++row)
      for (int place = 0; place < length; ++place) {
        Box spread = Box::empty();
        blocks.for_each_run(row, place, [&](Range grains) {
          for (std::int64_t i = grains.begin; i < grains.end; ++i) {
            const Vec3 moved = displacement(particles, i);
            const double square = squared_length(moved);
            if (!(square >= 0.0)) continue;  // it has left
            spread.include(moved);
            most.furthest = std::max(most.furthest, square);
            if (!inner_.contains(places_[static_cast<std::size_t>(i)])) most.border = std::max(most.border, square);
          }
        });
        spreads_[static_cast<std::size_t>(row * length + place)] = spread;
      }
    barrier();
    for (auto row = static_cast<int>(rows.begin); row < rows.end; ++row)
      for (int place = 0; place < length; ++place) {
        const Box& own = spreads_[static_cast<std::size_t>(row * length + place)];
        if (is_empty(own)) continue;
        blocks.for_each_neighbour(row, place, [&](int block) {
          const Box& other = spreads_[static_cast<std::size_t>(block)];
          if (!is_empty(other)) most.difference = std::max(most.difference, largest_difference_squared(own, other));
        });
      }
    squares[static_cast<std::size_t>(thread)] = most;
  });
  Squares most;
  for (const Squares& of_thread : squares) most.include(of_thread);
  Travelled travelled;
  travelled.furthest = std::sqrt(most.furthest);
  travelled.border = std::sqrt(most.border);
  // Grains of blocks that are no neighbours, and those inside of the border and of other ranks, are two cells apart, and reach less far than
  // one: none of them meet before one has come half a cell. (Boxes may be wider than the grains in them have come.)
  travelled.nearer = std::max(std::min(0.5 * std::sqrt(most.difference), travelled.furthest),
                              travelled.furthest * skin / cells.reach());
  return travelled;
}

Travelled TravelWatch::measure(const Particles& particles, int n_threads) const {
  std::vector<Squares> squares(static_cast<std::size_t>(n_threads));
  parallel(n_threads, [&](int thread) {
    const Range share = share_of(particles.size(), thread, n_threads);
    Squares most;
    for (std::int64_t i = share.begin; i < share.end; ++i) {
      const double square = squared_length(displacement(particles, i));
      if (square > most.furthest) most.furthest = square;  // false for grains that have left
    }
    squares[static_cast<std::size_t>(thread)] = most;
  });
  Squares most;
  for (const Squares& of_thread : squares) most.include(of_thread);
  const double furthest = std::sqrt(most.furthest);
  return {furthest, furthest, furthest};
}

}  // namespace moraine
