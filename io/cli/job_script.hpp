// The script of a batch job: what it asks the batch system for, and what it does.
//
// It is one that people can read, change and hand in by themselves. It starts the ranks of `moraine run --restart
// auto`; a signal some time before the time limit makes them write a checkpoint and end, and the script hands itself in
// again, until the scene is done. It stops where a job has gained no step, where the run has failed, and where somebody
// has cancelled the job.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/cli/layout.hpp"

namespace moraine {

enum class BatchSystem { slurm, pbs, lsf };

/// All that a script says.
struct Job {
  BatchSystem system = BatchSystem::slurm;
  std::string name;  // letters, digits, '.', '_', '-': see job_name()
  int nodes = 1;
  std::vector<Layout> layouts;             // one; of a sweep: all, one job of an array for each
  bool is_sweep = false;                   // results in OUT/RxT instead of OUT
  std::optional<std::int64_t> time_limit;  // [s]; none: the partition's
  int margin = 120;                        // [s] before the time limit the run is asked to end
  std::int64_t memory = 0;                 // of a node [MiB]; 0: all of it
  std::string partition, account;          // empty: the batch system's own choice
  std::string mpi = "pmix";                // by which srun and the MPI library find each other
  std::vector<std::string> directives;  // further ones, as the batch system reads them; Slurm's with or without dashes
  std::string origin;                   // who has written the script
  std::filesystem::path program, scene, out, script;  // absolute
  std::vector<std::string> overrides;
};

/// The script. Throws UsageError where the ranks of a layout do not divide evenly over the nodes, where the margin
/// takes all of the time limit, where PBS and LSF get no time limit or a sweep, and for control characters in what goes
/// into directives.
std::string job_script(const Job& job);

/// A name that every batch system takes: what is not a letter, a digit, '.', '_' or '-' becomes '_'.
std::string job_name(const std::string& name);

/// Seconds of a time limit in Slurm's formats: M, M:S, H:M:S, D-H, D-H:M, D-H:M:S. Throws UsageError that lists them.
std::int64_t parse_time_limit(const std::string& text);
/// "02:30:00", "1-12:00:00"
std::string time_limit_text(std::int64_t seconds);

/// Seconds before the time limit at which a run is asked to end, where nobody has said: a quarter of it, at most two
/// minutes.
int default_margin(std::optional<std::int64_t> time_limit);

/// MiB of "4000", "4000M", "16G", "1T" (units as Slurm's, M where there is none), rounded up; "0" is all of a node.
/// Throws UsageError.
std::int64_t parse_memory(const std::string& text);
/// What a node needs [MiB], with a margin for ranks that hold more than others, for ghosts, and for the lists from
/// which grains are dealt out. `of_scene`: estimate for the whole scene in one process [bytes].
std::int64_t memory_of_node(double of_scene, const Layout& layout, int nodes);

}  // namespace moraine
