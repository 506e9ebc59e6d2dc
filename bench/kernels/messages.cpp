// Halos without the messages: packing what goes to other ranks, unpacking what comes, and the ghost layers of grids.
#include <vector>

#include "bench/kernels/suspension.hpp"
#include "comm/grid_halo.hpp"
#include "engine/contacts/halo_records.hpp"
#include "engine/gas/grid_field.hpp"

namespace moraine::bench {

namespace {

/// A rank that sends every other of its grains, and has as many ghosts.
struct Border {
  static constexpr std::array<std::int32_t, 3> sizes = {1000, 32000, 1000000};  // sent: in L2, in L3, in memory

  explicit Border(std::int32_t n)
      : all(2 * n, true), particles(all.particles), records(particles, {true, true, true}, {1.0, 1.0, 1.0}) {
    for (std::int32_t i = 0; i < n; ++i) sent.push_back(2 * i);
    particles.set_ghosts(n);
    message.resize(static_cast<std::size_t>(n) * records.bytes());
    records.pack(particles, sent, message.data());
    unpack();
  }
  void pack() { records.pack(particles, sent, message.data()); }
  void unpack() {
    events.clear();
    records.unpack(message.data(), particles.size(), particles.n_ghosts(), particles, events);
  }
  /// Records (at both ends), the message, and the list of who is sent.
  Work work(double list_bytes) const {
    Work w;
    w.items_name = "ghosts/s";
    w.items = static_cast<double>(sent.size());
    const auto in_message = static_cast<double>(records.bytes());
    w.bytes = w.working_set = w.items * (8.0 * static_cast<double>(particles.stride()) + in_message + list_bytes);
    return w;
  }

  Suspension all;  // its own: ghosts come behind the grains
  Particles& particles;
  HaloRecords records;
  std::vector<std::int32_t> sent;
  std::vector<std::byte> message;
  std::vector<GhostEvent> events;
};

void pack(benchmark::State& state, std::int32_t n) {
  Border border(n);
  measure(state, border.work(4.0), [&] {
    border.pack();
    benchmark::ClobberMemory();
  });
}

void unpack(benchmark::State& state, std::int32_t n) {
  Border border(n);
  Work work = border.work(0.0);
  work.bytes += work.items * static_cast<double>(border.records.bytes());  // of the records, which are read before
  measure(state, work, [&] {
    border.unpack();
    benchmark::DoNotOptimize(border.events.data());
  });
}

/// Two layers around a periodic grid of doubles, as the gas has them; copied from the other side here, packed and sent where there are ranks.
void grid_layers(benchmark::State& state, int n) {
  GridShare share;
  share.n = {n, n, n};
  share.periodic = {true, true, true};
  share.cuts_y = share.cuts_z = {0, n};
  GridHalo halo(World(), share, gas_ghosts, 1, sizeof(double));
  GridField<double> field(GridLayout(share.block(0), gas_ghosts), 1.0);
  const double side = n + 2.0 * gas_ghosts, layers = 3.0 * 2.0 * gas_ghosts * side * side;
  Work work;
  work.items_name = "values/s";
  work.items = layers;
  work.bytes = work.working_set = 2.0 * 8.0 * layers;
  measure(state, work, [&] {
    halo.exchange({field.data()});
    benchmark::ClobberMemory();
  });
}

}  // namespace

void add_messages() {
  for (const std::int32_t n : Border::sizes) add("halo/pack/" + name_of(n), [=](benchmark::State& s) { pack(s, n); });
  for (const std::int32_t n : Border::sizes)
    add("halo/unpack/" + name_of(n), [=](benchmark::State& s) { unpack(s, n); });
  for (const int n : {32, 128, 320})
    add("halo/grid/" + std::to_string(n), [=](benchmark::State& s) { grid_layers(s, n); });
}

}  // namespace moraine::bench
