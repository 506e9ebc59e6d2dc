// Snapshots: the grains at one moment, for people and other tools.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "engine/run/image.hpp"
#include "io/checkpoint/checkpoint.hpp"

namespace moraine {

/// Writes /particles/<field> in order of gid, (n) or (n, components), each with its unit; time, step, domain and state
/// hash as attributes. Not compressed: grain data hardly shrink, and readers can map them. Whole or not at all. Ranks
/// and `distributed` as in write_checkpoint(). All ranks call it; throws StorageError, the same on all.
void write_snapshot(const std::filesystem::path& path, const Image& image, const World& world = {},
                    bool distributed = false);

/// Reads a snapshot, also one that another tool has rewritten without our checksums. `unknown`: gets the names of fields that the
/// field table does not have; they are left out. Throws StorageError.
Image read_snapshot(const std::filesystem::path& path, std::vector<std::string>* unknown = nullptr);

/// A checkpoint or a snapshot, whichever the file is.
struct ImageFile {
  std::string kind;  // "checkpoint", "snapshot"
  Image image;
  std::optional<RunRecord> record;   // of checkpoints
  std::vector<std::string> unknown;  // fields that were left out
  std::size_t n_rank_files = 0;      // files that hold its rows, one for each rank that wrote; 0: it holds them itself
};
ImageFile read_image_file(const std::filesystem::path& path);

/// How many of its grains each of the files of ranks holds that it names, in order of gid; nothing for a whole file. Throws StorageError.
std::vector<std::uint64_t> grains_of_rank_files(const std::filesystem::path& path);

/// snapshot_000000012000.h5
std::string snapshot_name(std::uint64_t step);

/// The step in a snapshot's name; nothing where the name is another.
std::optional<std::uint64_t> snapshot_step(const std::filesystem::path& path);

/// The snapshots of a run directory in order of step. Nothing is opened.
std::vector<std::filesystem::path> list_snapshots(const std::filesystem::path& run_directory);

/// The folder of a run directory that holds its snapshots.
std::filesystem::path snapshot_directory(const std::filesystem::path& run_directory);

}  // namespace moraine
