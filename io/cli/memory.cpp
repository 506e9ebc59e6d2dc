#include "io/cli/memory.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <numeric>
#include <span>
#include <sstream>

#include "io/cli/job_script.hpp"
#include "io/cli/summary.hpp"
#include "io/cli/text.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

/// A rank under mpirun beside the first: the program, its libraries, the buffers between ranks [bytes].
constexpr double bytes_of_rank = 3.8e7;

/// The first number of a file; nothing where there is none, such as in "max".
std::optional<double> number_in(const fs::path& file) {
  std::ifstream in(file);
  double value = 0.0;
  if (in >> value) return value;
  return std::nullopt;
}

/// The number behind a name, such as "MemAvailable: 1234 kB" or "inactive_file 1234".
std::optional<double> number_behind(const fs::path& file, const std::string& name) {
  std::ifstream in(file);
  for (std::string word; in >> word;) {
    double value = 0.0;
    if (word == name && in >> value) return value;
    in.clear();
  }
  return std::nullopt;
}

void keep_least(std::optional<FreeMemory>& least, std::optional<double> bytes, const std::string& source) {
  if (!bytes || (least && least->bytes <= *bytes)) return;
  least = FreeMemory{std::max(0.0, *bytes), source};
}

/// What a control group leaves: its limit less what it holds, of which the kernel can take back unused pages of files.
std::optional<double> left_in(const fs::path& group, const char* limit, const char* used, const char* reclaimable) {
  const std::optional<double> most = number_in(group / limit), now = number_in(group / used);
  if (!most || !now || *most > 1e17) return std::nullopt;
  return *most - *now + number_behind(group / "memory.stat", reclaimable).value_or(0.0);
}

/// Of the group and all those that it lies in.
void keep_least_of_groups(std::optional<FreeMemory>& least, const fs::path& mount, fs::path group, bool is_version_2) {
  for (group = group.relative_path();; group = group.parent_path()) {
    const fs::path place = mount / group;
    keep_least(least,
               is_version_2 ? left_in(place, "memory.max", "memory.current", "inactive_file")
                            : left_in(place, "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
               "of the control group " + place.string());
    if (group.empty()) return;
  }
}

/// Lines of /proc/self/cgroup: "0::/path" (version 2), "4:memory:/path" (version 1).
void keep_least_of_groups(std::optional<FreeMemory>& least, const fs::path& root) {
  std::ifstream in(root / "proc/self/cgroup");
  for (std::string line; std::getline(in, line);) {
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
    const std::string group = line.substr(second + 1);
    if (controllers == ",,") keep_least_of_groups(least, root / "sys/fs/cgroup", group, true);
    if (controllers.find(",memory,") != std::string::npos)
      keep_least_of_groups(least, root / "sys/fs/cgroup/memory", group, false);
  }
}

}  // namespace

std::optional<FreeMemory> free_memory(const fs::path& root) {
  if (const char* given = std::getenv("MORAINE_MEMORY")) {
    const std::string text = given;
    try {
      return FreeMemory{static_cast<double>(parse_memory(text)) * 1048576.0, "by MORAINE_MEMORY"};
    } catch (const UsageError&) {
      throw UsageError("MORAINE_MEMORY=\"" + text + "\": expected a number with K, M, G or T, such as 16G");
    }
  }
  std::optional<FreeMemory> least;
  if (const auto kilobytes = number_behind(root / "proc/meminfo", "MemAvailable:"))
    keep_least(least, *kilobytes * 1024.0, "of this machine");
  keep_least_of_groups(least, root);
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY)
    keep_least(least, static_cast<double>(limit.rlim_cur), "by ulimit -v");
  return least;
}

double memory_of_run(const Plan& plan, const Layout& layout) {
  return plan.memory + (layout.ranks - 1) * bytes_of_rank;
}

std::optional<std::string> expect_to_fit(const Plan& plan, const Layout& layout, double share) {
  // The estimate may be a quarter too high, and what fits must not be refused.
  constexpr double surely = 0.75;
  const double needed = share * memory_of_run(plan, layout);
  const std::optional<FreeMemory> free = free_memory();
  if (!free || needed <= free->bytes) return std::nullopt;
  if (surely * needed <= free->bytes)
    return fmt::format("memory may not suffice: the scene needs about {}, and {} are free ({})", bytes_text(needed),
                       bytes_text(free->bytes), free->source);
  throw UsageError(fmt::format(
      "the scene needs about {} of memory here, and {} are free ({}): it would be killed half way. Fewer grains or gas "
      "cells, or ranks on more nodes; if there is more memory than that, say so by MORAINE_MEMORY=16G or the like",
      bytes_text(needed), bytes_text(free->bytes), free->source));
}

std::optional<double> share_of_node(const World& world) {
  if (world.is_alone()) return 1.0;
  const char* const n = std::getenv("OMPI_COMM_WORLD_LOCAL_SIZE");
  const int n_here = n == nullptr ? 0 : std::atoi(n);
  if (n_here < 1 || n_here > world.size()) return std::nullopt;
  return static_cast<double>(n_here) / world.size();
}

double widest_skin_within(double free, double held, double arrays, const Plan& plan) {
  constexpr double rebuild = 1.3;  // of the arrays, while they are made anew
  constexpr double reserve = 0.1;  // for what comes and goes: output, buffers
  const double diameter = 10.0 * plan.skin;
  const double growth = ((1.0 - reserve) * free - held + arrays) / (rebuild * arrays);  // of the arrays
  return growth > 1.0 ? (diameter + plan.skin) * std::cbrt(growth) - diameter : plan.skin;
}

void keep_within_memory(Simulation& simulation, const std::optional<FreeMemory>& free, const World& world) {
  const std::optional<double> share = share_of_node(world);
  const auto on_node = [&](double bytes) {
    const std::vector<double> all = world.gather(bytes);
    return share.value_or(0.0) * std::accumulate(all.begin(), all.end(), 0.0);
  };
  const double held = on_node(peak_memory()), arrays = on_node(simulation.memory());
  const bool is_known = free && share && arrays > 0.0;
  const double widest = is_known ? widest_skin_within(free->bytes, held, arrays, simulation.plan()) : infinity;
  double negative = -widest;
  world.max(std::span(&negative, 1));  // the least of all nodes
  simulation.bound_skin(-negative);
}

}  // namespace moraine
