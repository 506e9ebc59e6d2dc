// Which of runs of grains are near a given one.
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
  const double* room = nullptr;  // of each; r contains it (only for the near filter)
};

/// The grains j of `run` with |centre - x_j| < reach + r_j are written to `found` in ascending order; returns their number.
/// Reads up to 7 entries past the run (which must exist), writes at most run.size() indices.
using PairFilter = int (*)(const Spheres& spheres, Range run, Vec3 centre, double reach, std::int32_t* found);
PairFilter pair_filter();

/// Grains that lie one behind the other, seen from the one that asks as their periodic image of that code.
struct GrainRun {
  Range grains;
  std::uint8_t image = 0;
};
/// Who asks for those near it.
struct Asking {
  Vec3 centre;
  double reach = 0.0;                  // [m] from its centre: radius, range of attraction and room
  double room = 0.0;                   // [m] of that
  const Vec3* image_shift = nullptr;   // [m] by image; nullptr: runs have none
  const double* band_share = nullptr;  // of the rooms of both, ascending, the first zero ...
  int n_bands = 1;                     // ... and how many
};
/// What is near, one array each.
struct NearGrains {
  std::int32_t* grain = nullptr;
  std::uint8_t* image = nullptr;  // nullptr: not asked for
  std::uint8_t* band = nullptr;
};
/// Writes the grains j of the runs with |centre - x_j| < reach + r_j, run by run in ascending order, and the last band whose share of the rooms of
/// both lies between the two beyond the rest of their reach. Returns their number. Reads up to 7 entries past a run (which must exist).
using NearFilter = int (*)(const Spheres& spheres, const GrainRun* runs, int n_runs, const Asking& asking,
                           const NearGrains& near);
NearFilter near_filter();

}  // namespace moraine
