// Which cores the threads of a run are on.
#pragma once

#include <string>
#include <vector>

namespace moraine {

/// The CPU that each of so many threads of this process is on now.
std::vector<int> cpus_of_threads(int n_threads);
/// The core that a CPU of this machine belongs to, named by the first of its CPUs; the CPU itself where that is not
/// known.
int core_of(int cpu);
/// Name of this machine.
std::string node_name();
/// Model of its processor; "unknown" where the system does not tell.
std::string processor_name();

/// Threads of one process at the beginning and at the end of what is timed.
struct ThreadPlaces {
  std::string node;
  std::vector<int> cpus_before, cpus;  // of each thread
  std::vector<int> cores;              // of `cpus`
  int n_allowed = 0;                   // CPUs that the process may use

  bool operator==(const ThreadPlaces&) const = default;
};

/// What the places of all threads of a run say about its timing.
struct Pinning {
  int n_threads = 0;
  int n_moved = 0;            // that ended on another CPU than they began on
  int n_on_shared_cpus = 0;   // that were on the same CPU as another one, at the end
  int n_on_shared_cores = 0;  // the same for cores
};
Pinning pinning_of(const std::vector<ThreadPlaces>& processes);

}  // namespace moraine
