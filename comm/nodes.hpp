// Which ranks are on one node, and may hand cores to each other.
#pragma once

#include <string>
#include <vector>

#include "comm/cpus.hpp"
#include "comm/world.hpp"

namespace moraine {

/// Rank by rank of a run. For tests, the environment variable MORAINE_NODE_OF takes one machine for several nodes: "0,0,1,1" puts
/// the ranks 0 and 1 on one and 2 and 3 on another (counted again from the start where there are more ranks).
struct Nodes {
  int n = 1;
  std::vector<int> node_of;  // of each rank, numbered in order of their first ranks

  /// All ranks call it. Throws std::invalid_argument on all of them where MORAINE_NODE_OF is not a list of numbers.
  static Nodes find(const World& world);
  std::vector<int> ranks_of(int node) const;
};

/// The cores of a node that its ranks may use together, one for each thread that they have.
struct CorePool {
  /// The CPUs of each core; empty where there are fewer cores than threads, so that the system has to share them out.
  std::vector<std::vector<int>> cores;
  /// All CPUs that any rank of the node may use, in order.
  std::vector<int> cpus;
  /// The run leaves none of them free, so that each thread may as well stay where it is.
  bool is_filled = false;
};

/// The pool of this rank's node: the union of what its ranks were started with, by a launcher's or a user's binding, and never more.
/// `n_threads` of each rank of the run. All ranks call it.
CorePool find_pool(const World& world, const Nodes& nodes, const std::vector<int>& n_threads);

/// The same for CPUs that are known: `n_threads` of the ranks of one node together, of which the threads from `first` on, `n` of them, are
/// of this (perhaps virtual) node.
CorePool share_pool(std::vector<int> cpus, int n_threads, int first, int n);

}  // namespace moraine
