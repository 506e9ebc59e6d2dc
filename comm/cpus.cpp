#include "comm/cpus.hpp"

#include <hwloc.h>
#include <sched.h>

#include <algorithm>
#include <map>
#include <memory>
#include <thread>

#include "comm/start_cpus.hpp"

namespace moraine {

namespace {

using Topology = std::unique_ptr<hwloc_topology, decltype(&hwloc_topology_destroy)>;

/// All of the machine, whatever this process is bound to; nothing where it cannot be found out.
Topology look_at_machine() {
  hwloc_topology_t topology = nullptr;
  if (hwloc_topology_init(&topology) != 0) return {nullptr, hwloc_topology_destroy};
  Topology machine(topology, hwloc_topology_destroy);
  // Only what is asked for below: devices take their time.
  hwloc_topology_set_io_types_filter(topology, HWLOC_TYPE_FILTER_KEEP_NONE);
  hwloc_topology_set_flags(topology, HWLOC_TOPOLOGY_FLAG_INCLUDE_DISALLOWED);
  if (hwloc_topology_load(topology) != 0) machine.reset();
  return machine;
}

/// Number of the NUMA node that an object is next to; 0 where there are none.
int numa_node_of(hwloc_topology_t machine, hwloc_obj_t of) {
  hwloc_obj_t node = nullptr;
  while ((node = hwloc_get_next_obj_by_type(machine, HWLOC_OBJ_NUMANODE, node)) != nullptr)
    if (of->nodeset && hwloc_bitmap_isset(of->nodeset, node->os_index)) return static_cast<int>(node->logical_index);
  return 0;
}

}  // namespace

std::vector<int> available_cpus() {
  std::vector<int> cpus;
  for (std::size_t cpu = 0; cpu < most_cpus; ++cpu)
    if (CPU_ISSET_S(cpu, cpu_set_bytes, cpus_at_start())) cpus.push_back(static_cast<int>(cpu));
  if (cpus.empty())
    for (unsigned cpu = 0; cpu < std::max(1u, std::thread::hardware_concurrency()); ++cpu)
      cpus.push_back(static_cast<int>(cpu));
  return cpus;
}

int available_cores() { return static_cast<int>(available_cpus().size()); }

void take_back_cpus() {
  if (CPU_COUNT_S(cpu_set_bytes, cpus_at_start()) > 0) sched_setaffinity(0, cpu_set_bytes, cpus_at_start());
}

std::vector<Core> cores_of(const std::vector<int>& cpus) {
  const Topology machine = look_at_machine();
  // By the place of the core in the machine: those that share caches and memory are numbered one after the other.
  std::map<unsigned, Core> cores;
  for (const int cpu : cpus) {
    hwloc_obj_t const unit =
        machine ? hwloc_get_pu_obj_by_os_index(machine.get(), static_cast<unsigned>(cpu)) : nullptr;
    hwloc_obj_t const core = unit ? hwloc_get_ancestor_obj_by_type(machine.get(), HWLOC_OBJ_CORE, unit) : nullptr;
    if (!core) {  // after all that are known
      cores[(1U << 30) + static_cast<unsigned>(cpu)].cpus = {cpu};
      continue;
    }
    Core& known = cores[core->logical_index];
    known.cpus.push_back(cpu);
    known.numa_node = numa_node_of(machine.get(), core);
    hwloc_obj_t const package = hwloc_get_ancestor_obj_by_type(machine.get(), HWLOC_OBJ_PACKAGE, core);
    known.package = package ? static_cast<int>(package->logical_index) : 0;
  }
  std::vector<Core> in_order;
  for (const auto& [number, core] : cores) in_order.push_back(core);
  return in_order;
}

bool run_on(const std::vector<int>& cpus) {
  if (cpus.empty()) return true;
  cpu_set_t set[most_cpus / CPU_SETSIZE] = {};
  for (const int cpu : cpus) CPU_SET_S(static_cast<std::size_t>(cpu), cpu_set_bytes, set);
  return sched_setaffinity(0, cpu_set_bytes, set) == 0;
}

}  // namespace moraine
