#include "comm/grid_halo.hpp"

#include <algorithm>
#include <cstring>

namespace moraine {

namespace {

/// The part before or after `part` of `n`, around the end where periodic; -1: none.
int neighbour(int part, int by, int n, bool is_periodic) {
  const int next = part + by;
  if (next >= 0 && next < n) return next;
  return is_periodic ? (next + n) % n : -1;
}

/// Of a periodic line of n cells; n may be smaller than the ghost layers.
constexpr int wrapped(int i, int n) { return (i % n + n) % n; }

/// Bytes of the ghost layers at one face across y or z.
std::size_t bytes_of_face(const GridLayout& layout, int axis, int n_fields, std::size_t value_bytes) {
  const int layers = layout.ghost, along = axis == 1 ? layout.size[2] : layout.size[1];
  return static_cast<std::size_t>(layout.stride(0) * (layout.size[0] + 2 * layers)) *
         static_cast<std::size_t>(along + 2 * layers) * static_cast<std::size_t>(layers * n_fields) * value_bytes;
}

}  // namespace

GridHalo::GridHalo(const World& world, const GridShare& share, int layers, int n_fields, std::size_t value_bytes)
    : layout_(share.block(world.rank()), layers),
      rank_(world.rank()),
      value_bytes_(value_bytes),
      is_periodic_x_(share.periodic[0]) {
  for (int axis = 1; axis < 3; ++axis) {
    std::vector<Halo::Link> links;
    along_[axis - 1] = along_axis(share, rank_, axis, bytes_of_face(layout_, axis, n_fields, value_bytes), links);
    if (!links.empty()) along_[axis - 1].halo.open(world, std::move(links));
  }
}

/// One message to each neighbour; where both are the same rank, what goes to its high side lies first: it is what
/// its low neighbour, this rank, has at the high end.
GridHalo::Along GridHalo::along_axis(const GridShare& share, int rank, int axis, std::size_t bytes,
                                     std::vector<Halo::Link>& links) {
  const int py = rank % share.parts_y(), pz = rank / share.parts_y();
  const int parts = axis == 1 ? share.parts_y() : share.parts_z(), part = axis == 1 ? py : pz;
  const auto rank_of_part = [&](int p) { return p < 0 ? -1 : axis == 1 ? share.rank_of(p, pz) : share.rank_of(py, p); };
  const bool is_periodic = share.periodic[static_cast<std::size_t>(axis)];
  Along along;
  along.low = rank_of_part(neighbour(part, -1, parts, is_periodic));
  along.high = rank_of_part(neighbour(part, 1, parts, is_periodic));
  if (along.high >= 0 && along.high != rank) {
    along.to_high = links.size();
    links.push_back({along.high, bytes, bytes});
  }
  if (along.low >= 0 && along.low != rank) {
    if (along.low == along.high) {
      along.to_low = along.to_high;
      links[along.to_high].send_bytes = links[along.to_high].receive_bytes = 2 * bytes;
    } else {
      along.to_low = links.size();
      links.push_back({along.low, bytes, bytes});
    }
  }
  return along;
}

GridTraffic halo_traffic(const GridShare& share, int rank, int layers, int n_fields, std::size_t value_bytes) {
  const GridLayout layout(share.block(rank), layers);
  GridTraffic traffic;
  for (int axis = 1; axis < 3; ++axis) {
    std::vector<Halo::Link> links;
    GridHalo::along_axis(share, rank, axis, bytes_of_face(layout, axis, n_fields, value_bytes), links);
    for (const Halo::Link& link : links) {
      const auto sent = static_cast<std::int64_t>(link.send_bytes), got = static_cast<std::int64_t>(link.receive_bytes);
      traffic += {1, 1, sent, got};
    }
  }
  return traffic;
}

/// Rows of the layers [first_layer, first_layer + ghost) along the axis, whole in the other directions.
template <typename Move>
void GridHalo::for_each_row(int axis, int first_layer, Move move) const {
  const int g = layout_.ghost, across = axis == 1 ? 2 : 1;
  const std::size_t bytes = static_cast<std::size_t>(layout_.size[0] + 2 * g) * value_bytes_;
  for (int other = -g; other < layout_.size[static_cast<std::size_t>(across)] + g; ++other)
    for (int layer = first_layer; layer < first_layer + g; ++layer) {
      const std::int64_t at = axis == 1 ? layout_.at(-g, layer, other) : layout_.at(-g, other, layer);
      move(static_cast<std::size_t>(at) * value_bytes_, bytes);
    }
}

void GridHalo::pack(int axis, bool is_high, std::span<void* const> fields, std::byte* to) const {
  const int first = is_high ? layout_.size[static_cast<std::size_t>(axis)] - layout_.ghost : 0;
  for (void* const field : fields)
    for_each_row(axis, first, [&](std::size_t at, std::size_t bytes) {
      std::memcpy(to, static_cast<const std::byte*>(field) + at, bytes);
      to += bytes;
    });
}

void GridHalo::unpack(int axis, bool is_high, std::span<void* const> fields, const std::byte* from) const {
  const int first = is_high ? layout_.size[static_cast<std::size_t>(axis)] : -layout_.ghost;
  for (void* const field : fields)
    for_each_row(axis, first, [&](std::size_t at, std::size_t bytes) {
      std::memcpy(static_cast<std::byte*>(field) + at, from, bytes);
      from += bytes;
    });
}

void GridHalo::fill_along_x(std::span<void* const> fields) const {
  const int g = layout_.ghost, n = layout_.size[0];
  for (void* const field : fields) {
    std::byte* const values = static_cast<std::byte*>(field);
    for (int k = -g; k < layout_.size[2] + g; ++k)
      for (int j = -g; j < layout_.size[1] + g; ++j) {
        std::byte* const row = values + static_cast<std::size_t>(layout_.at(0, j, k)) * value_bytes_;
        const auto at = [&](int i) {
          return row + static_cast<std::ptrdiff_t>(i) * static_cast<std::ptrdiff_t>(value_bytes_);
        };
        for (int layer = 1; layer <= g; ++layer) {
          std::memcpy(at(-layer), at(wrapped(-layer, n)), value_bytes_);
          std::memcpy(at(n - 1 + layer), at(wrapped(n - 1 + layer, n)), value_bytes_);
        }
      }
  }
}

void GridHalo::fill_along(int axis, std::span<void* const> fields) {
  Along& along = along_[axis - 1];
  if (along.low < 0 && along.high < 0) return;
  if (along.low == rank_ || along.high == rank_) {  // periodic, and not divided
    const int g = layout_.ghost, n = layout_.size[static_cast<std::size_t>(axis)];
    for (void* const field : fields) {
      std::byte* const values = static_cast<std::byte*>(field);
      const std::ptrdiff_t layer_bytes =
          static_cast<std::ptrdiff_t>(layout_.stride(axis)) * static_cast<std::ptrdiff_t>(value_bytes_);
      const int across = axis == 1 ? 2 : 1;
      const std::size_t row = static_cast<std::size_t>(layout_.size[0] + 2 * g) * value_bytes_;
      for (int other = -g; other < layout_.size[static_cast<std::size_t>(across)] + g; ++other) {
        const std::int64_t first = axis == 1 ? layout_.at(-g, 0, other) : layout_.at(-g, other, 0);
        std::byte* const start = values + static_cast<std::size_t>(first) * value_bytes_;
        for (int layer = 1; layer <= g; ++layer) {
          std::memcpy(start - layer * layer_bytes, start + wrapped(-layer, n) * layer_bytes, row);
          std::memcpy(start + (n - 1 + layer) * layer_bytes, start + wrapped(n - 1 + layer, n) * layer_bytes, row);
        }
      }
    }
    return;
  }
  const std::size_t bytes =
      along.halo.outgoing(along.high >= 0 ? along.to_high : along.to_low).size() / (along.low == along.high ? 2 : 1);
  const bool is_shared = along.low == along.high;
  if (along.high >= 0) pack(axis, true, fields, along.halo.outgoing(along.to_high).data());
  if (along.low >= 0) pack(axis, false, fields, along.halo.outgoing(along.to_low).data() + (is_shared ? bytes : 0));
  along.halo.start();
  along.halo.finish();
  // What comes from the low neighbour is its high end, which lies first in its message.
  if (along.low >= 0) unpack(axis, false, fields, along.halo.incoming(along.to_low).data());
  if (along.high >= 0) unpack(axis, true, fields, along.halo.incoming(along.to_high).data() + (is_shared ? bytes : 0));
}

void GridHalo::exchange(std::span<void* const> fields) {
  if (is_periodic_x_) fill_along_x(fields);
  fill_along(1, fields);
  fill_along(2, fields);
}

}  // namespace moraine
