// What one pass of a kernel does, and the counters that come of it.
#pragma once

#include <benchmark/benchmark.h>
#include <time.h>

#include <string>

namespace moraine::bench {

/// Work of one pass. What is zero is not reported.
struct Work {
  const char* items_name = "items/s";
  double items = 0.0;
  double bytes = 0.0;        // that have to come from, or go to, the level that holds the working set
  double flops = 0.0;        // useful ones: of contacts that touch
  double working_set = 0.0;  // [bytes]
  int n_threads = 1;
  bool is_float = false;  // flops in single precision
};

/// Sets the counters for passes that took `seconds` each: items/s, bytes/s, flops/s, and the percentage of the roof, which is the
/// least time that bytes and flops need on this machine over the time taken.
void report(benchmark::State& state, const Work& work, double seconds);

/// [s] of one thread, its own time: others that use the machine count less. Of several threads, wall time.
inline double clock_seconds(int n_threads) {
  timespec now{};
  clock_gettime(n_threads <= 1 ? CLOCK_THREAD_CPUTIME_ID : CLOCK_MONOTONIC, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Runs pass() as often as Google Benchmark wants, and reports.
template <typename Pass>
void measure(benchmark::State& state, const Work& work, Pass pass) {
  const double start = clock_seconds(work.n_threads);
  for (auto _ : state) pass();
  report(state, work, (clock_seconds(work.n_threads) - start) / static_cast<double>(state.iterations()));
}

template <typename Function>
void add(const std::string& name, Function function) {
  benchmark::RegisterBenchmark(name.c_str(), function)->Unit(benchmark::kMicrosecond);
}

void add_contact_sweeps();
void add_only_what_is_needed();
void add_motion();
void add_neighbours();
void add_surfaces();
void add_whole_engine();
void add_gas_exchange();
void add_drag();
void add_multigrid();
void add_messages();

}  // namespace moraine::bench
