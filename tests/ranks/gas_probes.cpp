// Probes of the gas: the same bits on all ranks as alone, whoever has the cells and the grains.
#include "engine/run/gas_probes.hpp"

#include <catch2/catch.hpp>

#include "tests/ranks/ranks.hpp"
#include "tests/support/gas_fields.hpp"

using namespace moraine;
using gas_fields::Grain;
using gas_fields::InventedGas;

namespace {

Scene scene_with_probes() {
  Scene scene = gas_fields::scene();
  using Kind = Probe::Kind;
  for (const Kind kind : {Kind::pressure, Kind::pressure_drop, Kind::bed_height, Kind::gas_profile, Kind::gas_mean}) {
    Probe probe;
    probe.kind = kind;
    probe.name = name_of(kind);
    probe.region = {{0.07, 0.0, 0.0}, {0.51, 0.33, 0.4}};
    probe.points = {{0.11, 0.26, 0.19}, {0.6, 0.0, 0.4}};
    scene.output.probes.push_back(probe);
  }
  return scene;
}

/// Two rows of each probe, one after the other.
std::vector<double> rows(const World& world, const Scene& scene, InventedGas& gas, const std::vector<Grain>& grains) {
  std::vector<double> all;
  const GasView view = gas.view();
  const Particles particles = gas_fields::particles(grains);
  for (std::size_t i = 0; i < scene.output.probes.size(); ++i) {
    std::vector<double> memory;
    for (const double time : {0.1, 0.2}) {
      const std::vector<double> row =
          gas_probe_row(world, scene, scene.output.probes[i], i, particles, &view, time, memory);
      all.insert(all.end(), row.begin(), row.end());
    }
  }
  return all;
}

}  // namespace

TEST_CASE("probes of the gas give the same bits on several ranks as on one, however grains and cells are shared out") {
  const World& world = ranks::world();
  const Scene scene = scene_with_probes();
  const std::vector<Grain> grains = gas_fields::cloud(scene, 3000);
  InventedGas alone(scene, 1, 0);
  const std::vector<double> expected = rows(World(), scene, alone, grains);
  const auto rank = static_cast<std::size_t>(world.rank()), size = static_cast<std::size_t>(world.size());
  for (int n_with_gas = 1; n_with_gas <= world.size(); ++n_with_gas)
    for (const bool is_dealt : {true, false}) {
      std::vector<Grain> own;
      for (std::size_t g = 0; g < grains.size(); ++g)
        if (is_dealt ? g % size == rank : rank + 1 == size) own.push_back(grains[g]);
      InventedGas gas(scene, n_with_gas, world.rank());
      CHECK(rows(world, scene, gas, own) == expected);
      const std::vector<GasMeans::Mean> means = gas.means.means(), all = alone.means.means();
      REQUIRE(means.size() == all.size());
      if (gas.block.is_empty()) continue;
      std::size_t c = 0;
      for (int k = gas.block.low[2]; k < gas.block.high[2]; ++k)
        for (int j = gas.block.low[1]; j < gas.block.high[1]; ++j)
          for (int i = 0; i < gas.grid.n[0]; ++i, ++c)
            for (std::size_t m = 0; m < means.size(); ++m) {
              const auto at = static_cast<std::size_t>((k * gas.grid.n[1] + j) * gas.grid.n[0] + i);
              if (means[m].values[c] != all[m].values[at]) FAIL(means[m].name << " differs");
            }
    }
}
