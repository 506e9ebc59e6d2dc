// Where the results of a run lie.
//
//   scene.toml        the scene as run          log.txt           what the run said
//   version.txt       program, commit, layout   summary.txt       the table at the end
//   snapshots/        HDF5                      snapshots.xdmf    for ParaView
//   checkpoints/      HDF5                      hashes.csv        state hash at each snapshot
//   NAME.csv          a probe                   energy.csv        the energy ledger
//   summary.json      the same for programs, with all that is known of each rank
//   job/              script and output of a batch job
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "engine/scene/scene.hpp"

namespace moraine {

/// Name of a run: of the scene file, or of its folder where the file is called scene.toml.
std::string run_name(const std::filesystem::path& scene_file);

/// True where a directory holds (part of) a run.
bool holds_run(const std::filesystem::path& directory);

/// Where the script and the output of a batch job lie, which are there before its run is.
std::filesystem::path job_folder(const std::filesystem::path& directory);

/// The directory of a new run. `out` (from --out) is taken as it is and refused where it holds anything but its job; else the scene's own, or
/// runs/NAME, or the first free one of NAME-2, NAME-3 ... Nothing is made. Throws UsageError.
std::filesystem::path new_run_directory(const std::filesystem::path& scene_file, const Scene& scene,
                                        const std::optional<std::filesystem::path>& out);

/// The newest run directory of a scene (highest number); nothing where it has none.
std::optional<std::filesystem::path> newest_run_directory(const std::filesystem::path& scene_file, const Scene& scene);

/// The run directory that a checkpoint lies in (DIR of DIR/checkpoints/checkpoint_STEP.h5), if it does.
std::optional<std::filesystem::path> run_directory_of(const std::filesystem::path& checkpoint);

}  // namespace moraine
