// Who gets which cores, and when cuts move: what is decided, without ranks.
#include <algorithm>
#include <catch2/catch.hpp>
#include <numeric>
#include <set>

#include "engine/run/balance.hpp"
#include "kernels/base/random.hpp"

using namespace moraine;

namespace {

std::vector<int> numbers(const std::vector<CoreShare>& shares) {
  std::vector<int> n;
  for (const CoreShare& share : shares) n.push_back(share.n_threads());
  return n;
}

BalanceView view_of(std::vector<double> work, std::vector<int> n_threads, std::vector<int> node_of) {
  BalanceView view;
  view.work = std::move(work);
  view.n_threads = std::move(n_threads);
  view.node_of = std::move(node_of);
  for (int node = 0; node <= *std::max_element(view.node_of.begin(), view.node_of.end()); ++node) {
    std::vector<int> own;
    for (std::size_t r = 0; r < view.work.size(); ++r)
      if (view.node_of[r] == node) own.push_back(view.n_threads[r]);
    for (const CoreShare& share : home_cores(own)) view.shares.push_back(share);
  }
  view.seconds_a_step = 1e-3;
  view.steps_ahead = 1000.0;
  view.cut_seconds = 0.01;
  return view;
}

}  // namespace

TEST_CASE("ranks with equal work keep the cores of their home") {
  const std::vector<CoreShare> shares = share_cores(std::vector<double>{1.0, 1.0, 1.0}, std::vector<int>{2, 2, 2});
  CHECK(shares == home_cores(std::vector<int>{2, 2, 2}));
  CHECK(busiest_core(std::vector<double>{1.0, 1.0, 1.0}, shares) == Approx(0.5));
}

TEST_CASE("a dense rank gets the cores of dilute ones, which share one") {
  const std::vector<double> work = {0.06, 0.72, 0.12, 0.10};
  const std::vector<CoreShare> shares = share_cores(work, std::vector<int>{1, 1, 1, 1});
  CHECK(numbers(shares) == std::vector<int>{1, 3, 1, 1});
  CHECK_FALSE(shares[1].is_shared);
  for (const std::size_t r : {0u, 2u, 3u}) {
    CHECK(shares[r].is_shared);
    CHECK(shares[r].cores == shares[0].cores);
  }
  CHECK(std::count(shares[1].cores.begin(), shares[1].cores.end(), 1) == 1);  // its home
}

TEST_CASE("on two cores a dilute rank becomes the guest of a dense one, not beside the thread that speaks for it") {
  const std::vector<double> work = {0.95, 0.05};
  const std::vector<CoreShare> shares = share_cores(work, std::vector<int>{1, 1});
  CHECK(numbers(shares) == std::vector<int>{2, 1});
  CHECK(shares[0].cores[0] == 0);
  CHECK(shares[1].cores[0] == 1);
  CHECK((shares[0].is_shared && shares[1].is_shared));
  CHECK(busiest_core(work, shares) < 0.6);
}

TEST_CASE(
    "shares use cores of the node only, none is idle while another is crowded, and never take longer than those of "
    "home") {
  for (std::uint64_t round = 0; round < 400; ++round) {
    const auto u = [&](std::uint64_t k) { return random_uniform(11, 100 * round + k, RandomPurpose::choice); };
    const int n_ranks = 1 + static_cast<int>(8 * u(0));
    std::vector<double> work;
    std::vector<int> n_threads;
    for (int r = 0; r < n_ranks; ++r) {
      const double x = u(static_cast<std::uint64_t>(10 + r));
      work.push_back(x < 0.2 ? 0.0 : x * x * x);
      n_threads.push_back(1 + static_cast<int>(3 * u(static_cast<std::uint64_t>(30 + r))));
    }
    const int n_cores = std::accumulate(n_threads.begin(), n_threads.end(), 0);
    const std::vector<CoreShare> shares = share_cores(work, n_threads);
    REQUIRE(shares.size() == work.size());
    std::vector<int> users(static_cast<std::size_t>(n_cores), 0);
    for (const CoreShare& share : shares) {
      REQUIRE(share.n_threads() >= 1);
      REQUIRE(std::set<int>(share.cores.begin(), share.cores.end()).size() == share.cores.size());
      for (const int core : share.cores) {
        REQUIRE((core >= 0 && core < n_cores));
        ++users[static_cast<std::size_t>(core)];
      }
    }
    for (const CoreShare& share : shares) {
      const bool is_shared = std::any_of(share.cores.begin(), share.cores.end(),
                                         [&](int core) { return users[static_cast<std::size_t>(core)] > 1; });
      REQUIRE(is_shared <= share.is_shared);
    }
    REQUIRE(busiest_core(work, shares) <= busiest_core(work, home_cores(n_threads)) * (1.0 + 1e-12));
    // Steps cannot be shorter than the work over the cores.
    REQUIRE(busiest_core(work, shares) >= std::accumulate(work.begin(), work.end(), 0.0) / n_cores * (1.0 - 1e-12));
  }
}

TEST_CASE("many ranks on a node are shared out in no time") {
  std::vector<double> work(128, 0.01);
  for (std::size_t r = 0; r < 16; ++r) work[r] = 1.0;
  const std::vector<CoreShare> shares = share_cores(work, std::vector<int>(128, 1));
  CHECK(busiest_core(work, shares) < 0.25);
}

TEST_CASE("cores alone mend what one node can; cuts move where nodes differ") {
  // One node: 3 + 1 cores do.
  BalancePlan plan = plan_balance(view_of({0.75, 0.25}, {2, 2}, {0, 0}));
  CHECK((plan.moves_cores && !plan.moves_cuts));
  CHECK(numbers(plan.shares) == std::vector<int>{3, 1});
  CHECK(plan.now == Approx(1.5));
  CHECK(plan.forecast == Approx(1.0));
  // Two nodes with 80 and 20 % of the work.
  plan = plan_balance(view_of({0.4, 0.4, 0.1, 0.1}, {1, 1, 1, 1}, {0, 0, 1, 1}));
  CHECK(plan.moves_cuts);
  CHECK(plan.now == Approx(1.6));
  CHECK(plan.forecast < 1.05);
}

TEST_CASE("each way of balance does what it may, and no more") {
  BalanceView view = view_of({0.8, 0.2}, {1, 1}, {0, 0});
  view.mode = Balance::off;
  BalancePlan plan = plan_balance(view);
  CHECK_FALSE((plan.moves_cores || plan.moves_cuts));
  CHECK(plan.forecast == plan.now);
  view.mode = Balance::threads;
  plan = plan_balance(view);
  CHECK((plan.moves_cores && !plan.moves_cuts));
  view.mode = Balance::cuts;
  plan = plan_balance(view);
  CHECK((plan.moves_cuts && !plan.moves_cores));
}

TEST_CASE("cuts stay where moving them costs more than it saves, and where they are even enough") {
  BalanceView view = view_of({0.4, 0.4, 0.1, 0.1}, {1, 1, 1, 1}, {0, 0, 1, 1});
  CHECK(plan_balance(view).moves_cuts);
  view.cut_seconds = 10.0;
  CHECK_FALSE(plan_balance(view).moves_cuts);
  view.steps_ahead = 1e6;
  CHECK(plan_balance(view).moves_cuts);
  CHECK_FALSE(plan_balance(view_of({0.26, 0.25, 0.25, 0.24}, {1, 1, 1, 1}, {0, 0, 1, 1})).moves_cuts);
}

TEST_CASE("a plan that has been carried out is not changed again while the work stays as it is") {
  for (std::uint64_t round = 0; round < 200; ++round) {
    std::vector<double> work;
    for (std::uint64_t r = 0; r < 6; ++r) {
      const double u = random_uniform(5, 10 * round + r, RandomPurpose::choice);
      work.push_back(u * u);
    }
    BalanceView view = view_of(work, {1, 2, 1, 2, 1, 1}, {0, 0, 0, 1, 1, 1});
    view.mode = Balance::threads;
    const BalancePlan first = plan_balance(view);
    view.shares = first.shares;
    const BalancePlan second = plan_balance(view);
    REQUIRE_FALSE(second.moves_cores);
    REQUIRE(second.now == Approx(first.forecast));
  }
}

TEST_CASE("a pool has only CPUs that ranks were started with, each once, and none where there are fewer than threads") {
  const std::vector<int> allowed = available_cpus();
  std::vector<int> twice = allowed;
  twice.insert(twice.end(), allowed.begin(), allowed.end());
  const int n = static_cast<int>(cores_of(allowed).size());
  const CorePool pool = share_pool(twice, n, 0, n);
  CHECK(pool.cpus == allowed);
  CHECK(pool.is_filled);
  std::vector<int> used;
  for (const std::vector<int>& core : pool.cores) used.insert(used.end(), core.begin(), core.end());
  std::sort(used.begin(), used.end());
  CHECK(used == allowed);
  CHECK(share_pool(allowed, available_cores() + 1, 0, 1).cores.empty());
  if (n > 1) {
    CHECK_FALSE(share_pool(allowed, n - 1, 0, n - 1).is_filled);
    CHECK(share_pool(allowed, n, n - 1, 1).cores == std::vector<std::vector<int>>{pool.cores.back()});
  }
}
