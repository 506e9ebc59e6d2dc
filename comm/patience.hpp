// How this process waits for other ranks, and how long it has.
#pragma once

namespace moraine {

/// What a rank does with its core while it waits.
enum class Patience {
  spin,   // asks again and again: fastest, on a core that is its own
  sleep,  // sleeps between questions: the core is another's, too
};
/// Of the whole process. Any time.
void set_patience(Patience patience);
Patience patience();

/// Time that this process has waited for others since its start [s]: messages, reductions, parcels, barriers.
double waited_for_ranks();

}  // namespace moraine
