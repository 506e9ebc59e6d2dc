// The CPUs that this process may use, and the cores that they belong to.
#pragma once

#include <string>
#include <vector>

namespace moraine {

/// The CPUs that this process was started with, in order, so that Slurm's and a user's binding count. What has happened
/// to its threads since then does not: OpenMP binds the main thread on its own where OMP_PROC_BIND says so.
std::vector<int> available_cpus();
/// How many they are.
int available_cores();
/// Gives the calling thread the CPUs back that the process was started with: for what it starts.
void take_back_cpus();

/// Hardware threads of one core, in order.
struct Core {
  std::vector<int> cpus;
  int numa_node = 0, package = 0;  // numbered from 0, of the machine
  bool operator==(const Core&) const = default;
};
/// The cores that some CPUs of this machine belong to, with those of the CPUs that are theirs, neighbours in memory next to
/// each other, as hwloc knows them. Where it knows nothing, each CPU is a core.
std::vector<Core> cores_of(const std::vector<int>& cpus);

/// The calling thread runs on these CPUs only from now on; false where the system does not allow it.
bool run_on(const std::vector<int>& cpus);

}  // namespace moraine
