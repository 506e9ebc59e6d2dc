#include "engine/run/image.hpp"

#include <cstdio>
#include <stdexcept>

namespace moraine {

std::string Hash128::text() const {
  char buffer[33];
  std::snprintf(buffer, sizeof(buffer), "%016llx%016llx", static_cast<unsigned long long>(high),
                static_cast<unsigned long long>(low));
  return buffer;
}

Hash128 Hash128::from_text(const std::string& hex) {
  if (hex.size() != 32 || hex.find_first_not_of("0123456789abcdef") != std::string::npos)
    throw std::invalid_argument("\"" + hex + "\" is not a state hash: 32 hexadecimal digits expected");
  return {std::stoull(hex.substr(0, 16), nullptr, 16), std::stoull(hex.substr(16), nullptr, 16)};
}

}  // namespace moraine
