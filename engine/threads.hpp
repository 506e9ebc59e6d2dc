// Threads of a rank: the one place that knows OpenMP.
#pragma once

#include <omp.h>

#include <chrono>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

#include "kernels/base/range.hpp"

namespace moraine {

/// Where the time of a team of threads went while it was the one that is noted [s].
struct ThreadTimes {
  struct alignas(64) Thread {  // threads write their own cache lines
    double working = 0.0;      // in the work of parallel(), barriers left out
    double waiting = 0.0;      // at barriers inside of it
  };
  std::vector<Thread> threads;
  double together = 0.0;  // wall-clock time in parallel() with several threads
  double held = 0.0;      // the same times the number of threads: what they could have worked
};

/// What parallel() adds to from now on, until the next call; nullptr: nothing. Called by the thread that calls parallel().
void note_thread_times(ThreadTimes* times);
ThreadTimes* noted_thread_times();
/// Takes the note back where it is this one: before it goes.
void forget_thread_times(const ThreadTimes* times);

/// The CPUs that the threads of parallel() run on from now on, each list for one thread; those beyond the last start over. Empty:
/// they stay where they are. Threads move when they next work.
void place_threads(std::vector<std::vector<int>> cpus_of_thread);

namespace threads {

inline double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}
/// Moves the calling thread where place_threads() wants it.
void take_place(int thread);
/// What the calling thread adds to at barriers.
inline thread_local ThreadTimes::Thread* own_times = nullptr;

}  // namespace threads

/// Runs work(thread) once on each of n_threads threads. An exception of any of them is thrown here when all are done;
/// work that waits at barriers must not throw between them.
template <typename Work>
void parallel(int n_threads, Work work) {
  if (n_threads <= 1) {
    threads::take_place(0);
    work(0);
    return;
  }
  std::exception_ptr failure;
  int n_given = n_threads;
  ThreadTimes* const times = noted_thread_times();
  if (times && times->threads.size() < static_cast<std::size_t>(n_threads))
    times->threads.resize(static_cast<std::size_t>(n_threads));
  const double begin = threads::now();
#pragma omp parallel num_threads(n_threads)
  {
    if (omp_get_num_threads() == n_threads) {
      const int thread = omp_get_thread_num();
      threads::take_place(thread);
      ThreadTimes::Thread* const own = times ? &times->threads[static_cast<std::size_t>(thread)] : nullptr;
      threads::own_times = own;
      const double start = threads::now(), waited = own ? own->waiting : 0.0;
      try {
        work(thread);
      } catch (...) {
#pragma omp critical
        failure = std::current_exception();
      }
      if (own) own->working += threads::now() - start - (own->waiting - waited);
      threads::own_times = nullptr;
    } else if (omp_get_thread_num() == 0) {
      n_given = omp_get_num_threads();
    }
  }
  if (times) {
    const double seconds = threads::now() - begin;
    times->together += seconds;
    times->held += seconds * n_threads;
  }
  if (n_given != n_threads)
    throw std::runtime_error("the system gave " + std::to_string(n_given) + " threads instead of " +
                             std::to_string(n_threads) + ": ask for fewer with --layout, or raise OMP_THREAD_LIMIT");
  if (failure) std::rethrow_exception(failure);
}

/// Waits for all threads of the surrounding parallel().
inline void barrier() {
  ThreadTimes::Thread* const own = threads::own_times;
  const double start = own ? threads::now() : 0.0;
#pragma omp barrier
  if (own) own->waiting += threads::now() - start;
}

/// Share number `part` of `n_parts` equal shares of [0, n).
constexpr Range share_of(std::int64_t n, int part, int n_parts) {
  return {n * part / n_parts, n * (part + 1) / n_parts};
}

}  // namespace moraine
