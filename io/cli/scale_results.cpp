#include "io/cli/scale_results.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <numeric>

namespace moraine {

namespace {

double median_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}

/// Mean over the repeats.
template <class Value>
double mean_of(const std::vector<RunSummary>& runs, Value value) {
  double sum = 0.0;
  for (const RunSummary& run : runs) sum += static_cast<double>(value(run));
  return sum / static_cast<double>(runs.size());
}

/// Mean over the repeats of a sum over the ranks.
template <class Number>
double mean_sum(const std::vector<RunSummary>& runs, Number RankSummary::*member) {
  return mean_of(runs, [&](const RunSummary& run) {
    return run.over_ranks([&](const RankSummary& rank) { return rank.*member; }).sum;
  });
}

Pinning worst_of(const std::vector<RunSummary>& runs) {
  Pinning worst;
  for (const RunSummary& run : runs) {
    const Pinning pinning = run.pinning();
    worst.n_threads = std::max(worst.n_threads, pinning.n_threads);
    worst.n_moved = std::max(worst.n_moved, pinning.n_moved);
    worst.n_on_shared_cpus = std::max(worst.n_on_shared_cpus, pinning.n_on_shared_cpus);
    worst.n_on_shared_cores = std::max(worst.n_on_shared_cores, pinning.n_on_shared_cores);
  }
  return worst;
}

double seconds_of(const std::vector<RunSummary>& runs) {
  return mean_of(runs, [](const RunSummary& run) { return run.seconds(); });
}

/// Mean over ranks and repeats, as a share of the steps.
double share_of(const std::vector<RunSummary>& runs, double RankSummary::*seconds) {
  const double mean = mean_of(runs, [&](const RunSummary& run) {
    return run.over_ranks([&](const RankSummary& r) { return r.*seconds; }).mean;
  });
  return seconds_of(runs) > 0.0 ? mean / seconds_of(runs) : 0.0;
}

/// Of the time of the slowest rank; what a rank is faster by is waiting, and is in its phases.
std::vector<PhaseShare> phase_shares(const std::vector<RunSummary>& runs) {
  std::vector<PhaseShare> shares;
  const double whole = seconds_of(runs);
  for (std::size_t i = 0; i < runs[0].phases.size(); ++i) {
    const double seconds = mean_of(runs, [i](const RunSummary& run) { return run.phase(i).mean; });
    shares.push_back({runs[0].phases[i], whole > 0.0 ? seconds / whole : 0.0});
  }
  return shares;
}

}  // namespace

LayoutResult result_of(const Layout& layout, const std::vector<RunSummary>& runs) {
  LayoutResult result;
  result.layout = layout;
  result.n_runs = static_cast<int>(runs.size());
  std::vector<double> seconds;
  for (const RunSummary& run : runs) seconds.push_back(run.seconds());
  result.median = median_of(seconds);
  result.least = *std::min_element(seconds.begin(), seconds.end());
  result.n_grains = mean_of(runs, [](const RunSummary& run) { return run.n_grains; });
  const double particle_steps = mean_of(runs, [](const RunSummary& run) { return run.particle_steps; });
  result.speed = result.median > 0.0 ? particle_steps / result.median : 0.0;
  result.phases = phase_shares(runs);
  for (const PhaseShare& phase : result.phases)
    if (phase.name.starts_with("waiting")) result.waiting += phase.share;
  result.reductions = share_of(runs, &RankSummary::reductions);
  result.parcels = share_of(runs, &RankSummary::parcels);
  result.grain_imbalance = mean_of(runs, [](const RunSummary& run) { return run.grain_imbalance(); });
  result.work_imbalance = mean_of(runs, [](const RunSummary& run) { return run.work_imbalance(); });
  result.n_ghosts = mean_sum(runs, &RankSummary::n_ghosts);
  result.n_messages = mean_sum(runs, &RankSummary::n_messages);
  result.n_bytes = mean_sum(runs, &RankSummary::n_bytes);
  result.n_migrated = mean_sum(runs, &RankSummary::n_migrated);
  result.peak_memory = mean_sum(runs, &RankSummary::peak_memory);
  result.n_rebuilds = mean_of(runs, [](const RunSummary& run) { return run.n_rebuilds; });
  result.n_cuts = mean_of(runs, [](const RunSummary& run) { return run.n_cuts; });
  result.pinning = worst_of(runs);
  for (const RunSummary& run : runs)
    if (std::find(result.hashes.begin(), result.hashes.end(), run.hash) == result.hashes.end())
      result.hashes.push_back(run.hash);
  return result;
}

std::size_t best_layout(const std::vector<LayoutResult>& layouts, std::optional<long long> cores) {
  std::optional<std::size_t> best;
  for (std::size_t i = 0; i < layouts.size(); ++i) {
    if (cores && layouts[i].layout.total() != *cores) continue;
    if (!best || layouts[i].speed > layouts[*best].speed) best = i;
  }
  return best.value();
}

void compare_layouts(std::vector<LayoutResult>& layouts) {
  if (layouts.empty()) return;
  long long fewest = layouts[0].layout.total();
  for (const LayoutResult& result : layouts) fewest = std::min(fewest, result.layout.total());
  const double speed_of_core = layouts[best_layout(layouts, fewest)].speed / static_cast<double>(fewest);
  for (LayoutResult& result : layouts) {
    result.speed_up = speed_of_core > 0.0 ? result.speed / speed_of_core : 0.0;
    result.efficiency = result.speed_up / static_cast<double>(result.layout.total());
  }
}

std::string hash_fault(const ScaleResults& results) {
  struct Seen {
    std::string layout, hash;
  };
  std::map<long long, Seen> first;  // by number of cores, where that matters
  for (const LayoutResult& result : results.layouts)
    for (const std::string& hash : result.hashes) {
      const long long key = results.kind == ScaleKind::weak ? result.layout.total() : 0;
      const auto [seen, is_new] = first.try_emplace(key, Seen{result.layout.text(), hash});
      if (is_new || seen->second.hash == hash) continue;
      return fmt::format(
          "runs of the same scene have ended in different states: layout {} with the hash {}, layout {} "
          "with {}. That must never be; please report it with the scene",
          seen->second.layout, seen->second.hash, result.layout.text(), hash);
    }
  return {};
}

}  // namespace moraine
