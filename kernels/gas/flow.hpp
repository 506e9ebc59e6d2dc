// The momentum of the gas on a staggered grid: what passes through the faces of momentum cells, and one step of rows
// along x. Rows of views start at a memory index; the offsets of neighbours are strides. Velocities are interstitial,
// fluxes superficial.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

namespace moraine {

/// What carries momentum at the start of a step.
struct MomentumView {
  int n_axes = 3;  // 2: nothing moves along z
  std::array<std::int64_t, 3> stride{};
  std::array<double, 3> inverse_spacing{};  // [1/m]
  std::array<const double*, 3> velocity{};  // [m/s] at low faces
  std::array<const double*, 3> flux{};      // [m/s] volume of gas per area and time at low faces
  const double* void_fraction = nullptr;    // at cells
  double viscosity = 0.0;                   // [m2/s] kinematic
};

/// Value at the face between `low` and `high` that the flux carries: on the cubic through all four values (which loses
/// no energy to speak of) wherever they lie on a smooth curve, also at its extrema; bounded by the upwind values
/// elsewhere (Suresh & Huynh 1997, J. Comput. Phys. 136, 83, eqs. 2.12 and 2.24 to 2.30, with alpha = 2 and the
/// curvature of four points instead of five). `before` and `after` are the values next to the two.
inline double carried_value(double before, double low, double high, double after, double flux) {
  const double bend_low = (before - low) - (low - high), bend_high = (low - high) - (high - after);
  const double a = 4.0 * bend_low - bend_high, b = 4.0 * bend_high - bend_low;
  const double least = std::min(std::min(a, b), std::min(bend_low, bend_high));
  const double most = std::max(std::max(a, b), std::max(bend_low, bend_high));
  const double bend = std::max(0.0, least) + std::min(0.0, most);
  const bool is_rising = flux >= 0.0;
  const double beyond = is_rising ? before : after;
  const double from = is_rising ? low : high;
  const double mean = 0.5 * (low + high);
  const double with_bend = mean - 0.5 * bend;
  const double steep = from + 2.0 * (from - beyond);
  const double curved = from + 0.5 * (from - beyond) + 4.0 / 3.0 * bend;
  const double least_here = std::min(std::min(low, high), with_bend),
               most_here = std::max(std::max(low, high), with_bend);
  const double least_there = std::min(from, std::min(steep, curved)),
               most_there = std::max(from, std::max(steep, curved));
  const double smooth = mean - 0.0625 * (bend_low + bend_high);
  return std::min(std::max(smooth, std::max(least_here, least_there)), std::min(most_here, most_there));
}

/// Rate of change of void fraction times velocity along `axis` [m/s2] by advection and viscous stress, at n low faces
/// of a row from `first` on. Two layers of velocities and one of fluxes around are read.
void momentum_rates(const MomentumView& view, int axis, std::int64_t first, int n, double* rates);
/// The same at a face of the domain that gas leaves or enters by, with half a momentum cell: across it the velocity
/// does not change.
double outlet_rate(const MomentumView& view, int axis, std::int64_t face, bool is_high);

/// Superficial flux through low faces: void fraction times velocity; and `drift`, which it carries from where there is
/// more to where there is less, at `spreading` [m/s].
void superficial_fluxes(int n, std::int64_t stride, const double* void_fraction, const double* drift, double spreading,
                        const double* velocity, double* fluxes);

/// Divergence [1/s] of fluxes in cells.
void divergence(int n, int n_axes, const std::array<std::int64_t, 3>& stride,
                const std::array<double, 3>& inverse_spacing, const std::array<const double*, 3>& fluxes,
                double* result);

/// Weights of the rates of this step and of the last one (Adams & Bashforth, second order, variable step).
struct StepWeights {
  double now = 1.0, before = 0.0;
};

/// The void fraction that carries momentum, from step to step by what the fluxes carry, and how far that is from where
/// steps of equal length would have it.
struct CarrierRow {
  const double* rate;           // [1/s] divergence of the fluxes now
  const double* rate_before;    // of the last step
  const double* void_fraction;  // at the start of the step
  const double* void_fraction_end;
  const double* carrier;
  double* carrier_end;
  double* drift;
};
void advance_carrier(int n, double dt, StepWeights weights, const CarrierRow& row);

/// One step of the velocity along one axis, before the change of pressure.
struct PredictorRow {
  std::int64_t stride = 1;
  double inverse_spacing = 0.0;  // [1/m]
  double dt = 0.0, dt_over_density = 0.0;
  StepWeights weights;
  double mean_gradient = 0.0;  // [Pa/m] of the pressure, beside what `pressure` holds
  bool is_model_a = true;      // void fraction times pressure gradient; else the gradient itself
  const double* rates;         // at faces
  const double* rates_before;
  const double* carrier;  // at cells
  const double* carrier_end;
  const double* void_fraction_end;
  const double* void_fraction_of_load;
  const double* exchange;
  const double* exchange_velocity;
  const double* pressure;
  double* velocity;     // in and out, at faces
  double* coefficient;  // [m3 s/kg] flux per pressure gradient
  double* mobility;     // [m3 s/kg] velocity per pressure gradient
};
void predict_velocity(int n, const PredictorRow& row);

/// velocity -= mobility * gradient of `change`.
void correct_velocity(int n, std::int64_t stride, double inverse_spacing, const double* mobility, const double* change,
                      double* velocity);

/// What grains feel along one axis in a row of cells.
struct CellRow {
  std::int64_t stride = 1;
  double inverse_spacing = 0.0, mean_gradient = 0.0;
  double weight = 1.0;  // of this step in the means
  const double* velocity;
  const double* pressure;
  const double* void_fraction;
  const double* exchange;
  const double* exchange_velocity;
  double* cell_velocity;  // means over the two faces: added to
  double* cell_gradient;
};
/// [N/m3] sums over a row: drag on the gas, and solid fraction times pressure gradient.
struct CellSums {
  double drag = 0.0, reaction = 0.0;
};
CellSums add_cell_means(int n, const CellRow& row);

/// What moves the gas at a row of faces beside drag.
struct ForceRow {
  std::int64_t stride = 1;
  double inverse_spacing = 0.0, mean_gradient = 0.0, density = 0.0;
  StepWeights weights;
  bool is_model_a = true;
  const double* rates;
  const double* rates_before;
  const double* pressure;
  const double* void_fraction;
};
/// [N/m3] the sum over the row.
double sum_of_forces(int n, const ForceRow& row);

}  // namespace moraine
