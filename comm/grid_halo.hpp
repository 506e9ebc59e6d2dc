// The ghost layers of values on a grid: filled from the ranks that own the cells, across periodic faces too.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "comm/grid_share.hpp"
#include "comm/halo.hpp"
#include "comm/world.hpp"
#include "kernels/base/grid.hpp"

namespace moraine {

class GridHalo {
 public:
  GridHalo() = default;
  /// For `n_fields` arrays at a time of the rank's block of `share`, values of value_bytes each, with `layers` ghost layers in
  /// memory, all of them filled. `world` has share.n_ranks() ranks; all make the same calls.
  GridHalo(const World& world, const GridShare& share, int layers, int n_fields, std::size_t value_bytes);

  /// Fills ghost layers, edges and corners too; those beyond faces that are not periodic stay as they are.
  void exchange(std::span<void* const> fields);
  template <typename T>
  void exchange(std::initializer_list<T*> fields) {
    std::vector<void*> pointers(fields.begin(), fields.end());
    exchange(std::span<void* const>(pointers));
  }

 private:
  /// What passes along y (0) or z (1): whole ghost layers, y before z so that edges come along.
  struct Along {
    Halo halo;
    int low = -1, high = -1;  // ranks of the neighbours, -1: none; this rank itself: the layers are copied here
    std::size_t to_low = 0, to_high = 0;  // links
  };
  template <typename Move>
  void for_each_row(int axis, int first_layer, Move move) const;
  void pack(int axis, bool is_high, std::span<void* const> fields, std::byte* to) const;
  void unpack(int axis, bool is_high, std::span<void* const> fields, const std::byte* from) const;
  void fill_along_x(std::span<void* const> fields) const;
  void fill_along(int axis, std::span<void* const> fields);

  static Along along_axis(const GridShare& share, int rank, int axis, std::size_t bytes,
                          std::vector<Halo::Link>& links);
  friend GridTraffic halo_traffic(const GridShare& share, int rank, int layers, int n_fields, std::size_t value_bytes);

  GridLayout layout_;
  int rank_ = 0;
  std::size_t value_bytes_ = 0;
  bool is_periodic_x_ = false;
  Along along_[2];
};

/// Of a rank in one exchange() of such a halo.
GridTraffic halo_traffic(const GridShare& share, int rank, int layers, int n_fields, std::size_t value_bytes);

}  // namespace moraine
