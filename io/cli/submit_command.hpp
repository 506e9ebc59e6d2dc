// moraine submit: a scene as a job of a cluster's batch system.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/cli/log.hpp"

namespace moraine {

struct SubmitRequest {
  std::filesystem::path scene_file;
  std::vector<std::string> overrides;  // "key=value"
  std::optional<std::string> layout;   // none: the scene's
  bool is_sweep = false;               // an array of jobs, one for each of `layouts`
  std::vector<std::string> layouts;
  std::optional<std::filesystem::path> out;  // none: see new_run_directory(); of a sweep runs/NAME-sweep
  std::optional<std::string> restart;        // "auto": in the directory of an earlier run
  int nodes = 1;
  std::optional<std::string> time, memory,
      name;  // see parse_time_limit(), parse_memory(); none: partition's, estimate, run's
  std::string partition, account;
  std::optional<int> margin;  // [s] none: see default_margin()
  std::string mpi = "pmix";
  std::vector<std::string> directives;
  std::string system = "slurm";  // or "pbs", "lsf": with is_dry_run only
  bool is_dry_run = false;       // the script is printed, and nothing else done
  std::filesystem::path program;
};

/// Looks at the scene and the request, writes the script to OUT/job/submit.sh and hands it to sbatch; says which job it
/// has become, and how to watch and to cancel it. Throws SceneFileError, SceneError, StorageError and UsageError, the
/// last also where there is no sbatch and where it refuses: then nothing is left behind.
void submit(const SubmitRequest& request, Log& log);

}  // namespace moraine
