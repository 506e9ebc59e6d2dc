// The contact laws that there are, by name.
#pragma once

#include <cstdint>

namespace moraine {

enum class NormalLaw : std::uint8_t { linear, hertz };
enum class TangentialLaw : std::uint8_t { none, viscous, spring, mindlin, power };

}  // namespace moraine
