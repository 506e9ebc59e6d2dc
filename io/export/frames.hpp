// The snapshots of a run as numbered frames, and the scene they belong to.
#pragma once

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "engine/run/image.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

/// A request that cannot be carried out: a field, a frame, a size that does not exist; a program that is missing.
struct ExportError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct Frames {
  std::filesystem::path directory;           // of the run; of the file where a single one was given
  std::vector<std::filesystem::path> files;  // in order of step
  bool is_run = false;

  /// Frame `number`: 0, 1, ... from the first, -1, -2, ... from the last. Throws ExportError that names the frames there are.
  const std::filesystem::path& at(int number) const;
};

/// The frames of a run directory, or one snapshot or checkpoint as the only frame. Throws StorageError.
Frames find_frames(const std::filesystem::path& run);

/// The scene as run, where the run directory has one that can be read; `why_not` gets the reason otherwise.
std::optional<Scene> scene_of(const Frames& frames, std::string& why_not);

/// "000000012000", the step in a frame's file name, or its name without ending.
std::string frame_label(const std::filesystem::path& file);

}  // namespace moraine
