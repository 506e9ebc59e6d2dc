// The gas: volume-averaged incompressible Navier-Stokes equations on a staggered grid.
#pragma once

#include <array>
#include <memory>
#include <stdexcept>
#include <vector>

#include "engine/gas/grid.hpp"
#include "engine/gas/grid_field.hpp"
#include "engine/gas/pressure_solver.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

/// What the grains are to the gas at the end of a gas step: values on the cells of the rank's block, with ghost layers
/// that the gas fills.
struct GasLoad {
  GridField<> void_fraction;  // [-] volume of gas over volume, floor applied
  GridField<> exchange;       // [kg/(m3 s)] beta: force on the gas per volume and velocity, with minus sign
  std::array<GridField<>, 3> exchange_velocity;  // [N/m3] beta times the grains' velocity
};

/// The gas cannot go on: why, and what to do.
struct GasError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// One gas step in numbers; the same on all ranks.
struct GasReport {
  int n_parts = 0;         // the gas step was divided into so many, for the gas was that fast or viscous
  int iterations = 0;      // of the pressure equation, in all parts
  double imbalance = 0.0;  // [-] largest mass imbalance of a cell, of the gas it holds
  double courant = 0.0;    // [-] largest of a part
};

/// A gas step is divided into fewer parts than that, or the run ends with a message.
inline constexpr double most_gas_parts = 1e4;
/// Parts into which the friction of the gas makes a gas step [s] be divided, however slow the gas is.
double viscous_parts(const Gas& gas, const GasGrid& grid, double step);

class GasFlow {
 public:
  /// At rest at `gas.velocity`, without grains. Throws SceneError where the boundaries cannot be (no outlet, and inflow
  /// does not balance).
  GasFlow(const Gas& gas, Vec3 gravity, const GasGrid& grid, const GasRanks& ranks);
  ~GasFlow();
  GasFlow(GasFlow&&) noexcept;
  GasFlow& operator=(GasFlow&&) noexcept;

  /// A load without grains, of this rank's block.
  GasLoad empty_load() const;
  /// From `time` to time + step [s], to the void fractions of `load`. The first call takes them as having been there
  /// before. All ranks of the gas.
  GasReport advance(double time, double step, GasLoad& load);

  /// State on this rank's block, ghosts filled: interstitial velocity at the low faces of cells [m/s] (component by
  /// axis), pressure above hydrostatic at cells [Pa], void fraction at cells.
  const GridField<>& velocity(int axis) const;
  const GridField<>& pressure() const;
  const GridField<>& void_fraction() const;
  /// What grains feel, at cells, without ghosts filled: mean of the two faces of the velocity [m/s] and of the pressure
  /// gradient [Pa/m] (beyond the last face between cells the gradient stays as it is; at an outlet it is the one to the
  /// outlet; with the mean gradient of periodic directions). Means over the last gas step where it was divided, so that
  /// with its load they give the very forces on the gas.
  const GridField<>& cell_velocity(int axis) const;
  const GridField<>& cell_pressure_gradient(int axis) const;

  /// The cell of this rank whose gas the last solution of the pressure equation balances worst, with its imbalance in the unit of
  /// 1/s; none where it has not been solved yet. For those who look for what went wrong.
  OpenCell worst_cell() const;

  /// All that advance() reads of the past, in arrays of this rank's block, to go on from; names and number are fixed by
  /// the scene.
  struct Kept {
    const char* name;
    const char* unit;
    int face_axis;  // 0, 1, 2: on the low faces along that axis; -1: on cells
    GridField<>* values;
  };
  std::vector<Kept> kept();
  std::vector<double> kept_numbers() const;
  /// After the arrays of kept() have been filled in.
  void restore(const std::vector<double>& numbers);

  /// Of the whole gas, same on all ranks: mass flow into the domain through each boundary entry at the end of the last
  /// step [kg/s]; momentum in the gas [N s]; and means over the last step: force of the boundaries on the gas by
  /// pressure, friction and mean pressure gradients, with momentum carried in, and of the grains by drag and (model A)
  /// pressure gradient [N]. The momentum changes by their sum, to round-off; README.md has the definitions. All ranks
  /// call it.
  struct Budget {
    std::vector<double> inflow;
    Vec3 momentum, boundary_force, drag;
  };
  Budget budget() const;

  std::size_t memory() const;  // [bytes]

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace moraine
