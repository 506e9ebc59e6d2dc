#include "engine/scene/scene.hpp"

namespace moraine {

int Scene::material_index(const std::string& name) const {
  for (std::size_t i = 0; i < materials.size(); ++i)
    if (materials[i].name == name) return static_cast<int>(i);
  return -1;
}

const PairLaw* Scene::pair_law(const std::string& a, const std::string& b) const {
  for (const PairLaw& pair : contact.pairs) {
    const auto& [first, second] = pair.between;
    if ((first == a && second == b) || (first == b && second == a)) return &pair;
  }
  return nullptr;
}

}  // namespace moraine
