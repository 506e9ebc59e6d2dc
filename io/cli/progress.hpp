// The line that says how far a run has come.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "io/cli/log.hpp"

namespace moraine {

/// Wall clock [s].
class WallClock {
 public:
  double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

class Progress {
 public:
  /// Steps at which the run starts and ends, and its time step [s].
  Progress(Log& log, std::uint64_t first_step, std::uint64_t last_step, double time_step);
  /// After each step. On a terminal a line a few times a second; else one at every tenth of the run, but not too often, and at
  /// least every minute.
  void update(std::uint64_t step, std::uint64_t n_grains);

 private:
  bool is_due(double now, std::uint64_t step) const;
  std::string line(double now, std::uint64_t step);

  Log* log_;
  std::uint64_t first_step_, last_step_;
  double time_step_;
  WallClock clock_;
  double shown_at_ = 0.0;  // [s]
  std::uint64_t shown_step_ = 0;
  double window_start_ = 0.0;  // [s] speed is taken over the last seconds, so that it follows the flow
  std::uint64_t window_step_ = 0;
  double window_work_ = 0.0;  // particle-steps since window_start_
  double speed_ = 0.0;        // particle-steps/s
  double steps_per_second_ = 0.0;
};

}  // namespace moraine
