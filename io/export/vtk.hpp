// Snapshots for the Visualization Toolkit: .vtp (XML PolyData, raw appended data) and a .pvd that strings them together in time.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "engine/run/image.hpp"

namespace moraine {

/// The content of a .vtp file: one vertex a grain, every field as point data.
std::string vtp_text(const Image& image);

/// The content of a .pvd file: time [s] and file name of each frame.
std::string pvd_text(const std::vector<std::pair<double, std::string>>& frames);

}  // namespace moraine
