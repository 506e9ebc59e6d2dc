// Who is near whom: sorting into cells, the filter, the pair list, and moving the grains.
#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "bench/kernels/bed.hpp"
#include "kernels/search/pair_filter.hpp"

namespace moraine::bench {

namespace {

/// Beds of their own: these benchmarks lay them out anew, for other numbers of threads.
Bed& own_bed(Size size) {
  static std::map<Size, std::unique_ptr<Bed>> beds;
  std::unique_ptr<Bed>& found = beds[size];
  if (!found) found = std::make_unique<Bed>(size, true);
  return *found;
}

/// Every grain asks the runs of cells that come after it, as the pair list does. Items are the grains asked about.
void filter(benchmark::State& state, Size size) {
  Bed& b = bed(size, true);
  const auto n = static_cast<std::size_t>(b.particles.size());
  std::vector<double> x[4];
  for (std::size_t c = 0; c < 4; ++c) {
    x[c].assign(n + 8, 0.0);
    for (std::size_t i = 0; i < n; ++i) x[c][i] = b.particles.record(static_cast<std::int64_t>(i))[c];
  }
  for (std::size_t i = 0; i < n; ++i) x[3][i] += 0.5 * Bed::skin;
  const std::vector<double> room(n + 8, 0.5 * Bed::skin);
  const Spheres spheres{x[0].data(), x[1].data(), x[2].data(), x[3].data(), room.data()};
  const double band_share[n_bands] = {0.0, 0.2, 0.4, 0.6, 0.8};
  const NearFilter near = near_filter();
  std::vector<std::int32_t> found(n);
  std::vector<std::uint8_t> band(n);
  Cells::Run runs[Cells::max_runs];
  std::int64_t n_asked = 0, n_found = 0;
  const auto pass = [&] {
    n_asked = n_found = 0;
    Cells::Walk walk(b.cells);
    for (std::int32_t i = 0; i < b.particles.size(); ++i) {
      const Vec3 centre{x[0][static_cast<std::size_t>(i)], x[1][static_cast<std::size_t>(i)],
                        x[2][static_cast<std::size_t>(i)]};
      const int n_runs = walk.runs_after(i, centre, runs);
      for (int r = 0; r < n_runs; ++r) n_asked += runs[r].grains.size();
      const Asking asking{centre, x[3][static_cast<std::size_t>(i)], 0.5 * Bed::skin, nullptr, band_share, n_bands};
      n_found += near(spheres, runs, n_runs, asking, {found.data(), nullptr, band.data()});
    }
    benchmark::DoNotOptimize(n_found);
  };
  pass();
  Work work;
  work.items_name = "asked/s";
  work.items = static_cast<double>(n_asked);
  work.flops = 10.0 * work.items;
  work.bytes = 40.0 * b.n_grains();
  work.working_set = work.bytes;
  measure(state, work, pass);
  state.counters["found_%"] = 100.0 * static_cast<double>(n_found) / static_cast<double>(n_asked);
}

Work work_of_grains(const Bed& b, int n_threads) {
  Work work;
  work.items_name = "grains/s";
  work.items = b.n_grains();
  work.n_threads = n_threads;
  return work;
}

void sort(benchmark::State& state, Size size, int n_threads) {
  Bed& b = own_bed(size);
  measure(state, work_of_grains(b, n_threads), [&] {
    b.cells.sort(Centres::of(b.particles), b.domain, {false, false, false}, 2.0 * b.particles.radius(0) + Bed::skin,
                 n_threads);
  });
}

/// With the memory of all contacts carried over.
void build(benchmark::State& state, Size size, int n_threads) {
  Bed& b = own_bed(size);
  b.cells.sort(Centres::of(b.particles), b.domain, {false, false, false}, 2.0 * b.particles.radius(0) + Bed::skin,
               n_threads);
  b.particles.reorder(b.cells.order(), n_threads);
  // in order already, so that grains stay where their memory is
  PairCarry nothing;
  b.pairs.build(b.particles, b.cells, {}, {}, {}, Bed::skin, {}, b.needs, b.cells.order(), nothing, 1);
  b.n_slots = b.thread().tiles.back().pair_end;
  b.restart({NormalLaw::linear, TangentialLaw::spring, true, false, true});
  PairCarry carry = b.pairs.carry(b.particles, {}, false, 1);
  measure(state, work_of_grains(b, n_threads), [&] {
    b.pairs.build(b.particles, b.cells, {}, {}, {}, Bed::skin, {}, b.needs, b.cells.order(), carry, n_threads);
  });
  state.counters["pairs"] = b.n_pairs();
}

/// Records, gids, materials and the ledger's sums; read once, written once.
void reorder(benchmark::State& state, Size size, int n_threads) {
  Bed& b = own_bed(size);
  b.cells.sort(Centres::of(b.particles), b.domain, {false, false, false}, 2.0 * b.particles.radius(0) + Bed::skin,
               n_threads);
  Work work = work_of_grains(b, n_threads);
  work.bytes = b.n_grains() * (2.0 * (8.0 * static_cast<double>(b.particles.stride()) + 8.0 + 2.0 + 32.0) + 4.0);
  work.working_set = work.bytes;
  measure(state, work, [&] { b.particles.reorder(b.cells.order(), n_threads); });
}

}  // namespace

void add_neighbours() {
  for (const Size size : sizes) add("near_filter/" + name_of(size), [=](benchmark::State& s) { filter(s, size); });
  const int all = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  const std::pair<const char*, void (*)(benchmark::State&, Size, int)> parts[] = {
      {"cells_sort", sort}, {"pair_list", build}, {"reorder", reorder}};
  for (const auto& [name, part] : parts)
    for (const Size size : {Size::k20, Size::k200})
      for (const int n_threads : all > 1 ? std::vector<int>{1, all} : std::vector<int>{1})
        add(std::string(name) + "/" + name_of(size) + "/threads:" + std::to_string(n_threads),
            [=, part = part](benchmark::State& s) { part(s, size, n_threads); });
}

}  // namespace moraine::bench
