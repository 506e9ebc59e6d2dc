// Time spent in each phase of the step.
#pragma once

#include <array>
#include <chrono>
#include <string>
#include <vector>

namespace moraine {

/// One row of the table of phases.
struct PhaseTime {
  std::string name;
  double seconds = 0.0;
};

enum class Phase { rebuild, gas, advance, faces, guard, observe, count_ };

class Stopwatch {
 public:
  /// Ends the running phase and starts another.
  void start(Phase phase) {
    const auto now = std::chrono::steady_clock::now();
    seconds_[static_cast<std::size_t>(running_)] += std::chrono::duration<double>(now - since_).count();
    running_ = phase;
    since_ = now;
  }
  /// Of a phase that is not running [s].
  double seconds(Phase phase) const { return seconds_[static_cast<std::size_t>(phase)]; }
  std::vector<PhaseTime> table() const {
    static constexpr const char* names[] = {"sort, pair list, wall candidates", "gas and drag", "contacts and motion",
                                            "periodic faces, outlets",          "guard",        "outside the step"};
    std::vector<PhaseTime> rows;
    for (std::size_t i = 0; i < seconds_.size(); ++i) rows.push_back({names[i], seconds_[i]});
    return rows;
  }

 private:
  std::array<double, static_cast<std::size_t>(Phase::count_)> seconds_{};
  Phase running_ = Phase::observe;
  std::chrono::steady_clock::time_point since_ = std::chrono::steady_clock::now();
};

}  // namespace moraine
