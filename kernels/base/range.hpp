// Half-open range of indices: a thread's share, a tile, a row of cells.
#pragma once

#include <cstdint>

namespace moraine {

struct Range {
  std::int64_t begin = 0;
  std::int64_t end = 0;

  constexpr std::int64_t size() const { return end - begin; }
  constexpr bool empty() const { return end <= begin; }
  constexpr bool operator==(const Range&) const = default;
};

}  // namespace moraine
