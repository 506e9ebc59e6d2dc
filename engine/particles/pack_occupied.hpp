// Space that is already taken by spheres, added one at a time.
#pragma once

#include <span>
#include <vector>

#include "engine/particles/pack.hpp"

namespace moraine {

class OccupiedSpace {
 public:
  /// For spheres of these radii [m]; extent: where most of them will lie.
  OccupiedSpace(const PackSpace& space, const Box& extent, std::span<const double> radii);
  void insert(const PackGrain& grain);
  /// True where the sphere would overlap one that is there.
  bool overlaps(const PackGrain& grain) const;
  /// The depth [m] of the deepest overlap that the sphere would have; 0 where it is free.
  double deepest_overlap(const PackGrain& grain) const;

 private:
  /// Calls visit(other) for every sphere that may touch this one, until a visit returns true.
  template <class Visit>
  bool visit_near(const PackGrain& grain, Visit&& visit) const;

  PackSpace space_;
  CellLevels cells_;
  std::vector<std::int32_t> first_in_cell_;  // -1: none
  std::vector<std::int32_t> next_;
  std::vector<PackGrain> grains_;
};

}  // namespace moraine
