// Signals that ask a run to end: noted, and heeded after the step.
#pragma once

namespace moraine {

/// While it lives, SIGINT, SIGTERM and SIGHUP are noted instead of ending the process; a second one of the same ends it at
/// once. A closed pipe (`moraine run ... | head`) no longer ends it either. One at a time.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

  /// The signal that came, or 0.
  static int signal();
};

}  // namespace moraine
