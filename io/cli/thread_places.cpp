#include "io/cli/thread_places.hpp"

#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <map>

#include "engine/threads.hpp"

namespace moraine {

std::vector<int> cpus_of_threads(int n_threads) {
  std::vector<int> cpus(static_cast<std::size_t>(n_threads), -1);
  parallel(n_threads, [&](int thread) { cpus[static_cast<std::size_t>(thread)] = sched_getcpu(); });
  return cpus;
}

int core_of(int cpu) {
  // A list such as "0,4" or "0-1".
  std::ifstream file("/sys/devices/system/cpu/cpu" + std::to_string(cpu) + "/topology/thread_siblings_list");
  int first = cpu;
  return file >> first ? first : cpu;
}

std::string node_name() {
  char name[256] = "";
  gethostname(name, sizeof name - 1);
  return name;
}

std::string processor_name() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const std::size_t colon = line.find(": ");
    if (line.starts_with("model name") && colon != std::string::npos) return line.substr(colon + 2);
  }
  return "unknown";
}

Pinning pinning_of(const std::vector<ThreadPlaces>& processes) {
  std::map<std::pair<std::string, int>, int> on_cpu, on_core;
  Pinning pinning;
  for (const ThreadPlaces& process : processes) {
    pinning.n_threads += static_cast<int>(process.cpus.size());
    for (const int cpu : process.cpus) ++on_cpu[{process.node, cpu}];
    for (const int core : process.cores) ++on_core[{process.node, core}];
    for (std::size_t i = 0; i < std::min(process.cpus.size(), process.cpus_before.size()); ++i)
      pinning.n_moved += process.cpus[i] == process.cpus_before[i] ? 0 : 1;
  }
  const auto on_shared = [](const auto& places) {
    int n = 0;
    for (const auto& [place, n_threads] : places) n += n_threads > 1 ? n_threads : 0;
    return n;
  };
  pinning.n_on_shared_cpus = on_shared(on_cpu);
  pinning.n_on_shared_cores = on_shared(on_core);
  return pinning;
}

}  // namespace moraine
