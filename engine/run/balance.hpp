// Who works where: the shares of a node's cores that its ranks have, and when to divide space anew. What is decided here is a
// matter of speed only; no result depends on it.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "comm/nodes.hpp"
#include "comm/world.hpp"
#include "engine/run/stopwatch.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

/// The cores of its node that a rank has in the grain phases.
struct CoreShare {
  std::vector<int> cores;  // numbers in the node's pool, one for each of its threads
  bool is_shared = false;  // some of them are another rank's as well
  int n_threads() const { return static_cast<int>(cores.size()); }
  bool operator==(const CoreShare&) const = default;
};

/// The cores that the ranks of a node begin with: as many as each has threads, one after the other.
std::vector<CoreShare> home_cores(std::span<const int> n_threads);

/// Shares out the cores of a node, as many as its ranks have threads at home, so that the busiest core has least to do: `work` of each rank in any
/// unit, which its threads share evenly. Each rank keeps cores of its home where it can. Ranks with little to do are put together on
/// a core, or on one of a busy rank, where that is better by more than such company costs.
std::vector<CoreShare> share_cores(std::span<const double> work, std::span<const int> n_threads);

/// How long the busiest core of a node takes, in the unit of `work`; work on a core that is shared counts a tenth more, but for the
/// largest piece of it.
double busiest_core(std::span<const double> work, std::span<const CoreShare> shares);

/// What is known when balance is looked at, rank by rank.
struct BalanceView {
  Balance mode = Balance::automatic;
  std::vector<int> node_of;
  std::vector<double> work;    // of the grain phases, in any unit
  std::vector<int> n_threads;  // at home
  std::vector<CoreShare> shares;
  double seconds_a_step = 0.0;  // [s] that the busiest core works in the grain phases, without waiting and messages
  double steps_ahead = 0.0;     // that a new division is likely to last: as long as the one before has
  double cut_seconds = 0.0;     // [s] that a new division costs
};

struct BalancePlan {
  std::vector<CoreShare> shares;
  bool moves_cores = false;
  bool moves_cuts = false;
  // How much longer than with work shared out perfectly a step takes: as it is, as it would be with the cores of home, and as
  // planned.
  double now = 1.0, at_home = 1.0, forecast = 1.0;
};

/// Cores follow where that makes steps at least 5 % shorter. Cuts move where they make steps shorter by another 5 % than cores can, and only where
/// what they save within steps_ahead is more than they cost.
BalancePlan plan_balance(const BalanceView& view);

/// A line of the record over time, of one rank.
struct BalanceRow {
  std::uint64_t step = 0;
  double time = 0.0;  // [s]
  int rank = 0, node = 0;
  double n_grains = 0.0, n_pairs = 0.0;
  double work = 0.0;  // over the mean of the ranks
  int n_threads = 1;  // in the grain phases, up to now
  // since the row before [s]
  double grains = 0.0, gas = 0.0;   // wall-clock time of the phases
  double waited = 0.0;              // of that for other ranks
  double worked = 0.0, held = 0.0;  // of all threads, and what they could have worked
};

/// What balance has done so far; the same on all ranks, but for the rows and notes, which the root has.
struct BalanceTotals {
  std::uint64_t n_looks = 0;  // times that it was looked at
  std::uint64_t n_core_moves = 0, n_cut_moves = 0;
  // Mean over the looks: longest step over the perfect one, counted; as it was, and as it would have been with the cores of home.
  double imbalance = 1.0, imbalance_at_home = 1.0;
  double last_imbalance = 1.0;  // as planned, at the last look
  double node_imbalance = 1.0;  // [-] work of the busiest node for each of its cores, over the mean, at the last look
  std::vector<int> n_threads;   // of each rank, now
  bool operator==(const BalanceTotals&) const = default;
};

/// Measures, decides, and sees to it that threads are where they should be.
class Balancer {
 public:
  /// All ranks call it.
  Balancer(const World& world, Balance mode, int n_threads);
  ~Balancer();
  Balancer(const Balancer&) = delete;
  Balancer& operator=(const Balancer&) = delete;

  /// From now on threads keep to cores, and ranks that share one sleep while they wait. Where the run leaves cores free that it may use, threads are
  /// kept to those that the node's ranks may use together, and the system chooses. All ranks call it. Returns what there is to say.
  std::vector<std::string> keep_to_cores();

  /// Threads of this rank in the grain phases, and in those of the gas.
  int n_threads() const { return forced_ > 0 ? forced_ : own_share().n_threads(); }
  int n_gas_threads() const { return n_home_; }
  void enter_grain_phases() { enter(true); }
  void enter_gas_phases() { enter(false); }

  /// For tests: the number of threads from the next rebuild on, whatever there is to do.
  void force(int n_threads) { forced_ = n_threads; }
  /// For tests: work is what is counted, whatever it was measured to take.
  void count_only() { counts_only_ = true; }

  /// What this rank has done since the start, to be looked at.
  struct Measure {
    std::uint64_t step = 0;
    double time = 0.0;                                          // [s]
    double n_grains = 0.0, n_pairs = 0.0;                       // now
    double counted = 0.0;                                       // work of a step, counted
    PhaseWork rebuild, advance, gas;                            // since the start
    double all_waited = 0.0, all_worked = 0.0, all_held = 0.0;  // [s] of all phases
    std::uint64_t n_rebuilds = 0;
  };
  struct Decision {
    bool moves_cuts = false;
    double weight = 1.0;  // of the counted work of this rank's grains, where they do
  };
  /// All ranks call it, at the same rebuild.
  Decision look(const Measure& measure);
  /// A division that has been made at this step took so much longer than an ordinary rebuild [s].
  void note_cut(std::uint64_t step, double seconds);

  const BalanceTotals& totals() const { return totals_; }
  std::vector<BalanceRow> take_rows() { return std::exchange(rows_, {}); }
  std::vector<std::string> take_notes() { return std::exchange(notes_, {}); }

 private:
  const CoreShare& own_share() const { return shares_[static_cast<std::size_t>(world_.rank())]; }
  void enter(bool is_grains);
  void add_rows(const Measure& measure, const std::vector<double>& all, const std::vector<double>& work);
  void note_gain(double seconds_a_step, std::uint64_t step);
  void note(std::string text);
  std::string shares_text(const std::vector<CoreShare>& shares) const;

  World world_;
  Balance mode_;
  int n_home_ = 1, forced_ = 0;
  Nodes nodes_;
  std::vector<int> n_threads_;  // at home, of each rank
  std::vector<CoreShare> shares_, home_;
  CorePool pool_;
  bool keeps_to_cores_ = false, counts_only_ = false;
  Measure before_;  // at the last look
  std::uint64_t last_cut_ = 0;
  double cut_seconds_ = 0.0;
  // The change that has yet to show what it gains.
  bool is_change_open_ = false;
  double seconds_before_change_ = 0.0, forecast_of_change_ = 1.0;
  std::uint64_t step_of_change_ = 0;

  BalanceTotals totals_;
  std::vector<BalanceRow> rows_;
  std::vector<std::string> notes_;
  int n_notes_ = 0;
};

}  // namespace moraine
