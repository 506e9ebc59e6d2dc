// How a run shares space out over its ranks: the one function for the run itself and for the projection.
#pragma once

#include <span>

#include "comm/subdomains.hpp"
#include "comm/world.hpp"
#include "engine/run/plan.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

/// The widest skin that a run may come to use [m]: half the mean diameter, or what the scene says.
double widest_skin(const Scene& scene, const Plan& plan);

/// Cuts space for the grains of all ranks (each gives its own). `widest`: as widest_skin(). `weights`: the work of each grain, in any unit; empty: all the same, as at
/// the start of a run, when no pairs are known. No part will be narrower than the largest grains can be apart and still be a pair at the
/// widest skin. The same on every layout. All ranks call it.
Subdomains decompose(const World& world, int n_parts, std::span<const Vec3> positions, std::span<const float> weights,
                     const Scene& scene, double largest_radius, double widest);

/// Equal boxes, as nearly as parts may be cut, wherever the grains are. All ranks call it.
Subdomains decompose_evenly(const World& world, int n_parts, const Scene& scene, double largest_radius, double widest);

}  // namespace moraine
