#include "io/cli/schedule.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace moraine {

Schedule::Schedule(double interval, double time_step)
    : steps_per_interval_(interval > 0.0 && time_step > 0.0 ? interval / time_step : 0.0) {}

std::uint64_t Schedule::step_of(std::uint64_t multiple) const {
  return static_cast<std::uint64_t>(std::llround(static_cast<double>(multiple) * steps_per_interval_));
}

std::uint64_t Schedule::first_multiple_from(std::uint64_t step) const {
  // The division only starts the search: which step a multiple falls on is decided by step_of alone.
  const double guess = std::floor(static_cast<double>(step) / steps_per_interval_) - 1.0;
  auto multiple = static_cast<std::uint64_t>(std::max(guess, 0.0));
  while (multiple > 0 && step_of(multiple - 1) >= step) --multiple;
  while (step_of(multiple) < step) ++multiple;
  return multiple;
}

bool Schedule::is_due(std::uint64_t step) const {
  return steps_per_interval_ > 0.0 && step_of(first_multiple_from(step)) == step;
}

std::uint64_t Schedule::next_after(std::uint64_t step) const {
  if (!(steps_per_interval_ > 0.0)) return std::numeric_limits<std::uint64_t>::max();
  return step_of(first_multiple_from(step + 1));
}

std::uint64_t steps_until(double time, double time_step) {
  const double steps = time / time_step;
  if (!(steps > 0.0)) return 0;
  return static_cast<std::uint64_t>(std::ceil(steps * (1.0 - 1e-12) - 1e-9));
}

}  // namespace moraine
