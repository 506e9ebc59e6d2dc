// Sites of regular lattices inside a container, and small displacements from them.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/particles/pack_container.hpp"

namespace moraine {

/// Sites for spheres of that radius [m], neighbours at least `spacing` [m] apart, along x, then y, then z. In a
/// periodic direction that the region spans the lattice is stretched so that it closes. Flat: one layer.
std::vector<Vec3> lattice_sites(const Container& container, LatticeFill::Kind kind, double spacing, double radius);

/// A random vector of length 0 to 1, evenly distributed over the ball (flat: the disc).
Vec3 random_in_ball(std::uint64_t seed, std::uint64_t number, bool is_flat);

}  // namespace moraine
