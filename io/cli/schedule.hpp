// When an output is due: at the multiples of its interval in simulated time, each at the step nearest to it.
#pragma once

#include <cstdint>

namespace moraine {

class Schedule {
 public:
  /// Interval and time step [s]; an interval of 0 is never due. Nothing is carried along from output to output, so that a run
  /// that was restarted anywhere, on any layout, has its outputs at the same steps.
  Schedule(double interval, double time_step);

  bool is_due(std::uint64_t step) const;
  /// The first step after `step` at which an output is due; the largest number where there is none.
  std::uint64_t next_after(std::uint64_t step) const;

 private:
  std::uint64_t step_of(std::uint64_t multiple) const;
  std::uint64_t first_multiple_from(std::uint64_t step) const;

  double steps_per_interval_ = 0.0;
};

/// Steps until that time is reached [s]: the least n with n * time_step >= time, rounding forgiven.
std::uint64_t steps_until(double time, double time_step);

}  // namespace moraine
