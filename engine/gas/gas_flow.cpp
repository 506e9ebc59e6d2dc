#include "engine/gas/gas_flow.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>
#include <vector>

#include "comm/grid_halo.hpp"
#include "comm/totals.hpp"
#include "engine/gas/boundaries.hpp"
#include "engine/gas/team.hpp"
#include "engine/threads.hpp"
#include "kernels/gas/flow.hpp"

namespace moraine {

namespace {

using Kind = GasBoundary::Kind;

/// Stable are Adams-Bashforth steps with up to about 0.7 and 1.0; rates at jumps of the void fraction are half as large
/// again.
constexpr double most_courant = 0.5, bearable_courant = 0.75, most_viscous = 0.6;
/// A step that is longer than the last one by more goes without it.
constexpr double most_growth = 2.0;
/// Part of a cell's drift that passes to each neighbour in a step; 1/6 is the limit.
constexpr double spreading = 0.05;

constexpr std::size_t index(int axis) { return static_cast<std::size_t>(axis); }

using Fields = std::array<GridField<>, 3>;

std::array<const double*, 3> rows_of(const Fields& fields, std::int64_t at) {
  return {fields[0].data() + at, fields[1].data() + at, fields[2].data() + at};
}

}  // namespace

struct GasFlow::Parts {
  Gas gas;
  GasGrid grid;
  GasRanks ranks;
  GridLayout layout;
  Boundaries boundaries;
  PressureSolver solver;
  GridHalo load_halo, step_halo, velocity_halo;
  int n_axes;
  std::array<double, 3> inverse_spacing;

  Fields velocity;
  GridField<> pressure, void_fraction;  // at the end of the last part
  GridField<> carrier;                  // void fraction that carries the momentum of `velocity`
  GridField<> drift, divergence_before;
  Fields rates_before;
  bool has_started = false;
  double dt_before = 0.0, boundary_time = 0.0;  // [s] of the last part; that the boundaries are at

  GridField<> void_fraction_start, void_fraction_end, carrier_end, divergence_now, change, source;
  Fields flux, rates, coefficient, mobility, cell_velocity, cell_gradient;
  std::array<ExactSum, 3> boundary_force, drag;  // of this rank, mean over the last gas step

  Parts(const Gas& the_gas, const GasGrid& the_grid, const GasRanks& the_ranks);

  /// One part of a gas step.
  struct Part {
    double dt, end;  // [s]
    double share;    // of the gas step
    double reached;  // of the gas step at the end of the part
    StepWeights weights;
    double tolerance;  // [1/s]
  };

  // The ranges of rows, and what to do with them on all threads.
  template <typename Work>
  void for_each_row(int thread, std::array<int, 2> y, std::array<int, 2> z, Work work) const;
  /// work(range of memory indices) on all threads: of whole arrays.
  template <typename Work>
  void for_all_values(Work work) const {
    parallel(ranks.n_threads, [&](int thread) { work(share_of(layout.n_values(), thread, ranks.n_threads)); });
  }
  /// Rows around the block too, by so many layers along axes in which the gas moves.
  template <typename Work>
  void for_each_row_around(int thread, int low, int high, Work work) const;
  bool is_model_a() const { return gas.model == GasModel::a; }
  double mean_gradient(int axis) const { return grid.periodic[index(axis)] ? gas.pressure_gradient[axis] : 0.0; }
  bool is_bounded(int axis) const { return !grid.periodic[index(axis)]; }
  bool is_at_low(int axis) const { return is_bounded(axis) && ranks.block().low[index(axis)] == 0; }
  bool is_at_high(int axis) const { return is_bounded(axis) && ranks.block().high[index(axis)] == grid.n[index(axis)]; }
  /// The block's low faces along an axis that are not on the domain's, as [first, end) along each axis.
  std::array<std::array<int, 2>, 3> inner_faces(int axis) const;
  /// Those on the domain's faces too.
  std::array<std::array<int, 2>, 3> all_faces(int axis) const;
  /// visit(boundary face, memory index of the face, of its cell), for the thread's share of them.
  template <typename Visit>
  void for_each_boundary_face(const BoundarySurface& surface, const Team& team, Visit visit) const;
  /// work(team) on all threads.
  template <typename Work>
  void together(Work work) const {
    parallel(ranks.n_threads, [&](int thread) { work(Team{thread, ranks.n_threads}); });
  }
  /// Adds what add(team, sums) of all threads finds, along each axis.
  template <typename Add>
  void sum_up(std::array<ExactSum, 3>& sums, Add add) const;

  void take(GasLoad& load);
  void clear_means();
  double least_void_fraction(const GasLoad& load) const;
  void start(double time, double step, double tolerance, const GasLoad& load, GasReport& report);
  void advance_part(const Part& part, const GasLoad& load, GasReport& report);
  void find_rates(const Part& part);
  void predict(const Part& part, const GasLoad& load);
  void close_boundaries(const Team& team);
  void project(double dt, double tolerance, GasReport& report);
  void finish_velocity(double time);
  void account(const Part& part, const GasLoad& load);
  void add_momentum(double weight, bool is_everywhere, std::array<ExactSum, 3>& sums) const;
  double courant_rate(double time) const;
  int n_parts_for(double fastest, double left, double step) const;
  void exchange_velocity();
  MomentumView view() const;
};

GasFlow::Parts::Parts(const Gas& the_gas, const GasGrid& the_grid, const GasRanks& the_ranks)
    : gas(the_gas),
      grid(the_grid),
      ranks(the_ranks),
      layout(the_ranks.block(), gas_ghosts),
      boundaries(the_gas, the_grid, the_ranks.block()),
      solver(the_grid, the_ranks),
      load_halo(the_ranks.world, the_ranks.share, gas_ghosts, 5, sizeof(double)),
      step_halo(the_ranks.world, the_ranks.share, gas_ghosts, the_grid.is_flat ? 3 : 4, sizeof(double)),
      velocity_halo(the_ranks.world, the_ranks.share, gas_ghosts, the_grid.is_flat ? 2 : 3, sizeof(double)),
      n_axes(the_grid.is_flat ? 2 : 3),
      inverse_spacing{1.0 / the_grid.spacing.x, 1.0 / the_grid.spacing.y, 1.0 / the_grid.spacing.z} {
  for (Fields* fields :
       {&velocity, &rates_before, &flux, &rates, &coefficient, &mobility, &cell_velocity, &cell_gradient})
    for (GridField<>& field : *fields) field = GridField<>(layout);
  for (GridField<>* field : {&pressure, &drift, &divergence_before, &divergence_now, &change, &source})
    *field = GridField<>(layout);
  for (GridField<>* field : {&void_fraction, &carrier, &void_fraction_start, &void_fraction_end, &carrier_end})
    *field = GridField<>(layout, 1.0);
  for (int a = 0; a < n_axes; ++a) {
    velocity[index(a)].fill(gas.velocity[a]);
    cell_velocity[index(a)].fill(gas.velocity[a]);
  }
  boundaries.extend_pressure(pressure, 1.0, {});
}

template <typename Work>
void GasFlow::Parts::for_each_row(int thread, std::array<int, 2> y, std::array<int, 2> z, Work work) const {
  const int n_y = y[1] - y[0], n_z = z[1] - z[0];
  const Range share = share_of(std::int64_t{n_y} * n_z, thread, ranks.n_threads);
  for (std::int64_t row = share.begin; row < share.end; ++row)
    work(y[0] + static_cast<int>(row % n_y), z[0] + static_cast<int>(row / n_y));
}

template <typename Work>
void GasFlow::Parts::for_each_row_around(int thread, int low, int high, Work work) const {
  const bool has_z = n_axes == 3;
  for_each_row(thread, {-low, layout.size[1] + high}, {has_z ? -low : 0, layout.size[2] + (has_z ? high : 0)}, work);
}

std::array<std::array<int, 2>, 3> GasFlow::Parts::inner_faces(int axis) const {
  std::array<std::array<int, 2>, 3> range{{{0, layout.size[0]}, {0, layout.size[1]}, {0, layout.size[2]}}};
  if (is_at_low(axis)) range[index(axis)][0] = 1;
  return range;
}

std::array<std::array<int, 2>, 3> GasFlow::Parts::all_faces(int axis) const {
  std::array<std::array<int, 2>, 3> range{{{0, layout.size[0]}, {0, layout.size[1]}, {0, layout.size[2]}}};
  if (is_at_high(axis)) ++range[index(axis)][1];
  return range;
}

template <typename Visit>
void GasFlow::Parts::for_each_boundary_face(const BoundarySurface& surface, const Team& team, Visit visit) const {
  std::array<int, 3> cell{};
  cell[index(surface.axis)] = surface.is_high ? layout.size[index(surface.axis)] - 1 : 0;
  const std::int64_t to_face = surface.is_high ? layout.stride(surface.axis) : 0;
  const Range rows = team.share(surface.size[1]);
  for (int j = static_cast<int>(rows.begin); j < static_cast<int>(rows.end); ++j)
    for (int i = 0; i < surface.size[0]; ++i) {
      cell[index(surface.along[0])] = i;
      cell[index(surface.along[1])] = j;
      const std::int64_t at = layout.at(cell[0], cell[1], cell[2]);
      visit(surface.at(i, j), at + to_face, at);
    }
}

template <typename Add>
void GasFlow::Parts::sum_up(std::array<ExactSum, 3>& sums, Add add) const {
  std::vector<std::array<ExactSum, 3>> of_threads(static_cast<std::size_t>(ranks.n_threads));
  together([&](const Team& team) { add(team, of_threads[index(team.thread)]); });
  for (const auto& of_thread : of_threads)
    for (std::size_t a = 0; a < 3; ++a) sums[a].add(of_thread[a]);
}

MomentumView GasFlow::Parts::view() const {
  return {n_axes,
          {1, layout.stride(1), layout.stride(2)},
          inverse_spacing,
          rows_of(velocity, 0),
          rows_of(flux, 0),
          void_fraction.data(),
          gas.viscosity / gas.density};
}

void GasFlow::Parts::take(GasLoad& load) {
  load_halo.exchange({load.void_fraction.data(), load.exchange.data(), load.exchange_velocity[0].data(),
                      load.exchange_velocity[1].data(), load.exchange_velocity[2].data()});
  GridField<>* const fields[] = {&load.void_fraction, &load.exchange, &load.exchange_velocity[0],
                                 &load.exchange_velocity[1], &load.exchange_velocity[2]};
  together([&](const Team& team) { boundaries.mirror(fields, team); });
}

void GasFlow::Parts::exchange_velocity() {
  if (n_axes == 2)
    velocity_halo.exchange({velocity[0].data(), velocity[1].data()});
  else
    velocity_halo.exchange({velocity[0].data(), velocity[1].data(), velocity[2].data()});
}

/// Fluxes, the void fraction that they leave, and the rates of momentum.
void GasFlow::Parts::find_rates(const Part& part) {
  const std::array<std::int64_t, 3> stride{1, layout.stride(1), layout.stride(2)};
  const MomentumView fields = view();
  together([&](const Team& team) {
    const int thread = team.thread;
    for_each_row_around(thread, 1, 2, [&](int j, int k) {
      const std::int64_t at = layout.at(-1, j, k);
      for (int a = 0; a < n_axes; ++a)
        superficial_fluxes(layout.size[0] + 3, stride[index(a)], void_fraction.data() + at, drift.data() + at,
                           spreading * grid.spacing[a] / part.dt, velocity[index(a)].data() + at,
                           flux[index(a)].data() + at);
    });
    barrier();
    for_each_row_around(thread, 1, 1, [&](int j, int k) {
      const std::int64_t at = layout.at(-1, j, k);
      const int n = layout.size[0] + 2;
      divergence(n, n_axes, stride, inverse_spacing, rows_of(flux, at), divergence_now.data() + at);
      advance_carrier(n, part.dt, part.weights,
                      {divergence_now.data() + at, divergence_before.data() + at, void_fraction.data() + at,
                       void_fraction_end.data() + at, carrier.data() + at, carrier_end.data() + at, drift.data() + at});
    });
    for (int a = 0; a < n_axes; ++a) {
      const auto range = inner_faces(a);
      for_each_row(thread, range[1], range[2], [&](int j, int k) {
        const std::int64_t at = layout.at(range[0][0], j, k);
        momentum_rates(fields, a, at, range[0][1] - range[0][0], rates[index(a)].data() + at);
      });
    }
    for (const BoundarySurface& surface : boundaries.surfaces())
      for_each_boundary_face(surface, team, [&](const BoundaryFace& boundary, std::int64_t face, std::int64_t) {
        if (boundary.kind == Kind::pressure)
          rates[index(surface.axis)].data()[face] = outlet_rate(fields, surface.axis, face, surface.is_high);
      });
    team.sync();
    GridField<>* const ends[] = {&carrier_end};
    boundaries.mirror(ends, team);
  });
}

void GasFlow::Parts::predict(const Part& part, const GasLoad& load) {
  together([&](const Team& team) {
    for (int a = 0; a < n_axes; ++a) {
      const auto range = all_faces(a);
      for_each_row(team.thread, range[1], range[2], [&](int j, int k) {
        const std::int64_t at = layout.at(0, j, k);
        PredictorRow row;
        row.stride = layout.stride(a);
        row.inverse_spacing = inverse_spacing[index(a)];
        row.dt = part.dt;
        row.dt_over_density = part.dt / gas.density;
        row.weights = part.weights;
        row.mean_gradient = mean_gradient(a);
        row.is_model_a = is_model_a();
        row.rates = rates[index(a)].data() + at;
        row.rates_before = rates_before[index(a)].data() + at;
        row.carrier = carrier.data() + at;
        row.carrier_end = carrier_end.data() + at;
        row.void_fraction_end = void_fraction_end.data() + at;
        row.void_fraction_of_load = load.void_fraction.data() + at;
        row.exchange = load.exchange.data() + at;
        row.exchange_velocity = load.exchange_velocity[index(a)].data() + at;
        row.pressure = pressure.data() + at;
        row.velocity = velocity[index(a)].data() + at;
        row.coefficient = coefficient[index(a)].data() + at;
        row.mobility = mobility[index(a)].data() + at;
        predict_velocity(range[0][1], row);
      });
    }
    team.sync();
    boundaries.set_given(void_fraction_end, part.end, velocity, team);
    close_boundaries(team);
  });
}

/// No flux follows the pressure where velocities are given; an outlet is half a cell away.
void GasFlow::Parts::close_boundaries(const Team& team) {
  for (const BoundarySurface& surface : boundaries.surfaces()) {
    double* const c = coefficient[index(surface.axis)].data();
    double* const m = mobility[index(surface.axis)].data();
    for_each_boundary_face(surface, team, [&](const BoundaryFace& boundary, std::int64_t face, std::int64_t) {
      if (boundary.kind == Kind::pressure)
        c[face] *= 2.0;
      else
        c[face] = m[face] = 0.0;
    });
  }
}

/// Makes the velocity carry what continuity asks for, by a change of the pressure.
void GasFlow::Parts::project(double dt, double tolerance, GasReport& report) {
  const std::array<std::int64_t, 3> stride{1, layout.stride(1), layout.stride(2)};
  exchange_velocity();
  parallel(ranks.n_threads, [&](int thread) {
    for_each_row_around(thread, 0, 1, [&](int j, int k) {
      const std::int64_t at = layout.at(0, j, k);
      for (int a = 0; a < n_axes; ++a)
        superficial_fluxes(layout.size[0] + 1, stride[index(a)], void_fraction_end.data() + at, drift.data() + at, 0.0,
                           velocity[index(a)].data() + at, flux[index(a)].data() + at);
    });
    barrier();
    for_each_row_around(thread, 0, 0, [&](int j, int k) {
      const std::int64_t at = layout.at(0, j, k);
      divergence(layout.size[0], n_axes, stride, inverse_spacing, rows_of(flux, at), source.data() + at);
      for (int i = 0; i < layout.size[0]; ++i) {
        const std::int64_t cell = at + i;
        source.data()[cell] += (void_fraction_end.data()[cell] - void_fraction.data()[cell]) / dt;
      }
    });
  });
  for_all_values([&](Range range) { std::fill_n(change.data() + range.begin, range.size(), 0.0); });
  solver.set({&coefficient[0], &coefficient[1], &coefficient[2]});
  const PressureReport solved = solver.solve(source, change, tolerance);
  if (!std::isfinite(solved.residual))
    throw GasError("the gas velocity is no longer finite: choose a smaller gas.step");
  report.iterations += solved.iterations;
  report.imbalance += solved.residual * dt;
  together([&](const Team& team) {
    boundaries.extend_pressure(change, 0.0, team);
    for (int a = 0; a < n_axes; ++a) {
      const auto range = all_faces(a);
      for_each_row(team.thread, range[1], range[2], [&](int j, int k) {
        const std::int64_t at = layout.at(0, j, k);
        correct_velocity(range[0][1], stride[index(a)], inverse_spacing[index(a)], mobility[index(a)].data() + at,
                         change.data() + at, velocity[index(a)].data() + at);
      });
    }
  });
}

void GasFlow::Parts::finish_velocity(double time) {
  boundary_time = time;
  if (n_axes == 2)
    step_halo.exchange({velocity[0].data(), velocity[1].data(), drift.data()});
  else
    step_halo.exchange({velocity[0].data(), velocity[1].data(), velocity[2].data(), drift.data()});
  together([&](const Team& team) {
    GridField<>* const fields[] = {&drift};
    boundaries.mirror(fields, team);
    boundaries.extend(void_fraction_end, time, velocity, team);
  });
}

void GasFlow::Parts::clear_means() {
  for (std::size_t a = 0; a < 3; ++a) boundary_force[a] = drag[a] = ExactSum{};
  for_all_values([&](Range range) {
    for (std::size_t a = 0; a < static_cast<std::size_t>(n_axes); ++a)
      for (GridField<>* field : {&cell_velocity[a], &cell_gradient[a]})
        std::fill_n(field->data() + range.begin, range.size(), 0.0);
  });
}

/// Of all ranks.
double GasFlow::Parts::least_void_fraction(const GasLoad& load) const {
  double most_solid = -1.0;
  for (int k = 0; k < layout.size[2]; ++k)
    for (int j = 0; j < layout.size[1]; ++j)
      for (int i = 0; i < layout.size[0]; ++i) most_solid = std::max(most_solid, -load.void_fraction(i, j, k));
  ranks.world.max(std::span(&most_solid, 1));
  return -most_solid;
}

/// Velocities at the start, made to fit the boundaries and the void fraction: what a push by them leaves where it takes
/// no time. Its momentum counts as given by the boundaries.
void GasFlow::Parts::start(double time, double step, double tolerance, const GasLoad& load, GasReport& report) {
  add_momentum(-1.0 / step, true, boundary_force);
  for (GridField<>* field : {&void_fraction, &void_fraction_end, &carrier})
    std::copy_n(load.void_fraction.data(), layout.n_values(), field->data());
  boundaries.set_given(void_fraction, time, velocity, {});
  parallel(ranks.n_threads, [&](int thread) {
    for (int a = 0; a < n_axes; ++a) {
      const auto range = all_faces(a);
      const std::int64_t s = layout.stride(a);
      for_each_row(thread, range[1], range[2], [&](int j, int k) {
        for (std::int64_t at = layout.at(0, j, k), end = at + range[0][1]; at < end; ++at) {
          mobility[index(a)].data()[at] = 1.0;
          coefficient[index(a)].data()[at] = 0.5 * (void_fraction.data()[at] + void_fraction.data()[at - s]);
        }
      });
    }
  });
  close_boundaries({});
  GasReport of_start;
  project(1.0, tolerance, of_start);
  report.iterations += of_start.iterations;
  finish_velocity(time);
  add_momentum(1.0 / step, true, boundary_force);
  has_started = true;
}

void GasFlow::Parts::advance_part(const Part& part, const GasLoad& load, GasReport& report) {
  for_all_values([&](Range range) {
    const double* const from = void_fraction_start.data();
    const double* const to = load.void_fraction.data();
    double* const end = void_fraction_end.data();
    for (std::int64_t c = range.begin; c < range.end; ++c)
      end[c] = part.reached == 1.0 ? to[c] : from[c] + part.reached * (to[c] - from[c]);
  });
  find_rates(part);
  predict(part, load);
  project(part.dt, part.tolerance, report);
  double* const p = pressure.data();
  const double* const dp = change.data();
  together([&](const Team& team) {
    const Range range = team.share(layout.n_values());
    for (std::int64_t c = range.begin; c < range.end; ++c) p[c] += dp[c];
    team.sync();
    boundaries.extend_pressure(pressure, 1.0, team);
  });
  finish_velocity(part.end);
  std::swap(carrier, carrier_end);
  std::swap(void_fraction, void_fraction_end);
  account(part, load);
  std::swap(divergence_before, divergence_now);
  std::swap(rates_before, rates);
  dt_before = part.dt;
}

/// What the grains feel, and the forces on the gas; see README.md for what counts as which.
void GasFlow::Parts::account(const Part& part, const GasLoad& load) {
  const double weight = grid.cell_volume() * part.share;
  const auto forces_at = [&](int axis, std::int64_t at) -> ForceRow {
    const std::size_t a = index(axis);
    return {layout.stride(axis),  inverse_spacing[a],
            mean_gradient(axis),  gas.density,
            part.weights,         is_model_a(),
            rates[a].data() + at, rates_before[a].data() + at,
            pressure.data() + at, load.void_fraction.data() + at};
  };
  std::vector<std::array<ExactSum, 6>> sums(static_cast<std::size_t>(ranks.n_threads));
  together([&](const Team& team) {
    const int thread = team.thread;
    auto& mine = sums[index(thread)];
    for (int axis = 0; axis < n_axes; ++axis) {
      const std::size_t a = index(axis);
      for_each_row_around(thread, 0, 0, [&](int j, int k) {
        const std::int64_t at = layout.at(0, j, k);
        const CellSums row = add_cell_means(
            layout.size[0],
            {layout.stride(axis), inverse_spacing[a], mean_gradient(axis), part.share, velocity[a].data() + at,
             pressure.data() + at, load.void_fraction.data() + at, load.exchange.data() + at,
             load.exchange_velocity[a].data() + at, cell_velocity[a].data() + at, cell_gradient[a].data() + at});
        const double reaction = is_model_a() ? weight * row.reaction : 0.0;
        mine[a + 3].add(weight * row.drag);
        mine[a + 3].add(reaction);
        mine[a].add(-reaction);
      });
      const auto range = inner_faces(axis);
      for_each_row(thread, range[1], range[2], [&](int j, int k) {
        mine[a].add(weight * sum_of_forces(range[0][1] - range[0][0], forces_at(axis, layout.at(range[0][0], j, k))));
      });
    }
    for (const BoundarySurface& surface : boundaries.surfaces()) {
      const std::size_t a = index(surface.axis);
      for_each_boundary_face(surface, team, [&](const BoundaryFace& boundary, std::int64_t f, std::int64_t c) {
        const double force = boundary.kind == Kind::pressure ? sum_of_forces(1, forces_at(surface.axis, f))
                                                             : load.exchange.data()[c] * velocity[a].data()[f] -
                                                                   load.exchange_velocity[a].data()[c];
        mine[a].add(0.5 * weight * force);
      });
    }
  });
  for (const auto& of_thread : sums)
    for (std::size_t a = 0; a < 3; ++a) boundary_force[a].add(of_thread[a]), drag[a].add(of_thread[a + 3]);
}

/// `weight` times the momentum of the gas [N s] of this rank; or only of the half cells at faces with given velocity.
void GasFlow::Parts::add_momentum(double weight, bool is_everywhere, std::array<ExactSum, 3>& sums) const {
  const double factor = weight * gas.density * grid.cell_volume();
  const auto at_face = [&](std::size_t a, std::int64_t f, std::int64_t s) {
    return 0.5 * (carrier.data()[f] + carrier.data()[f - s]) * velocity[a].data()[f];
  };
  sum_up(sums, [&](const Team& team, std::array<ExactSum, 3>& mine) {
    for (int a = 0; is_everywhere && a < n_axes; ++a) {
      const auto range = inner_faces(a);
      for_each_row(team.thread, range[1], range[2], [&](int j, int k) {
        double sum = 0.0;
        for (std::int64_t f = layout.at(range[0][0], j, k), end = layout.at(range[0][1], j, k); f < end; ++f)
          sum += at_face(index(a), f, layout.stride(a));
        mine[index(a)].add(factor * sum);
      });
    }
    for (const BoundarySurface& surface : boundaries.surfaces())
      for_each_boundary_face(surface, team, [&](const BoundaryFace& boundary, std::int64_t f, std::int64_t) {
        if (is_everywhere || boundary.kind != Kind::pressure)
          mine[index(surface.axis)].add(0.5 * factor * at_face(index(surface.axis), f, layout.stride(surface.axis)));
      });
  });
}

/// [1/s] largest Courant number of a cell per time, with what flows in at `time`; of all ranks.
double GasFlow::Parts::courant_rate(double time) const {
  std::vector<double> largest(static_cast<std::size_t>(ranks.n_threads), 0.0);
  parallel(ranks.n_threads, [&](int thread) {
    double most = 0.0;
    for_each_row_around(thread, 0, 0, [&](int j, int k) {
      const std::int64_t at = layout.at(0, j, k);
      for (std::int64_t c = at; c < at + layout.size[0]; ++c) {
        double sum = 0.0;
        for (std::size_t a = 0; a < static_cast<std::size_t>(n_axes); ++a) {
          const double* const u = velocity[a].data() + c;
          sum += std::max(std::abs(u[0]), std::abs(u[layout.stride(static_cast<int>(a))])) * inverse_spacing[a];
        }
        most = std::max(most, sum);
      }
    });
    largest[static_cast<std::size_t>(thread)] = most;
  });
  double most = *std::max_element(largest.begin(), largest.end());
  for (const BoundarySurface& surface : boundaries.surfaces())
    for_each_boundary_face(surface, {}, [&](const BoundaryFace& face, std::int64_t, std::int64_t cell) {
      if (face.kind != Kind::velocity) return;
      const double factor = std::abs(boundaries.ramp(face.entry, time)) / void_fraction.data()[cell];
      double sum = 0.0;
      for (int a = 0; a < n_axes; ++a) sum += std::abs(face.velocity[a]) * inverse_spacing[index(a)];
      most = std::max(most, factor * sum);
    });
  ranks.world.max(std::span(&most, 1));
  return most;
}

int GasFlow::Parts::n_parts_for(double fastest, double left, double step) const {
  const double viscous = viscous_parts(gas, grid, left);
  const double n = std::max({1.0, fastest * left / most_courant, viscous});
  if (!(n < most_gas_parts)) {
    std::ostringstream message;
    message << "the gas is too " << (viscous == n ? "viscous" : "fast") << " for its cells: a gas step of " << step
            << " s would have to be divided into " << n << " parts; choose "
            << (viscous == n ? "larger cells, or a smaller gas.step and patience"
                             : "a smaller gas.step or larger cells, or a ramp for gas that enters");
    throw GasError(message.str());
  }
  return static_cast<int>(std::ceil(n));
}

/// From a bound of the fastest decay by friction.
double viscous_parts(const Gas& gas, const GasGrid& grid, double step) {
  double sum = 0.0, most = 0.0;
  for (int a = 0; a < (grid.is_flat ? 2 : 3); ++a) {
    const double square = 1.0 / (grid.spacing[a] * grid.spacing[a]);
    sum += square;
    most = std::max(most, square);
  }
  return 4.0 * gas.viscosity / gas.density * (sum + most) * step / most_viscous;
}

GasFlow::GasFlow(const Gas& gas, Vec3, const GasGrid& grid, const GasRanks& ranks)
    : parts_(std::make_unique<Parts>(gas, grid, ranks)) {}
GasFlow::~GasFlow() = default;
GasFlow::GasFlow(GasFlow&&) noexcept = default;
GasFlow& GasFlow::operator=(GasFlow&&) noexcept = default;

GasLoad GasFlow::empty_load() const {
  const GridLayout& layout = parts_->layout;
  return {
      GridField<>(layout, 1.0), GridField<>(layout), {GridField<>(layout), GridField<>(layout), GridField<>(layout)}};
}

GasReport GasFlow::advance(double time, double step, GasLoad& load) {
  Parts& p = *parts_;
  GasReport report;
  p.take(load);
  p.clear_means();
  const double emptiest = p.least_void_fraction(load), tolerance = p.gas.tolerance * emptiest / step;
  if (!p.has_started) p.start(time, step, tolerance, load, report);
  p.for_all_values([&](Range range) {
    std::copy_n(p.void_fraction.data() + range.begin, range.size(), p.void_fraction_start.data() + range.begin);
  });
  p.add_momentum(-1.0 / step, false, p.boundary_force);

  double fastest = p.courant_rate(time + step), left = step;
  int n_left = p.n_parts_for(fastest, left, step);
  double dt = step / n_left;
  for (;;) {
    left = n_left == 1 ? 0.0 : left - dt;
    Parts::Part part{dt, time + (step - left), dt / step, 1.0 - left / step, {}, tolerance};
    if (p.dt_before > 0.0 && dt <= most_growth * p.dt_before)
      part.weights = {1.0 + 0.5 * dt / p.dt_before, -0.5 * dt / p.dt_before};
    p.advance_part(part, load, report);
    report.courant = std::max(report.courant, fastest * dt);
    ++report.n_parts;
    if (--n_left == 0) break;
    fastest = p.courant_rate(time + step);
    if (fastest * dt > bearable_courant) {
      n_left = std::max(n_left, p.n_parts_for(fastest, left, step));
      dt = left / n_left;
    }
  }
  p.add_momentum(1.0 / step, false, p.boundary_force);
  report.imbalance /= emptiest;
  return report;
}

const GridField<>& GasFlow::velocity(int axis) const { return parts_->velocity[index(axis)]; }
const GridField<>& GasFlow::pressure() const { return parts_->pressure; }
const GridField<>& GasFlow::void_fraction() const { return parts_->void_fraction; }
const GridField<>& GasFlow::cell_velocity(int axis) const { return parts_->cell_velocity[index(axis)]; }
const GridField<>& GasFlow::cell_pressure_gradient(int axis) const { return parts_->cell_gradient[index(axis)]; }

OpenCell GasFlow::worst_cell() const { return parts_->solver.worst_cell(); }

std::vector<GasFlow::Kept> GasFlow::kept() {
  Parts& p = *parts_;
  std::vector<Kept> all{{"gas_pressure", "Pa", -1, &p.pressure},
                        {"gas_void_fraction", "1", -1, &p.void_fraction},
                        {"gas_carrier", "1", -1, &p.carrier},
                        {"gas_carrier_drift", "1", -1, &p.drift},
                        {"gas_divergence", "1/s", -1, &p.divergence_before}};
  static constexpr const char* velocities[3] = {"gas_velocity_x", "gas_velocity_y", "gas_velocity_z"};
  static constexpr const char* rates[3] = {"gas_rate_x", "gas_rate_y", "gas_rate_z"};
  for (int a = 0; a < p.n_axes; ++a) {
    all.push_back({velocities[a], "m/s", a, &p.velocity[index(a)]});
    all.push_back({rates[a], "m/s2", a, &p.rates_before[index(a)]});
  }
  return all;
}

std::vector<double> GasFlow::kept_numbers() const {
  return {parts_->has_started ? 1.0 : 0.0, parts_->dt_before, parts_->boundary_time};
}

void GasFlow::restore(const std::vector<double>& numbers) {
  Parts& p = *parts_;
  p.has_started = numbers.at(0) != 0.0;
  p.dt_before = numbers.at(1);
  p.boundary_time = numbers.at(2);
  p.load_halo.exchange(
      {p.pressure.data(), p.void_fraction.data(), p.carrier.data(), p.divergence_before.data(), p.drift.data()});
  GridField<>* const cells[] = {&p.void_fraction, &p.carrier, &p.drift};
  p.boundaries.mirror(cells, {});
  p.exchange_velocity();
  p.boundaries.extend(p.void_fraction, p.boundary_time, p.velocity, {});
  p.boundaries.extend_pressure(p.pressure, 1.0, {});
}

GasFlow::Budget GasFlow::budget() const {
  const Parts& p = *parts_;
  const std::size_t n_entries = p.gas.boundaries.size();
  std::vector<ExactSum> sums(n_entries + 9);
  for (const BoundarySurface& surface : p.boundaries.surfaces()) {
    const double area = p.grid.cell_volume() * p.inverse_spacing[index(surface.axis)];
    const double inwards = (surface.is_high ? -1.0 : 1.0) * p.gas.density * area;
    p.for_each_boundary_face(surface, {}, [&](const BoundaryFace& face, std::int64_t f, std::int64_t cell) {
      if (face.entry >= 0)
        sums[static_cast<std::size_t>(face.entry)].add(
            inwards * (p.void_fraction.data()[cell] * p.velocity[index(surface.axis)].data()[f]));
    });
  }
  std::array<ExactSum, 3> momentum;
  p.add_momentum(1.0, true, momentum);
  for (std::size_t a = 0; a < 3; ++a) {
    sums[n_entries + a] = momentum[a];
    sums[n_entries + 3 + a] = p.boundary_force[a];
    sums[n_entries + 6 + a] = p.drag[a];
  }
  total(p.ranks.world, sums);
  Budget result;
  for (std::size_t e = 0; e < n_entries; ++e) result.inflow.push_back(sums[e].value());
  const auto vector = [&](std::size_t first) {
    return Vec3{sums[first].value(), sums[first + 1].value(), sums[first + 2].value()};
  };
  result.momentum = vector(n_entries);
  result.boundary_force = vector(n_entries + 3);
  result.drag = vector(n_entries + 6);
  return result;
}

std::size_t GasFlow::memory() const {
  const Parts& p = *parts_;
  std::size_t bytes = 0;
  for (const Fields* fields : {&p.velocity, &p.rates_before, &p.flux, &p.rates, &p.coefficient, &p.mobility,
                               &p.cell_velocity, &p.cell_gradient})
    for (const GridField<>& field : *fields) bytes += field.bytes();
  for (const GridField<>* field :
       {&p.pressure, &p.void_fraction, &p.carrier, &p.drift, &p.divergence_before, &p.void_fraction_start,
        &p.void_fraction_end, &p.carrier_end, &p.divergence_now, &p.change, &p.source})
    bytes += field->bytes();
  return bytes;
}

}  // namespace moraine
