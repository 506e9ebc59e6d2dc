#include "bench/kernels/meter.hpp"

#include <algorithm>

#include "bench/kernels/roof.hpp"

namespace moraine::bench {

void report(benchmark::State& state, const Work& work, double seconds) {
  const auto set = [&](const char* name, double value) {
    if (value > 0.0) state.counters[name] = value;
  };
  set(work.items_name, work.items / seconds);
  set("bytes/s", work.bytes / seconds);
  set("flops/s", work.flops / seconds);
  if (!(work.bytes > 0.0 || work.flops > 0.0)) return;
  const Level level = roof().level(work.working_set, work.n_threads);
  const Ceiling& ceiling = roof().of(work.n_threads);
  const double needed = std::max(work.bytes / ceiling.bandwidth[static_cast<std::size_t>(level)],
                                 work.flops / (work.is_float ? ceiling.float_flops : ceiling.flops));
  set("roof_%", 100.0 * needed / seconds);
  state.SetLabel(level_names[static_cast<std::size_t>(level)]);
}

}  // namespace moraine::bench
