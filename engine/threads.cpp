#include "engine/threads.hpp"

#include <algorithm>
#include <atomic>

#include "comm/cpus.hpp"

namespace moraine {

namespace {

ThreadTimes* noted = nullptr;

// Written between parallel regions, by the thread that starts them; read inside.
std::vector<std::vector<int>> places;
unsigned version = 0;  // of the places; 0: there were never any

// Of the calling thread: where it is, by which version.
thread_local unsigned seen = 0;
thread_local std::vector<int> is_at;

}  // namespace

void note_thread_times(ThreadTimes* times) { noted = times; }
ThreadTimes* noted_thread_times() { return noted; }
void forget_thread_times(const ThreadTimes* times) {
  if (noted == times) noted = nullptr;
}

void place_threads(std::vector<std::vector<int>> cpus_of_thread) {
  if (cpus_of_thread == places) return;
  places = std::move(cpus_of_thread);
  ++version;
}

void threads::take_place(int thread) {
  if (seen == version) return;
  seen = version;
  if (places.empty()) return;
  const std::vector<int>& wanted = places[static_cast<std::size_t>(thread) % places.size()];
  if (wanted == is_at) return;
  if (run_on(wanted)) is_at = wanted;
}

}  // namespace moraine
