// The threads that do a piece of work together, inside parallel().
#pragma once

#include "engine/threads.hpp"

namespace moraine {

/// All threads of the surrounding parallel(), or the first one alone.
struct Team {
  int thread = 0;
  int n = 1;
  void sync() const {
    if (n > 1) barrier();
  }
  bool is_first() const { return thread == 0; }
  /// This thread's share of [0, n_items).
  Range share(std::int64_t n_items) const { return share_of(n_items, thread, n); }
};

}  // namespace moraine
