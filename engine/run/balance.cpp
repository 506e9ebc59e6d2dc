#include "engine/run/balance.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <numeric>

namespace moraine {

namespace {

constexpr double worth_a_change = 0.95;  // of the time of a step
constexpr double cost_of_company = 0.1;  // of work on a core that has other work, too

std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// Ranks of a node without names of cores: how many each has, or whose core it is on.
struct Sketch {
  std::vector<int> n_cores;  // of each rank of its own; 0: it is a guest
  std::vector<int> host;     // of a guest: the rank on whose core it is; -1: one of the cores for guests alone
  std::vector<int> place;    // which of those cores
  double time = 0.0;
};

struct LoadedCore {
  int owner = -1, place = 0;  // owner -1: for guests alone
  double work = 0.0, largest = 0.0;
  double time() const { return work + cost_of_company * (work - largest); }
  void add(double more) {
    work += more;
    largest = std::max(largest, more);
  }
};

/// The ranks of `order` from n_guests on have n_cores - n_apart cores for themselves, one at least; the first n_guests share n_apart cores, or
/// where that is 0 are put on those of the others.
Sketch sketch(std::span<const double> work, const std::vector<int>& order, int n_cores, int n_guests, int n_apart) {
  const auto n_ranks = static_cast<int>(work.size());
  Sketch result;
  result.n_cores.assign(work.size(), 0);
  result.host.assign(work.size(), -1);
  result.place.assign(work.size(), 0);
  for (int i = n_guests; i < n_ranks; ++i) result.n_cores[at(order[at(i)])] = 1;
  for (int left = n_cores - n_apart - (n_ranks - n_guests); left > 0; --left) {
    int busiest = order.back();
    for (int i = n_guests; i < n_ranks; ++i) {
      const int rank = order[at(i)];
      if (work[at(rank)] / result.n_cores[at(rank)] > work[at(busiest)] / result.n_cores[at(busiest)]) busiest = rank;
    }
    ++result.n_cores[at(busiest)];
  }
  std::vector<LoadedCore> cores;
  for (int place = 0; place < n_apart; ++place) cores.push_back({-1, place, 0.0, 0.0});
  for (int rank = 0; rank < n_ranks; ++rank)
    for (int place = 0; place < result.n_cores[at(rank)]; ++place) {
      cores.push_back({rank, place, 0.0, 0.0});
      cores.back().add(work[at(rank)] / result.n_cores[at(rank)]);
    }
  // The heaviest guest first, each to where it makes least difference; rather not beside a first thread, which speaks for its rank.
  const std::size_t n_open = n_apart > 0 ? at(n_apart) : cores.size();
  for (int i = n_guests - 1; i >= 0; --i) {
    const int guest = order[at(i)];
    const auto least = std::min_element(cores.begin(), cores.begin() + static_cast<std::ptrdiff_t>(n_open),
                                        [](const LoadedCore& a, const LoadedCore& b) {
                                          return a.work != b.work ? a.work < b.work : a.place > b.place;
                                        });
    least->add(work[at(guest)]);
    result.host[at(guest)] = least->owner;
    result.place[at(guest)] = least->place;
  }
  for (const LoadedCore& core : cores) result.time = std::max(result.time, core.time());
  return result;
}

Sketch best_sketch(std::span<const double> work, int n_cores) {
  const auto n_ranks = static_cast<int>(work.size());
  std::vector<int> order(work.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return work[at(a)] < work[at(b)]; });
  Sketch best = sketch(work, order, n_cores, 0, 0);
  // Not every number has to be tried where there are many ranks.
  const int stride = 1 + n_ranks / 32;
  for (int n_guests = 1; n_guests < n_ranks; n_guests += stride)
    for (int n_apart = 0; n_apart <= std::min(n_guests, 8) && n_apart < n_cores; ++n_apart) {
      if (n_cores - n_apart < n_ranks - n_guests) continue;
      if (n_apart == 1 && n_guests == 1) continue;  // a guest that is alone is none
      const Sketch other = sketch(work, order, n_cores, n_guests, n_apart);
      // Company is worth while only where it gains clearly.
      const bool is_better = other.time < (best.host == std::vector<int>(work.size(), -1) ? 0.97 : 1.0) * best.time;
      if (is_better) best = other;
    }
  return best;
}

std::vector<int> first_cores(std::span<const int> n_threads) {
  std::vector<int> first(n_threads.size(), 0);
  for (std::size_t r = 1; r < first.size(); ++r) first[r] = first[r - 1] + n_threads[r - 1];
  return first;
}

double sum_of(std::span<const double> values) { return std::accumulate(values.begin(), values.end(), 0.0); }

/// Values of the ranks of one node, out of those of all.
template <typename Value>
std::vector<Value> of_node(const std::vector<Value>& all, const std::vector<int>& node_of, int node) {
  std::vector<Value> own;
  for (std::size_t rank = 0; rank < all.size(); ++rank)
    if (node_of[rank] == node) own.push_back(all[rank]);
  return own;
}

std::vector<CoreShare> home_of_all(const std::vector<int>& n_threads, const std::vector<int>& node_of, int n_nodes) {
  std::vector<CoreShare> all(n_threads.size());
  for (int node = 0; node < n_nodes; ++node) {
    const std::vector<CoreShare> own = home_cores(of_node(n_threads, node_of, node));
    std::size_t next = 0;
    for (std::size_t rank = 0; rank < all.size(); ++rank)
      if (node_of[rank] == node) all[rank] = own[next++];
  }
  return all;
}

}  // namespace

std::vector<CoreShare> home_cores(std::span<const int> n_threads) {
  std::vector<CoreShare> shares;
  int next = 0;
  for (const int n : n_threads) {
    shares.emplace_back();
    for (int k = 0; k < n; ++k) shares.back().cores.push_back(next++);
  }
  return shares;
}

std::vector<CoreShare> share_cores(std::span<const double> work, std::span<const int> n_threads) {
  const int n_cores = std::accumulate(n_threads.begin(), n_threads.end(), 0);
  if (work.size() <= 1) return home_cores(n_threads);
  const Sketch found = best_sketch(work, n_cores);
  const std::vector<int> first = first_cores(n_threads);
  std::vector<char> is_free(at(n_cores), 1);
  std::vector<CoreShare> shares(work.size());
  const auto take = [&](CoreShare& share, int core) {
    is_free[at(core)] = 0;
    share.cores.push_back(core);
  };
  for (std::size_t r = 0; r < work.size(); ++r)  // of home what is to be kept
    for (int k = 0; k < std::min(found.n_cores[r], n_threads[r]); ++k) take(shares[r], first[r] + k);
  const auto nearest_free = [&](int to) {
    int best = -1;
    for (int core = 0; core < n_cores; ++core)
      if (is_free[at(core)] && (best < 0 || std::abs(core - to) < std::abs(best - to))) best = core;
    return best;
  };
  // Cores for guests alone: at the home of the first guest of each.
  std::vector<int> apart;
  for (std::size_t r = 0; r < work.size(); ++r) {
    if (found.n_cores[r] > 0 || found.host[r] >= 0) continue;
    const auto place = at(found.place[r]);
    if (apart.size() <= place) apart.resize(place + 1, -1);
    if (apart[place] < 0) {
      apart[place] = nearest_free(first[r]);
      is_free[at(apart[place])] = 0;
    }
    shares[r].cores = {apart[place]};
    shares[r].is_shared = true;
  }
  for (std::size_t r = 0; r < work.size(); ++r)
    while (shares[r].n_threads() < found.n_cores[r]) take(shares[r], nearest_free(first[r] + n_threads[r]));
  for (std::size_t r = 0; r < work.size(); ++r) {
    if (found.n_cores[r] > 0 || found.host[r] < 0) continue;
    CoreShare& host = shares[at(found.host[r])];
    shares[r].cores = {host.cores[at(found.place[r])]};
    shares[r].is_shared = host.is_shared = true;
  }
  return shares;
}

double busiest_core(std::span<const double> work, std::span<const CoreShare> shares) {
  std::vector<LoadedCore> cores;
  for (std::size_t r = 0; r < work.size(); ++r)
    for (const int core : shares[r].cores) {
      if (cores.size() <= at(core)) cores.resize(at(core) + 1);
      cores[at(core)].add(work[r] / shares[r].n_threads());
    }
  double longest = 0.0;
  for (const LoadedCore& core : cores) longest = std::max(longest, core.time());
  return longest;
}

BalancePlan plan_balance(const BalanceView& view) {
  BalancePlan plan;
  const int n_nodes = 1 + *std::max_element(view.node_of.begin(), view.node_of.end());
  const auto n_ranks = view.work.size();
  const double all_work = sum_of(view.work);
  const int n_cores = std::accumulate(view.n_threads.begin(), view.n_threads.end(), 0);
  const std::vector<CoreShare> home = home_of_all(view.n_threads, view.node_of, n_nodes);
  plan.shares = view.shares;
  if (!(all_work > 0.0)) return plan;
  const double perfect = all_work / n_cores;
  const bool may_share = view.mode == Balance::automatic || view.mode == Balance::threads;
  const bool may_cut = (view.mode == Balance::automatic || view.mode == Balance::cuts) && n_ranks > 1;

  double longest_now = 0.0, longest_at_home = 0.0, longest = 0.0;
  for (int node = 0; node < n_nodes; ++node) {
    const std::vector<double> work = of_node(view.work, view.node_of, node);
    const std::vector<int> n_threads = of_node(view.n_threads, view.node_of, node);
    const double now = busiest_core(work, of_node(view.shares, view.node_of, node));
    longest_now = std::max(longest_now, now);
    longest_at_home = std::max(longest_at_home, busiest_core(work, of_node(home, view.node_of, node)));
    double planned = now;
    if (may_share && work.size() > 1) {
      const std::vector<CoreShare> better = share_cores(work, n_threads);
      if (busiest_core(work, better) < worth_a_change * now) {
        plan.moves_cores = true;
        planned = busiest_core(work, better);
        std::size_t next = 0;
        for (std::size_t rank = 0; rank < n_ranks; ++rank)
          if (view.node_of[rank] == node) plan.shares[rank] = better[next++];
      }
    }
    longest = std::max(longest, planned);
  }
  plan.now = longest_now / perfect;
  plan.at_home = longest_at_home / perfect;
  plan.forecast = longest / perfect;
  if (!may_cut) return plan;

  // Parts are cut as even as grains and cells allow: measured, within some percent.
  constexpr double uneven = 1.03;
  const int fewest = *std::min_element(view.n_threads.begin(), view.n_threads.end());
  const double after_cut = uneven * all_work / static_cast<double>(n_ranks) / fewest;
  if (!(after_cut < worth_a_change * longest)) return plan;
  const double seconds = view.seconds_a_step * longest / longest_now;  // of a step, once cores have moved
  const double saved = seconds * (1.0 - after_cut / longest) * view.steps_ahead;
  if (!(saved > view.cut_seconds)) return plan;
  plan.moves_cuts = true;
  plan.shares = home;
  plan.moves_cores = !(plan.shares == view.shares);
  plan.forecast = after_cut / perfect;
  return plan;
}

Balancer::Balancer(const World& world, Balance mode, int n_threads)
    : world_(world), mode_(mode), n_home_(n_threads), nodes_(Nodes::find(world)) {
  for (const double n : world.gather(static_cast<double>(n_threads))) n_threads_.push_back(static_cast<int>(n));
  shares_ = home_ = home_of_all(n_threads_, nodes_.node_of, nodes_.n);
  totals_.n_threads = n_threads_;
}

Balancer::~Balancer() {
  if (!keeps_to_cores_) return;
  place_threads({});
  run_on(available_cpus());
  set_patience(Patience::spin);
}

std::vector<std::string> Balancer::keep_to_cores() {
  std::vector<std::string> said;
  if (std::getenv("OMP_PROC_BIND") || std::getenv("GOMP_CPU_AFFINITY") || std::getenv("OMP_PLACES")) {
    said.emplace_back("threads stay where OMP_PROC_BIND, OMP_PLACES or GOMP_CPU_AFFINITY want them");
    if (mode_ == Balance::automatic) mode_ = Balance::cuts;
    if (mode_ == Balance::threads) mode_ = Balance::off;
    return said;
  }
  pool_ = find_pool(world_, nodes_, n_threads_);
  // A system that does not let a rank onto the cores of its neighbours: it keeps to those it has.
  double is_refused = run_on(pool_.cpus) ? 0.0 : 1.0;
  world_.max(std::span(&is_refused, 1));
  if (is_refused > 0.0) {
    run_on(available_cpus());
    said.emplace_back("the system does not let ranks of a node onto each other's cores: these do not move");
    if (mode_ == Balance::automatic) mode_ = Balance::cuts;
    if (mode_ == Balance::threads) mode_ = Balance::off;
    return said;
  }
  keeps_to_cores_ = true;
  enter_grain_phases();
  return said;
}

void Balancer::enter(bool is_grains) {
  if (!keeps_to_cores_) return;
  // A share of more cores than at home begins with those, so that the gas finds its threads in place, and drag has all of them.
  const CoreShare& home = home_[at(world_.rank())];
  const bool is_own = is_grains || (own_share().n_threads() > home.n_threads() && !own_share().is_shared);
  const CoreShare& share = is_own ? own_share() : home;
  set_patience(pool_.cores.empty() || (is_grains && share.is_shared) ? Patience::sleep : Patience::spin);
  if (!pool_.is_filled) {
    place_threads({pool_.cpus});
    return;
  }
  std::vector<std::vector<int>> places;
  for (const int core : share.cores) places.push_back(pool_.cores[at(core)]);
  place_threads(std::move(places));
}

Balancer::Decision Balancer::look(const Measure& now) {
  const auto grains_of = [](const Measure& m) { return m.rebuild.seconds + m.advance.seconds; };
  const double worked = now.rebuild.working + now.advance.working - before_.rebuild.working - before_.advance.working;
  const std::array<double, 10> own = {now.counted,
                                      worked,
                                      grains_of(now) - grains_of(before_),
                                      now.gas.seconds - before_.gas.seconds,
                                      now.all_waited - before_.all_waited,
                                      now.all_worked - before_.all_worked,
                                      now.all_held - before_.all_held,
                                      now.n_grains,
                                      now.n_pairs,
                                      now.rebuild.seconds - before_.rebuild.seconds};
  const std::vector<double> all = world_.gather(std::span<const double>(own));
  const auto value = [&](std::size_t rank, std::size_t k) { return all[rank * own.size() + k]; };
  const auto n_ranks = at(world_.size());
  double all_counted = 0.0, all_worked = 0.0, longest = 0.0, busiest = 0.0, rebuilding = 0.0;
  for (std::size_t rank = 0; rank < n_ranks; ++rank) {
    all_counted += value(rank, 0);
    all_worked += value(rank, 1);
    longest = std::max(longest, value(rank, 2));
    busiest = std::max(busiest, value(rank, 1) / shares_[rank].n_threads());
    rebuilding = std::max(rebuilding, value(rank, 9));
  }
  // Counted, and each rank's count weighed by what it was measured to cost there: not by more than a noisy machine may mislead.
  constexpr double least = 0.8, most = 1.25;
  std::vector<double> work(n_ranks, 0.0), weight(n_ranks, 1.0);
  for (std::size_t rank = 0; rank < n_ranks; ++rank) {
    if (value(rank, 0) > 0.0 && all_worked > 0.0 && !counts_only_)
      weight[rank] = std::clamp(value(rank, 1) / value(rank, 0) / (all_worked / all_counted), least, most);
    work[rank] = weight[rank] * value(rank, 0);
  }
  const auto n_steps = static_cast<double>(now.step - before_.step);
  BalanceView view;
  view.mode = mode_;
  view.node_of = nodes_.node_of;
  view.work = work;
  view.n_threads = n_threads_;
  view.shares = shares_;
  view.seconds_a_step = n_steps > 0.0 ? busiest / n_steps : 0.0;
  // A division that did not last is not taken for one that will.
  view.steps_ahead = totals_.n_cut_moves > 0 ? static_cast<double>(now.step - last_cut_)
                                             : std::max(500.0, static_cast<double>(now.step));
  const auto n_rebuilds = static_cast<double>(now.n_rebuilds - before_.n_rebuilds);
  view.cut_seconds = cut_seconds_ > 0.0 ? cut_seconds_ : n_rebuilds > 0.0 ? 3.0 * rebuilding / n_rebuilds : 0.0;
  const BalancePlan plan = plan_balance(view);

  const double seconds_a_step = n_steps > 0.0 ? longest / n_steps : 0.0;
  note_gain(seconds_a_step, now.step);
  const auto k = static_cast<double>(++totals_.n_looks);
  totals_.imbalance += (plan.now - totals_.imbalance) / k;
  totals_.imbalance_at_home += (plan.at_home - totals_.imbalance_at_home) / k;
  totals_.last_imbalance = plan.forecast;
  totals_.node_imbalance = 1.0;
  for (int node = 0; node < nodes_.n && all_counted > 0.0; ++node) {
    const std::vector<int> n_threads = of_node(n_threads_, nodes_.node_of, node);
    const double per_core =
        sum_of(of_node(work, nodes_.node_of, node)) / std::accumulate(n_threads.begin(), n_threads.end(), 0);
    const double mean = sum_of(work) / std::accumulate(n_threads_.begin(), n_threads_.end(), 0);
    totals_.node_imbalance = std::max(totals_.node_imbalance, per_core / mean);
  }
  add_rows(now, all, work);
  if (plan.moves_cuts || plan.moves_cores) {
    note(fmt::format(
        "balance at step {}: {}{}{}; the longest rank took {:.2f} times the mean, forecast {:.2f}", now.step,
        plan.moves_cuts ? "cuts between ranks move" : "", plan.moves_cuts && plan.moves_cores ? ", " : "",
        plan.moves_cores ? "cores of the ranks " + shares_text(shares_) + " -> " + shares_text(plan.shares) : "",
        plan.now, plan.forecast));
    is_change_open_ = true;
    seconds_before_change_ = seconds_a_step;
    forecast_of_change_ = plan.now / plan.forecast;
    step_of_change_ = now.step;
  }
  if (plan.moves_cores) {
    ++totals_.n_core_moves;
    shares_ = plan.shares;
    for (std::size_t rank = 0; rank < n_ranks; ++rank) totals_.n_threads[rank] = shares_[rank].n_threads();
    enter_grain_phases();
  }
  if (plan.moves_cuts) ++totals_.n_cut_moves;
  before_ = now;
  return {plan.moves_cuts, weight[at(world_.rank())]};
}

void Balancer::note_cut(std::uint64_t step, double seconds) {
  last_cut_ = step;
  double longest = seconds;
  world_.max(std::span(&longest, 1));
  cut_seconds_ = std::max(longest, 1e-6);
}

/// What the last change was worth, once there are steps to tell.
void Balancer::note_gain(double seconds_a_step, std::uint64_t step) {
  if (!is_change_open_ || !(seconds_a_step > 0.0)) return;
  is_change_open_ = false;
  if (seconds_before_change_ > 0.0)
    note(fmt::format(
        "balance: since step {} a step of the grain phases takes {:.3g} ms instead of {:.3g} ms: {:.2f} times as fast "
        "(forecast {:.2f}), to step {}",
        step_of_change_, 1e3 * seconds_a_step, 1e3 * seconds_before_change_, seconds_before_change_ / seconds_a_step,
        forecast_of_change_, step));
}

/// Something to say, as long as there is not too much of it: grains that never rest keep the cuts moving.
void Balancer::note(std::string text) {
  constexpr int most = 40;
  if (!world_.is_root() || n_notes_ > most) return;
  notes_.push_back(++n_notes_ <= most ? std::move(text)
                                      : "balance: further changes are counted at the end, and balance.csv shows them");
}

/// "3+1" for each node, such as "2+2 | 3+1"; a number in brackets: on a shared core.
std::string Balancer::shares_text(const std::vector<CoreShare>& shares) const {
  constexpr std::size_t most = 32;
  std::string text;
  for (int node = 0; node < nodes_.n && text.size() < 3 * most; ++node) {
    if (node > 0) text += " | ";
    bool is_first = true;
    for (const CoreShare& share : of_node(shares, nodes_.node_of, node)) {
      text += is_first ? "" : "+";
      text += share.is_shared && share.n_threads() == 1 ? "(1)" : std::to_string(share.n_threads());
      is_first = false;
    }
  }
  return text.size() > 3 * most ? text.substr(0, 3 * most) + "..." : text;
}

void Balancer::add_rows(const Measure& now, const std::vector<double>& all, const std::vector<double>& work) {
  if (!world_.is_root()) return;
  const std::size_t n = all.size() / at(world_.size());
  const double mean = sum_of(work) / static_cast<double>(work.size());
  for (std::size_t rank = 0; rank < work.size(); ++rank) {
    const double* const values = all.data() + rank * n;
    BalanceRow row;
    row.step = now.step;
    row.time = now.time;
    row.rank = static_cast<int>(rank);
    row.node = nodes_.node_of[rank];
    row.n_grains = values[7];
    row.n_pairs = values[8];
    row.work = mean > 0.0 ? work[rank] / mean : 1.0;
    row.n_threads = shares_[rank].n_threads();
    row.grains = values[2];
    row.gas = values[3];
    row.waited = values[4];
    row.worked = values[5];
    row.held = values[6];
    rows_.push_back(row);
  }
}

}  // namespace moraine
