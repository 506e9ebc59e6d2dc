// What one of the ranks has to say, known to all.
#pragma once

#include <string>

#include "comm/world.hpp"

namespace moraine {

/// The text of the first rank that has one; empty where none has. All ranks call it.
std::string first_text(const World& world, std::string text);

}  // namespace moraine
