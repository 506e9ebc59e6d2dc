// What grains give to cells (deposit) and what they feel of them (interpolate).
#include <algorithm>
#include <vector>

#include "bench/kernels/suspension.hpp"
#include "engine/particles/aligned_array.hpp"

namespace moraine::bench {

namespace {

constexpr const char* weights_name(GasWeights kind) { return kind == GasWeights::cell ? "cell" : "trilinear"; }

/// Flops of a grain's place among the cells; of the weights of eight cells; and of so many values mixed from them.
constexpr double flops_of_place = 18.0, flops_of_weights = 15.0;
constexpr double flops_of_mixing(GasWeights kind, double n_values) {
  return kind == GasWeights::cell ? 0.0 : 7.0 * 3.0 * n_values;
}
constexpr double flops_of_spreading(GasWeights kind, double n_values) {  // a product and the sum that rounds it
  return kind == GasWeights::cell ? 2.0 * n_values : flops_of_weights + 8.0 * 2.0 * n_values;
}

/// Cell values, and what one pass over the grains moves: records, `grain_bytes` more a grain, and cells in (and out).
struct Setting {
  Suspension& s;
  GasWeights kind;
  CellWeights weights;
  CellWindow window;

  Setting(std::int32_t n, GasWeights how)
      : s(suspension(n, false)), kind(how), weights(s.weights(how)), window(s.window(weights)) {}
  double n_cells() const { return static_cast<double>(window.n_cells()); }
  Work work(double flops, double grain_bytes, double cell_bytes, bool writes_cells) const {
    Work w;
    w.items_name = "grains/s";
    w.items = s.n_grains();
    w.flops = w.items * flops;
    w.working_set = w.items * (s.record_bytes() + grain_bytes) + n_cells() * cell_bytes;
    w.bytes = w.working_set + (writes_cells ? n_cells() * cell_bytes : 0.0);
    return w;
  }
  AlignedArray<double> cells(int width) const {
    AlignedArray<double> values;
    values.resize_discarding(static_cast<std::size_t>(window.n_cells() * width));
    for (std::size_t k = 0; k < values.size(); ++k) values[k] = 0.5 + 0.4 * static_cast<double>(k % 7) / 7.0;
    return values;
  }
  AlignedArray<std::int64_t> sums(int width) const {
    AlignedArray<std::int64_t> values;
    values.resize_discarding(static_cast<std::size_t>(window.n_cells() * width));
    std::fill(values.begin(), values.end(), 0);
    return values;
  }
  AlignedArray<double> coefficients() const {
    AlignedArray<double> values;
    values.resize_discarding(static_cast<std::size_t>(s.particles.size()));
    std::fill(values.begin(), values.end(), 1e-6);
    return values;
  }
};

void deposit_volumes(benchmark::State& state, const Setting& at) {
  AlignedArray<std::int64_t> cells = at.sums(1);
  const Work work = at.work(5.0 + flops_of_place + flops_of_spreading(at.kind, 1.0), 0.0, 8.0, true);
  measure(state, work, [&] {
    deposit_volume(at.s.grains(), at.weights, at.window, 0x1p60, cells.data());
    benchmark::ClobberMemory();
  });
}

void deposit_exchanges(benchmark::State& state, const Setting& at) {
  AlignedArray<std::int64_t> cells = at.sums(4);
  const AlignedArray<double> coefficients = at.coefficients();
  const Work work = at.work(7.0 + flops_of_place + flops_of_spreading(at.kind, 4.0), 8.0, 32.0, true);
  measure(state, work, [&] {
    deposit_exchange(at.s.grains(), at.weights, at.window, coefficients.data(), 0x1p50, 0x1p50, false, cells.data());
    benchmark::ClobberMemory();
  });
}

/// Void fraction and gas velocity at the grains, in tiles that stay in L1, as drag takes them.
void interpolate_slip(benchmark::State& state, const Setting& at) {
  const AlignedArray<double> cells = at.cells(4);
  const Work work = at.work(9.0 + flops_of_place + flops_of_mixing(at.kind, 4.0), 0.0, 32.0, false);
  SlipTile tile;
  GrainView grains = at.s.grains();
  const std::int64_t n = grains.range.end;
  measure(state, work, [&] {
    for (std::int64_t begin = 0; begin < n; begin += SlipTile::size) {
      grains.range = {begin, std::min(begin + SlipTile::size, n)};
      gather_slip(grains, at.weights, at.window, cells.data(), false, tile);
      benchmark::DoNotOptimize(tile.slip[0]);
    }
  });
}

/// Gas velocity and pressure gradient at the grains, and what becomes of them: drag, acceleration, sums.
void interpolate_forces(benchmark::State& state, const Setting& at) {
  const AlignedArray<double> cells = at.cells(8), coefficients = at.coefficients();
  double* const acceleration = at.s.particles.gas_acceleration();
  Feel how;
  how.sum_scale = 0x1p40;
  const Work work = at.work(35.0 + flops_of_place + flops_of_mixing(at.kind, 8.0), 8.0 + 24.0, 64.0, false);
  measure(state, work, [&] {
    ForceSums sums;
    feel(at.s.grains(), at.weights, at.window, cells.data(), coefficients.data(), how, acceleration, sums);
    benchmark::DoNotOptimize(sums);
  });
}

}  // namespace

void add_gas_exchange() {
  const std::pair<const char*, void (*)(benchmark::State&, const Setting&)> parts[] = {
      {"deposit/volume", deposit_volumes},
      {"deposit/exchange", deposit_exchanges},
      {"interpolate/slip", interpolate_slip},
      {"interpolate/forces", interpolate_forces}};
  for (const auto& [name, part] : parts)
    for (const GasWeights kind : {GasWeights::cell, GasWeights::trilinear})
      for (const std::int32_t n : suspension_sizes)
        add(std::string(name) + "/" + weights_name(kind) + "/" + name_of(n),
            [=, part = part](benchmark::State& s) { part(s, Setting(n, kind)); });
}

}  // namespace moraine::bench
