// The gas of a run: when it takes a step, and what of it goes into images and hashes.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "comm/world.hpp"
#include "engine/coupling/coupling.hpp"
#include "engine/run/gas_probes.hpp"
#include "engine/run/gas_record.hpp"
#include "engine/run/grid_rows.hpp"
#include "engine/run/image.hpp"
#include "engine/run/plan.hpp"
#include "engine/run/simulation.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

class GasPhase {
 public:
  /// All ranks of `world`.
  GasPhase(const Scene& scene, const Plan& plan, const World& world, int n_threads);

  bool is_due(std::uint64_t step) const { return step % grain_steps_ == 0; }
  /// Grain steps from this one until the gas steps again (at least 1).
  std::uint64_t until_next(std::uint64_t step) const { return grain_steps_ - step % grain_steps_; }
  /// One gas step to the grains as they are. Throws RunError where grains would overshoot, for the gas step is too long. All ranks.
  void advance(Particles& particles, double time);
  /// For the grains' part of it.
  void set_grain_threads(int n_threads) { coupling_.set_grain_threads(n_threads); }

  const GasTotals& totals() const { return totals_; }
  /// Bytes that the gas of this rank and its exchange with grains hold.
  std::size_t memory() const { return coupling_.memory(); }

  /// What probes look at, until the gas steps again.
  GasView view();

  /// For flight records: this rank's cells that are worth a look, these and those around them as CSV, and the last gas steps as CSV.
  ConcernedCells find_concerned();
  /// Those of each rank, for the rank that has a cell need not have the grains in it. All ranks.
  std::vector<ConcernedCells> find_concerned_of_all();
  std::string rows_of_cells(const ConcernedCells& cells, double time);
  std::string rows_of_steps() const { return steps_.text(); }
  const GasGrid& grid() const { return coupling_.grid(); }

  /// Appends all that the gas remembers, or (for snapshots) what is worth a look. All ranks.
  void gather_kept(Image& image);
  void gather_shown(Image& image);
  /// Goes on from what gather_kept has gathered. All ranks.
  void restore(const Image& image);
  /// Hands over words that stand for a part of the state, the same parts on any layout, each once over all ranks.
  void each_part(const std::function<void(std::span<const std::uint64_t>)>& use);

 private:
  /// One quantity of the gas as an image has it; no values where this rank has no gas.
  struct Quantity {
    std::string name;
    std::string unit;
    int face_axis = -1;
    GridField<>* values = nullptr;
  };
  std::vector<Quantity> kept();
  /// As it is now, means of the two faces; that of GasFlow is a mean over the parts of the last gas step, and not kept.
  void find_cell_velocity();
  void restore_means(const Image& image);
  void look_at_void_fraction(double least, double time) const;
  void gather(const std::string& name, const std::string& unit, int face_axis, const GridField<>* field,
              Image& image) const;

  World world_;
  double step_ = 0.0;  // [s] of the gas
  std::uint64_t grain_steps_ = 1;
  GasWeights weights_ = GasWeights::trilinear;
  Coupling coupling_;
  GasMeans means_;
  std::array<GridField<>, 3> cell_velocity_;  // [m/s] for those who look
  GasTotals totals_;
  GasStepRecord steps_;
};

}  // namespace moraine
