// Several sweeps over a grid in one passage through memory.
#pragma once

#include <algorithm>

#include "engine/gas/team.hpp"

namespace moraine {

/// First plane of a thread's share of n planes; even, so that planes which are lumped together stay with one thread.
constexpr int first_of_share(int n, int part, int n_parts) {
  if (part == n_parts) return n;
  return static_cast<int>(share_of(n, part, n_parts).begin) / 2 * 2;
}

/// Whether every thread has planes enough for so many stages.
constexpr bool is_thick_enough(int n_planes, int n_stages, int n_threads) {
  return n_threads == 1 || n_planes / n_threads >= 2 * n_stages;
}

/// Calls stage(s, k) for all stages and planes, where stage s at plane k needs stage s - 1 at k - 1, k and k + 1 (and changes nothing that those
/// still need). Stages follow each other at a distance of one plane, so that what they share stays in the cache. Each thread does first what
/// depends on its planes alone; then, all having waited, what was left out on both sides of its first plane. (The tiles are the trapezoids of
/// Frigo & Strumpen 2005, ICS.) Returns when all are done.
template <typename Stage>
void wave(int n_planes, int n_stages, Team team, Stage stage) {
  const int first = first_of_share(n_planes, team.thread, team.n);
  const int end = first_of_share(n_planes, team.thread + 1, team.n);
  for (int front = first; front < end + n_stages - 1; ++front)
    for (int s = 0; s < n_stages; ++s) {
      const int k = front - s;
      if (k >= first + (first > 0 ? s : 0) && k < end - (end < n_planes ? s : 0)) stage(s, k);
    }
  team.sync();
  if (team.n == 1) return;
  if (first > 0)
    for (int s = 1; s < n_stages; ++s)
      for (int k = first - s; k < first + s; ++k) stage(s, k);
  team.sync();
}

}  // namespace moraine
