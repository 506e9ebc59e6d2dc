// How many ranks and threads a run uses.
#pragma once

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "comm/cpus.hpp"
#include "comm/world.hpp"

namespace moraine {

/// A command line or a request that cannot be carried out; nothing has been done. Exit code 2.
struct UsageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct Layout {
  int ranks = 1;
  int threads = 1;
  long long total() const { return static_cast<long long>(ranks) * threads; }
  std::string text() const { return std::to_string(ranks) + 'x' + std::to_string(threads); }
};

/// "auto" or "RxT", such as "1x8". Throws UsageError that says what was expected.
Layout parse_layout(const std::string& text);

/// What the program takes where nobody says.
struct LayoutChoice {
  Layout layout;
  std::string why;
};
/// For a scene of so many grains and gas cells on these cores: a rank for each NUMA node that has its share of them, as
/// memory of another is further away; one where the scene is too small for that, or ranks cannot be started; on one node threads
/// alone, which share memory and need neither ghosts nor messages (bench/results/layouts.md). No more threads than have
/// work.
LayoutChoice choose_layout(std::uint64_t n_grains, std::uint64_t n_cells, const std::vector<Core>& cores,
                           bool can_start_ranks);

/// The CPUs of a rank, and the node that they belong to.
struct RankCpus {
  std::string node;
  std::vector<int> cpus;  // in order
};
/// How many threads each rank can have, so that ranks that may run on the same CPUs share them; at least 1.
int threads_for_each(const std::vector<RankCpus>& ranks);
/// True where some CPUs have more threads than they are.
bool are_crowded(const std::vector<RankCpus>& ranks, int threads);

/// The layout of a run whose ranks a launcher has started.
struct GivenLayout {
  Layout layout;
  bool is_crowded = false;
  std::string why;  // it was chosen; empty: it was asked for
};
/// The ranks are those given; `asked` (--layout) must agree with them (UsageError), `of_scene` counts where it does.
/// "auto": the cores of each rank. All ranks call it, and get the same.
GivenLayout layout_of_given_ranks(const std::optional<std::string>& asked, const std::string& of_scene,
                                  const World& world);

}  // namespace moraine
