// Signals that ask a run to end: noted, and heeded after the step.
#pragma once

namespace moraine {

/// While it lives, SIGINT, SIGTERM and SIGHUP are noted instead of ending the process; a second one of the same ends it
/// at once. A closed pipe (`moraine run ... | head`) no longer ends it either. One at a time. Under a launcher SIGUSR1,
/// SIGUSR2 and SIGALRM stand for the three: mpirun hands those on to its ranks, where it answers SIGINT, SIGTERM and
/// SIGHUP by killing them.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

  /// The signal that came (or is stood for), or 0.
  static int signal();
  /// The signal by which to ask mpirun's ranks for what `signal` asks for.
  static int stand_in_for(int signal);
};

}  // namespace moraine
