// A run: the scene brought to life, and the order in which things happen.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "comm/world.hpp"
#include "engine/contacts/ghosts.hpp"
#include "engine/run/image.hpp"
#include "engine/run/ledger.hpp"
#include "engine/run/plan.hpp"
#include "engine/run/stopwatch.hpp"
#include "engine/scene/scene.hpp"

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

/// The run cannot go on: what happened to which grain, with its contacts, and the likely cure.
struct RunError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

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
  /// How often the ranks have looked how far all grains have come: the steps that are not rebuilds but have a reduction.
  std::uint64_t n_looks() const;
  /// Bytes that grains, pairs, wall contacts and cells of this rank hold now.
  double memory() const;

  /// Everything needed to go on, in order of gid. All ranks; each gets consecutive rows, in order of rank.
  Image checkpoint() const;
  /// The given fields only (empty: all that travel), in order of gid. All ranks, as above.
  Image snapshot(const std::vector<std::string>& fields = {}) const;
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
  /// Where the time of this rank went since the start.
  std::vector<PhaseTime> phases() const;

  /// One row of a probe, with its column names; the observers call it when it is due. All ranks.
  std::vector<std::string> probe_columns(std::size_t probe) const;
  std::vector<double> probe_row(std::size_t probe);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace moraine
