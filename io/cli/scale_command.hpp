// moraine scale: one scene on many layouts, what it gains from each core, and where the rest goes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/cli/log.hpp"
#include "io/cli/scale_results.hpp"

namespace moraine {

struct ScaleRequest {
  std::filesystem::path scene_file;
  std::vector<std::string> overrides;  // "key=value"
  ScaleKind kind = ScaleKind::strong;
  std::optional<std::string> layouts;           // "1x1,1x4"; none: all up to the cores of this machine
  std::optional<std::uint64_t> steps, warm_up;  // none: 300 and 100, or what the scene has
  int repeats = 3;
  std::optional<std::filesystem::path> out;  // none: runs/scale-NAME, runs/scale-NAME-weak
  std::vector<int> projected;                // numbers of ranks, beyond what is measured
  std::optional<std::filesystem::path> network;
  std::string program;  // the executable that is run
};

/// Runs the sweep, or what is missing of it, says and writes its results, and returns the exit code: that of a signal
/// where it was interrupted, failed where a run could not go on or layouts ended in different states. Throws
/// SceneFileError, SceneError, UsageError, StorageError before anything is run.
int scale_scene(const ScaleRequest& asked, Log& log);

}  // namespace moraine
