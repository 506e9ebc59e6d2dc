// Google Benchmark over the kernels: `./moraine bench`, or this program with Google Benchmark's options.
#include <benchmark/benchmark.h>

#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#include "bench/kernels/meter.hpp"
#include "bench/kernels/roof.hpp"
#include "kernels/contact/sweep.hpp"

namespace {

using moraine::bench::Ceiling;

std::string text(const Ceiling& ceiling) {
  char line[200];
  std::snprintf(line, sizeof(line),
                "%.1f Gflop/s, %.1f in single precision; triad %.0f GB/s in L2, %.0f in L3, %.1f in memory",
                1e-9 * ceiling.flops, 1e-9 * ceiling.float_flops, 1e-9 * ceiling.bandwidth[0],
                1e-9 * ceiling.bandwidth[1], 1e-9 * ceiling.bandwidth[2]);
  return line;
}

void describe_machine() {
  const moraine::bench::Roof& roof = moraine::bench::roof();
  benchmark::AddCustomContext("build", MORAINE_BENCH_BUILD);
  benchmark::AddCustomContext("instruction set", moraine::instruction_set());
  benchmark::AddCustomContext("roof of 1 thread", text(roof.one));
  benchmark::AddCustomContext("roof of " + std::to_string(roof.n_threads) + " threads", text(roof.all));
}

}  // namespace

int main(int argc, char** argv) {
  bool is_list = false;
  for (int k = 1; k < argc; ++k)
    is_list =
        is_list || std::strncmp(argv[k], "--benchmark_list_tests", 22) == 0 || std::strcmp(argv[k], "--help") == 0;
  if (!is_list) describe_machine();
  moraine::bench::add_contact_sweeps();
  moraine::bench::add_only_what_is_needed();
  moraine::bench::add_motion();
  moraine::bench::add_neighbours();
  moraine::bench::add_surfaces();
  moraine::bench::add_gas_exchange();
  moraine::bench::add_drag();
  moraine::bench::add_multigrid();
  moraine::bench::add_messages();
  moraine::bench::add_whole_engine();
  // Defaults first, so that whoever says otherwise is the last to say it: all of them in about a minute, in columns.
  std::vector<std::string> defaults = {"--benchmark_min_time=0.1", "--benchmark_counters_tabular=true"};
  std::vector<char*> arguments(argv, argv + argc);
  for (std::size_t k = 0; k < defaults.size(); ++k)
    arguments.insert(arguments.begin() + 1 + static_cast<std::ptrdiff_t>(k), defaults[k].data());
  int n_arguments = static_cast<int>(arguments.size());
  arguments.push_back(nullptr);
  benchmark::Initialize(&n_arguments, arguments.data());
  if (benchmark::ReportUnrecognizedArguments(n_arguments, arguments.data())) return 2;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
