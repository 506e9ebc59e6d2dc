// Probes that look at the gas, or at what it does to a bed. Results are the same to the bit on all layouts: sums are
// exact, or of integers.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "comm/grid_share.hpp"
#include "comm/world.hpp"
#include "engine/gas/grid.hpp"
#include "engine/gas/grid_field.hpp"
#include "engine/particles/particles.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

class GasMeans;

/// The gas as probes see it: values at the cells of this rank's block, ghosts not looked at. Null pointers where the
/// rank has no cells.
struct GasView {
  const GasGrid& grid;
  const GridShare& share;
  const GridField<>* void_fraction = nullptr;         // [-]
  const GridField<>* pressure = nullptr;              // [Pa] above hydrostatic
  std::array<const GridField<>*, 3> cell_velocity{};  // [m/s] interstitial, mean of the two faces
  GasMeans* means = nullptr;                          // where a probe is of kind gas_mean
};

/// The cell that a point of the domain is in.
std::array<int, 3> cell_of(const GasGrid& grid, Vec3 position);

/// What grains in a cell add up to; grains belong to the cell that their centre is in.
struct GrainCells {
  CellBlock block;                              // of this rank
  std::vector<double> volume;                   // [m3], one a cell of the block, x fastest
  std::array<std::vector<double>, 3> momentum;  // [m4/s] volume times velocity
  std::vector<double>
      fluctuation;  // [m5/s2] volume times squared velocity relative to the mean of the cell, over dimensions
};
/// All ranks call it; those without cells get empty arrays. Sums are of integers: 2^-36 of the largest grain's
/// contribution is lost.
GrainCells grains_by_cell(const World& world, const GasGrid& grid, const GridShare& share, const Particles& particles);

/// Averages over time of cell values (Probe::Kind::gas_mean), in sums that are kept through restarts.
class GasMeans {
 public:
  GasMeans() = default;
  /// `block`: of this rank; empty where it has none.
  GasMeans(const Scene& scene, const CellBlock& block);

  /// Adds the present values to the sums of a probe (its index in the scene).
  void add(std::size_t probe, const GasView& gas, const GrainCells& grains);

  /// Sums of all probes, to be kept in checkpoints and filled in again at a restart, together with counts(). On cells.
  struct Sum {
    std::string name;  // "NAME.void_fraction_sum"
    std::string unit;
    GridField<>* values;
  };
  std::vector<Sum> sums();
  /// Averages so far, of all probes that have samples, for snapshots. Arrays of the block, without ghosts, x fastest.
  struct Mean {
    std::string name;  // "NAME.void_fraction", ...
    std::string unit;
    std::vector<double> values;
  };
  std::vector<Mean> means() const;
  /// Number of samples of each gas_mean probe, in order of the scene.
  std::vector<double> counts() const;
  void restore(const std::vector<double>& counts);
  double count(std::size_t probe) const;

 private:
  enum Quantity : std::size_t {
    void_fraction,
    volume,
    momentum_x,
    momentum_y,
    momentum_z,
    fluctuation,
    pressure,
    n_quantities
  };
  struct OfProbe {
    std::size_t probe = 0;
    std::string name;
    double n_samples = 0.0;
    std::array<GridField<>, n_quantities> sums;
  };
  std::vector<OfProbe> probes_;
  CellBlock block_;
};

/// Columns and rows as in probes.hpp, of the kinds pressure, pressure_drop, bed_height, gas_profile and gas_mean. A row
/// is empty where `gas` is null and the kind needs it.
std::vector<std::string> gas_probe_columns(const Scene& scene, const Probe& probe);
std::vector<double> gas_probe_row(const World& world, const Scene& scene, const Probe& probe, std::size_t number,
                                  const Particles& particles, const GasView* gas, double time,
                                  std::vector<double>& memory);

}  // namespace moraine
