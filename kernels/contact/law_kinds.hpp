// The contact laws that there are, by name.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace moraine {

enum class NormalLaw : std::uint8_t { linear, hertz };
enum class TangentialLaw : std::uint8_t { none, viscous, spring, mindlin, power };
enum class RollingLaw : std::uint8_t { none, constant, spring };
enum class CohesionLaw : std::uint8_t { none, jkr, sjkr, linear, liquid_bridge };

/// True for a law under which a contact, once made, holds on beyond the place where it was made: whether it is made is remembered.
constexpr bool has_bond(CohesionLaw law) { return law == CohesionLaw::jkr || law == CohesionLaw::liquid_bridge; }

/// True for a law that remembers the tangential displacement of a contact from step to step.
constexpr bool has_history(TangentialLaw law) { return law != TangentialLaw::none && law != TangentialLaw::viscous; }

constexpr std::string_view name_of(NormalLaw law) { return law == NormalLaw::linear ? "linear" : "hertz"; }
constexpr std::string_view name_of(TangentialLaw law) {
  constexpr std::array<std::string_view, 5> names = {"none", "viscous", "spring", "mindlin", "power"};
  return names[static_cast<std::size_t>(law)];
}

constexpr std::string_view name_of(RollingLaw law) {
  constexpr std::array<std::string_view, 3> names = {"none", "constant", "spring"};
  return names[static_cast<std::size_t>(law)];
}
constexpr std::string_view name_of(CohesionLaw law) {
  constexpr std::array<std::string_view, 5> names = {"none", "jkr", "sjkr", "linear", "liquid_bridge"};
  return names[static_cast<std::size_t>(law)];
}

}  // namespace moraine
