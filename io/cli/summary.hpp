// What a run says at its end: to people (summary.txt) and to programs (summary.json).
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "engine/run/simulation.hpp"
#include "io/cli/thread_places.hpp"

namespace moraine {

/// Where the time of this process went. What is counted begins after the warm-up.
struct RunTimes {
  double start = 0.0;           // [s] filling the scene, or reading the checkpoint
  double stepping = 0.0;        // [s]
  double outputs = 0.0;         // [s]
  WorldTimes world;             // [s] of the stepping
  double particle_steps = 0.0;  // grains, summed over the steps
  std::uint64_t n_steps = 0;    // of this process
  std::uint64_t n_warm_up = 0;  // before them, not counted
  std::vector<int> cpus;        // that the threads were on after the last step
};

/// The counters of this rank as counting begins.
struct RunMark {
  std::vector<PhaseTime> phases;  // empty: all from zero
  std::uint64_t n_rebuilds = 0, n_looks = 0, n_cuts = 0, n_migrated = 0;
  std::vector<int> cpus;        // of its threads
  std::vector<NamedWork> work;  // empty: all from zero
};
RunMark mark_of(const Simulation& simulation, int n_threads);

/// One rank of a run. Grains, pairs, ghosts and messages are as they were at the end.
struct RankSummary {
  std::vector<double> phases;                         // [s] in the order of RunSummary::phases
  double stepping = 0.0, start = 0.0, outputs = 0.0;  // [s]
  double reductions = 0.0,
         parcels = 0.0;  // [s] of the stepping: in reductions; in parcels, that is migration and new ghosts
  std::uint64_t n_grains = 0, n_pairs = 0, n_ghosts = 0;
  std::uint64_t n_neighbours = 0;
  std::uint64_t n_messages = 0, n_bytes = 0;  // sent in a step
  std::uint64_t n_migrated = 0;               // grains given to others
  double memory = 0.0, peak_memory = 0.0;     // [bytes] in grains, pairs, contacts; of the process
  ThreadPlaces places;
  std::vector<NamedWork> work;  // of its threads in each phase of the steps, waiting apart from working

  bool operator==(const RankSummary&) const = default;
};

/// A number over the ranks.
struct OverRanks {
  double mean = 0.0, largest = 0.0, sum = 0.0;
};

/// Where the time of all threads of a run went [s].
struct ThreadUse {
  double held = 0.0;             // in the steps
  double working = 0.0;          // of that
  double waiting_ranks = 0.0;    // while their rank waited for others
  double waiting_threads = 0.0;  // for each other, or while one works alone
};

struct RunSummary {
  std::string scene_file, title;
  std::string version, commit;
  std::string processor;
  int n_cpus = 0;  // of the first rank's machine
  std::string layout, directory;
  int signal = 0;                      // that has ended the run; 0: it ended by itself
  double time_step = 0.0, time = 0.0;  // [s]
  std::uint64_t n_steps = 0, n_warm_up = 0;
  double particle_steps = 0.0;
  std::uint64_t n_born = 0, n_grains = 0, n_left = 0;
  std::uint64_t n_rebuilds = 0, n_looks = 0,
                n_cuts = 0;           // cuts: how often space was divided, those at the start included
  std::string balance_mode;           // as the scene has it
  BalanceTotals balance;              // of the whole process
  std::vector<std::string> warnings;  // what the run did that its time step was not chosen for
  std::optional<GasTotals> gas;       // of the whole process, where the scene has gas
  std::vector<std::string> phases;    // those of the steps; the last is what they took beyond the others
  std::vector<RankSummary> ranks;
  std::string hash;

  /// Of a value of each rank.
  template <class Value>
  OverRanks over_ranks(Value value) const {
    OverRanks all;
    for (const RankSummary& rank : ranks) {
      const auto one = static_cast<double>(value(rank));
      all.sum += one;
      if (one > all.largest) all.largest = one;
    }
    if (!ranks.empty()) all.mean = all.sum / static_cast<double>(ranks.size());
    return all;
  }
  OverRanks phase(std::size_t i) const;  // [s]
  OverRanks waiting() const;             // [s] in phases that are called so
  double seconds() const;                // [s] of stepping, of the slowest rank
  double speed() const;                  // [particle-steps/s]; 0 where no steps were counted
  double grain_imbalance() const;        // [-] largest number of grains of a rank over the mean
  double work_imbalance() const;         // [-] the same of pairs + 4 grains
  Pinning pinning() const;
  ThreadUse thread_use() const;

  bool operator==(const RunSummary&) const = default;
};

/// The account of a run. All ranks call it; the root's holds all of it, that of the others is of no use.
RunSummary summarize(const Simulation& simulation, const RunTimes& times, const RunMark& mark);

/// Table of phases, speed, grains, memory; ends in "state hash: ...". With several ranks the phases are means, with the
/// largest beside them, and memory is that of all.
std::string summary_text(const RunSummary& run);
std::string summary_json(const RunSummary& run);
/// Reads a summary.json. Throws StorageError where it cannot be read or is not one.
RunSummary read_summary(const std::filesystem::path& file);

/// Most memory that this process has held so far [bytes].
double peak_memory();

}  // namespace moraine
