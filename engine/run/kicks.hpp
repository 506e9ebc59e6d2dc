// The kicks of a run (kernels/motion): that of a step, and that which brings velocities to the time of the positions.
#pragma once

#include <cstdint>

#include "engine/scene/scene.hpp"
#include "kernels/motion/motion.hpp"

namespace moraine {

/// A kick over `h`, with a drift over `dt` [s].
Kick kick_of(const Scene& scene, double h, double dt);
/// For those who look between steps: velocities are half a step late, but for the start. No drift.
Kick kick_to_positions(const Scene& scene, std::uint64_t step, double dt);

}  // namespace moraine
