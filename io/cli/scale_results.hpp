// What a scaling sweep has shown: the runs of each layout as one row, against the least number of cores.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/cli/sweep.hpp"

namespace moraine {

/// Time in one phase, as a share of the time of all steps; means over ranks and repeats.
struct PhaseShare {
  std::string name;
  double share = 0.0;  // [-]
};

/// The runs of one layout. Counts are sums over the ranks, and means over the repeats.
struct LayoutResult {
  Layout layout;
  int n_runs = 0;
  double n_grains = 0.0;
  double median = 0.0, least = 0.0;        // [s] for all steps
  double speed = 0.0;                      // [particle-steps/s] of the median
  double speed_up = 0.0;                   // [-] speed over that of the reference, times its number of cores
  double efficiency = 0.0;                 // [-] speed of a core over that of a core of the reference
  std::vector<PhaseShare> phases;          // without waiting they would be what the cores have done
  double waiting = 0.0;                    // [-] share of phases that are waiting
  double reductions = 0.0, parcels = 0.0;  // [-] shares, inside the phases: reductions; migration and new ghosts
  double grain_imbalance = 1.0, work_imbalance = 1.0;      // [-] largest of a rank over the mean
  double n_ghosts = 0.0, n_messages = 0.0, n_bytes = 0.0;  // messages and bytes a step
  double n_migrated = 0.0, n_rebuilds = 0.0, n_cuts = 0.0;
  double peak_memory = 0.0;         // [bytes] of all ranks
  Pinning pinning;                  // the worst of the repeats
  std::vector<std::string> hashes;  // of the end states, each once
};

/// A point beyond what was measured; against one rank, as foretold.
struct ProjectedResult {
  int ranks = 1;
  std::int64_t n_grains = 0;
  double step = 0.0;                     // [s]
  double speed_up = 0.0;                 // [-]
  double efficiency = 0.0;               // [-]
  double imbalance = 1.0;                // [-] of the work
  double messages = 0.0, waiting = 0.0;  // [-] shares of a step
};

struct ScaleResults {
  ScaleKind kind = ScaleKind::strong;
  std::string scene_file, title, version, commit, machine;
  std::uint64_t steps = 0, warm_up = 0;
  std::vector<LayoutResult> layouts;  // by cores, then ranks
  std::vector<ProjectedResult> projected;
  std::string command;
};

/// One layout from its runs (at least one); without speed-up and efficiency.
LayoutResult result_of(const Layout& layout, const std::vector<RunSummary>& runs);
/// Fills in speed-up and efficiency. The reference is the fastest of the layouts with the fewest cores.
void compare_layouts(std::vector<LayoutResult>& layouts);
/// Index of the fastest of all, or of those on so many cores. There must be one.
std::size_t best_layout(const std::vector<LayoutResult>& layouts, std::optional<long long> cores = std::nullopt);
/// What is wrong where runs of the same grains have ended differently: names two layouts and both hashes. In weak
/// scaling those on as many cores have the same grains. Empty where all is well.
std::string hash_fault(const ScaleResults& results);

}  // namespace moraine
