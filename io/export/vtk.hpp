// Snapshots for the Visualization Toolkit: .vtp and .vti (XML PolyData and ImageData, raw appended data), .pvtp over pieces of
// the former, and a .pvd that strings them together in time.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "engine/run/image.hpp"

namespace moraine {

/// Rows of an image's grains: [begin, end).
struct GrainRows {
  std::uint64_t begin = 0, end = 0;
};

/// The content of a .vtp file: one vertex a grain, every field as point data.
std::string vtp_text(const Image& image, GrainRows rows);
inline std::string vtp_text(const Image& image) { return vtp_text(image, {0, image.n_grains}); }

/// The content of a .pvtp file, which strings the pieces of one moment together: what their arrays are, and the names of their files.
std::string pvtp_text(const Image& image, const std::vector<std::string>& pieces);

/// The content of a .vti file: the cells of the gas with its quantities as cell data; NAME_x, NAME_y and NAME_z become
/// a vector. Empty where the image has no gas.
std::string vti_text(const Image& image);

/// The same for the cells of coarse-grained fields.
std::string vti_text(const FieldImage& fields);

/// The content of a .vtp file: the triangles of a wall, with the forces on them as cell data.
std::string vtp_text(const WallMap& map, double time);

/// The content of a .pvd file: time [s] and file name of each frame.
std::string pvd_text(const std::vector<std::pair<double, std::string>>& frames);

}  // namespace moraine
