// Where the ranks' boxes lie: the cuts of a run at its start and at each rebalancing, and of a projection.
#pragma once

#include <span>

#include "comm/subdomains.hpp"
#include "comm/world.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

/// Cuts the scene's domain into n_parts for the grains at these positions [m], of these weights (any unit). Grains may lie on any ranks of
/// `world`; all ranks call it. `widest_skin` [m]: the pair list will not use a wider one.
Subdomains decompose(const World& world, int n_parts, std::span<const Vec3> positions, std::span<const float> weights,
                     const Scene& scene, double largest_radius, double widest_skin);

/// The widest skin that the pair list may come to use [m], for grains of this mean diameter [m].
double widest_skin(const Scene& scene, double mean_diameter);

}  // namespace moraine
