#include "engine/particles/pack_occupied.hpp"

namespace moraine {

OccupiedSpace::OccupiedSpace(const PackSpace& space, const Box& extent, std::span<const double> radii)
    : space_(space), cells_(space, extent, radii), first_in_cell_(static_cast<std::size_t>(cells_.n_cells()), -1) {
  next_.reserve(radii.size());
  grains_.reserve(radii.size());
}

void OccupiedSpace::insert(const PackGrain& grain) {
  const auto cell = static_cast<std::size_t>(cells_.cell_of(cells_.level_of(grain.radius), grain.position));
  next_.push_back(first_in_cell_[cell]);
  first_in_cell_[cell] = static_cast<std::int32_t>(grains_.size());
  grains_.push_back(grain);
}

template <class Visit>
bool OccupiedSpace::visit_near(const PackGrain& grain, Visit&& visit) const {
  const auto visit_cell = [&](std::int64_t cell) {
    for (std::int32_t i = first_in_cell_[static_cast<std::size_t>(cell)]; i >= 0;
         i = next_[static_cast<std::size_t>(i)])
      if (visit(grains_[static_cast<std::size_t>(i)])) return true;
    return false;
  };
  for (int level = 0; level < cells_.n_levels(); ++level) {
    if (cells_.is_empty(level)) continue;
    const double reach = (grain.radius + cells_.largest_radius(level)) * pack_clearance;
    if (cells_.visit_cells(level, grain.position, reach, visit_cell)) return true;
  }
  return false;
}

bool OccupiedSpace::overlaps(const PackGrain& grain) const {
  return visit_near(grain, [&](const PackGrain& other) {
    const double reach = (grain.radius + other.radius) * pack_clearance;
    return squared_length(space_.difference(grain.position, other.position)) < reach * reach;
  });
}

double OccupiedSpace::deepest_overlap(const PackGrain& grain) const {
  double deepest = 0.0;
  visit_near(grain, [&](const PackGrain& other) {
    const double reach = (grain.radius + other.radius) * pack_clearance;
    deepest = std::max(deepest, reach - length(space_.difference(grain.position, other.position)));
    return false;
  });
  return deepest;
}

}  // namespace moraine
