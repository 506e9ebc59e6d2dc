// Cores and cuts follow the grains; counted, so that a busy machine does not matter.
#include <catch2/catch.hpp>
#include <chrono>
#include <cstdlib>
#include <ctime>
#include <thread>

#include "comm/nodes.hpp"
#include "comm/patience.hpp"
#include "engine/run/simulation.hpp"
#include "tests/ranks/ranks.hpp"
#include "tests/support/flow_scenes.hpp"

using namespace moraine;

namespace {

/// Sets an environment variable for as long as it lives.
class Variable {
 public:
  Variable(const char* name, const char* value) : name_(name) { setenv(name, value, 1); }
  ~Variable() { unsetenv(name_); }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  const char* name_;
};

/// Grains on the floor of a column that is ten times as high, all but a few in its lowest quarter.
Scene tall_column() {
  Scene s = scenes::basic();
  s.domain.low = {0.0, 0.0, 0.0};
  s.domain.high = {0.08, 0.08, 0.9};
  s.time.gravity = {0.0, 0.0, -9.81};
  s.particles = {scenes::lattice({{0.0, 0.0, 0.0}, {0.08, 0.08, 0.2}}, 1.03 * scenes::d),
                 scenes::lattice({{0.0, 0.0, 0.3}, {0.08, 0.08, 0.85}}, 5.0 * scenes::d)};
  scenes::add_wall(s, "box", BoxShape{s.domain.box()}, "steel");
  return s;
}

/// A column of grains at one end of a long box, held by nothing: it slumps and spreads to the other end.
Scene collapse() {
  Scene s = scenes::basic();
  s.domain.low = {0.0, 0.0, 0.0};
  s.domain.high = {0.6, 0.06, 0.2};
  s.domain.periodic = {false, true, false};
  s.time.gravity = {9.0, 0.0, -5.0};
  s.particles = {scenes::lattice({{0.0, 0.0, 0.0}, {0.15, 0.06, 0.18}}, 1.03 * scenes::d)};
  for (PairLaw& law : s.contact.pairs) law.friction = 0.1;
  scenes::add_wall(s, "box", BoxShape{s.domain.box()}, "steel");
  return s;
}

}  // namespace

TEST_CASE("cores of dilute ranks go to the dense one, and come back when the grains do") {
  const World& all = ranks::world();
  Scene scene = tall_column();
  scene.run.balance = Balance::threads;
  Simulation simulation(scene, 2, all);
  simulation.force_counting();
  for (int i = 0; i < 1200; ++i) simulation.step();
  const BalanceTotals& balance = simulation.balance();
  REQUIRE(balance.n_looks > 0);
  CHECK(balance.n_core_moves >= 1);
  CHECK(balance.n_cut_moves == 0);
  // All boxes are equal, and the lowest quarter has nearly all grains.
  CHECK(balance.n_threads[0] >= 4);
  CHECK(balance.imbalance_at_home > 2.5);
  CHECK(balance.last_imbalance < 0.6 * balance.imbalance_at_home);
  CHECK(simulation.n_threads() == balance.n_threads[static_cast<std::size_t>(all.rank())]);
}

TEST_CASE("shares follow a column that runs from one rank to the next within some hundred steps") {
  const World& all = ranks::world();
  Scene scene = collapse();
  scene.run.balance = Balance::threads;
  Simulation simulation(scene, 2, all);
  simulation.force_counting();
  std::vector<int> most_at;  // the rank that has most threads, as time goes by
  std::vector<std::string> notes;
  double worst = 1.0;
  std::uint64_t looks = 0;
  for (int i = 0; i < 6000; ++i) {
    simulation.step();
    const BalanceTotals& balance = simulation.balance();
    if (balance.n_looks == looks) continue;
    looks = balance.n_looks;
    const auto most = std::max_element(balance.n_threads.begin(), balance.n_threads.end());
    const int rank = static_cast<int>(most - balance.n_threads.begin());
    if (most_at.empty() || most_at.back() != rank) most_at.push_back(rank);
    worst = std::max(worst, balance.last_imbalance);
    for (std::string& note : simulation.take_balance_notes()) notes.push_back(std::move(note));
  }
  CHECK(looks >= 6000 / 500);
  REQUIRE(most_at.size() >= 2);
  CHECK(most_at.front() == 0);
  CHECK(most_at.back() >= all.size() / 2);
  CHECK(simulation.balance().n_core_moves >= 2);
  // Whole threads, and two at least: near enough. With the cores of home it is four.
  CHECK(worst < 2.0);
  if (all.is_root()) {
    CHECK(notes.size() >= 2);
    CHECK(notes.front().find("cores of the ranks 2+2+2+2 -> ") != std::string::npos);
    const std::vector<BalanceRow> rows = simulation.take_balance_rows();
    CHECK(rows.size() == looks * static_cast<std::size_t>(all.size()));
    for (const BalanceRow& row : rows) {
      REQUIRE(row.worked <= row.held * 1.001 + 1e-3);
      REQUIRE(row.waited >= 0.0);
    }
  }
}

TEST_CASE("cuts move until two nodes have the same work, where they had 80 and 20 percent of it") {
  const World& all = ranks::world();
  const Variable nodes("MORAINE_NODE_OF", "0,0,1,1");
  Scene scene = scenes::basic();
  scene.domain.high = {0.4, 0.06, 0.1};
  scene.domain.periodic = {false, true, false};
  scene.time.gravity = {0.0, 0.0, -9.81};
  scene.particles = {scenes::lattice({{0.0, 0.0, 0.0}, {0.2, 0.06, 0.08}}, 1.03 * scenes::d),
                     scenes::lattice({{0.2, 0.0, 0.0}, {0.4, 0.06, 0.02}}, 1.03 * scenes::d)};
  scenes::add_wall(scene, "box", BoxShape{scene.domain.box()}, "steel");
  Simulation alone(scene, 1);
  Simulation simulation(scene, 1, all);
  simulation.force_equal_boxes();
  simulation.force_counting();
  double worst = 0.0;
  for (int i = 0; i < 1500; ++i) {
    alone.step();
    simulation.step();
    worst = std::max(worst, simulation.balance().node_imbalance);
  }
  CHECK(worst > 1.4);
  CHECK(simulation.balance().n_cut_moves >= 1);
  CHECK(simulation.balance().node_imbalance < 1.05);
  const std::vector<double> work =
      all.gather(static_cast<double>(simulation.n_own_grains()) * 4.0 + static_cast<double>(simulation.n_own_pairs()));
  const double first = work[0] + work[1], second = work[2] + work[3];
  CHECK(std::max(first, second) < 1.05 * 0.5 * (first + second));
  CHECK(simulation.state_hash() == alone.state_hash());
}

TEST_CASE("ranks of one machine are one node, or as many as are asked for") {
  const World& all = ranks::world();
  CHECK(Nodes::find(all).n == 1);
  {
    const Variable nodes("MORAINE_NODE_OF", "7,3");
    const Nodes two = Nodes::find(all);
    CHECK(two.n == 2);
    CHECK(two.node_of == std::vector<int>{0, 1, 0, 1});
    CHECK(two.ranks_of(1) == std::vector<int>{1, 3});
    // Virtual nodes have no core in common, and nothing that the ranks may not use.
    const CorePool pool = find_pool(all, two, {1, 1, 1, 1});
    for (const std::vector<int>& core : pool.cores)
      for (const int cpu : core) CHECK(std::count(pool.cpus.begin(), pool.cpus.end(), cpu) == 1);
    if (!pool.cores.empty()) CHECK(pool.cores.size() == 2);
  }
  const Variable nodes("MORAINE_NODE_OF", "0,one");
  CHECK_THROWS_WITH(Nodes::find(all), Catch::Contains("MORAINE_NODE_OF is \"0,one\"; expected the node of each rank"));
}

TEST_CASE("a rank that sleeps while it waits leaves its core to others") {
  const World& all = ranks::world();
  const auto cpu_seconds = [] {
    timespec now{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
  };
  set_patience(Patience::sleep);
  const double before = cpu_seconds(), waited = waited_for_ranks();
  if (all.is_root()) std::this_thread::sleep_for(std::chrono::milliseconds(500));
  all.wait_for_all();
  CHECK(cpu_seconds() - before < 0.25);
  if (!all.is_root()) CHECK(waited_for_ranks() - waited > 0.3);
  set_patience(Patience::spin);
}

TEST_CASE("how long a rank takes to notice a message, spinning and sleeping", "[.timing]") {
  const World& all = ranks::world();
  for (const Patience how : {Patience::spin, Patience::sleep}) {
    set_patience(how);
    constexpr int n = 2000;
    all.wait_for_all();
    const auto start = std::chrono::steady_clock::now();
    std::uint64_t value = 1;
    for (int i = 0; i < n; ++i) all.max(std::span(&value, 1));
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (all.is_root())
      std::printf("%s: %.1f us a reduction\n", how == Patience::spin ? "spin" : "sleep", 1e6 * seconds / n);
  }
  set_patience(Patience::spin);
}
