// A run: the scene brought to life, and the order in which things happen.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "comm/world.hpp"
#include "engine/contacts/ghosts.hpp"
#include "engine/particles/particles.hpp"
#include "engine/run/balance.hpp"
#include "engine/run/image.hpp"
#include "engine/run/ledger.hpp"
#include "engine/run/plan.hpp"
#include "engine/run/stopwatch.hpp"
#include "engine/scene/scene.hpp"
#include "engine/walls/motion.hpp"

namespace moraine {

/// What the gas has done since the start of this process.
struct GasTotals {
  std::uint64_t n_steps = 0;
  std::uint64_t n_parts = 0;       // into which its steps were divided
  std::uint64_t n_iterations = 0;  // of the pressure equation
  double imbalance = 0.0;          // [-] largest mass imbalance of a cell, of the gas it holds
  std::uint64_t n_floored = 0;     // cells taken as less dense than they were, summed over steps
  double least_void_fraction = 1.0;
  double momentum_error = 0.0;  // [-] largest difference of what the gas lost and the grains got
  bool operator==(const GasTotals&) const = default;
};

/// What the threads of a rank did in a phase.
struct NamedWork {
  std::string phase;
  PhaseWork work;
  bool operator==(const NamedWork&) const = default;
};

/// The run cannot go on: what happened to which grain, with its contacts, and the likely cure.
struct RunError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// What this rank has to tell of those whom a stop or a warning concerns, as CSV; empty where it has nothing.
struct FlightRecord {
  std::string grains;     // steps of grains, with their contacts and forces (FlightRecorder)
  std::string gas_cells;  // cells of the gas and those around them
  std::string gas_steps;  // the last steps of the gas; the same on all ranks
  std::string subject;    // of a warning; empty for a stop
};

/// Sets the acceleration [m/s2] of each of this rank's grains beside gravity and gas, three values a grain, in the order of the views.
/// The values come as zeros.
using BodyForce = std::function<void(std::span<double> acceleration)>;

/// How a wall moves over an interval, from the time in its middle [s]. It must depend on nothing but the time, and be the same on all ranks.
using WallFunction = std::function<WallRates(double time)>;

class Simulation {
 public:
  /// Fills the scene with its grains. Throws SceneError (with every problem) where the scene cannot be run. The ranks of `world`
  /// share the grains; all of them make the same calls in the same order. What is marked "all ranks" below must be
  /// called by all at the same step, and gives the same on each, but for images, of which each rank holds its rows.
  Simulation(const Scene& scene, int n_threads, const World& world = {});
  /// Goes on from an image of the same scene. Each rank gives consecutive rows of each table, in order of rank; any numbers, also none.
  Simulation(const Scene& scene, int n_threads, const Image& image, const World& world = {});
  ~Simulation();
  Simulation(Simulation&&) noexcept;
  Simulation& operator=(Simulation&&) noexcept;

  /// Advances by one time step. Throws RunError, on the rank that finds the fault.
  void step();

  const World& world() const;
  /// Asks that the run should end. Ranks agree on it when they next look at how far the grains have come (at most some tens of
  /// steps later), so that all end at the same step; alone it holds at once.
  void ask_to_stop();
  bool is_stop_agreed() const;
  /// The run goes on after all. All ranks.
  void forget_stop();

  /// From now on `force` is asked in every step, before the grains are kicked; an empty one ends that. What it gives must depend on nothing but the
  /// grain and the time, or the same bits on any layout are lost. Ranks look how far grains have come in every step, as nobody can
  /// foresee what it will do. Its work counts among the losses to drag. It is not kept in checkpoints. All ranks.
  void set_body_force(BodyForce force);
  /// A wall whose motion in the scene is of kind script is moved by `function` from the next step on whose number is a multiple of `every`
  /// (and from the first): it is asked then, and what it says holds for so many steps. What was said last is kept in checkpoints. step() throws
  /// RunError where a scripted wall has no function, or is moved faster than its max_speed. Throws std::invalid_argument where there is
  /// no such wall. All ranks.
  void set_wall_motion(const std::string& wall, WallFunction function, std::uint64_t every = 1);
  /// A field of this rank's grains where it lies, or nothing where the scene has no need of it. Grains are in no particular order (see
  /// gid), and those that have left since the last rebuild have positions that are not numbers. The next rebuild puts them elsewhere, and whoever
  /// still looks sees what was there before.
  std::optional<FieldView> view(Field field);
  /// Removes who has left from the views; alone only, several ranks wait for the next rebuild.
  void remove_left();
  /// Position, velocity or angular velocity of grains have been changed through a view. Throws std::invalid_argument, on all ranks, where a
  /// value is not finite or a grain lies outside the domain. All ranks.
  void grains_changed();

  const Scene& scene() const;
  const Plan& plan() const;
  std::uint64_t step_number() const;
  double time() const;       // [s]
  double time_step() const;  // [s]
  /// Of all ranks. With several of them as it was when they last looked or observed; exact after snapshot(), checkpoint(), energy().
  std::uint64_t n_grains() const;
  std::uint64_t n_born() const;
  std::uint64_t n_left() const;
  std::uint64_t n_rebuilds() const;
  /// How often walls were looked for anew because they had moved, beyond rebuilds; of this rank.
  std::uint64_t n_wall_searches() const;
  /// How often the ranks have looked how far all grains have come: the steps that are not rebuilds but have a reduction.
  std::uint64_t n_looks() const;
  /// Of these, how many came earlier than agreed, because a rank had grains that nobody had foreseen so fast.
  std::uint64_t n_early_looks() const;
  /// What happened since the last call that a user should know, in sentences; the same on all ranks.
  std::vector<std::string> take_notes();
  /// Bytes that grains, pairs, wall contacts and cells of this rank hold now.
  double memory() const;
  /// The skin of the pair list becomes no wider than this [m], as where there is no memory for more pairs; Plan::skin always is allowed. Reaches
  /// no result. All ranks, the same.
  void bound_skin(double widest);

  /// Everything needed to go on, in order of gid. All ranks; each gets consecutive rows, in order of rank.
  Image checkpoint() const;
  /// The given fields only (empty: all that travel), in order of gid. All ranks, as above.
  Image snapshot(const std::vector<std::string>& fields = {}) const;
  /// Force maps of snapshots are means from now on.
  void begin_force_maps();
  /// All ranks.
  Hash128 state_hash() const;
  /// Throws std::logic_error unless the scene keeps the ledger (Output::energy). All ranks.
  EnergyLedger energy() const;
  /// What this rank exchanges with others in a step, since the last rebuild.
  HaloCounts halo_counts() const;
  std::uint64_t n_own_grains() const;  // of this rank
  std::int64_t n_own_pairs() const;    // in its list; border pairs are in the lists of both ranks
  std::uint64_t n_migrated() const;    // grains that this rank has given to others
  std::uint64_t n_cuts() const;        // how often space has been divided
  /// What the gas has done in this process, same on all ranks; nothing in a scene without gas.
  std::optional<GasTotals> gas_totals() const;
  /// What the run does that its time step was not chosen for, in words with numbers. All ranks, same on all.
  std::vector<std::string> step_warnings() const;
  /// How many of them this rank knows: of several, what they have found until they last looked.
  std::size_t n_known_warnings() const;
  std::vector<std::string> known_warnings() const;
  /// Begins a flight record of those concerned: of the gas the cells worth a look and the grains in them, else the grains in the deepest
  /// contact and the fastest, through the next 32 steps. All ranks.
  void begin_record(Concern concern);
  /// This rank's records that are complete; with `is_end` also those that are not.
  std::vector<FlightRecord> take_records(bool is_end = false);
  /// Where the time of this rank went since the start.
  std::vector<PhaseTime> phases() const;
  /// What the threads of this rank did in each phase since the start, waiting apart from working.
  std::vector<NamedWork> work() const;

  /// Threads keep to cores from now on, those of the ranks of a node together, which change hands as `run.balance` of the scene says. For programs that
  /// have the machine to themselves; without it the numbers of threads follow the grains, and the system places them. All ranks.
  /// What there is to say of it.
  std::vector<std::string> keep_to_cores();
  int n_threads() const;  // of this rank in the grain phases, now
  const BalanceTotals& balance() const;
  /// At the root, since the last call: lines over time, and what was done and gained, in words.
  std::vector<BalanceRow> take_balance_rows();
  std::vector<std::string> take_balance_notes();
  /// For tests: this rank's threads from each rebuild on, by the number of the rebuild.
  void force_threads(std::function<int(std::uint64_t)> choose);
  /// For tests: balance goes by counted work alone, so that a busy machine does not matter.
  void force_counting();
  /// For tests: at the next rebuild space is divided into equal boxes, wherever the grains are. All ranks.
  void force_equal_boxes();

  /// One row of a probe, with its column names; the observers call it when it is due. All ranks.
  std::vector<std::string> probe_columns(std::size_t probe) const;
  std::vector<double> probe_row(std::size_t probe);
  /// Of a probe of kind fields: the means over its samples since begin_fields(). Each rank has consecutive values. All ranks.
  FieldImage fields(std::size_t probe) const;
  /// Its next samples make a new mean.
  void begin_fields(std::size_t probe);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace moraine
