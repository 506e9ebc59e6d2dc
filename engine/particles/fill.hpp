// Grains at birth: the groups of a scene as a list of seeds, in the order in which gids are given.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/scene/scene.hpp"

namespace moraine {

struct FillReport {
  std::string text;   // one line a group: how many grains, solid fraction reached
};

/// All grains of the scene in order of birth. Depends on the scene only (never on threads). Throws SceneError, for
/// example where a solid fraction cannot be reached or a grain of a file lies outside the domain.
std::vector<GrainSeed> make_grains(const Scene& scene, int n_threads, FillReport* report = nullptr);

/// How many grains make_grains will give, without making them (exact for counts and lattices, expected for fractions).
std::int64_t count_grains(const Scene& scene);

}  // namespace moraine
