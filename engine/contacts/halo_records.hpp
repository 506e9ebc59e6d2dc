// What travels of a grain in every step: out of its record into a message, and out of that into the ghost's.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "engine/contacts/pair_list.hpp"
#include "engine/particles/particles.hpp"

namespace moraine {

class HaloRecords {
 public:
  HaloRecords() = default;
  /// The fields that these grains have; `period` [m] counts where `is_periodic`.
  HaloRecords(const Particles& particles, std::array<bool, 3> is_periodic, Vec3 period);

  /// Of one grain, in a message.
  std::size_t bytes() const { return bytes_; }
  /// The present state of some grains, one after the other.
  void pack(const Particles& particles, std::span<const std::int32_t> grains, std::byte* to) const;
  /// Into `n` ghosts from `first` on, in their order. Adds those that have been brought back by a period or have left to `events`.
  void unpack(const std::byte* from, std::int32_t first, std::int32_t n, Particles& particles,
              std::vector<GhostEvent>& events) const;

 private:
  std::vector<std::pair<int, std::size_t>> parts_;  // first double in the record, and bytes
  std::size_t bytes_ = 0;
  std::array<bool, 3> is_periodic_{};
  bool is_any_periodic_ = false;
  Vec3 period_;
};

}  // namespace moraine
