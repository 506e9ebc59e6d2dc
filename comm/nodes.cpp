#include "comm/nodes.hpp"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <numeric>
#include <sstream>
#include <stdexcept>

#include "comm/mpi.hpp"

namespace moraine {

namespace {

constexpr const char* variable = "MORAINE_NODE_OF";

/// The node that the variable gives a rank; 0 where it is not set.
std::uint64_t virtual_node(int rank) {
  const char* const text = std::getenv(variable);
  if (text == nullptr || *text == '\0') return 0;
  std::vector<std::uint64_t> given;
  std::istringstream words(text);
  for (std::string word; std::getline(words, word, ',');) {
    if (word.empty() || word.size() > 6 || word.find_first_not_of("0123456789") != std::string::npos)
      throw std::invalid_argument(std::string(variable) + " is \"" + text +
                                  "\"; expected the node of each rank, such as 0,0,1,1");
    given.push_back(std::stoull(word));
  }
  return given[static_cast<std::size_t>(rank) % given.size()];
}

/// The first rank of the machine that this rank is on.
std::uint64_t first_of_machine(const World& world) {
  MPI_Comm machine = MPI_COMM_NULL;
  MPI_Comm_split_type(communicator_of(world), MPI_COMM_TYPE_SHARED, world.rank(), MPI_INFO_NULL, &machine);
  int first = world.rank();
  MPI_Bcast(&first, 1, MPI_INT, 0, machine);
  MPI_Comm_free(&machine);
  return static_cast<std::uint64_t>(first);
}

std::vector<int> numbers_of(const std::string& text) {
  std::vector<int> numbers;
  std::istringstream words(text);
  for (int number; words >> number;) numbers.push_back(number);
  return numbers;
}

}  // namespace

Nodes Nodes::find(const World& world) {
  Nodes nodes;
  const std::uint64_t own = virtual_node(world.rank());
  if (world.is_alone()) {
    nodes.node_of = {0};
    return nodes;
  }
  const std::vector<std::uint64_t> keys = world.gather((first_of_machine(world) << 32) | own);
  std::vector<std::uint64_t> known;
  for (const std::uint64_t key : keys) {
    const auto found = std::find(known.begin(), known.end(), key);
    nodes.node_of.push_back(static_cast<int>(found - known.begin()));
    if (found == known.end()) known.push_back(key);
  }
  nodes.n = static_cast<int>(known.size());
  return nodes;
}

std::vector<int> Nodes::ranks_of(int node) const {
  std::vector<int> ranks;
  for (std::size_t rank = 0; rank < node_of.size(); ++rank)
    if (node_of[rank] == node) ranks.push_back(static_cast<int>(rank));
  return ranks;
}

CorePool share_pool(std::vector<int> cpus, int n_threads, int first, int n) {
  CorePool pool;
  std::sort(cpus.begin(), cpus.end());
  cpus.erase(std::unique(cpus.begin(), cpus.end()), cpus.end());
  pool.cpus = cpus;
  std::vector<std::vector<int>> units;
  const std::vector<Core> cores = cores_of(cpus);
  if (n_threads <= static_cast<int>(cores.size())) {
    for (const Core& core : cores) units.push_back(core.cpus);
  } else {  // each hardware thread for itself
    for (const Core& core : cores)
      for (const int cpu : core.cpus) units.push_back({cpu});
  }
  if (n_threads > static_cast<int>(units.size())) return pool;
  pool.is_filled = n_threads == static_cast<int>(units.size());
  pool.cores.assign(units.begin() + first, units.begin() + first + n);
  return pool;
}

CorePool find_pool(const World& world, const Nodes& nodes, const std::vector<int>& n_threads) {
  if (world.is_alone()) return share_pool(available_cpus(), n_threads[0], 0, n_threads[0]);
  std::string own = std::to_string(first_of_machine(world));
  for (const int cpu : available_cpus()) own += ' ' + std::to_string(cpu);
  std::string all;
  for (const std::string& text : world.gather_at_root(own)) all += text + '\n';
  world.broadcast(all);

  std::vector<std::vector<int>> of_rank;  // machine, then its CPUs
  std::istringstream lines(all);
  for (std::string line; std::getline(lines, line);) of_rank.push_back(numbers_of(line));
  const auto me = static_cast<std::size_t>(world.rank());
  // Virtual nodes of a machine take their threads' worth of it one after the other.
  std::vector<int> cpus;
  std::vector<int> of_node(static_cast<std::size_t>(nodes.n), 0);
  int in_all = 0;
  for (std::size_t rank = 0; rank < of_rank.size(); ++rank) {
    if (of_rank[rank][0] != of_rank[me][0]) continue;
    cpus.insert(cpus.end(), of_rank[rank].begin() + 1, of_rank[rank].end());
    of_node[static_cast<std::size_t>(nodes.node_of[rank])] += n_threads[rank];
    in_all += n_threads[rank];
  }
  const auto own_node = of_node.begin() + nodes.node_of[me];
  return share_pool(cpus, in_all, std::accumulate(of_node.begin(), own_node, 0), *own_node);
}

}  // namespace moraine
