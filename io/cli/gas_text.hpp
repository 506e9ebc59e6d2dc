// What a scene says of its gas, in lines for `moraine check`.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/scene/scene.hpp"

namespace moraine {

/// Cells and their size in grain diameters, gas step, drag law, boundaries in words, limits. `time_step`: of the grains
/// [s]; `grain_steps` in a gas step. Empty in a scene without gas.
std::vector<std::string> gas_lines(const Scene& scene, double time_step, std::uint64_t grain_steps);

}  // namespace moraine
