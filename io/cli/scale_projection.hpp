// Efficiencies beyond the cores of this machine, foretold (engine/run/projection).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "engine/run/projection.hpp"
#include "io/cli/scale_results.hpp"

namespace moraine {

/// The scene as it is run on so many cores.
using SceneOnCores = std::function<Scene(int n_cores)>;

/// One point for each number of ranks, of one thread each. Points whose scene has more grains than can be filled here
/// in reasonable time are left out, and said so in `remarks`. Throws SceneError, UsageError.
std::vector<ProjectedResult> project_scaling(const SceneOnCores& scene_on, const std::vector<int>& ranks,
                                             const Network& network, std::vector<std::string>& remarks);

}  // namespace moraine
