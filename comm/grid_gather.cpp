#include "comm/grid_gather.hpp"

#include <cstring>

namespace moraine {

GridGather::GridGather(const World& world, const GridShare& share, int layers, std::size_t value_bytes)
    : share_(share), rank_(world.rank()), layers_(layers), value_bytes_(value_bytes) {
  if (share.n_ranks() == 1) return;
  const auto bytes_of = [&](int rank) {
    std::size_t sum = 0;
    for_each_row(rank, [&](std::size_t, std::size_t, std::size_t bytes) { sum += bytes; });
    return sum;
  };
  std::vector<Halo::Link> to, from;
  if (rank_ == 0) {
    for (int rank = 1; rank < share.n_ranks(); ++rank) {
      to.push_back({rank, 0, bytes_of(rank)});
      from.push_back({rank, bytes_of(rank), 0});
    }
  } else {
    to.push_back({0, bytes_of(rank_), 0});
    from.push_back({0, 0, bytes_of(rank_)});
  }
  to_.open(world, std::move(to));
  from_.open(world, std::move(from));
}

/// Calls move(position in the rank's array, position in the whole array, bytes) for each line along x of the rank's cells, and of the
/// ghosts next to them beyond the ends of the grid.
template <typename Move>
void GridGather::for_each_row(int rank, Move move) const {
  const CellBlock block = share_.block(rank);
  const GridLayout own(block, layers_), whole({{0, 0, 0}, share_.n}, layers_);
  const std::size_t bytes = static_cast<std::size_t>(block.size(0) + 2 * layers_) * value_bytes_;
  const auto first = [&](std::size_t axis) { return block.low[axis] == 0 ? -layers_ : 0; };
  const auto end = [&](std::size_t axis) {
    return block.high[axis] - block.low[axis] + (block.high[axis] == share_.n[axis] ? layers_ : 0);
  };
  for (int k = first(2); k < end(2); ++k)
    for (int j = first(1); j < end(1); ++j)
      move(static_cast<std::size_t>(own.at(-layers_, j, k)) * value_bytes_,
           static_cast<std::size_t>(whole.at(-layers_, block.low[1] + j, block.low[2] + k)) * value_bytes_, bytes);
}

void GridGather::to_root(const void* block, void* whole) {
  const auto* const own = static_cast<const std::byte*>(block);
  auto* const all = static_cast<std::byte*>(whole);
  if (rank_ != 0) {
    std::byte* to = to_.outgoing(0).data();
    for_each_row(rank_, [&](std::size_t at, std::size_t, std::size_t bytes) {
      std::memcpy(to, own + at, bytes);
      to += bytes;
    });
  }
  to_.start();
  if (rank_ == 0)
    for_each_row(0, [&](std::size_t at, std::size_t to, std::size_t bytes) { std::memcpy(all + to, own + at, bytes); });
  to_.finish();
  if (rank_ != 0) return;
  for (int rank = 1; rank < share_.n_ranks(); ++rank) {
    const std::byte* from = to_.incoming(static_cast<std::size_t>(rank - 1)).data();
    for_each_row(rank, [&](std::size_t, std::size_t to, std::size_t bytes) {
      std::memcpy(all + to, from, bytes);
      from += bytes;
    });
  }
}

void GridGather::from_root(const void* whole, void* block) {
  const auto* const all = static_cast<const std::byte*>(whole);
  auto* const own = static_cast<std::byte*>(block);
  if (rank_ == 0) {
    for (int rank = 1; rank < share_.n_ranks(); ++rank) {
      std::byte* to = from_.outgoing(static_cast<std::size_t>(rank - 1)).data();
      for_each_row(rank, [&](std::size_t, std::size_t from, std::size_t bytes) {
        std::memcpy(to, all + from, bytes);
        to += bytes;
      });
    }
  }
  from_.start();
  if (rank_ == 0)
    for_each_row(
        0, [&](std::size_t at, std::size_t from, std::size_t bytes) { std::memcpy(own + at, all + from, bytes); });
  from_.finish();
  if (rank_ == 0) return;
  const std::byte* from = from_.incoming(0).data();
  for_each_row(rank_, [&](std::size_t at, std::size_t, std::size_t bytes) {
    std::memcpy(own + at, from, bytes);
    from += bytes;
  });
}

}  // namespace moraine
