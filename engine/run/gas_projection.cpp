#include "engine/run/gas_projection.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "engine/coupling/cell_exchange.hpp"
#include "engine/coupling/coupling.hpp"
#include "engine/gas/multigrid.hpp"
#include "engine/particles/particles.hpp"
#include "engine/run/plan.hpp"
#include "engine/threads.hpp"
#include "kernels/drag/cells.hpp"

namespace moraine {

namespace {

std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

/// [s] when the last ramp has reached its end.
double full_speed_from(const Gas& gas) {
  double time = 0.0;
  for (const GasBoundary& boundary : gas.boundaries)
    for (const auto& point : boundary.ramp) time = std::max(time, point[0]);
  return time;
}

/// [s] of a cell in a cycle, all coarser grids counted as cells of their own.
double measure_cycle(const GasGrid& grid, int n_threads, double seconds) {
  std::array<int, 3> n = grid.n;
  for (int& along : n) along = (along + 1) / 2;
  const GridShare share = share_out(n, grid.periodic, 1, 1);
  const GridCells cells = GridCells::uniform(n, grid.spacing);
  Multigrid multigrid(World(), share, cells, n_threads);
  for (auto& weights : multigrid.finest().weights) std::fill(weights.begin(), weights.end(), 1.0F);
  const auto n_cells = static_cast<double>(cells_of_all(plan_levels(share, cells)));
  const int team = multigrid.finest().n_threads;
  parallel(team, [&](int thread) { multigrid.set({thread, team}); });
  int n_cycles = 0;
  const double start = threads::now();
  do {
    parallel(team, [&](int thread) {
      ExactSum product;
      multigrid.cycle({thread, team}, product);
    });
    ++n_cycles;
  } while (n_cycles < 3 || threads::now() - start < seconds);
  return (threads::now() - start) / (n_cycles * n_cells);
}

double time_of(const GridTraffic& traffic, const Network& network, double copy) {
  const auto real = [](std::int64_t n) { return static_cast<double>(n); };
  return std::max(real(traffic.n_sent), real(traffic.n_received)) * network.latency +
         std::max(real(traffic.bytes_sent), real(traffic.bytes_received)) / network.bandwidth +
         copy * real(traffic.bytes_sent + traffic.bytes_received);
}

/// To all ranks and back by halves.
double time_of_reduction(int n_ranks, const Network& network) {
  return 2.0 * std::bit_width(static_cast<unsigned>(std::max(n_ranks - 1, 0))) * network.latency;
}

}  // namespace

GasLayout lay_out_gas(const Scene& scene, std::span<const Vec3> positions, std::span<const std::int32_t> owners,
                      int n_ranks) {
  const Gas& gas = scene.gas.value();
  const GasGrid grid = gas_grid(scene.domain, gas);
  const GridShare share = gas_share(grid, n_ranks);
  GasLayout layout;
  layout.n_gas_ranks = share.n_ranks();
  layout.cells_of_root = cells_of_root(grid, share);
  layout.n_reductions = coupling_reductions(gas);
  layout.ranks.resize(at(n_ranks));
  std::vector<GrainExtent> extents(at(n_ranks));
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Vec3& p = positions[i];
    extents[at(owners[i])].add({p, p, 0.0, 1});
  }
  const CellWeights weights(gas.weights, grid.n, grid.low, grid.spacing, grid.periodic);
  std::vector<CellWindow> windows;
  for (const GrainExtent& extent : extents)
    windows.push_back(extent.n > 0 ? with_room(weights.around(extent.low, extent.high), share) : CellWindow{});
  const std::vector<GridTraffic> exchange =
      gas.drag && n_ranks > 1 ? exchange_traffic(windows, share, gas.moves_gas) : std::vector<GridTraffic>(at(n_ranks));
  for (int rank = 0; rank < n_ranks; ++rank) {
    GasRank& of_rank = layout.ranks[at(rank)];
    of_rank.n_grains = extents[at(rank)].n;
    of_rank.exchange = exchange[at(rank)];
    if (rank >= share.n_ranks()) continue;
    of_rank.n_cells = share.block(rank).n_cells();
    of_rank.flow = gas_traffic(gas, grid, share, rank);
  }
  return layout;
}

GasRates measure_gas_rates(const Scene& scene, std::span<const GrainSeed> grains, int n_threads, double seconds) {
  const Gas& gas = scene.gas.value();
  const GasGrid grid = gas_grid(scene.domain, gas);
  FieldNeeds needs;
  needs.rotation = scene.contact.rotation;
  needs.gas = true;
  Particles particles(needs);
  put_grains(scene, {grains.begin(), grains.end()}, particles);
  Coupling coupling(scene, grid, World(), n_threads);
  const double step = choose_gas_step(scene), from = full_speed_from(gas);
  for (int warm = 0; warm < 2; ++warm) coupling.advance(particles, from + warm * step, step);
  GasRates rates;
  double flow = 0.0;
  const double start = threads::now();
  do {
    const CouplingReport report =
        coupling.advance(particles, from + static_cast<double>(2 + rates.n_steps) * step, step);
    flow += report.flow_seconds;
    rates.n_parts += report.gas.n_parts;
    rates.n_iterations += report.gas.iterations;
    ++rates.n_steps;
  } while (rates.n_steps < 3 || threads::now() - start < seconds);
  const auto n_steps = static_cast<double>(rates.n_steps);
  const auto n_cells = static_cast<double>(coupling.share().n_cells());
  rates.cell = flow / (n_steps * n_cells);
  rates.grain = (threads::now() - start - flow) / (n_steps * std::max<double>(1.0, static_cast<double>(grains.size())));
  rates.n_parts /= n_steps;
  rates.n_iterations /= n_steps;
  rates.root_cell = measure_cycle(grid, n_threads, 0.1 * seconds);
  return rates;
}

GasPrediction predict_gas(const Scene& scene, const GasLayout& layout, const GasRates& rates, const Rates& grain_rates,
                          const Network& network, const Prediction& steps) {
  GasPrediction result;
  const auto n_ranks = static_cast<int>(layout.ranks.size());
  result.grain_steps = static_cast<int>(make_plan(scene, 1).gas_steps);
  double n_grains = 0.0, n_cells = 0.0;
  for (const GasRank& rank : layout.ranks) {
    n_grains += static_cast<double>(rank.n_grains);
    n_cells += static_cast<double>(rank.n_cells);
    result.grains = std::max(result.grains, rates.grain * static_cast<double>(rank.n_grains));
    result.cells = std::max(result.cells, rates.cell * static_cast<double>(rank.n_cells));
    const auto of = [&](const Talk& talk) {
      return time_of(talk.messages, network, grain_rates.copy) +
             talk.n_reductions * time_of_reduction(layout.n_gas_ranks, network);
    };
    result.messages = std::max(result.messages, of(rank.flow.step) + rates.n_parts * of(rank.flow.part) +
                                                    rates.n_iterations * of(rank.flow.iteration) +
                                                    time_of(rank.exchange, network, grain_rates.copy));
  }
  result.messages += layout.n_reductions * time_of_reduction(n_ranks, network);
  result.root = rates.n_iterations * rates.root_cell * static_cast<double>(layout.cells_of_root);
  result.whole = result.grain_steps * steps.step + result.grains + result.cells + result.root + result.messages;
  result.one_rank = result.grain_steps * steps.one_rank + rates.grain * n_grains + rates.cell * n_cells;
  if (result.whole > 0.0) result.efficiency = result.one_rank / (result.whole * n_ranks);
  return result;
}

}  // namespace moraine
