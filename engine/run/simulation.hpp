// A run: the scene brought to life, and the order in which things happen.
#pragma once

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "engine/run/image.hpp"
#include "engine/run/ledger.hpp"
#include "engine/run/plan.hpp"
#include "engine/run/stopwatch.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

/// The run cannot go on: what happened to which grain, with its contacts, and the likely cure.
struct RunError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class Simulation {
 public:
  /// Fills the scene with its grains. Throws SceneError (with every problem) where the scene cannot be run.
  Simulation(const Scene& scene, int n_threads);
  /// Goes on from an image of the same scene.
  Simulation(const Scene& scene, int n_threads, const Image& image);
  ~Simulation();
  Simulation(Simulation&&) noexcept;
  Simulation& operator=(Simulation&&) noexcept;

  /// Advances by one time step. Throws RunError.
  void step();

  const Scene& scene() const;
  const Plan& plan() const;
  std::uint64_t step_number() const;
  double time() const;       // [s]
  double time_step() const;  // [s]
  std::uint64_t n_grains() const;
  std::uint64_t n_born() const;
  std::uint64_t n_left() const;
  std::uint64_t n_rebuilds() const;
  /// Bytes that grains, pairs, wall contacts and cells hold now.
  double memory() const;

  /// Everything needed to go on, in order of gid.
  Image checkpoint() const;
  /// The given fields only (empty: all that travel), in order of gid.
  Image snapshot(const std::vector<std::string>& fields = {}) const;
  Hash128 state_hash() const;
  /// Throws std::logic_error unless the scene keeps the ledger (Output::energy).
  EnergyLedger energy() const;
  /// Where the time went since the start.
  std::vector<PhaseTime> phases() const;

  /// One row of a probe, with its column names; the observers call it when it is due.
  std::vector<std::string> probe_columns(std::size_t probe) const;
  std::vector<double> probe_row(std::size_t probe);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace moraine
