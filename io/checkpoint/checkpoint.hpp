// Checkpoints: all that a run needs to go on as if it had never stopped.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "comm/world.hpp"
#include "engine/run/image.hpp"
#include "io/checkpoint/durable_file.hpp"
#include "io/checkpoint/image_file.hpp"

namespace moraine {

struct Checkpoint {
  Image image;
  RunRecord record;
};

/// Writes a checkpoint beside the old file, synced, then renamed: after a crash or a full disk PATH holds the old one
/// or the new one, whole. Each rank gives consecutive rows of the image; the file is the same, byte for byte, for any
/// number of ranks. `distributed`: each rank writes a file of its own beside PATH, which shows their rows as its own
/// (see rank_files.hpp). All ranks call it; throws StorageError, the same on all.
void write_checkpoint(const std::filesystem::path& path, const Image& image, const RunRecord& record,
                      const World& world = {}, bool distributed = false);

/// Each rank gets an equal share of the rows: of grains, of pairs, of walls. Any number of ranks reads any file. All
/// ranks call it; throws StorageError, the same on all, that names the file and what is wrong: missing, not a
/// checkpoint, a newer format, cut short, or damaged (and which part of it).
Checkpoint read_checkpoint(const std::filesystem::path& path, const World& world = {});

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

/// The newest sound checkpoint of a run, as read_checkpoint() gives it; nothing where the run has none. The root looks,
/// all ranks call it. Throws StorageError, the same on all, where the run has checkpoints and all are damaged.
std::optional<LatestCheckpoint> find_latest_checkpoint(const std::filesystem::path& run_directory,
                                                       const World& world = {});

/// Removes all but the `n_kept` (at least 1) latest checkpoints, with the files of their ranks, and what interrupted
/// writes left. One process calls it. Throws StorageError.
void remove_old_checkpoints(const std::filesystem::path& run_directory, int n_kept);

/// The folder of a run directory that holds its checkpoints.
std::filesystem::path checkpoint_directory(const std::filesystem::path& run_directory);

}  // namespace moraine
