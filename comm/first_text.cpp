#include "comm/first_text.hpp"

#include <algorithm>
#include <cstdint>
#include <vector>

namespace moraine {

std::string first_text(const World& world, std::string text) {
  const std::vector<std::uint64_t> has_text = world.gather(std::uint64_t{!text.empty()});
  const auto first = std::find(has_text.begin(), has_text.end(), 1);
  if (first == has_text.end()) return {};
  world.broadcast(text, static_cast<int>(first - has_text.begin()));
  return text;
}

}  // namespace moraine
