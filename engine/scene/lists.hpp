// Lists of grains that several ranks share: no rank has to hold one whole.
#pragma once

#include <cstdint>
#include <vector>

#include "comm/world.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

/// What a list says as a whole, whether its grains are all here or shared.
ListFacts facts_of(const ListedGrains& list);

/// Tells all ranks what they hold together, after each has read its share. The columns are those that the root has
/// found. All ranks call it; alone it changes nothing.
void share_facts(const World& world, ListedGrains& list);

/// For each material of the scene whether grains are made of it, at the start or later.
std::vector<bool> grain_materials(const Scene& scene);

/// True where every rank has rows of the lists, and so gives birth to grains; else the root has all of them.
bool is_scattered(const Scene& scene);

/// True where ranks share the lists of the scene, in whatever way.
bool is_shared(const Scene& scene);

}  // namespace moraine
