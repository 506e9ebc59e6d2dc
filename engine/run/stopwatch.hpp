// Time spent in each phase of the step: working, waiting for other ranks, waiting for threads.
#pragma once

#include <array>
#include <chrono>
#include <string>
#include <vector>

#include "comm/patience.hpp"
#include "engine/threads.hpp"

namespace moraine {

/// One row of the table of phases.
struct PhaseTime {
  std::string name;
  double seconds = 0.0;
};

enum class Phase { rebuild, gas, look, advance, faces, guard, observe, count_ };

/// What a rank's threads did in a phase [s].
struct PhaseWork {
  double seconds = 0.0;          // wall-clock time
  double waited = 0.0;           // of it for other ranks
  double working = 0.0;          // of all threads together, alone or in parallel
  double held = 0.0;             // what they could have worked, had they all worked all the time
  std::vector<double> threads;   // working, of each thread, in parallel
  std::vector<double> barriers;  // each thread at barriers between them
  bool operator==(const PhaseWork&) const = default;
};

class Stopwatch {
 public:
  Stopwatch() { note_thread_times(&times_[0].threads); }
  ~Stopwatch() {
    for (const Times& phase : times_) forget_thread_times(&phase.threads);
  }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

  /// Ends the running phase and starts another, which has so many threads.
  void start(Phase phase, int n_threads) {
    const double now = threads::now(), waited = waited_for_ranks();
    Times& ended = times_[static_cast<std::size_t>(running_)];
    ended.seconds += now - since_;
    ended.waited += waited - waited_before_;
    ended.held += (now - since_) * n_threads_;
    running_ = phase;
    since_ = now;
    waited_before_ = waited;
    n_threads_ = n_threads;
    note_thread_times(&times_[static_cast<std::size_t>(phase)].threads);
  }
  /// Of a phase that is not running.
  PhaseWork work(Phase phase) const {
    const Times& times = times_[static_cast<std::size_t>(phase)];
    PhaseWork work{times.seconds, times.waited, 0.0, times.held, {}, {}};
    for (const ThreadTimes::Thread& thread : times.threads.threads) {
      work.threads.push_back(thread.working);
      work.barriers.push_back(thread.waiting);
      work.working += thread.working;
    }
    // The first thread speaks for the rank: what it waits for others is in its work, or in what it does alone.
    work.working += times.seconds - times.threads.together - times.waited;
    return work;
  }
  /// Wall-clock time of a phase that is not running, and the part of it that went into waiting for other ranks [s].
  double seconds(Phase phase) const { return times_[static_cast<std::size_t>(phase)].seconds; }
  double waited(Phase phase) const { return times_[static_cast<std::size_t>(phase)].waited; }

  static const char* name(Phase phase) {
    static constexpr const char* names[] = {
        "sort, pair list, wall candidates", "gas and drag", "looks",           "contacts and motion",
        "periodic faces, outlets",          "guard",        "outside the step"};
    return names[static_cast<std::size_t>(phase)];
  }

 private:
  struct Times {
    double seconds = 0.0, waited = 0.0, held = 0.0;  // [s]
    ThreadTimes threads;
  };
  std::array<Times, static_cast<std::size_t>(Phase::count_)> times_;
  Phase running_ = Phase::observe;
  int n_threads_ = 1;
  double since_ = threads::now(), waited_before_ = waited_for_ranks();
};

}  // namespace moraine
