// The gas in a flight record: the steps that it took last, and the cells that whoever asks what has gone wrong should look at.
#pragma once

#include <array>
#include <deque>
#include <string>
#include <vector>

#include "engine/coupling/coupling.hpp"
#include "engine/particles/particles.hpp"
#include "engine/run/gas_probes.hpp"

namespace moraine {

/// The last gas steps in numbers; the same on all ranks.
class GasStepRecord {
 public:
  /// `time` [s] at which the step began.
  void note(double time, const CouplingReport& report);
  /// CSV, a row a step.
  std::string text() const;

 private:
  static constexpr std::size_t n_kept = 32;
  std::deque<std::string> rows_;
};

/// Why a cell is worth a look.
enum class CellConcern { not_finite, imbalance, least_void_fraction, fastest };
inline constexpr std::size_t n_cell_concerns = 4;

/// Of a rank's cells the first that is not finite, the worst balanced, the densest and the one with the fastest gas, by number of concern, as indices in the
/// whole grid; -1 where there is none. `worst`: GasFlow::worst_cell().
using ConcernedCells = std::array<std::array<int, 3>, n_cell_concerns>;
inline constexpr ConcernedCells no_cells = {{{-1, -1, -1}, {-1, -1, -1}, {-1, -1, -1}, {-1, -1, -1}}};
ConcernedCells find_concerned(const GasView& gas, const CellBlock& block, const OpenCell& worst);

/// CSV: these cells and those around them, as far as they are of this rank.
std::string rows_of_cells(const GasView& gas, const CellBlock& block, const ConcernedCells& cells,
                          const OpenCell& worst, double time);

/// This rank's grains with their centres in any of these cells, at most so many of each.
std::vector<std::int32_t> grains_in(const GasGrid& grid, const std::vector<ConcernedCells>& cells,
                                    const Particles& particles, int most);

}  // namespace moraine
