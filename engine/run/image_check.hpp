// An image may come from a file that nobody has written by this program: what it says must be possible in the scene.
#pragma once

#include <cstddef>

#include "engine/run/image.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

/// Throws SceneError with the first of this rank's rows that the scene cannot have: a place outside the domain, a
/// material or surface that there is not, two grains of one gid ... Velocities are left to the guard.
void expect_possible(const Scene& scene, std::size_t n_surfaces, const Image& image);

}  // namespace moraine
