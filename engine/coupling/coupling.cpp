#include "engine/coupling/coupling.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <exception>
#include <optional>

#include "comm/totals.hpp"
#include "engine/coupling/cell_exchange.hpp"
#include "engine/coupling/grain_sums.hpp"
#include "engine/coupling/smoothing.hpp"
#include "engine/threads.hpp"

namespace moraine {

namespace {

/// Blocks of the gas are not cut smaller than this; cuts keep to what the coarse levels of its solver like.
constexpr std::int64_t least_cells = 8192;
constexpr int cut_alignment = 8;

/// The scale of a deposit: the power of two at which sums of n values up to `largest` stay below 2^62, and each below 2^50.
double scale_for(double largest, std::int64_t n) {
  if (!(largest > 0.0)) return 1.0;
  const int bits = std::min(50, 62 - static_cast<int>(std::bit_width(static_cast<std::uint64_t>(n))));
  int exponent = 0;
  std::frexp(largest, &exponent);
  return std::ldexp(1.0, bits - exponent);
}

}  // namespace

GridShare gas_share(const GasGrid& grid, int n_ranks) {
  return share_out(grid.n, grid.periodic, n_ranks, least_cells, cut_alignment);
}

// Of what is largest and how many, windows included; of coefficients; of what only the gas knows; of what was given and got.
int coupling_reductions(const Gas& gas) {
  if (!gas.drag) return 2;
  return gas.moves_gas ? 7 : 6;
}

struct Coupling::Parts {
  Parts(const Scene& scene, const GasGrid& gas_grid, const World& all, int threads);

  void start_gas();
  CouplingReport advance(Particles& particles, double time, double step);
  void look(const Particles& particles);
  void load_void_fractions(CouplingReport& report);
  void send_slip();
  void set_coefficients(double step, CouplingReport& report);
  void load_exchange();
  void send_feel();
  void share(CouplingReport& report);
  void feel(Particles& particles, CouplingReport& report);
  std::array<double, 3> gas_loss();
  /// [kg/m3] of what the motion of grains carries along: they feel its inertia in the pressure gradient.
  double carried_density() const { return gas.model == GasModel::a && gas.moves_gas ? gas.density : 0.0; }
  /// Calls f(line of the block, j, k) for all lines along x of this rank's block, on all threads.
  template <typename Function>
  void each_line(Function f) const;
  std::vector<double*> fields(std::size_t first, std::size_t n);

  Gas gas;
  Vec3 gravity;
  GasGrid grid;
  World world;
  int n_threads = 1;
  GridShare blocks;
  CellBlock block;
  std::optional<GasRanks> ranks;
  std::unique_ptr<GasFlow> flow;
  GasLoad load;
  GrainSums grains;
  CellExchange exchange;
  std::optional<Smoothing> smoothing;

  // of the cells of this rank's block, x fastest, without ghosts
  AlignedArray<std::int64_t> block_sums;  // as deposited
  AlignedArray<double> block_fields;      // up to six fields, one after the other
  AlignedArray<double> block_cells;       // values of a cell together, as they are sent
  AlignedArray<double> window_cells;      // the same of the window

  // of the present gas step, the same on all ranks
  std::int64_t n_grains = 0;
  double largest_volume = 0.0;  // [m3]
  ExchangeExtent largest;
  double fastest_gas = 0.0;  // [m/s] largest component at a cell
};

Coupling::Parts::Parts(const Scene& scene, const GasGrid& gas_grid, const World& all, int threads)
    : gas(scene.gas.value()),
      gravity(scene.time.gravity),
      grid(gas_grid),
      world(all),
      n_threads(threads),
      blocks(gas_share(grid, world.size())),
      block(blocks.block(world.rank())),
      grains(CellWeights(gas.weights, grid.n, grid.low, grid.spacing, grid.periodic), grid.is_flat, threads),
      exchange(world, blocks, threads) {
  start_gas();
  if (!gas.drag) return;
  const auto n_cells = static_cast<std::size_t>(block.is_empty() ? 0 : block.n_cells());
  block_sums.resize_discarding(4 * n_cells);
  block_fields.resize_discarding(6 * n_cells);
  block_cells.resize_discarding(8 * n_cells);
}

/// Where the boundaries cannot be, the ranks of the gas say so; those without gas must not go on and wait for them.
void Coupling::Parts::start_gas() {
  std::exception_ptr failure;
  if (const std::optional<World> of_gas = world.first(blocks.n_ranks())) {
    ranks = GasRanks{*of_gas, blocks, n_threads};
    try {
      flow = std::make_unique<GasFlow>(gas, gravity, grid, *ranks);
      load = flow->empty_load();
    } catch (const SceneError&) {
      failure = std::current_exception();
    }
    if (gas.drag && gas.weights == GasWeights::smoothed && gas.smoothing > 0.0)
      smoothing.emplace(grid, *ranks, gas.smoothing);
  }
  std::array<double, 1> has_failed = {failure ? 1.0 : 0.0};
  world.max(has_failed);
  if (failure) std::rethrow_exception(failure);
  if (has_failed[0] > 0.0)
    throw SceneError(
        std::vector<Problem>{Problem{"gas.boundary", "cannot be as they are: see what the first rank says"}});
}

template <typename Function>
void Coupling::Parts::each_line(Function f) const {
  if (block.is_empty()) return;
  parallel(n_threads, [&](int thread) {
    const Range lines = share_of(std::int64_t{block.size(1)} * block.size(2), thread, n_threads);
    for (std::int64_t line = lines.begin; line < lines.end; ++line)
      f(line, static_cast<int>(line % block.size(1)), static_cast<int>(line / block.size(1)));
  });
}

std::vector<double*> Coupling::Parts::fields(std::size_t first, std::size_t n) {
  std::vector<double*> pointers;
  const auto n_cells = static_cast<std::size_t>(block.n_cells());
  for (std::size_t f = first; f < first + n; ++f) pointers.push_back(block_fields.data() + f * n_cells);
  return pointers;
}

CouplingReport Coupling::Parts::advance(Particles& particles, double time, double step) {
  CouplingReport report;
  if (gas.drag) {
    look(particles);
    if (gas.moves_gas) load_void_fractions(report);
    send_slip();
    set_coefficients(step, report);
    if (gas.moves_gas) load_exchange();
  }
  if (flow) {
    const double start = threads::now();
    report.gas = flow->advance(time, step, load);
    report.flow_seconds = threads::now() - start;
  }
  if (gas.drag) send_feel();
  share(report);
  if (gas.drag) {
    feel(particles, report);
  } else if (double* const acceleration = particles.gas_acceleration()) {
    std::fill(acceleration, acceleration + 3 * std::int64_t{particles.size()}, 0.0);
  }
  return report;
}

/// Where the grains are, how many and how large of all ranks, and windows that hold them.
void Coupling::Parts::look(const Particles& particles) {
  const GrainExtent extent = grains.look(particles);
  constexpr double four_thirds_pi = 4.188790204786390985;
  const double r = extent.largest_radius;
  std::array<double, 2> largest_of = {four_thirds_pi * r * r * r, exchange.fits(grains.needed()) ? 0.0 : 1.0};
  world.max(largest_of);
  std::array<std::int64_t, 1> n = {extent.n};
  world.sum(std::span<std::int64_t>(n));
  largest_volume = largest_of[0];
  n_grains = n[0];
  if (largest_of[1] > 0.0) {
    exchange.open(grains.needed());
    window_cells.resize_discarding(static_cast<std::size_t>(8 * exchange.window().n_cells()));
  }
}

void Coupling::Parts::load_void_fractions(CouplingReport& report) {
  // the largest volume may be a rounding away from the largest deposit
  const double scale = scale_for(1.000001 * largest_volume, n_grains), to_share = 1.0 / (scale * grid.cell_volume());
  std::fill(block_sums.begin(), block_sums.end(), 0);
  exchange.to_owners(1, grains.volumes(exchange.window(), scale), block_sums.data());
  const std::int64_t nx = block.size(0);
  each_line([&](std::int64_t line, int, int) {
    for (std::int64_t c = line * nx; c < (line + 1) * nx; ++c)
      block_fields.data()[c] = static_cast<double>(block_sums.data()[c]) * to_share;
  });
  if (smoothing) smoothing->apply(fields(0, 1));

  std::vector<double> least(static_cast<std::size_t>(block.is_empty() ? 0 : block.size(1) * block.size(2)), 1.0);
  std::vector<std::uint64_t> floored(least.size(), 0);
  each_line([&](std::int64_t line, int j, int k) {
    double* const eps = &load.void_fraction(0, j, k);
    const double* const solid = block_fields.data() + line * nx;
    for (std::int64_t i = 0; i < nx; ++i) {
      const double there = 1.0 - solid[i];
      least[static_cast<std::size_t>(line)] = std::min(least[static_cast<std::size_t>(line)], there);
      floored[static_cast<std::size_t>(line)] += there < gas.least_void_fraction ? 1 : 0;
      eps[i] = std::max(there, gas.least_void_fraction);
    }
  });
  for (std::size_t line = 0; line < least.size(); ++line) {
    report.least_void_fraction = std::min(report.least_void_fraction, least[line]);
    report.n_floored += floored[line];
  }
}

/// Void fraction, and the gas velocity as the last step left it (which a restart knows), to all grains.
void Coupling::Parts::send_slip() {
  const std::int64_t nx = block.size(0), n_cells = block.is_empty() ? 0 : block.n_cells();
  each_line([&](std::int64_t line, int j, int k) {
    for (int axis = 0; axis < 3; ++axis) {
      const GridField<>& velocity = flow->velocity(axis);
      const double* const low = velocity.data() + velocity.layout().at(0, j, k);
      const double* const high = low + velocity.layout().stride(axis);
      double* const mean = block_fields.data() + axis * n_cells + line * nx;
      for (std::int64_t i = 0; i < nx; ++i) mean[i] = 0.5 * (low[i] + high[i]);
    }
  });
  if (smoothing) smoothing->apply(fields(0, 3));
  each_line([&](std::int64_t line, int j, int k) {
    for (std::int64_t i = 0; i < nx; ++i) {
      double* const cell = block_cells.data() + 4 * (line * nx + i);
      cell[0] = gas.moves_gas ? load.void_fraction(static_cast<int>(i), j, k) : 1.0;
      for (int axis = 0; axis < 3; ++axis) cell[1 + axis] = block_fields.data()[axis * n_cells + line * nx + i];
    }
  });
  exchange.to_windows(4, block_cells.data(), window_cells.data());
}

void Coupling::Parts::set_coefficients(double step, CouplingReport& report) {
  const ExchangeExtent own = grains.set_coefficients(*gas.drag, gas.model, {gas.density, gas.viscosity},
                                                     carried_density(), exchange.window(), window_cells.data());
  std::array<double, 3> all = {own.coefficient, own.momentum, own.rate};
  world.max(all);
  largest = {all[0], all[1], all[2]};
  report.fastest_exchange = largest.rate * step;
}

void Coupling::Parts::load_exchange() {
  const double scale = scale_for(1.000001 * largest.coefficient, n_grains);
  const double momentum_scale = scale_for(1.000001 * largest.momentum, n_grains);
  std::fill(block_sums.begin(), block_sums.end(), 0);
  exchange.to_owners(4, grains.exchanges(exchange.window(), scale, momentum_scale), block_sums.data());
  const double per_volume = 1.0 / (scale * grid.cell_volume());
  const double momentum_per_volume = 1.0 / (momentum_scale * grid.cell_volume());
  const std::int64_t nx = block.size(0), n_cells = block.is_empty() ? 0 : block.n_cells();
  each_line([&](std::int64_t line, int, int) {
    for (std::int64_t c = line * nx; c < (line + 1) * nx; ++c)
      for (int f = 0; f < 4; ++f)
        block_fields.data()[f * n_cells + c] =
            static_cast<double>(block_sums.data()[4 * c + f]) * (f == 0 ? per_volume : momentum_per_volume);
  });
  if (smoothing) smoothing->apply(fields(0, 4));
  each_line([&](std::int64_t line, int j, int k) {
    const double* const from = block_fields.data() + line * nx;
    std::copy(from, from + nx, &load.exchange(0, j, k));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double* const of_axis = from + (static_cast<std::int64_t>(axis) + 1) * n_cells;
      std::copy(of_axis, of_axis + nx, &load.exchange_velocity[axis](0, j, k));
    }
  });
}

/// New gas velocity and pressure gradient, with the void fraction, to all grains.
void Coupling::Parts::send_feel() {
  const std::int64_t nx = block.size(0), n_cells = block.is_empty() ? 0 : block.n_cells();
  each_line([&](std::int64_t line, int j, int k) {
    for (int axis = 0; axis < 3; ++axis) {
      const GridField<>& velocity = flow->cell_velocity(axis);
      const GridField<>& gradient = flow->cell_pressure_gradient(axis);
      const double* const u = velocity.data() + velocity.layout().at(0, j, k);
      const double* const g = gradient.data() + gradient.layout().at(0, j, k);
      std::copy(u, u + nx, block_fields.data() + axis * n_cells + line * nx);
      std::copy(g, g + nx, block_fields.data() + (3 + axis) * n_cells + line * nx);
    }
  });
  if (smoothing) smoothing->apply(fields(0, 6));
  std::vector<double> fastest(static_cast<std::size_t>(block.is_empty() ? 0 : block.size(1) * block.size(2)), 0.0);
  each_line([&](std::int64_t line, int j, int k) {
    for (std::int64_t i = 0; i < nx; ++i) {
      const std::int64_t c = line * nx + i;
      double* const cell = block_cells.data() + 8 * c;
      for (int axis = 0; axis < 3; ++axis) {
        cell[axis] = block_fields.data()[axis * n_cells + c];
        cell[4 + axis] = block_fields.data()[(3 + axis) * n_cells + c];
        fastest[static_cast<std::size_t>(line)] =
            std::max(fastest[static_cast<std::size_t>(line)], std::abs(cell[axis]));
      }
      cell[3] = load.void_fraction(static_cast<int>(i), j, k);
      cell[7] = 0.0;
    }
  });
  fastest_gas = 0.0;
  for (const double speed : fastest) fastest_gas = std::max(fastest_gas, speed);
  exchange.to_windows(8, block_cells.data(), window_cells.data());
}

/// What only the ranks of the gas know, to all.
void Coupling::Parts::share(CouplingReport& report) {
  std::array<double, 6> all = {fastest_gas,
                               -report.least_void_fraction,
                               static_cast<double>(report.gas.n_parts),
                               static_cast<double>(report.gas.iterations),
                               report.gas.imbalance,
                               report.gas.courant};
  world.max(all);
  std::array<std::uint64_t, 1> floored = {report.n_floored};
  world.sum(floored);
  fastest_gas = all[0];
  report.least_void_fraction = -all[1];
  report.gas = {static_cast<int>(all[2]), static_cast<int>(all[3]), all[4], all[5]};
  report.n_floored = floored[0];
}

/// Sets what grains feel, and compares it with what the gas has lost.
void Coupling::Parts::feel(Particles& particles, CouplingReport& report) {
  Feel how;
  how.buoyancy = -gas.density * gravity;
  how.has_gradient = gas.model == GasModel::a;
  how.is_flat = grid.is_flat;
  how.fluid_density = carried_density();
  how.sum_scale = scale_for(1.000001 * (largest.coefficient * fastest_gas + largest.momentum), n_grains);
  const ForceSums own = grains.feel(exchange.window(), window_cells.data(), how, particles.gas_acceleration());

  std::array<std::int64_t, 4> sums = own.drag;
  world.sum(std::span<std::int64_t>(sums));
  if (!gas.moves_gas) return;
  const std::array<double, 3> loss = gas_loss();
  for (std::size_t axis = 0; axis < 3 && sums[3] > 0; ++axis) {
    const double gain = static_cast<double>(sums[axis]) / how.sum_scale;
    const double given = static_cast<double>(sums[3]) / how.sum_scale;
    report.momentum_error = std::max(report.momentum_error, std::abs(loss[axis] - gain) / given);
  }
}

/// [N] sum over all cells of beta u - (beta v).
std::array<double, 3> Coupling::Parts::gas_loss() {
  const std::int64_t nx = block.size(0);
  std::vector<std::array<ExactSum, 3>> of_thread(static_cast<std::size_t>(n_threads));
  if (!block.is_empty())
    parallel(n_threads, [&](int thread) {
      const Range lines = share_of(std::int64_t{block.size(1)} * block.size(2), thread, n_threads);
      for (std::int64_t line = lines.begin; line < lines.end; ++line) {
        const int j = static_cast<int>(line % block.size(1)), k = static_cast<int>(line / block.size(1));
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const GridField<>& velocity = flow->cell_velocity(static_cast<int>(axis));
          double sum = 0.0;
          for (int i = 0; i < nx; ++i)
            sum += load.exchange(i, j, k) * velocity(i, j, k) - load.exchange_velocity[axis](i, j, k);
          of_thread[static_cast<std::size_t>(thread)][axis].add(sum * grid.cell_volume());
        }
      }
    });
  std::array<ExactSum, 3> sums;
  for (const auto& part : of_thread)
    for (std::size_t axis = 0; axis < 3; ++axis) sums[axis].add(part[axis]);
  total(world, sums);
  return {sums[0].value(), sums[1].value(), sums[2].value()};
}

Coupling::Coupling(const Scene& scene, const GasGrid& grid, const World& world, int n_threads)
    : parts_(std::make_unique<Parts>(scene, grid, world, n_threads)) {}
Coupling::~Coupling() = default;
Coupling::Coupling(Coupling&&) noexcept = default;
Coupling& Coupling::operator=(Coupling&&) noexcept = default;

CouplingReport Coupling::advance(Particles& particles, double time, double step) {
  return parts_->advance(particles, time, step);
}

void Coupling::set_grain_threads(int n_threads) { parts_->grains.set_threads(n_threads); }

GasFlow* Coupling::flow() { return parts_->flow.get(); }
const GasGrid& Coupling::grid() const { return parts_->grid; }
const GridShare& Coupling::share() const { return parts_->blocks; }

std::size_t Coupling::memory() const {
  const Parts& p = *parts_;
  return p.grains.memory() + p.exchange.memory() + p.block_sums.capacity_bytes() + p.block_fields.capacity_bytes() +
         p.block_cells.capacity_bytes() + p.window_cells.capacity_bytes() + (p.smoothing ? p.smoothing->memory() : 0) +
         (p.flow ? p.flow->memory() : 0);
}

}  // namespace moraine
