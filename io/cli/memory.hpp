// Whether a scene fits into the memory that there is, before it is tried: what does not fit is killed half way, without a word.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "engine/run/simulation.hpp"
#include "io/cli/layout.hpp"

namespace moraine {

/// Memory that this process may still take, and what sets the bound.
struct FreeMemory {
  double bytes = 0.0;
  std::string source;
};

/// The least of: what the system says is available, what the limits of the control groups of this process leave (version 1 and 2), and
/// its own limit (ulimit -v). Where the environment has MORAINE_MEMORY, such as 16G, that and nothing else. `root`: of the file
/// system, for tests. Nothing where nothing can be found out. Throws UsageError for a MORAINE_MEMORY that is none.
std::optional<FreeMemory> free_memory(const std::filesystem::path& root = "/");

/// Memory of all ranks together [bytes].
double memory_of_run(const Plan& plan, const Layout& layout);

/// Throws UsageError with estimate and bound where this share of the run does not fit here. Where it may or may not: what a user should
/// know, else nothing.
std::optional<std::string> expect_to_fit(const Plan& plan, const Layout& layout, double share = 1.0);

/// The widest skin [m] with which a run keeps within what is free [bytes]: pairs become more as the cube of their reach. The run's processes
/// hold `held`, `arrays` of it in what grows with the pairs, at the skin of the plan.
double widest_skin_within(double free, double held, double arrays, const Plan& plan);

/// The share of the ranks that is on this rank's node, as mpirun tells; srun and others do not.
std::optional<double> share_of_node(const World& world);

/// Bounds the skin of a run by the memory that was free before it took its own, where that and the ranks of a node are known. All ranks.
void keep_within_memory(Simulation& simulation, const std::optional<FreeMemory>& free, const World& world);

}  // namespace moraine
