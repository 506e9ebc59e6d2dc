// Ranks of this program, started by it through mpirun.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "engine/scene/scene.hpp"
#include "io/cli/layout.hpp"
#include "io/cli/mpirun_talk.hpp"

namespace moraine {

/// Where ranks are to be started.
struct Place {
  int n_cpus = 1;               // that this process may use
  int n_cores = 1;              // the cores that they belong to: fewer, where cores have several hardware threads
  bool is_whole = true;         // all CPUs of the machine: mpirun binds without asking which are allowed
  bool is_one_of_many = false;  // a machine of several that a batch system has given
};
Place this_place();

/// Throws SceneError where a script moves walls of the scene: only Python can run it.
void refuse_scripted_walls(const Scene& scene);

/// True where a layout has more threads than the place has CPUs.
bool is_crowded(const Layout& layout, const Place& place);

/// The words between mpirun and the program. Where there are CPUs for all, each rank is bound to its own.
std::vector<std::string> mpirun_options(const Layout& layout, const Place& place);

/// Open MPI's mpirun, found in PATH. Throws UsageError that names its package.
std::filesystem::path find_mpirun(const Layout& layout);

/// The layout that is asked for, by --layout or by the scene; "auto": what choose_layout() takes for the scene on the CPUs of this
/// process. Throws UsageError.
LayoutChoice layout_for(const Scene& scene, const std::optional<std::string>& asked);

/// Several tasks of srun that do not find each other, as without PMIx: each would do the whole run, in one directory.
struct StrayTasks {
  int n_tasks = 0;
  bool is_first = false;  // this process is the one that speaks
};
/// Where this process is one of such.
std::optional<StrayTasks> stray_tasks();

/// Why mpirun was ended that waited for nothing.
enum class GivenUp { no, not_started, no_ranks };

/// How a job came to its end.
struct JobEnd {
  int code = 0;                      // exit code of the job
  int signal = 0;                    // that this process has been asked to end by, and has passed on; 0: none
  std::optional<KilledRank> killed;  // a rank that a signal has ended
  int mpirun_killed = 0;             // the signal that has ended mpirun, and by that the ranks; 0: none
  GivenUp given_up = GivenUp::no;
};

/// Runs `words` (program and arguments) as the ranks of the layout and waits for their end. SIGINT, SIGTERM and SIGHUP
/// are passed on, so that the ranks end with a checkpoint; a second one of the same ends this process, and by that the
/// job. Ranks that do not find each other are told of and given up after MORAINE_START_PATIENCE (600 s); an mpirun that has
/// no ranks, after a tenth of it. Throws UsageError.
JobEnd run_as_ranks(const Layout& layout, const std::vector<std::string>& words);

}  // namespace moraine
