// Threads of a rank: the one place that knows OpenMP.
#pragma once

#include <omp.h>

#include <exception>
#include <stdexcept>
#include <string>

#include "kernels/base/range.hpp"

namespace moraine {

/// Runs work(thread) once on each of n_threads threads. An exception of any of them is thrown here when all are done;
/// work that waits at barriers must not throw between them.
template <typename Work>
void parallel(int n_threads, Work work) {
  if (n_threads <= 1) {
    work(0);
    return;
  }
  std::exception_ptr failure;
  int n_given = n_threads;
#pragma omp parallel num_threads(n_threads)
  {
    if (omp_get_num_threads() == n_threads) {
      try {
        work(omp_get_thread_num());
      } catch (...) {
#pragma omp critical
        failure = std::current_exception();
      }
    } else if (omp_get_thread_num() == 0) {
      n_given = omp_get_num_threads();
    }
  }
  if (n_given != n_threads)
    throw std::runtime_error("the system gave " + std::to_string(n_given) + " threads instead of " +
                             std::to_string(n_threads) + ": ask for fewer with --layout, or raise OMP_THREAD_LIMIT");
  if (failure) std::rethrow_exception(failure);
}

/// Waits for all threads of the surrounding parallel().
inline void barrier() {
#pragma omp barrier
}

/// Share number `part` of `n_parts` equal shares of [0, n).
constexpr Range share_of(std::int64_t n, int part, int n_parts) {
  return {n * part / n_parts, n * (part + 1) / n_parts};
}

}  // namespace moraine
