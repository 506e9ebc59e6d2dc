#include "io/export/frames.hpp"

#include <fmt/format.h>

#include "io/scene_toml/scene_toml.hpp"
#include "io/snapshot/snapshot.hpp"

namespace moraine {

namespace fs = std::filesystem;

const fs::path& Frames::at(int number) const {
  const int n = static_cast<int>(files.size());
  const int index = number < 0 ? n + number : number;
  if (index < 0 || index >= n)
    throw ExportError(fmt::format("frame {} does not exist: {} has frames 0 to {} (or -1, -2, ... from the last)",
                                  number, directory.string(), n - 1));
  return files[static_cast<std::size_t>(index)];
}

Frames find_frames(const fs::path& run) {
  if (!fs::exists(run)) throw StorageError(run, "does not exist; expected a run directory or a snapshot");
  if (!fs::is_directory(run)) return {run.has_parent_path() ? run.parent_path() : fs::path("."), {run}, false};
  Frames frames{run, list_snapshots(run), true};
  if (frames.files.empty()) throw StorageError(run, "holds no snapshots");
  return frames;
}

std::optional<Scene> scene_of(const Frames& frames, std::string& why_not) {
  // A single snapshot lies in RUN/snapshots, a checkpoint in RUN/checkpoints.
  for (const fs::path& directory : {frames.directory, frames.directory / ".."}) {
    const fs::path file = directory / "scene.toml";
    if (!fs::exists(file)) continue;
    try {
      return read_scene(file);
    } catch (const SceneFileError& error) {
      why_not = error.what();
    }
  }
  if (why_not.empty()) why_not = "there is no scene.toml beside it";
  return std::nullopt;
}

std::string frame_label(const fs::path& file) {
  const std::string stem = file.stem().string();
  const std::size_t digits = stem.find_last_not_of("0123456789");
  return digits + 1 < stem.size() && digits != std::string::npos ? stem.substr(digits + 1) : stem;
}

}  // namespace moraine
