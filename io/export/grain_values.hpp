// One number a grain, by name: what pictures are coloured by.
#pragma once

#include <string>
#include <vector>

#include "engine/run/image.hpp"

namespace moraine {

struct GrainValues {
  std::string label;           // "speed [m/s]"
  std::vector<double> values;  // in order of gid
};

/// A scalar field; a vector field (its length) or a component of it ("velocity.z"); or one of speed, diameter, x, y, z, mass.
/// Throws ExportError that lists the names there are.
GrainValues grain_values(const Image& image, const std::string& name);

/// The range of most values: from the 0.5th to the 99.5th percentile, so that a few grains in flight do not wash out the rest.
std::pair<double, double> usual_range(const std::vector<double>& values);

}  // namespace moraine
