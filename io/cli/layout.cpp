#include "io/cli/layout.hpp"

#include <sched.h>

#include <algorithm>
#include <charconv>
#include <thread>
#include <vector>

namespace moraine {

int available_cores() {
  // The set may be larger than cpu_set_t on large machines: grow until it fits.
  for (int n_cpus = 1024; n_cpus <= 1 << 20; n_cpus *= 2) {
    cpu_set_t* set = CPU_ALLOC(n_cpus);
    const std::size_t bytes = CPU_ALLOC_SIZE(n_cpus);
    const bool is_read = sched_getaffinity(0, bytes, set) == 0;
    const int count = is_read ? CPU_COUNT_S(bytes, set) : 0;
    CPU_FREE(set);
    if (count > 0) return count;
  }
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

Layout parse_layout(const std::string& text) {
  if (text == "auto") return {1, available_cores()};
  Layout layout;
  const char* last = text.data() + text.size();
  const auto [middle, error] = std::from_chars(text.data(), last, layout.ranks);
  bool is_good = error == std::errc() && middle < last && (*middle == 'x' || *middle == 'X');
  if (is_good) {
    const auto [end, second] = std::from_chars(middle + 1, last, layout.threads);
    is_good = second == std::errc() && end == last;
  }
  if (!is_good || layout.ranks < 1 || layout.threads < 1)
    throw UsageError("layout \"" + text + "\": expected \"auto\" or RANKSxTHREADS, such as \"1x" +
                     std::to_string(available_cores()) + "\"");
  if (layout.ranks > 1)
    throw UsageError("layout \"" + text + "\": this version runs as one rank; for the same number of cores use \"1x" +
                     std::to_string(static_cast<long long>(layout.ranks) * layout.threads) + "\"");
  return layout;
}

}  // namespace moraine
