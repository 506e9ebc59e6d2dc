// What a sweep of speed against error has shown: errors of each setting against the reference, the efficient front, and
// the setting to recommend.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "engine/run/image.hpp"
#include "io/cli/pareto_settings.hpp"
#include "io/cli/summary.hpp"

namespace moraine {

/// What a run has shown of the quantities that are compared; all runs of a sweep have them in the same order.
struct ParetoRecord {
  RunSummary summary;
  std::vector<double> means;       // of each statistic: average over time
  std::vector<double> deviations;  // and standard deviation over time
  std::vector<std::vector<double>>
      paths;  // at each look: x, y, z of the grains in order of gid; not a number where gone
  std::vector<std::vector<double>> rows;  // of each value: its rows
};

/// The error of one quantity against the reference.
struct ParetoError {
  std::string quantity;
  double value = 0.0;                // [-] relative; for statistics the mean of the differences, with its sign
  std::optional<double> half_width;  // [-] of its 95 % confidence interval; none: not repeated
  double reference = 0.0;            // what it is relative to, in the quantity's unit
  /// What is known to hold the error.
  double bound() const { return (value < 0.0 ? -value : value) + half_width.value_or(0.0); }
  /// What the error is known to have at least.
  double least() const { return std::max((value < 0.0 ? -value : value) - half_width.value_or(0.0), 0.0); }
};

/// Whether a setting is on the efficient front, as far as intervals tell.
enum class ParetoStanding {
  beaten,  // another is at least as fast and as accurate, and better in one of the two, beyond both intervals
  open,    // neither that, nor the opposite is known
  front    // all that may be as fast are less accurate, beyond both intervals
};
const char* word_for(ParetoStanding standing);

/// One setting.
struct ParetoResult {
  ParetoSetting setting;
  int n_runs = 0;
  double seconds = 0.0;             // [s] of stepping, median of the runs, scaled to the end of the scene
  std::vector<double> times;        // [s] of stepping of each repeat
  double speed = 0.0;               // [particle-steps/s] of that run
  std::vector<ParetoError> errors;  // of each quantity; none where it failed
  std::string failure;              // what the run said as it stopped; empty: it did not
  std::vector<std::string> hashes;  // end states, in order of the repeats
  ParetoStanding standing = ParetoStanding::beaten;

  bool is_good() const { return failure.empty(); }
  /// The quantity that may have the largest error, its interval included.
  const ParetoError& worst() const;
  /// What the largest error is known to have at least.
  double least_error() const;
};

struct ParetoResults {
  std::string scene_file, title, version, commit, machine, layout, command;
  ParetoMeasure measure = ParetoMeasure::paths;
  double end = 0.0, from = 0.0, scene_end = 0.0;  // [s]
  int repeats = 1;
  double accept = 0.0;                // [-]
  std::vector<ParetoResult> results;  // the reference first
  std::optional<std::size_t> recommended;
  std::string advice;                // why that one, or why none
  bool is_chaotic = false;           // paths do not converge, so that errors by paths mean nothing
  std::vector<std::string> remarks;  // what was not tried
};

/// Whether the runs of both, repeat by repeat, have ended in the same states; false without any. Then they have the same errors, whatever their intervals.
bool is_same_state(const ParetoResult& one, const ParetoResult& other);

/// Reads what a run has left: its summary, probes, and the paths of its grains. `columns` are those that the scene names for this
/// measure. Throws StorageError.
ParetoRecord read_record(const ParetoPlan& plan, const std::vector<ProbeColumn>& columns,
                         const std::filesystem::path& run_directory);

/// Errors of a setting's runs against those of the reference, repeat by repeat. A setting may have fewer repeats.
std::vector<ParetoError> errors_between(const ParetoPlan& plan, const std::vector<ProbeColumn>& columns,
                                        const std::vector<ParetoRecord>& runs,
                                        const std::vector<ParetoRecord>& reference);

/// Half the width of the 95 % confidence interval of a mean, from its samples (Student 1908); none for fewer than two.
std::optional<double> half_width_of_mean(const std::vector<double>& samples);

/// Finds who is on the front, looks whether paths converge, and recommends. Times are compared repeat by repeat, as runs of one
/// repeat follow each other, so that a machine that changes its speed slows both. The reference is not a candidate.
void judge(ParetoResults& results);

}  // namespace moraine
