// Who needs a copy (a ghost) of a grain: the one rule for the engine, which makes the ghosts, and for the projection, which
// only counts them.
//
// First, whoever is nearer to a grain than its radius, the largest of its class of sizes, and the skin: so all see what is as large as
// their own grains or larger. Then, where there are several classes: the owner of a larger grain needs those smaller ones that are
// a pair with it. Their owners know the larger one as a ghost by then, and find them; so nobody needs all fines within the reach of
// a boulder that is not there.
#pragma once

#include <span>

#include "comm/subdomains.hpp"
#include "kernels/base/vec3.hpp"

namespace moraine {

/// How far from a grain a partner of a pair no larger than `largest_radius` can lie [m], with room for rounding.
inline double ghost_reach(double radius, double largest_radius, double skin) {
  return (radius + largest_radius + skin) * (1.0 + 1e-12);
}

/// Squared distance of a grain, shifted by whole periods, from a part [m2].
inline double squared_distance_shifted(const Subdomains& subdomains, const Subdomains::Near& near, Vec3 position) {
  for (int axis = 0; axis < 3; ++axis) {
    const int steps = near.steps[static_cast<std::size_t>(axis)];
    if (steps != 0)
      position[axis] += steps * subdomains.period()[axis];  // periods may be infinite where nothing is periodic
  }
  return squared_distance(position, subdomains.box(near.part));
}

/// Calls f(other) for each part that needs a ghost of a grain of `part` at `position`: whose box, or a periodic image of it,
/// is nearer than `reach`. Each is named once, in order of part. `near` is subdomains.near(part, reach of the largest grain),
/// or of a larger reach.
template <typename F>
void for_each_needing(const Subdomains& subdomains, int part, std::span<const Subdomains::Near> near, Vec3 position,
                      double reach, F&& f) {
  const Box& own = subdomains.box(part);
  bool is_inside = true;  // so far inside that it reaches nobody: most grains end here
  for (int axis = 0; axis < 3; ++axis)
    is_inside = is_inside && position[axis] - own.low[axis] > reach && own.high[axis] - position[axis] > reach;
  if (is_inside) return;
  int named = -1;
  for (const Subdomains::Near& other : near) {
    if (other.part == named) continue;
    if (!(squared_distance_shifted(subdomains, other, position) < reach * reach)) continue;
    named = other.part;
    f(named);
  }
}

}  // namespace moraine
