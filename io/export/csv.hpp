// A snapshot as a table: a header with units, then one grain a line in order of gid.
#pragma once

#include <string>

#include "engine/run/image.hpp"

namespace moraine {

/// Columns: gid, then every other field, vectors as three ("velocity.x [m/s]"). Numbers read back to the same bits.
std::string csv_text(const Image& image);

}  // namespace moraine
