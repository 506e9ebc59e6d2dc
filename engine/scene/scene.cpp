#include "engine/scene/scene.hpp"

namespace moraine {

int Scene::material_index(const std::string& name) const {
  for (std::size_t i = 0; i < materials.size(); ++i)
    if (materials[i].name == name) return static_cast<int>(i);
  return -1;
}

const char* name_of(Probe::Kind kind) {
  constexpr std::array names = {"energy",      "wall_force", "wall_pressure", "region",        "mass",
                                "profile",     "contacts",   "pressure",      "pressure_drop", "bed_height",
                                "gas_profile", "gas_mean",   "mixing",        "fields"};
  return names[static_cast<std::size_t>(kind)];
}

bool needs_gas(Probe::Kind kind) {
  return kind == Probe::Kind::pressure || kind == Probe::Kind::pressure_drop || kind == Probe::Kind::gas_profile ||
         kind == Probe::Kind::gas_mean;
}

const PairLaw* Scene::pair_law(const std::string& a, const std::string& b) const {
  for (const PairLaw& pair : contact.pairs) {
    const auto& [first, second] = pair.between;
    if ((first == a && second == b) || (first == b && second == a)) return &pair;
  }
  return nullptr;
}

}  // namespace moraine
