#include "io/cli/progress.hpp"

#include <fmt/format.h>

#include "io/cli/text.hpp"

namespace moraine {

namespace {
constexpr double between_lines_terminal = 0.25;  // [s]
constexpr double shortest_between_lines = 5.0;   // [s] in a file
constexpr double longest_between_lines = 60.0;   // [s] in a file
constexpr double speed_window = 3.0;             // [s]
}  // namespace

Progress::Progress(Log& log, std::uint64_t first_step, std::uint64_t last_step, double time_step)
    : log_(&log),
      first_step_(first_step),
      last_step_(last_step),
      time_step_(time_step),
      shown_step_(first_step),
      window_step_(first_step) {}

bool Progress::is_due(double now, std::uint64_t step) const {
  const double since = now - shown_at_;
  if (log_->is_terminal()) return since >= between_lines_terminal;
  if (since < shortest_between_lines) return false;
  const std::uint64_t n_steps = last_step_ - first_step_;
  const auto tenth = [&](std::uint64_t s) { return n_steps == 0 ? 0 : (s - first_step_) * 10 / n_steps; };
  return since >= longest_between_lines || tenth(step) > tenth(shown_step_);
}

std::string Progress::line(double now, std::uint64_t step) {
  if (now - window_start_ >= speed_window || speed_ == 0.0) {
    speed_ = window_work_ / (now - window_start_);
    steps_per_second_ = static_cast<double>(step - window_step_) / (now - window_start_);
    if (now - window_start_ >= speed_window) window_start_ = now, window_step_ = step, window_work_ = 0.0;
  }
  const double percent = 100.0 * static_cast<double>(step) / static_cast<double>(last_step_);
  const double left = static_cast<double>(last_step_ - step) / steps_per_second_;
  // Short enough for a line of 80 characters.
  return fmt::format("{:5.1f} %  {:.4g} of {:.4g} s  step {}  {:.2f} M particle-steps/s  {} left", percent,
                     static_cast<double>(step) * time_step_, static_cast<double>(last_step_) * time_step_, step,
                     speed_ * 1e-6, duration_text(left));
}

void Progress::update(std::uint64_t step, std::uint64_t n_grains) {
  window_work_ += static_cast<double>(n_grains);
  const double now = clock_.seconds();
  if (!is_due(now, step)) return;
  log_->progress(line(now, step));
  shown_at_ = now;
  shown_step_ = step;
}

}  // namespace moraine
