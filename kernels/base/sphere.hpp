// The sphere's volume and moment of inertia, in one place.
#pragma once

#include <numbers>

namespace moraine {

/// [m3] of a sphere of that radius [m].
constexpr double sphere_volume(double radius) { return 4.0 / 3.0 * std::numbers::pi * radius * radius * radius; }
/// [kg m2] of a solid sphere about its centre.
constexpr double sphere_inertia(double mass, double radius) { return 0.4 * mass * radius * radius; }

}  // namespace moraine
