// From the blocks of the gas grid that ranks hold to the rows of an image, x fastest and in order of rank, and back.
#pragma once

#include <array>

#include "comm/grid_share.hpp"
#include "comm/world.hpp"
#include "engine/gas/grid_field.hpp"
#include "engine/run/image.hpp"

namespace moraine {

/// The values of one quantity of the gas over all its blocks.
struct GridPlaces {
  GridShare share;  // cells; the first ranks have a block each
  int face_axis =
      -1;  // 0, 1, 2: on the low faces along that axis, and the last face where it is not periodic; -1: on cells

  /// How many there are along each axis.
  std::array<int, 3> n_values() const;
  /// Those of a rank: its block, with the last face where it ends there.
  CellBlock block(int rank) const;
};

/// Fills in n and this rank's values. `field` is nullptr where the rank has no block. All ranks of `world`.
void gather_grid(const World& world, const GridPlaces& places, const GridField<>* field, GridArray& array);
/// The opposite; ranks may hold any numbers of consecutive values. Ghost layers stay as they are. Throws SceneError where the array has other numbers of values.
void put_grid(const World& world, const GridPlaces& places, const GridArray& array, GridField<>* field);

}  // namespace moraine
