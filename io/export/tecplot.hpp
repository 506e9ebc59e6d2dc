// A snapshot for Tecplot: ASCII data files of one zone each, values point by point.
#pragma once

#include <string>

#include "engine/run/image.hpp"

namespace moraine {

/// The grains in order of gid, each a node and a finite element of its own (a triangle without sides: so both Tecplot and VTK take scattered points):
/// X, Y, Z [m], then every other field, vectors as three variables. Numbers read back to the same bits. Throws
/// ExportError where there are no positions.
std::string tecplot_grains(const Image& image);

/// The gas, an ordered zone, at the centres of its cells. Empty where the image has no gas.
std::string tecplot_gas(const Image& image);

}  // namespace moraine
