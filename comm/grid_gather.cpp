#include "comm/grid_gather.hpp"

#include <cstring>

namespace moraine {

namespace {

/// Rows along an axis that come of a rank's block: its cells, and the ghosts beyond the ends of the grid.
struct RowRange {
  int first, end;
};
RowRange rows_of(const GridShare& share, const CellBlock& block, std::size_t axis, int layers) {
  return {block.low[axis] == 0 ? -layers : 0,
          block.high[axis] - block.low[axis] + (block.high[axis] == share.n[axis] ? layers : 0)};
}

std::size_t bytes_of_block(const GridShare& share, int rank, int layers, std::size_t value_bytes) {
  const CellBlock block = share.block(rank);
  const RowRange y = rows_of(share, block, 1, layers), z = rows_of(share, block, 2, layers);
  return static_cast<std::size_t>(y.end - y.first) * static_cast<std::size_t>(z.end - z.first) *
         static_cast<std::size_t>(block.size(0) + 2 * layers) * value_bytes;
}

}  // namespace

GridTraffic to_root_traffic(const GridShare& share, int rank, int layers, std::size_t value_bytes) {
  const auto bytes = [&](int of) { return static_cast<std::int64_t>(bytes_of_block(share, of, layers, value_bytes)); };
  GridTraffic traffic;
  if (rank != 0) return {1, 0, bytes(rank), 0};
  for (int other = 1; other < share.n_ranks(); ++other) traffic += {0, 1, 0, bytes(other)};
  return traffic;
}

GridTraffic from_root_traffic(const GridShare& share, int rank, int layers, std::size_t value_bytes) {
  const GridTraffic back = to_root_traffic(share, rank, layers, value_bytes);
  return {back.n_received, back.n_sent, back.bytes_received, back.bytes_sent};
}

GridGather::GridGather(const World& world, const GridShare& share, int layers, std::size_t value_bytes)
    : share_(share), rank_(world.rank()), layers_(layers), value_bytes_(value_bytes) {
  if (share.n_ranks() == 1) return;
  const auto bytes_of = [&](int rank) { return bytes_of_block(share, rank, layers, value_bytes); };
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
  const RowRange y = rows_of(share_, block, 1, layers_), z = rows_of(share_, block, 2, layers_);
  for (int k = z.first; k < z.end; ++k)
    for (int j = y.first; j < y.end; ++j)
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
