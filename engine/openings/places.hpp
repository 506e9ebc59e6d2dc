// Places inside the shapes of openings.
#pragma once

#include <array>
#include <optional>

#include "engine/scene/scene.hpp"

namespace moraine {

/// Whether a point lies in a region (half-open along the axes of boxes and cylinders).
bool contains(const CylinderRegion& cylinder, Vec3 point);
bool contains(const SphereRegion& sphere, Vec3 point);

using InletShape = decltype(Inlet::where);

/// Whether a point lies in the region of an inlet; false for discs and polygons, which hold nothing.
bool contains(const InletShape& shape, Vec3 point);
/// Volume of the region [m3]; 0 for discs and polygons.
double volume_of(const InletShape& shape);
/// The box around all places that a sphere's centre can have [m].
Box bounds_of(const InletShape& shape);

/// The centre of a sphere that lies wholly inside a region, or whose centre lies on a disc or polygon at least its radius away from
/// its rim: the same for the same three numbers in [0, 1), and spread evenly where these are. None where the numbers lead
/// outside, or the sphere is too large.
std::optional<Vec3> place_in(const InletShape& shape, double radius, const std::array<double, 3>& numbers);

}  // namespace moraine
