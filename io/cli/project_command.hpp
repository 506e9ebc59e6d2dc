// moraine project: a run on many ranks, foretold on this machine.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace moraine {

struct ProjectRequest {
  std::filesystem::path scene_file;
  std::vector<std::string> overrides;
  std::vector<int> ranks;
  int threads = 1;  // of a rank
  std::optional<std::filesystem::path> network;
  std::optional<double> grains;  // more than the scene has: ranks with as many grains each stand for them
  std::optional<std::filesystem::path> csv;
};

/// Fills the scene, cuts it for each number of ranks, counts and predicts, and says on what assumptions. Writes the CSV file
/// where one is asked for. Throws SceneFileError, SceneError, UsageError, StorageError.
std::string project_text(const ProjectRequest& request);

}  // namespace moraine
