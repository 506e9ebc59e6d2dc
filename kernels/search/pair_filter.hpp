// Which of a run of grains are near a given one.
#pragma once

#include <cstdint>

#include "kernels/base/range.hpp"
#include "kernels/base/vec3.hpp"

namespace moraine {

/// Centres and radii in separate arrays, in sorted order [m].
struct Spheres {
  const double* x = nullptr;
  const double* y = nullptr;
  const double* z = nullptr;
  const double* r = nullptr;
};

/// The grains j of `run` with |centre - x_j| < reach + r_j are written to `found` in ascending order; returns their number.
/// Reads up to 7 entries past the run (which must exist), writes at most run.size() indices.
using PairFilter = int (*)(const Spheres& spheres, Range run, Vec3 centre, double reach, std::int32_t* found);
PairFilter pair_filter();

}  // namespace moraine
