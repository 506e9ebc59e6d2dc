// A slice through the gas, for pictures.
#pragma once

#include <string>
#include <vector>

#include "engine/run/image.hpp"

namespace moraine {

/// One value a cell in the layer of cells in the middle of the domain that faces the viewer most: of those along x, y or z.
struct GasSlice {
  std::string label;           // "gas speed [m/s]"
  int axis = 1;                // that the slice is across
  double place = 0.0;          // [m] along it
  std::array<int, 2> n{};      // cells along the other two axes, in order
  std::vector<double> values;  // the first of the two runs fastest
};

/// `name`: a quantity of the gas on its cells (void_fraction, pressure, ...), or gas_speed. Throws ExportError that lists the names there are.
GasSlice gas_slice(const Image& image, const std::string& name, int axis);

}  // namespace moraine
