// moraine run: a scene from its file to its results.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "comm/world.hpp"
#include "io/cli/log.hpp"

namespace moraine {

struct RunRequest {
  std::filesystem::path scene_file;
  std::vector<std::string> overrides;        // "key=value"
  std::optional<std::string> layout;         // none: the scene's
  std::optional<std::filesystem::path> out;  // none: see new_run_directory()
  std::optional<std::string> restart;        // "auto" or a checkpoint
  std::optional<double> until;               // [s]
  std::optional<std::uint64_t> steps;        // ends after so many, those of the warm-up not counted
  std::uint64_t warm_up = 0;                 // steps before those that speed and phases are of
  bool has_outputs = true;                   // false: no snapshots, checkpoints and probes, also not at the end
  std::vector<std::string> command_line;     // program and arguments of this request, to start ranks by
};

/// Exit codes of the program.
namespace exit_code {
inline constexpr int good = 0;
inline constexpr int failed = 1;     // the run could not go on, a disk is full; compare: not equal
inline constexpr int bad_input = 2;  // scene, command line, files to be read: nothing was done
inline constexpr int signal = 128;   // + the signal's number: ended by it, with a checkpoint (INT: 130, TERM: 143)
}  // namespace exit_code

/// Runs a scene to its end and returns the exit code; with a layout of several ranks, which no launcher has started, by
/// starting them. All ranks of `world` (those that a launcher has started) call it; `log` is mute at all but the root.
/// Bad scenes and requests throw (SceneFileError, SceneError, UsageError, StorageError) before anything is written;
/// later errors are reported, with the checkpoint to go on from, and end the job where it has several ranks.
int run_scene(const RunRequest& request, Log& log, const World& world = {});

}  // namespace moraine
