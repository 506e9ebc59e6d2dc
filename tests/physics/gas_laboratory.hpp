// The gas alone on a small grid: what the tests of its flow have in common.
#pragma once

#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "engine/gas/gas_flow.hpp"

namespace moraine::gas_laboratory {

/// A grid from the origin. `n_threads` for the rank alone.
inline GasGrid grid(std::array<int, 3> n, Vec3 size, std::array<bool, 3> periodic, bool is_flat = true) {
  return {n, {}, {size.x / n[0], size.y / n[1], size.z / n[2]}, periodic, is_flat};
}

inline GasRanks alone(const GasGrid& grid, int n_threads = 1) {
  return {World{}, share_out(grid.n, grid.periodic, 1, 1), n_threads};
}

inline Gas gas(const GasGrid& grid, double density, double viscosity) {
  Gas made;
  made.cells = grid.n;
  made.density = density;
  made.viscosity = viscosity;
  return made;
}

inline GasBoundary boundary(GasBoundary::Kind kind, int face, Vec3 velocity = {}, double pressure = 0.0) {
  GasBoundary made;
  made.kind = kind;
  made.face = face;
  made.velocity = velocity;
  made.pressure = pressure;
  return made;
}

/// A flow with its load and its clock.
struct Bench {
  GasGrid grid;
  GasFlow flow;
  GasLoad load;
  double time = 0.0;

  Bench(const Gas& gas, const GasGrid& on, const GasRanks& ranks)
      : grid(on), flow(gas, {}, on, ranks), load(flow.empty_load()) {}
  Bench(const Gas& gas, const GasGrid& on) : Bench(gas, on, alone(on)) {}

  GasReport advance(double step) {
    const GasReport report = flow.advance(time, step, load);
    time += step;
    return report;
  }
  void run(double until, double step) {
    const int n = static_cast<int>(std::ceil((until - time) / step - 1e-9));
    for (int s = 0; s < n; ++s) advance(step);
  }
  /// [m] of a cell's centre, or of its low face, along an axis.
  double centre(int axis, int cell) const { return (cell + 0.5) * grid.spacing[axis]; }
  double face(int axis, int cell) const { return cell * grid.spacing[axis]; }
  /// Sets a velocity through the arrays that a restart sets; value(x, y) at the faces.
  template <typename Value>
  void set_velocity(int axis, Value value) {
    for (const GasFlow::Kept& kept : flow.kept())
      if (kept.face_axis == axis && std::string(kept.unit) == "m/s")
        for (int k = 0; k < grid.n[2]; ++k)
          for (int j = 0; j < grid.n[1]; ++j)
            for (int i = 0; i < grid.n[0]; ++i)
              (*kept.values)(i, j, k) =
                  value(axis == 0 ? face(0, i) : centre(0, i), axis == 1 ? face(1, j) : centre(1, j));
  }
};

}  // namespace moraine::gas_laboratory
