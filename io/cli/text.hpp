// Numbers as people read them.
#pragma once

#include <cstdint>
#include <string>

namespace moraine {

/// "12 s", "3 min 20 s", "2 h 05 min"
std::string duration_text(double seconds);
/// "640 B", "12.3 MB"
std::string bytes_text(double bytes);
/// "12 345 678"
std::string count_text(std::uint64_t count);
/// "1 grain", "2 grains"
std::string counted(std::uint64_t count, const std::string& thing);

}  // namespace moraine
