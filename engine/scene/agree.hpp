// Work on a scene that all ranks do together: it succeeds on all of them, or fails on all with the same words.
#pragma once

#include <string>

#include "comm/first_text.hpp"
#include "comm/world.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

/// Calls f, which may throw SceneError on any rank; the first one's is thrown on all. All ranks call it; alone it is just f.
template <typename Function>
void agree(const World& world, Function f) {
  if (world.is_alone()) return f();
  std::string problem;
  try {
    f();
  } catch (const SceneError& error) {
    problem = error.what();
  }
  problem = first_text(world, problem);
  if (!problem.empty()) throw SceneError({Problem{"", problem}});
}

}  // namespace moraine
