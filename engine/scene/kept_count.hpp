// Whole numbers that checkpoints keep among their real ones.
#pragma once

#include <cmath>
#include <cstdint>
#include <string>

#include "engine/scene/scene.hpp"

namespace moraine {

/// A count that a checkpoint holds under that name: whole, 0 to 2^63. Throws SceneError where it can be none, for a file may come from anywhere.
inline std::uint64_t kept_count(double value, const std::string& name) {
  if (!(value >= 0.0 && value < 9223372036854775808.0) || value != std::floor(value))
    throw SceneError({{"",
                       "the checkpoint cannot be of this scene: \"" + name + "\" holds " + std::to_string(value) +
                           " where a count must be",
                       false}});
  return static_cast<std::uint64_t>(value);
}

}  // namespace moraine
