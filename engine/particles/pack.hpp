// Spheres of given radii, packed without overlap into a container, beside spheres that are already there.
//
// Two methods. Random sequential addition (Widom 1966, J. Chem. Phys. 44, 3888): one after the other, the largest
// first, each at a random place where it fits; quick and statistically clean while the packing is loose. Relaxation,
// for anything denser: all at random at once, then overlaps are removed by minimising the energy of soft repulsive
// spheres (O'Hern et al. 2003, Phys. Rev. E 68, 011306) with the fast inertial relaxation engine (Bitzek et al. 2006,
// Phys. Rev. Lett. 97, 170201); it reaches the random close packing, about 0.63 for equal spheres, more for wide
// distributions.
//
// Both use counter-based random numbers: the result depends on seed and numbers only.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/particles/pack_container.hpp"

namespace moraine {

struct PackProblem {
  const Container& container;
  std::span<const PackGrain> fixed;  // spheres that are already there
  std::uint64_t seed = 1;
  std::uint64_t first_number = 0;  // grain i draws its random numbers as number first_number + i
  int n_threads = 1;               // for the relaxation; the result does not depend on it
};

/// No two centres end up closer than the sum of the radii times this.
inline constexpr double pack_clearance = 1.0 + 1e-9;

/// Places the grains one by one. False, with positions undefined, where that would take too many attempts.
bool pack_sequentially(const PackProblem& problem, std::span<PackGrain> grains);

struct Relaxation {
  bool is_free = false;  // no overlap is left
  double scale = 1.0;    // factor on all radii at which no overlap is left (a lower bound where is_free is false)
  std::int64_t n_steps = 0;
};

/// Places the grains at random and moves them apart. Where they cannot all fit, finds out how large they could be.
Relaxation pack_by_relaxation(const PackProblem& problem, std::span<PackGrain> grains);

}  // namespace moraine
