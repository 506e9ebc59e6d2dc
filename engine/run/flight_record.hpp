// The steps of grains that are in trouble, for whoever has to find out why a run has stopped or warned.
#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "engine/run/guard.hpp"
#include "engine/run/simulation.hpp"

namespace moraine {

/// A RunError with the flight record of the grains concerned.
struct RecordedRunError : RunError {
  RecordedRunError(const std::string& what, FlightRecord rows) : RunError(what), record(std::move(rows)) {}
  FlightRecord record;
};

/// Watches this rank's contacts from half of run.max_overlap on, and grains from half of the speed at which they would miss
/// contacts, and keeps the last steps of those concerned. A step costs nothing until something is that deep or fast; then some
/// tens of steps cost about twice as much, after which the watch rests for a thousand: scenes in which that is usual go on
/// as before.
class FlightRecorder {
 public:
  explicit FlightRecorder(double max_overlap) : max_overlap_(max_overlap) {}

  /// Overlap over the smaller radius of which the contacts are to tell in the next step.
  double watched_overlap() const { return is_calm() ? 0.5 * max_overlap_ : max_overlap_; }

  bool is_watching() const { return !is_calm(); }

  /// After a step in which some overlap was deeper than watched_overlap(), or a grain fast. Returns whether it is time to stop.
  bool note(const GuardView& view, bool is_deep, bool is_fast);

  /// The record, with the present state of these grains (local indices) as its end: a header and one row a contact, or one a
  /// grain that touches nothing.
  std::string finish(const GuardView& view, const std::vector<std::int32_t>& grains);

  /// Keeps the coming steps (where none come: the present state) of these grains (local indices), as long as they are of this rank, for a record that is begun with
  /// what it holds of the gas. For what a run survives: nobody knows before whom it concerns.
  void follow(const GuardView& view, const std::vector<std::int32_t>& grains, FlightRecord record);
  bool is_following() const { return !followed_.empty(); }
  /// After a step.
  void note_followed(const GuardView& view);
  /// The records that are complete; with `is_end` also those that are not.
  std::vector<FlightRecord> take_followed(bool is_end);

 private:
  static constexpr int n_watched = 32, n_rest = 1000;  // [steps]

  struct Followed {
    FlightRecord record;
    std::vector<std::uint64_t> gids;  // ascending
    int n_steps = 0;
  };

  bool is_calm() const { return phase_ == 0; }

  double max_overlap_;
  int phase_ = 0;  // steps since the watch began; 0: nothing to watch
  std::deque<std::string> steps_;
  std::vector<Followed> followed_;
};

/// Those that an open energy ledger may be due to: of the deepest contact, the fastest, and the one that moves furthest for its size.
std::vector<std::int32_t> most_moved_grains(const GuardView& view);

/// The grains of the deepest contact for its size, the first of them ours; empty where nothing touches.
std::vector<std::int32_t> deepest_grains(const GuardView& view);

}  // namespace moraine
