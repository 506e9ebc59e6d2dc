// moraine pareto: one scene run in many ways, and what each costs in time and in accuracy.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/cli/log.hpp"

namespace moraine {

struct ParetoRequest {
  std::filesystem::path scene_file;
  std::vector<std::string> overrides;        // "key=value"
  std::optional<std::string> layout;         // of each run; none: the scene's
  std::optional<int> repeats;                // with other seeds; none: 3 for statistics, 1 for paths
  bool is_product = false;                   // every time step with every precision and variant
  std::optional<std::filesystem::path> out;  // none: runs/pareto-NAME
  std::string program;                       // the executable that is run
};

/// Runs the sweep, or what is missing of it, says and writes its results, and returns the exit code: that of a signal where it was
/// interrupted; failed where the reference could not be run, or where paths do not converge and nothing can be
/// recommended. Throws SceneFileError, UsageError, StorageError before anything is run.
int pareto_scene(const ParetoRequest& request, Log& log);

}  // namespace moraine
