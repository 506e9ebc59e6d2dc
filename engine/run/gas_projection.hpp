// The gas of a run on many ranks, foretold, as projection.hpp does it for the grains. README.md has the model of the time.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "comm/grid_share.hpp"
#include "engine/gas/gas_traffic.hpp"
#include "engine/run/projection.hpp"

namespace moraine {

/// One rank in a gas step.
struct GasRank {
  std::int64_t n_grains = 0;
  std::int64_t n_cells = 0;  // of the gas; 0: it has none
  GasTraffic flow;
  GridTraffic exchange;  // with the ranks that have its grains' cells, and those that have grains in its cells
};

/// How a gas lies on so many ranks. Counts are those of a run that starts so (tests/ranks/calls.cpp).
struct GasLayout {
  int n_gas_ranks = 0;
  std::int64_t cells_of_root = 0;  // of the coarse grids that the first rank solves alone in each iteration
  int n_reductions = 0;            // of a gas step, over all ranks
  std::vector<GasRank> ranks;
};
/// `owners`: the rank of each grain. The scene has a gas.
GasLayout lay_out_gas(const Scene& scene, std::span<const Vec3> positions, std::span<const std::int32_t> owners,
                      int n_ranks);

/// What this machine takes for a gas step of the scene, on the threads of one rank.
struct GasRates {
  double cell = 0.0;                         // [s] of a cell
  double grain = 0.0;                        // [s] of a grain: deposits, drag, interpolation
  double root_cell = 0.0;                    // [s] of a cell of the coarse grids in an iteration
  double n_parts = 0.0, n_iterations = 0.0;  // of a gas step, means
  std::int64_t n_steps = 0;                  // that were timed
};
/// Advances the gas through the grains as they lie, from when its inlets have reached their full speed, for about `seconds`. Throws
/// SceneError where its boundaries cannot be, GasError where it cannot go on.
GasRates measure_gas_rates(const Scene& scene, std::span<const GrainSeed> grains, int n_threads, double seconds = 2.0);

/// A gas step, and the grain steps until the next, of the slowest rank [s].
struct GasPrediction {
  int grain_steps = 0;      // to a gas step
  double grains = 0.0;      // the gas step's work for grains
  double cells = 0.0;       // its work for cells, by all ranks that have some
  double root = 0.0;        // and by the first alone
  double messages = 0.0;    // and messages and reductions
  double whole = 0.0;       // all of it, with the grain steps
  double one_rank = 0.0;    // the same of one rank with all the grains and cells
  double efficiency = 0.0;  // [-] one_rank / (whole * n_ranks)
};
/// `steps`: what predict() says of the grain steps on as many ranks, or on as many as stand for them.
GasPrediction predict_gas(const Scene& scene, const GasLayout& layout, const GasRates& rates, const Rates& grain_rates,
                          const Network& network, const Prediction& steps);

}  // namespace moraine
