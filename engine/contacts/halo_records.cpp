#include "engine/contacts/halo_records.hpp"

#include <cmath>
#include <cstring>

namespace moraine {

HaloRecords::HaloRecords(const Particles& particles, std::array<bool, 3> is_periodic, Vec3 period)
    : is_periodic_(is_periodic), is_any_periodic_(is_periodic[0] || is_periodic[1] || is_periodic[2]), period_(period) {
  for (const FieldInfo& row : field_table) {
    if (row.travel != Travel::every_step || !particles.has(row.field)) continue;
    parts_.emplace_back(row.record_slot, static_cast<std::size_t>(row.components) * sizeof(double));
    bytes_ += parts_.back().second;
  }
}

void HaloRecords::pack(const Particles& particles, std::span<const std::int32_t> grains, std::byte* to) const {
  for (const std::int32_t i : grains)
    for (const auto& [slot, bytes] : parts_) {
      std::memcpy(to, particles.record(i) + slot, bytes);
      to += bytes;
    }
}

void HaloRecords::unpack(const std::byte* from, std::int32_t first, std::int32_t n, Particles& particles,
                         std::vector<GhostEvent>& events) const {
  for (std::int32_t g = first; g < first + n; ++g) {
    const Vec3 before = particles.position(g);
    for (const auto& [slot, bytes] : parts_) {
      std::memcpy(particles.record(g) + slot, from, bytes);
      from += bytes;
    }
    const Vec3 now = particles.position(g);
    if (now.x != now.x) {
      if (before.x == before.x) events.push_back({g, {}, true});
      continue;
    }
    if (!is_any_periodic_) continue;
    // A grain moves by less than its radius in a step: what looks like more is a period that its owner brought it back by.
    GhostEvent event{g, {}, false};
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<std::size_t>(axis);
      if (is_periodic_[a] && std::abs(now[axis] - before[axis]) > 0.5 * period_[axis])
        event.steps[a] = now[axis] > before[axis] ? 1 : -1;
    }
    if (event.steps != std::array<int, 3>{}) events.push_back(event);
  }
}

}  // namespace moraine
