// Checkpoints: all that a run needs to go on as if it had never stopped.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "engine/run/image.hpp"
#include "io/checkpoint/durable_file.hpp"

namespace moraine {

/// Where a checkpoint comes from.
struct RunRecord {
  std::string scene;    // the scene file as run, overrides applied
  std::string version;  // of the program
  std::string commit;   // of its source
};

struct Checkpoint {
  Image image;
  RunRecord record;
};

/// Writes a checkpoint beside the old file, synced, then renamed: after a crash or a full disk PATH holds the old one or the
/// new one, whole. Throws StorageError.
void write_checkpoint(const std::filesystem::path& path, const Image& image, const RunRecord& record);

/// Throws StorageError that names the file and what is wrong: missing, not a checkpoint, a newer format, cut short, or damaged (and
/// which part of it).
Checkpoint read_checkpoint(const std::filesystem::path& path);

/// checkpoint_000000012000.h5
std::string checkpoint_name(std::uint64_t step);

/// The checkpoints of a run directory, latest step first, by name; nothing is opened. Empty where there are none.
std::vector<std::filesystem::path> list_checkpoints(const std::filesystem::path& run_directory);

/// The step in a checkpoint's name; nothing where the name is another.
std::optional<std::uint64_t> checkpoint_step(const std::filesystem::path& path);

struct LatestCheckpoint {
  std::filesystem::path path;
  Checkpoint checkpoint;
  std::vector<std::string> warnings;  // one for each later checkpoint that is damaged: its name, what is wrong
};

/// The newest sound checkpoint of a run; nothing where the run has none. Throws StorageError where it has some and all are damaged.
std::optional<LatestCheckpoint> find_latest_checkpoint(const std::filesystem::path& run_directory);

/// Removes all but the `n_kept` (at least 1) latest checkpoints, and what interrupted writes left. Throws StorageError.
void remove_old_checkpoints(const std::filesystem::path& run_directory, int n_kept);

/// The folder of a run directory that holds its checkpoints.
std::filesystem::path checkpoint_directory(const std::filesystem::path& run_directory);

}  // namespace moraine
