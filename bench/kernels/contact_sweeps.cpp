// Contact laws over the pairs of a bed, and over touches with walls.
#include <algorithm>
#include <vector>

#include "bench/kernels/bed.hpp"
#include "engine/particles/aligned_array.hpp"

namespace moraine::bench {

namespace {

constexpr NormalLaw normals[] = {NormalLaw::linear, NormalLaw::hertz};
constexpr TangentialLaw tangentials[] = {TangentialLaw::none, TangentialLaw::viscous, TangentialLaw::spring,
                                         TangentialLaw::mindlin, TangentialLaw::power};

std::string name_of_choice(const LawChoice& c) {
  return name_of(c.normal, c.tangential) + (c.has_rotation ? "/spin" : "/still") +
         (c.is_uniform ? "/uniform" : "/mixed") + (c.has_ledger ? "/ledger" : "") + (c.is_mixed ? "/float" : "");
}

void sweep_pairs(benchmark::State& state, const LawChoice& choice, Size size) {
  Bed& b = bed(size, choice.has_rotation);
  b.restart(choice);
  const PairKernel kernel = contact_kernels(choice).pairs;
  const PairSweep sweep = b.sweep(choice, false);
  const std::int64_t slot = slot_bytes(choice);
  const auto n_touching = static_cast<double>(b.run(kernel, sweep, slot).n_touching);
  measure(state, work_of_sweep(b, choice, false, n_touching),
          [&] { benchmark::DoNotOptimize(b.run(kernel, sweep, slot)); });
  state.counters["pairs"] = b.n_pairs();
}

/// Every grain touches a floor; rows as the engine makes them.
struct Floor {
  std::vector<std::int32_t> grain;
  std::vector<double> columns;
  AlignedArray<double> history, slots;
  std::vector<std::uint8_t> species;
  WallTouches view;
  std::int64_t n = 0;

  explicit Floor(const Particles& particles) : n(particles.size() / pair_group * pair_group) {
    const auto rows = static_cast<std::size_t>(n);
    for (std::int32_t i = 0; i < n; ++i) grain.push_back(i);
    columns.assign(8 * rows, 0.0);
    for (std::size_t k = 0; k < rows; ++k) {
      columns[2 * rows + k] = 1.0;
      columns[3 * rows + k] = 0.9995 * particles.radius(static_cast<std::int64_t>(k));
      columns[7 * rows + k] = 1.0;
    }
    history.resize_discarding(4 * rows);
    std::fill(history.begin(), history.end(), 0.0);
    slots.resize_discarding(12 * rows);
    species.assign(rows, 0);
    const double* const c = columns.data();
    view = {grain.data(),   c,
            c + rows,       c + 2 * rows,
            c + 3 * rows,   c + 4 * rows,
            c + 5 * rows,   c + 6 * rows,
            c + 7 * rows,   species.data(),
            history.data(), slots.data()};
  }
};

void sweep_walls(benchmark::State& state, const LawChoice& choice, Size size) {
  Bed& b = bed(size, choice.has_rotation);
  Floor floor(b.particles);
  const WallKernel kernel = contact_kernels(choice).walls;
  const WallSweep sweep{b.particles.records(), floor.view, &b.table, Bed::dt, 0.5};
  const double row = 4.0 + 1.0 + 64.0, slot = 8.0 * slot_size(choice.has_rotation, choice.has_ledger);
  const double record = 8.0 * record_size(choice.has_rotation), history = has_history(choice.tangential) ? 32.0 : 0.0;
  LawChoice counted = choice;
  counted.is_uniform = false;  // walls have no uniform kernel
  Work work;
  work.items_name = "contacts/s";
  work.items = static_cast<double>(floor.n);
  work.bytes = work.items * (row + slot + record + 2.0 * history);
  work.flops = work.items * flops_of_contact(counted);
  work.working_set = work.items * (row + slot + record + history);
  measure(state, work, [&] { benchmark::DoNotOptimize(kernel(sweep, {0, floor.n})); });
}

}  // namespace

void add_contact_sweeps() {
  const auto add_pairs = [](const LawChoice& c, Size size) {
    add("pairs/" + name_of_choice(c) + "/" + name_of(size), [=](benchmark::State& s) { sweep_pairs(s, c, size); });
  };
  for (const Size size : sizes)
    for (const NormalLaw normal : normals)
      for (const TangentialLaw tangential : tangentials) {
        if (!is_listed({normal, tangential})) continue;
        const bool is_common =
            tangential == (normal == NormalLaw::linear ? TangentialLaw::spring : TangentialLaw::mindlin);
        for (const bool has_rotation : {true, false})
          for (const bool is_uniform : {true, false})
            for (const bool has_ledger : {false, true}) {
              LawChoice choice{normal, tangential, has_rotation, is_uniform, has_ledger};
              if (has_ledger && !is_common) continue;
              add_pairs(choice, size);
              choice.is_mixed = true;
              if (is_common) add_pairs(choice, size);
            }
      }
  for (const NormalLaw normal : normals)
    for (const TangentialLaw tangential : tangentials) {
      if (!is_listed({normal, tangential})) continue;
      for (const bool has_rotation : {true, false}) {
        const LawChoice c{normal, tangential, has_rotation, true, false};
        for (const Size size : sizes) {
          if (size != Size::k1 && !(tangential == TangentialLaw::spring && has_rotation)) continue;
          add("walls/" + name_of(normal, tangential) + (has_rotation ? "/spin/" : "/still/") + name_of(size),
              [=](benchmark::State& s) { sweep_walls(s, c, size); });
        }
      }
    }
}

}  // namespace moraine::bench
