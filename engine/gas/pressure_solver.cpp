#include "engine/gas/pressure_solver.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "comm/grid_halo.hpp"
#include "comm/totals.hpp"
#include "engine/gas/multigrid.hpp"
#include "engine/gas/team.hpp"
#include "engine/gas/wave.hpp"
#include "engine/particles/aligned_array.hpp"
#include "kernels/base/exact_sum.hpp"
#include "kernels/gas/pressure.hpp"

namespace moraine {

namespace {

/// The power of two that brings `size` to between 1 and 2; 1 where it cannot.
double scale_to_one(double size) {
  return size > 0.0 && std::isfinite(size) ? std::ldexp(1.0, -std::clamp(std::ilogb(size), -1000, 1000)) : 1.0;
}

template <typename T>
void allocate(AlignedArray<T>& values, std::int64_t n) {
  values.resize_discarding(static_cast<std::size_t>(n));
  std::fill(values.begin(), values.end(), T{});
}

}  // namespace

struct PressureSolver::Parts {
  Parts(const GasGrid& grid, const GasRanks& ranks);

  /// Sums are of rows, exact; so they do not depend on who adds them up.
  struct alignas(64) Reduced {
    ExactSum sum;
    double most = 0.0;
  };
  /// What a thread has found, into that of all threads and ranks.
  struct Result {
    double sum, most;
  };
  Result reduce(Team team, const ExactSum& sum, double most, bool has_sum, bool has_most);

  template <typename Work>
  void for_rows(Team team, Work work) const {
    const Range range = team.share(std::int64_t{rows.n(1)} * rows.n(2));
    for (std::int64_t row = range.begin; row < range.end; ++row)
      work(static_cast<int>(row % rows.n(1)), static_cast<int>(row / rows.n(1)));
  }
  template <typename Work>
  Result sum_rows(Team team, Work value_of_row);

  /// Faces along an axis that this rank sets: those at the end of the domain too.
  std::array<int, 3> faces(std::size_t axis) const;
  bool is_wrapped_onto_itself(std::size_t axis) const { return ranks.share.periodic[axis] && ranks.share.n[axis] == 1; }

  void find_scale(const std::array<const GridField<double>*, 3>& coefficients, Team team);
  void fill_weights(const std::array<const GridField<double>*, 3>& coefficients, Team team);
  void load(const GridField<double>& b, const GridField<double>& p, Team team);
  void subtract_mean(AlignedArray<double>& values, Team team);
  void exchange_doubles(AlignedArray<double>& values, Team team);
  double turn(float scale_of_z, float beta, Team team);
  /// Result of a solve as each thread knows it, in the scaled unit.
  PressureReport iterate(double tolerance, int max_iterations, Team team);

  GasRanks ranks;
  CellBlock block;
  std::array<double, 3> inverse_square{};  // [1/m2] of the spacing
  Multigrid multigrid;
  SplitRows rows;
  std::array<AlignedArray<double>, 3> weights;  // c/h^2 times scale
  AlignedArray<double> x, r, q;
  AlignedArray<float> d;
  GridHalo weights_halo, doubles_halo, floats_halo, pressure_halo;
  double scale = 1.0;        // a power of two: weights are at most about one
  bool is_free = true;       // by a constant: no outlet
  std::int64_t n_cells = 0;  // with any weight, of all ranks
  std::vector<Reduced> partials;
  Result result{};

  FaceWeights<double> face_weights() const { return {weights[0].data(), weights[1].data(), weights[2].data()}; }
  MultigridLevel& finest() { return multigrid.finest(); }
  int n_threads() { return finest().n_threads; }  // small grids have one
};

PressureSolver::Parts::Parts(const GasGrid& grid, const GasRanks& gas_ranks)
    : ranks(gas_ranks),
      block(gas_ranks.block()),
      inverse_square{1.0 / (grid.spacing.x * grid.spacing.x), 1.0 / (grid.spacing.y * grid.spacing.y),
                     1.0 / (grid.spacing.z * grid.spacing.z)},
      multigrid(gas_ranks.world, gas_ranks.share, GridCells::uniform(grid.n, grid.spacing), gas_ranks.n_threads),
      rows(multigrid.finest().rows),
      partials(static_cast<std::size_t>(n_threads())) {
  for (auto& w : weights) allocate(w, rows.n_values());
  for (auto* values : {&x, &r, &q}) allocate(*values, rows.n_values());
  allocate(d, rows.n_values());
  const GridShare rows_share = share_of_rows(ranks.share);
  weights_halo = GridHalo(ranks.world, rows_share, 1, 3, sizeof(double));
  doubles_halo = GridHalo(ranks.world, rows_share, 1, 1, sizeof(double));
  floats_halo = GridHalo(ranks.world, rows_share, 1, 1, sizeof(float));
  pressure_halo = GridHalo(ranks.world, ranks.share, gas_ghosts, 1, sizeof(double));
}

PressureSolver::Parts::Result PressureSolver::Parts::reduce(Team team, const ExactSum& sum, double most, bool has_sum,
                                                            bool has_most) {
  Reduced& own = partials[static_cast<std::size_t>(team.thread)];
  own.sum = sum;
  own.most = most;
  team.sync();
  if (team.is_first()) {
    for (std::size_t t = 1; t < static_cast<std::size_t>(team.n); ++t) {
      if (has_sum) own.sum.add(partials[t].sum);
      own.most = std::max(own.most, partials[t].most) + 0.0 * partials[t].most;
    }
    result = {0.0, own.most};
    if (has_sum) result.sum = total(ranks.world, own.sum);
    if (has_most) ranks.world.max(std::span(&result.most, 1));
  }
  team.sync();
  return result;
}

template <typename Work>
PressureSolver::Parts::Result PressureSolver::Parts::sum_rows(Team team, Work value_of_row) {
  ExactSum sum;
  for_rows(team, [&](int j, int k) { sum.add(value_of_row(rows.at(j, k))); });
  return reduce(team, sum, 0.0, true, false);
}

std::array<int, 3> PressureSolver::Parts::faces(std::size_t axis) const {
  std::array<int, 3> n{rows.n(0), rows.n(1), rows.n(2)};
  if (block.high[axis] == ranks.share.n[axis] && !ranks.share.periodic[axis]) ++n[axis];
  return n;
}

void PressureSolver::Parts::find_scale(const std::array<const GridField<double>*, 3>& coefficients, Team team) {
  double most = 0.0, most_at_end = 0.0;  // of all faces, of those at an end of the domain
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (is_wrapped_onto_itself(axis)) continue;
    const std::array<int, 3> n = faces(axis);
    const GridField<double>& c = *coefficients[axis];
    const Range range = team.share(std::int64_t{n[1]} * n[2]);
    for (std::int64_t row = range.begin; row < range.end; ++row) {
      const int j = static_cast<int>(row % n[1]), k = static_cast<int>(row / n[1]);
      const double* const from = c.data() + c.layout().at(0, j, k);
      const double of_row = inverse_square[axis] * *std::max_element(from, from + n[0]);
      most = std::max(most, of_row);
      if (ranks.share.periodic[axis]) continue;
      const int face = block.low[axis] + (axis == 1 ? j : k);
      if (axis == 0)
        most_at_end = std::max({most_at_end, from[0], from[rows.n(0)]});
      else if (face == 0 || face == ranks.share.n[axis])
        most_at_end = std::max(most_at_end, of_row);
    }
  }
  most = reduce(team, {}, most, false, true).most;
  most_at_end = reduce(team, {}, most_at_end, false, true).most;
  if (team.is_first()) {
    scale = scale_to_one(most);
    is_free = most_at_end == 0.0;
  }
  team.sync();
}

void PressureSolver::Parts::fill_weights(const std::array<const GridField<double>*, 3>& coefficients, Team team) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (is_wrapped_onto_itself(axis)) continue;
    const std::array<int, 3> n = faces(axis);
    const GridField<double>& c = *coefficients[axis];
    const double factor = inverse_square[axis] * scale;
    const Range range = team.share(std::int64_t{n[1]} * n[2]);
    for (std::int64_t row = range.begin; row < range.end; ++row) {
      const int j = static_cast<int>(row % n[1]), k = static_cast<int>(row / n[1]);
      double* const to = weights[axis].data() + rows.at(j, k);
      const double* const from = c.data() + c.layout().at(0, j, k);
      split_row(rows, from, factor, to);
      if (n[0] > rows.n(0)) to[rows.in_row(rows.n(0))] = factor * from[rows.n(0)];
      if (axis == 0 && ranks.share.periodic[0]) wrap_row(rows, to);
      round_weights(rows, to, finest().weights[axis].data() + rows.at(j, k));
    }
  }
  team.sync();
  if (team.is_first()) weights_halo.exchange({weights[0].data(), weights[1].data(), weights[2].data()});
  team.sync();
  multigrid.set(team);
  std::int64_t count = 0;
  for_rows(team, [&](int j, int k) {
    const float* const inverse = finest().inverse.data() + rows.at(j, k);
    count += std::count_if(inverse, inverse + rows.row(), [](float value) { return value > 0.0F; });
  });
  ExactSum sum;
  sum.add(static_cast<double>(count));
  const double all = reduce(team, sum, 0.0, true, false).sum;
  if (team.is_first()) n_cells = static_cast<std::int64_t>(all);
}

void PressureSolver::Parts::subtract_mean(AlignedArray<double>& values, Team team) {
  const double sum = sum_rows(team, [&](std::int64_t row) {
                       shift_row(rows, 0.0, finest().inverse.data() + row, values.data() + row);
                       return sum_row(rows, values.data() + row);
                     }).sum;
  if (n_cells == 0) return;
  for_rows(team, [&](int j, int k) {
    const std::int64_t row = rows.at(j, k);
    shift_row(rows, -sum / static_cast<double>(n_cells), finest().inverse.data() + row, values.data() + row);
  });
}

void PressureSolver::Parts::exchange_doubles(AlignedArray<double>& values, Team team) {
  team.sync();
  if (!finest().has_halo) return;
  if (team.is_first()) doubles_halo.exchange({values.data()});
  team.sync();
}

/// r = b - A p with its sign turned, as everything here: M = -A.
void PressureSolver::Parts::load(const GridField<double>& b, const GridField<double>& p, Team team) {
  for_rows(team, [&](int j, int k) {
    const std::int64_t row = rows.at(j, k);
    const float* const inverse = finest().inverse.data() + row;
    split_row(rows, b.data() + b.layout().at(0, j, k), -scale, r.data() + row);
    split_row(rows, p.data() + p.layout().at(0, j, k), 1.0, x.data() + row);
    shift_row(rows, 0.0, inverse, r.data() + row);
    shift_row(rows, 0.0, inverse, x.data() + row);
    if (ranks.share.periodic[0]) wrap_row(rows, x.data() + row);
  });
  if (is_free) subtract_mean(r, team);
  exchange_doubles(x, team);
  for_rows(team, [&](int j, int k) {
    const std::int64_t row = rows.at(j, k);
    apply_operator(rows, row, face_weights(), x.data(), q.data());
    subtract_row(rows, q.data() + row, r.data() + row);
  });
}

/// Preconditioned conjugate gradients (Hestenes & Stiefel 1952; the cycle in float as in Strzodka & Goeddeke 2006). The residual goes to the
/// cycle divided by its size, a power of two, so that nothing vanishes in float; `unit` is what the first one was divided by.
PressureReport PressureSolver::Parts::iterate(double tolerance, int max_iterations, Team team) {
  double most = 0.0;
  for_rows(team, [&](int j, int k) {
    const double of_row = largest(rows, r.data() + rows.at(j, k));
    most = std::max(most, of_row) + 0.0 * of_row;  // what is not finite stays
  });
  most = reduce(team, {}, most, false, true).most;
  PressureReport report;
  // The cycle gets the residual times `size`, a power of two that belongs to the residual of one step before.
  const double unit = scale_to_one(most);
  double size = unit, previous = 0.0;
  for_rows(team,
           [&](int j, int k) { scale_row(rows, size, r.data() + rows.at(j, k), finest().r.data() + rows.at(j, k)); });
  for (;;) {
    report.residual = most;
    report.is_converged = most <= tolerance;
    if (report.is_converged || report.iterations >= max_iterations || !std::isfinite(most)) return report;
    team.sync();
    ExactSum product;
    multigrid.cycle(team, product);
    const double to_unit = unit / size;
    const double along = to_unit / size * reduce(team, product, 0.0, true, false).sum;
    if (!(along > 0.0) || !std::isfinite(along)) return report;
    const double beta = report.iterations == 0 ? 0.0 : along / previous;
    previous = along;
    const double curvature = turn(static_cast<float>(to_unit), static_cast<float>(beta), team);
    if (!(curvature > 0.0) || !std::isfinite(curvature)) return report;
    const double alpha = along / curvature;
    size = scale_to_one(most);
    most = 0.0;
    for_rows(team, [&](int j, int k) {
      const std::int64_t row = rows.at(j, k);
      const double of_row = step_row(rows, alpha, size, d.data() + row, q.data() + row, x.data() + row, r.data() + row,
                                     finest().r.data() + row);
      most = std::max(most, of_row) + 0.0 * of_row;
    });
    most = reduce(team, {}, most, false, true).most;
    ++report.iterations;
  }
}

/// d = scale z + beta d, q = M d; d q.
double PressureSolver::Parts::turn(float scale_of_z, float beta, Team team) {
  ExactSum product;
  const auto turn_one = [&](int j, int k) {
    const std::int64_t row = rows.at(j, k);
    turn_row(rows, scale_of_z, beta, finest().z.data() + row, d.data() + row);
  };
  const auto apply_one = [&](int j, int k) {
    const std::int64_t row = rows.at(j, k);
    apply_operator(rows, row, face_weights(), d.data(), q.data());
    product.add(dot_row(rows, q.data() + row, d.data() + row));
  };
  if (finest().wave_axis > 0 && is_thick_enough(finest().n_planes(), 2, team.n)) {
    wave(finest().n_planes(), 2, team, [&](int stage, int at) {
      if (stage == 1) return finest().for_plane(at, apply_one);
      finest().for_plane(at, turn_one);
      finest().wrap_plane(d.data(), at);
    });
  } else {
    for_rows(team, turn_one);
    team.sync();
    if (finest().has_halo && team.is_first()) floats_halo.exchange({d.data()});
    team.sync();
    for_rows(team, apply_one);
  }
  return reduce(team, product, 0.0, true, false).sum;
}

PressureSolver::PressureSolver(const GasGrid& grid, const GasRanks& ranks)
    : parts_(std::make_unique<Parts>(grid, ranks)) {}
PressureSolver::~PressureSolver() = default;
PressureSolver::PressureSolver(PressureSolver&&) noexcept = default;
PressureSolver& PressureSolver::operator=(PressureSolver&&) noexcept = default;

void PressureSolver::set(const std::array<const GridField<double>*, 3>& coefficients) {
  const int n_threads = parts_->n_threads();
  parallel(n_threads, [&](int thread) {
    const Team team{thread, n_threads};
    parts_->find_scale(coefficients, team);
    parts_->fill_weights(coefficients, team);
  });
}

PressureReport PressureSolver::solve(const GridField<double>& b, GridField<double>& p, double tolerance,
                                     int max_iterations) {
  Parts& s = *parts_;
  const int n_threads = s.n_threads();
  PressureReport report;
  parallel(n_threads, [&](int thread) {
    const Team team{thread, n_threads};
    s.load(b, p, team);
    const PressureReport own = s.iterate(tolerance * s.scale, max_iterations, team);
    if (s.is_free) s.subtract_mean(s.x, team);
    s.for_rows(
        team, [&](int j, int k) { join_row(s.rows, s.x.data() + s.rows.at(j, k), p.data() + p.layout().at(0, j, k)); });
    if (team.is_first()) report = own;
  });
  s.pressure_halo.exchange({p.data()});
  report.residual /= s.scale;
  return report;
}

OpenCell PressureSolver::worst_cell() const {
  const Parts& s = *parts_;
  OpenCell worst;
  std::vector<double> plain(static_cast<std::size_t>(s.rows.row()));
  for (int k = 0; k < s.rows.n(2); ++k)
    for (int j = 0; j < s.rows.n(1); ++j) {
      join_row(s.rows, s.r.data() + s.rows.at(j, k), plain.data());
      for (int i = 0; i < s.rows.n(0); ++i)
        if (const double residual = std::abs(plain[static_cast<std::size_t>(i)]) / s.scale; residual > worst.residual)
          worst = {{i, j, k}, residual};
    }
  return worst;
}

}  // namespace moraine
