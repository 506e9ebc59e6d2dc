#include <algorithm>
#include <catch2/catch.hpp>

#include "engine/run/gas_probes.hpp"
#include "kernels/base/sphere.hpp"
#include "tests/support/gas_fields.hpp"

using namespace moraine;
using gas_fields::Grain;
using gas_fields::InventedGas;
using gas_fields::particles;

namespace {

std::vector<double> row_of(const Scene& scene, const Probe& probe, InventedGas& gas, const std::vector<Grain>& grains,
                           std::vector<double>& memory, double time = 1.0) {
  const GasView view = gas.view();
  return gas_probe_row(World(), scene, probe, 0, particles(grains), &view, time, memory);
}

std::vector<double> row_of(const Scene& scene, const Probe& probe, const std::vector<Grain>& grains = {}) {
  InventedGas gas(scene, 1, 0);
  std::vector<double> memory;
  return row_of(scene, probe, gas, grains, memory);
}

Probe probe_of(Probe::Kind kind, int axis = 2) {
  Probe probe;
  probe.kind = kind;
  probe.axis = axis;
  probe.region = gas_fields::scene().domain.box();
  return probe;
}

}  // namespace

TEST_CASE("pressures are those of a linear field between cell centres, beyond them, and on the faces") {
  const Scene scene = gas_fields::scene();
  Probe probe = probe_of(Probe::Kind::pressure);
  probe.points = {{0.3, 0.25, 0.2}, {0.05, 0.025, 0.025}, {0, 0, 0}, {0.6, 0.5, 0.4}, {0.01, 0.49, 0.123}};
  const std::vector<double> row = row_of(scene, probe);
  REQUIRE(row.size() == probe.points.size());
  REQUIRE(gas_probe_columns(scene, probe).size() == row.size());
  for (std::size_t i = 0; i < row.size(); ++i)
    CHECK(row[i] == Approx(InventedGas::pressure_at(probe.points[i])).epsilon(1e-14));
}

TEST_CASE("pressures in a periodic direction are taken from the other side, and in one cell from that cell") {
  Scene scene = gas_fields::scene();
  scene.domain.periodic = {true, false, false};
  scene.gas->cells[2] = 1;
  Probe probe = probe_of(Probe::Kind::pressure);
  probe.points = {{0, 0.25, 0.1}, {0.6, 0.25, 0.3}};
  // Halfway between the first cell and the last along x; at the height of the only one.
  const double expected = InventedGas::pressure_at({0.3, 0.25, 0.2});
  for (const double value : row_of(scene, probe)) CHECK(value == Approx(expected).epsilon(1e-14));
}

TEST_CASE("the pressure drop between the faces of the domain knows no ghost row") {
  const Scene scene = gas_fields::scene();
  const std::vector<double> row = row_of(scene, probe_of(Probe::Kind::pressure_drop));
  REQUIRE(row.size() == 3);
  CHECK(row[0] == Approx(InventedGas::pressure_at({0.3, 0.25, 0.0})));
  CHECK(row[1] == Approx(InventedGas::pressure_at({0.3, 0.25, 0.4})));
  CHECK(row[2] == Approx(20.0).epsilon(1e-12));
}

TEST_CASE("the pressure drop between two planes is that of a linear field") {
  const Scene scene = gas_fields::scene();
  Probe probe = probe_of(Probe::Kind::pressure_drop, 1);
  probe.between = {0.11, 0.43};
  CHECK(row_of(scene, probe)[2] == Approx(3.0 * 0.32).epsilon(1e-12));
}

TEST_CASE("the bed's height is that below which the share of mass lies") {
  const Scene scene = gas_fields::scene();
  std::vector<Grain> grains;
  for (int i = 10; i >= 1; --i) grains.push_back({{0.1, 0.1, 0.03 * i}, {}});
  Probe probe = probe_of(Probe::Kind::bed_height);
  for (const auto& [share, height] : {std::pair(0.05, 0.03), {0.5, 0.15}, {0.55, 0.18}, {0.9, 0.27}, {1.0, 0.3}}) {
    probe.share = share;
    const std::vector<double> row = row_of(scene, probe, grains);
    REQUIRE(row.size() == 3);
    CHECK(row[0] == Approx(height).epsilon(1e-11));
    CHECK(row[1] == Approx(0.165));
    CHECK(row[2] == 0.3);
  }
  grains[0].mass = 100.0;  // the highest
  probe.share = 0.5;
  CHECK(row_of(scene, probe, grains)[0] == Approx(0.3).epsilon(1e-11));
}

TEST_CASE("a bed without grains has no height") {
  const Scene scene = gas_fields::scene();
  CHECK(row_of(scene, probe_of(Probe::Kind::bed_height)) == std::vector<double>{0, 0, 0});
}

TEST_CASE("grains are added up in the cell of their centre, motion apart from fluctuation") {
  const Scene scene = gas_fields::scene();
  const InventedGas gas(scene, 1, 0);
  const std::vector<Grain> grains = {
      {{0.05, 0.02, 0.02}, {1, 0, 0}}, {{0.06, 0.03, 0.01}, {3, 0, 2}}, {{0.59, 0.49, 0.39}, {0, 5, 0}}};
  const GrainCells cells = grains_by_cell(World(), gas.grid, gas.share, particles(grains));
  const double v = sphere_volume(0.01);
  REQUIRE(cells.volume.size() == 480);
  CHECK(cells.volume[0] == Approx(2.0 * v));
  CHECK(cells.momentum[0][0] == Approx(4.0 * v));
  CHECK(cells.momentum[2][0] == Approx(2.0 * v));
  CHECK(cells.fluctuation[0] == Approx(4.0 * v / 3.0));  // (1 + 1 + 1 + 1) v, over three dimensions
  CHECK(cells.volume[479] == Approx(v));
  CHECK(cells.momentum[1][479] == Approx(5.0 * v));
  CHECK(cells.fluctuation[479] == Approx(0.0).margin(1e-9 * v));
}

TEST_CASE("a profile averages over the cells of its region, and over time from when it is asked to") {
  const Scene scene = gas_fields::scene();
  Probe probe = probe_of(Probe::Kind::gas_profile, 0);
  probe.region = {{0, 0.1, 0.1}, {0.6, 0.125, 0.15}};  // half a cell along y
  probe.from = 0.5;
  InventedGas gas(scene, 1, 0);
  std::vector<double> memory;
  const std::vector<Grain> early = {{{0.15, 0.12, 0.12}, {9, 9, 9}}}, first = {{{0.15, 0.12, 0.12}, {1, 0, 0}}},
                           second = {{{0.15, 0.12, 0.12}, {3, 0, 0}}, {{0.15, 0.13, 0.13}, {3, 0, 6}}};
  CHECK(row_of(scene, probe, gas, early, memory, 0.4)[0] == 0.0);
  CHECK(row_of(scene, probe, gas, first, memory, 0.5)[0] == 1.0);
  const std::vector<double> row = row_of(scene, probe, gas, second, memory, 0.6);
  constexpr std::size_t width = 9;
  REQUIRE(row.size() == 1 + 6 * width);
  REQUIRE(gas_probe_columns(scene, probe).size() == row.size());
  CHECK(row[0] == 2.0);
  const double* const layer = &row[1 + width];  // 0.1 to 0.2 m
  CHECK(layer[0] == Approx(gas.void_fraction(1, 2, 2)));
  CHECK(layer[1] == Approx(7.0 / 3.0));  // three grains in two samples
  CHECK(layer[3] == Approx(2.0));
  CHECK(layer[4] == Approx((9.0 + 9.0) / 3.0 / 3.0));
  CHECK(layer[5] == Approx(gas.velocity[0](1, 2, 2)));
  CHECK(layer[8] == Approx(InventedGas::pressure_at({0.15, 0.125, 0.125})));
  CHECK(row[1 + 1] == 0.0);  // no grains in the first layer
}

TEST_CASE("averages of cells go on from their sums with the same bits") {
  Scene scene = gas_fields::scene();
  scene.output.probes = {probe_of(Probe::Kind::gas_mean)};
  scene.output.probes[0].name = "mean";
  const std::vector<Grain> grains = gas_fields::cloud(scene, 500);
  const auto sample = [&](InventedGas& gas) {
    std::vector<double> memory;
    return row_of(scene, scene.output.probes[0], gas, grains, memory);
  };
  InventedGas whole(scene, 1, 0), broken(scene, 1, 0);
  sample(whole), sample(broken);
  InventedGas restarted(scene, 1, 0);
  const std::vector<GasMeans::Sum> from = broken.means.sums(), to = restarted.means.sums();
  REQUIRE(from.size() == 7);
  for (std::size_t i = 0; i < from.size(); ++i) {
    const auto n = static_cast<std::size_t>(from[i].values->layout().n_values());
    std::copy_n(from[i].values->data(), n, to[i].values->data());
  }
  restarted.means.restore(broken.means.counts());
  CHECK(sample(whole) == sample(restarted));
  const std::vector<GasMeans::Mean> a = whole.means.means(), b = restarted.means.means();
  REQUIRE(a.size() == 6);
  for (std::size_t i = 0; i < a.size(); ++i) {
    CHECK(a[i].name == b[i].name);
    CHECK(a[i].values == b[i].values);
  }
  CHECK(a[0].name == "mean.void_fraction");
  CHECK(a[0].values[7] == Approx(whole.void_fraction(1, 1, 0)));
}

TEST_CASE("averages that nothing was added to are not shown") {
  Scene scene = gas_fields::scene();
  scene.output.probes = {probe_of(Probe::Kind::gas_mean)};
  CHECK(InventedGas(scene, 1, 0).means.means().empty());
}
