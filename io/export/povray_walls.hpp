// Walls of a scene in the language of POV-Ray.
#pragma once

#include <string>
#include <vector>

#include "engine/run/image.hpp"
#include "engine/scene/scene.hpp"
#include "io/export/camera.hpp"

namespace moraine {

/// Surfaces translucent where they lie behind the grains or are meshes, edges as thin lines; what would hide the grains is left out.
std::string povray_walls(const std::vector<WallDefinition>& walls, const Box& frame, const Camera& camera, double time);

/// Moving walls where an image has them.
std::vector<WallDefinition> moved_walls(std::vector<WallDefinition> walls, const Image& image);

/// The edges of a box as thin lines.
std::string povray_edges(const Box& box, double radius, const std::string& texture);

/// <x, y, z>
std::string povray_vector(Vec3 v);

}  // namespace moraine
