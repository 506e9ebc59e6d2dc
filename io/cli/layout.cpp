#include "io/cli/layout.hpp"

#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <sstream>
#include <thread>

#include "io/cli/start_cpus.hpp"

namespace moraine {

namespace {

std::string text_of(const RankCpus& rank) {
  std::string text = rank.node;
  for (const int cpu : rank.cpus) text += '\n' + std::to_string(cpu);
  return text;
}

RankCpus rank_cpus_of(const std::string& text) {
  std::istringstream lines(text);
  RankCpus rank;
  std::getline(lines, rank.node);
  for (int cpu; lines >> cpu;) rank.cpus.push_back(cpu);
  return rank;
}

bool overlap(const std::vector<int>& a, const std::vector<int>& b) {
  for (auto i = a.begin(), j = b.begin(); i != a.end() && j != b.end(); *i < *j ? ++i : ++j)
    if (*i == *j) return true;
  return false;
}

/// The CPUs of each rank, and how many ranks (itself among them) may run on some of them.
struct Crowd {
  int n_cpus;
  int n_ranks;
};
std::vector<Crowd> crowds_of(const std::vector<RankCpus>& ranks) {
  std::map<std::string, std::vector<const RankCpus*>> nodes;
  for (const RankCpus& rank : ranks) nodes[rank.node].push_back(&rank);
  std::vector<Crowd> crowds;
  for (const auto& [name, of_node] : nodes)
    for (const RankCpus* rank : of_node)
      crowds.push_back({static_cast<int>(rank->cpus.size()),
                        static_cast<int>(std::count_if(of_node.begin(), of_node.end(), [rank](const RankCpus* other) {
                          return other == rank || overlap(rank->cpus, other->cpus);
                        }))});
  return crowds;
}

}  // namespace

std::vector<int> available_cpus() {
  std::vector<int> cpus;
  for (std::size_t cpu = 0; cpu < most_cpus; ++cpu)
    if (CPU_ISSET_S(cpu, cpu_set_bytes, cpus_at_start())) cpus.push_back(static_cast<int>(cpu));
  if (cpus.empty())
    for (unsigned cpu = 0; cpu < std::max(1u, std::thread::hardware_concurrency()); ++cpu)
      cpus.push_back(static_cast<int>(cpu));
  return cpus;
}

int available_cores() { return static_cast<int>(available_cpus().size()); }

void take_back_cpus() {
  if (CPU_COUNT_S(cpu_set_bytes, cpus_at_start()) > 0) sched_setaffinity(0, cpu_set_bytes, cpus_at_start());
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
  return layout;
}

int threads_for_each(const std::vector<RankCpus>& ranks) {
  int threads = static_cast<int>(most_cpus);
  for (const Crowd& crowd : crowds_of(ranks)) threads = std::min(threads, crowd.n_cpus / crowd.n_ranks);
  return std::max(1, threads);
}

bool are_crowded(const std::vector<RankCpus>& ranks, int threads) {
  const std::vector<Crowd> crowds = crowds_of(ranks);
  return std::any_of(crowds.begin(), crowds.end(), [&](const Crowd& crowd) {
    return static_cast<long long>(crowd.n_ranks) * threads > crowd.n_cpus;
  });
}

GivenLayout layout_of_given_ranks(const std::optional<std::string>& asked, const std::string& of_scene,
                                  const World& world) {
  std::optional<int> threads;
  if (const std::string text = asked.value_or(of_scene); text != "auto") {
    const Layout layout = parse_layout(text);
    if (layout.ranks == world.size())
      threads = layout.threads;
    else if (asked)
      throw UsageError("layout \"" + text + "\" asks for " + std::to_string(layout.ranks) +
                       " ranks, but the launcher (mpirun, srun) has started " + std::to_string(world.size()) +
                       ": leave --layout out, or ask for \"" + std::to_string(world.size()) + "xTHREADS\"");
  }
  char node[256] = "";
  gethostname(node, sizeof node - 1);
  std::string answer;
  const std::vector<std::string> texts = world.gather_at_root(text_of({node, available_cpus()}));
  if (world.is_root()) {
    std::vector<RankCpus> ranks;
    for (const std::string& text : texts) ranks.push_back(rank_cpus_of(text));
    const int n = threads.value_or(threads_for_each(ranks));
    answer = std::to_string(n) + (are_crowded(ranks, n) ? " crowded" : " roomy");
  }
  world.broadcast(answer);
  return {{world.size(), std::stoi(answer)}, answer.ends_with("crowded")};
}

}  // namespace moraine
