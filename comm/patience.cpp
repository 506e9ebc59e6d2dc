#include "comm/patience.hpp"

#include <sched.h>
#include <sys/prctl.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <ctime>

#include "comm/wait.hpp"

namespace moraine {

namespace {

// Only the thread that speaks for the rank waits, but any may be asked how.
std::atomic<Patience> how = Patience::spin;
std::atomic<double> seconds_waited = 0.0;

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

/// Calls is_done() until it is.
template <typename IsDone>
void wait_until(IsDone is_done) {
  if (is_done()) return;
  const double since = now();
  for (unsigned n = 0; !is_done(); ++n) be_patient(n);
  add_waited(now() - since);
}

}  // namespace

void set_patience(Patience patience) {
  if (how.exchange(patience) == patience || patience == Patience::spin) return;
  prctl(PR_SET_TIMERSLACK, 1000UL, 0UL, 0UL, 0UL);  // [ns] else each sleep is 50 us longer than it is asked to be
}

Patience patience() { return how; }
double waited_for_ranks() { return seconds_waited; }
void add_waited(double seconds) { seconds_waited = seconds_waited + seconds; }

void be_patient(unsigned n_times) {
  if (how == Patience::spin) {
    constexpr unsigned spins =
        100;  // some microseconds: where ranks share cores after all, more is what the others lack
    if (n_times >= spins) sched_yield();  // costs nothing where nobody else wants the core
    return;
  }
  // Give way first: what is waited for is often a moment away. Then sleep longer and longer.
  constexpr unsigned yields = 8;
  if (n_times < yields) {
    sched_yield();
    return;
  }
  constexpr long shortest = 20'000, longest = 200'000;  // [ns]
  const timespec pause{0, std::min(longest, shortest * static_cast<long>(1 + (n_times - yields) / 4))};
  nanosleep(&pause, nullptr);
}

void wait_for(MPI_Request request) {
  wait_until([&] {
    int is_done = 0;
    MPI_Test(&request, &is_done, MPI_STATUS_IGNORE);
    return is_done != 0;
  });
}

void wait_for_all(std::span<MPI_Request> requests) {
  wait_until([&] {
    int is_done = 0;
    MPI_Testall(static_cast<int>(requests.size()), requests.data(), &is_done, MPI_STATUSES_IGNORE);
    return is_done != 0;
  });
}

}  // namespace moraine
