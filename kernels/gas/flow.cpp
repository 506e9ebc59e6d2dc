#include "kernels/gas/flow.hpp"

namespace moraine {

namespace {

constexpr int tile = 256;

/// Momentum through one face of a momentum cell of component `axis`, per density: at the centres of cells where it is
/// across `axis` ...
struct AtCentres {
  const double *velocity, *flux, *void_fraction;
  std::int64_t s;
  double stress;  // 2 nu / h
  double operator()(std::int64_t cell) const {
    const double low = velocity[cell], high = velocity[cell + s];
    const double carrying = 0.5 * (flux[cell] + flux[cell + s]);
    const double value = carried_value(velocity[cell - s], low, high, velocity[cell + 2 * s], carrying);
    return carrying * value - stress * void_fraction[cell] * (high - low);
  }
};

/// ... and at the edges that the low face along `axis` has on its low side along another one.
struct AtEdges {
  const double *velocity, *other, *flux, *void_fraction;
  std::int64_t s, d;            // strides of the axis and of the other one
  double stress, other_stress;  // nu / 4 / h of the other one, and of the axis
  double operator()(std::int64_t face) const {
    const double low = velocity[face - d], high = velocity[face];
    const double carrying = 0.5 * (flux[face] + flux[face - s]);
    const double value = carried_value(velocity[face - 2 * d], low, high, velocity[face + d], carrying);
    const double held =
        (void_fraction[face] + void_fraction[face - d]) + (void_fraction[face - s] + void_fraction[face - s - d]);
    const double shear = stress * (high - low) + other_stress * (other[face] - other[face - s]);
    return carrying * value - held * shear;
  }
};

AtCentres centres(const MomentumView& v, std::size_t axis) {
  return {v.velocity[axis], v.flux[axis], v.void_fraction, v.stride[axis], 2.0 * v.viscosity * v.inverse_spacing[axis]};
}

AtEdges edges(const MomentumView& v, std::size_t axis, std::size_t across) {
  return {v.velocity[axis],
          v.velocity[across],
          v.flux[across],
          v.void_fraction,
          v.stride[axis],
          v.stride[across],
          0.25 * v.viscosity * v.inverse_spacing[across],
          0.25 * v.viscosity * v.inverse_spacing[axis]};
}

/// rates += (what passes at `low` - what passes at `low` + s) / h
template <typename Passing>
void add_rates(Passing passing, std::int64_t low, std::int64_t s, double inverse_spacing, int n,
               double* __restrict__ rates) {
  double through[tile + 1];
  if (s == 1) {
    for (int i = 0; i <= n; ++i) through[i] = passing(low + i);
    for (int i = 0; i < n; ++i) rates[i] += (through[i] - through[i + 1]) * inverse_spacing;
  } else {
    for (int i = 0; i < n; ++i) through[i] = passing(low + i);
    for (int i = 0; i < n; ++i) rates[i] += (through[i] - passing(low + s + i)) * inverse_spacing;
  }
}

}  // namespace

void momentum_rates(const MomentumView& view, int axis, std::int64_t first, int n, double* rates) {
  const auto a = static_cast<std::size_t>(axis);
  for (int start = 0; start < n; start += tile) {
    const int count = std::min(tile, n - start);
    const std::int64_t face = first + start;
    std::fill(rates + start, rates + start + count, 0.0);
    for (std::size_t d = 0; d < static_cast<std::size_t>(view.n_axes); ++d)
      if (d == a)
        add_rates(centres(view, a), face - view.stride[a], view.stride[a], view.inverse_spacing[a], count,
                  rates + start);
      else
        add_rates(edges(view, a, d), face, view.stride[d], view.inverse_spacing[d], count, rates + start);
  }
}

double outlet_rate(const MomentumView& view, int axis, std::int64_t face, bool is_high) {
  const auto a = static_cast<std::size_t>(axis);
  const double through = view.flux[a][face] * view.velocity[a][face];
  const double inside = centres(view, a)(is_high ? face - view.stride[a] : face);
  double rate = 2.0 * view.inverse_spacing[a] * (is_high ? inside - through : through - inside);
  for (std::size_t d = 0; d < static_cast<std::size_t>(view.n_axes); ++d)
    if (d != a) add_rates(edges(view, a, d), face, view.stride[d], view.inverse_spacing[d], 1, &rate);
  return rate;
}

void superficial_fluxes(int n, std::int64_t stride, const double* void_fraction, const double* drift, double spreading,
                        const double* velocity, double* __restrict__ fluxes) {
  for (int i = 0; i < n; ++i)
    fluxes[i] =
        0.5 * (void_fraction[i] + void_fraction[i - stride]) * velocity[i] - spreading * (drift[i] - drift[i - stride]);
}

void divergence(int n, int n_axes, const std::array<std::int64_t, 3>& stride,
                const std::array<double, 3>& inverse_spacing, const std::array<const double*, 3>& fluxes,
                double* __restrict__ result) {
  const double *x = fluxes[0], *y = fluxes[1], *z = fluxes[2];
  const double hx = inverse_spacing[0], hy = inverse_spacing[1], hz = inverse_spacing[2];
  const std::int64_t sy = stride[1], sz = stride[2];
  if (n_axes == 2)
    for (int i = 0; i < n; ++i) result[i] = (x[i + 1] - x[i]) * hx + (y[i + sy] - y[i]) * hy;
  else
    for (int i = 0; i < n; ++i) result[i] = (x[i + 1] - x[i]) * hx + (y[i + sy] - y[i]) * hy + (z[i + sz] - z[i]) * hz;
}

void advance_carrier(int n, double dt, StepWeights weights, const CarrierRow& row) {
  double* __restrict__ carrier_end = row.carrier_end;
  double* __restrict__ drift = row.drift;
#pragma GCC ivdep  // too many arrays for the compiler to look whether they overlap
  for (int i = 0; i < n; ++i) {
    const double carried = row.carrier[i] - dt * (weights.now * row.rate[i] + weights.before * row.rate_before[i]);
    const double end = row.void_fraction_end[i];
    const double kept = std::min(std::max(carried, 0.5 * end), 1.5 * end);
    carrier_end[i] = kept;
    drift[i] = kept - (row.void_fraction[i] - 0.5 * dt * row.rate[i]);
  }
}

namespace {

template <bool is_model_a>
void predict(int n, const PredictorRow& row) {
  // In local variables, so that the compiler sees that nothing changes them.
  double* __restrict__ const velocity = row.velocity;
  double* __restrict__ const coefficient = row.coefficient;
  double* __restrict__ const mobility = row.mobility;
  const double *const carrier = row.carrier, *const carrier_end = row.carrier_end, *const end = row.void_fraction_end;
  const double *const load = row.void_fraction_of_load, *const exchange = row.exchange,
                      *const push = row.exchange_velocity;
  const double *const pressure = row.pressure, *const rates = row.rates, *const rates_before = row.rates_before;
  const std::int64_t s = row.stride;
  const double now = row.dt * row.weights.now, before = row.dt * row.weights.before;
  const double dt = row.dt_over_density, half_dt = 0.5 * dt, steepness = row.inverse_spacing, mean = row.mean_gradient;
#pragma GCC ivdep  // too many arrays for the compiler to look whether they overlap
  for (int i = 0; i < n; ++i) {
    const double pressed = is_model_a ? half_dt * (load[i] + load[i - s]) : dt;
    const double gradient = (pressure[i] - pressure[i - s]) * steepness + mean;
    const double held = 0.5 * (carrier[i] + carrier[i - s]) * velocity[i] +
                        (now * rates[i] + before * rates_before[i]) +
                        (half_dt * (push[i] + push[i - s]) - pressed * gradient);
    const double inverse =
        1.0 / (0.5 * (carrier_end[i] + carrier_end[i - s]) + half_dt * (exchange[i] + exchange[i - s]));
    const double follows = pressed * inverse;
    velocity[i] = held * inverse;
    mobility[i] = follows;
    coefficient[i] = 0.5 * (end[i] + end[i - s]) * follows;
  }
}

}  // namespace

void predict_velocity(int n, const PredictorRow& row) {
  if (row.is_model_a)
    predict<true>(n, row);
  else
    predict<false>(n, row);
}

void correct_velocity(int n, std::int64_t stride, double inverse_spacing, const double* mobility, const double* change,
                      double* __restrict__ velocity) {
  for (int i = 0; i < n; ++i) velocity[i] -= mobility[i] * ((change[i] - change[i - stride]) * inverse_spacing);
}

namespace {

/// Sums of a row in an order that depends on nothing but its length.
class RowSum {
 public:
  void add(const double* values, int n) {
    int i = 0;
    for (; i + lanes <= n; i += lanes)
      for (int lane = 0; lane < lanes; ++lane) sums_[lane] += values[i + lane];
    for (int lane = 0; i < n; ++i, ++lane) sums_[lane] += values[i];
  }
  double value() const {
    double sum = 0.0;
    for (const double lane : sums_) sum += lane;
    return sum;
  }

 private:
  static constexpr int lanes = 8;
  double sums_[lanes] = {};
};

}  // namespace

CellSums add_cell_means(int n, const CellRow& row) {
  double* __restrict__ const cell_velocity = row.cell_velocity;
  double* __restrict__ const cell_gradient = row.cell_gradient;
  const double *const u = row.velocity, *const p = row.pressure, *const held = row.void_fraction;
  const double *const exchange = row.exchange, *const push = row.exchange_velocity;
  const std::int64_t s = row.stride;
  const double slope = 0.5 * row.inverse_spacing, mean = row.mean_gradient, weight = row.weight;
  RowSum drag, reaction;
  for (int start = 0; start < n; start += tile) {
    const int end = std::min(n, start + tile);
    double drags[tile], reactions[tile];
    for (int i = start; i < end; ++i) {
      const double velocity = 0.5 * (u[i] + u[i + s]), gradient = slope * (p[i + s] - p[i - s]) + mean;
      cell_velocity[i] += weight * velocity;
      cell_gradient[i] += weight * gradient;
      drags[i - start] = push[i] - exchange[i] * velocity;
      reactions[i - start] = (1.0 - held[i]) * gradient;
    }
    drag.add(drags, end - start);
    reaction.add(reactions, end - start);
  }
  return {drag.value(), reaction.value()};
}

double sum_of_forces(int n, const ForceRow& row) {
  const double *const p = row.pressure, *const held = row.void_fraction;
  const double *const rates = row.rates, *const rates_before = row.rates_before;
  const std::int64_t s = row.stride;
  const double now = row.density * row.weights.now, before = row.density * row.weights.before;
  const double model_a = row.is_model_a ? 0.5 : 0.0, model_b = row.is_model_a ? 0.0 : 1.0;
  RowSum sum;
  for (int start = 0; start < n; start += tile) {
    const int end = std::min(n, start + tile);
    double forces[tile];
    for (int i = start; i < end; ++i) {
      const double gradient = (p[i] - p[i - s]) * row.inverse_spacing + row.mean_gradient;
      forces[i - start] =
          (now * rates[i] + before * rates_before[i]) - (model_a * (held[i] + held[i - s]) + model_b) * gradient;
    }
    sum.add(forces, end - start);
  }
  return sum.value();
}

}  // namespace moraine
