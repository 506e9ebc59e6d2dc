// The last steps of grains that are in trouble, for whoever has to find out why a run has stopped.
#pragma once

#include <deque>
#include <string>
#include <vector>

#include "engine/run/guard.hpp"
#include "engine/run/simulation.hpp"

namespace moraine {

/// A RunError with the flight record of the grains concerned.
struct RecordedRunError : RunError {
  RecordedRunError(const std::string& what, std::string rows) : RunError(what), record(std::move(rows)) {}
  std::string record;  // CSV, see FlightRecorder
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

 private:
  static constexpr int n_watched = 32, n_rest = 1000;  // [steps]

  bool is_calm() const { return phase_ == 0; }

  double max_overlap_;
  int phase_ = 0;  // steps since the watch began; 0: nothing to watch
  std::deque<std::string> steps_;
};

/// The grains of the deepest contact for its size, the first of them ours; empty where nothing touches.
std::vector<std::int32_t> deepest_grains(const GuardView& view);

}  // namespace moraine
