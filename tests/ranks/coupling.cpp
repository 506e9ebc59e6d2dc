// What grains and gas do to each other is the same to the bit on any number of ranks and threads, wherever the grains are.
#include "engine/coupling/coupling.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "tests/ranks/ranks.hpp"

using namespace moraine;
using ranks::world;

namespace {

constexpr double diameter = 0.004;
constexpr int n_grains = 4000;

struct Case {
  GasWeights weights = GasWeights::trilinear;
  std::array<int, 3> cells{};
  std::array<bool, 3> periodic{};
  bool is_flat = false;
  GasModel model = GasModel::a;
  DragLaw drag = DragLaw::gidaspow;
};

Scene scene_of(const Case& c) {
  Scene scene;
  scene.domain.low = {-0.05, 0.02, 0.0};
  scene.domain.high = {0.11, 0.5, c.is_flat ? 0.004 : 0.72};
  scene.domain.periodic = c.periodic;
  scene.domain.dimensions = c.is_flat ? 2 : 3;
  scene.time.gravity = c.is_flat ? Vec3{0, -9.81, 0} : Vec3{0, 0, -9.81};
  scene.materials = {{"glass", 2700.0, 0.0, 0.3}};
  Gas gas;
  gas.cells = c.cells;
  gas.density = 1.2;
  gas.viscosity = 1.8e-5;
  gas.drag = c.drag;
  gas.model = c.model;
  gas.weights = c.weights;
  gas.smoothing = 0.015;
  gas.velocity = c.is_flat ? Vec3{0, 1.5, 0} : Vec3{0, 0, 1.5};
  const int face = c.is_flat ? 2 : 4;
  GasBoundary inlet, outlet;
  inlet.kind = GasBoundary::Kind::velocity;
  inlet.face = face;
  inlet.velocity = gas.velocity;
  outlet.kind = GasBoundary::Kind::pressure;
  outlet.face = face + 1;
  if (!c.periodic[static_cast<std::size_t>(face / 2)]) gas.boundaries = {inlet, outlet};
  scene.gas = gas;
  return scene;
}

GasGrid grid_of(const Scene& scene) {
  GasGrid grid;
  grid.n = scene.gas->cells;
  grid.low = scene.domain.low;
  for (int a = 0; a < 3; ++a)
    grid.spacing[a] = (scene.domain.high[a] - scene.domain.low[a]) / grid.n[static_cast<std::size_t>(a)];
  grid.periodic = scene.domain.periodic;
  grid.is_flat = scene.domain.dimensions == 2;
  return grid;
}

/// Grain `gid` at a time: most in a heap at the low end of the last direction, some anywhere; they drift far enough to leave windows.
GrainSeed grain(const Scene& scene, int gid, int time) {
  const auto number = [&](int which) {
    const double x = std::sin(12.9898 * (gid + 1) + 78.233 * which) * 43758.5453;
    return x - std::floor(x);
  };
  GrainSeed seed;
  const bool is_flat = scene.domain.dimensions == 2;
  for (int a = 0; a < 3; ++a) {
    const bool is_height = a == (is_flat ? 1 : 2);
    double place = number(a) * (is_height && gid % 10 > 0 ? 0.15 : 1.0) + time * 0.11 * (gid % 3);
    place -= std::floor(place);
    seed.position[a] = scene.domain.low[a] + place * (scene.domain.high[a] - scene.domain.low[a]);
    seed.velocity[a] = number(3 + a) - 0.5;
  }
  if (is_flat) seed.position.z = 0.002, seed.velocity.z = 0.0;
  seed.radius = 0.5 * diameter * (0.8 + 0.4 * number(6));
  return seed;
}

struct Result {
  std::map<std::uint64_t, Vec3> acceleration;  // at the root
  std::vector<double> numbers;
  bool operator==(const Result&) const = default;
};

/// Two gas steps on the first ranks; the others do nothing. Grains are dealt out by place, in some order; the last of three or more has none.
Result run(const Case& c, int n_ranks, int n_threads) {
  Result result;
  const std::optional<World> some = world().first(n_ranks);
  if (!some) return result;
  const Scene scene = scene_of(c);
  Coupling coupling(scene, grid_of(scene), *some, n_threads);
  const int n_holders = n_ranks > 2 ? n_ranks - 1 : n_ranks;
  for (int time = 0; time < 2; ++time) {
    std::vector<GrainSeed> seeds;
    std::vector<std::uint64_t> gids;
    for (int i = 0; i < n_grains; ++i) {
      const int gid = n_ranks % 2 == 0 ? n_grains - 1 - i : i;
      const GrainSeed seed = grain(scene, gid, time);
      const double place = (seed.position.y - scene.domain.low.y) / (scene.domain.high.y - scene.domain.low.y);
      if (std::min(static_cast<int>(place * place * n_holders), n_holders - 1) != some->rank()) continue;
      seeds.push_back(seed);
      gids.push_back(static_cast<std::uint64_t>(gid));
    }
    FieldNeeds needs;
    needs.gas = true;
    Particles particles(needs);
    put_grains(scene, seeds, gids, particles);
    for (std::int32_t i = 0; i < particles.size(); ++i)
      if (particles.gid(i) % 97 == 0) particles.set_real(Field::position, i, 0, std::nan(""));
    const CouplingReport report = coupling.advance(particles, 1e-3 * time, 1e-3);
    for (const double number : {report.least_void_fraction, report.momentum_error, report.fastest_exchange,
                                static_cast<double>(report.n_floored), report.gas.imbalance, report.gas.courant})
      result.numbers.push_back(number);
    ParcelWriter writer;
    for (std::int32_t i = 0; i < particles.size(); ++i) {
      writer.put(particles.gid(i));
      for (int a = 0; a < 3; ++a) writer.put(particles.gas_acceleration()[3 * i + a]);
    }
    for (const Parcel& parcel : some->exchange({{0, writer.take()}}))
      for (ParcelReader reader(parcel.bytes); !reader.at_end();) {
        const auto gid = reader.get<std::uint64_t>();
        const double x = reader.get<double>(), y = reader.get<double>(), z = reader.get<double>();
        result.acceleration[gid + static_cast<std::uint64_t>(n_grains * time)] = {x, y, z};
      }
  }
  return result;
}

void check_layouts(const Case& c) {
  const Result alone = run(c, 1, 1);
  if (world().is_root()) {
    CHECK(alone.acceleration.size() == 2 * n_grains);
    bool is_any_pushed = false, is_all_finite = true;
    for (const auto& [gid, a] : alone.acceleration) {
      is_any_pushed = is_any_pushed || length(a) > 0.1;
      is_all_finite = is_all_finite && std::isfinite(length(a));
    }
    CHECK(is_any_pushed);
    CHECK(is_all_finite);
    CHECK(alone.numbers[0] < 0.98);   // void fraction
    CHECK(alone.numbers[1] < 1e-10);  // exchange of momentum
    CHECK(alone.numbers[7] < 1e-10);
  }
  for (const auto& [n_ranks, n_threads] : {std::pair(1, 3), std::pair(1, 4), std::pair(2, 1), std::pair(3, 2),
                                           std::pair(4, 1), std::pair(5, 1), std::pair(6, 2)}) {
    INFO(n_ranks << " ranks of " << n_threads << " threads");
    const Result other = run(c, n_ranks, n_threads);
    if (world().is_root()) {
      CHECK(other.numbers == alone.numbers);
      CHECK(other.acceleration == alone.acceleration);
    }
  }
}

}  // namespace

TEST_CASE("grains and gas push each other the same on 1 to 6 ranks: trilinear weights") {
  check_layouts({GasWeights::trilinear, {16, 48, 72}, {false, false, false}});
}

TEST_CASE("grains and gas push each other the same on 1 to 6 ranks: nearest cell, periodic, model B") {
  check_layouts({GasWeights::cell, {16, 48, 72}, {true, true, false}, false, GasModel::b, DragLaw::beetstra});
}

TEST_CASE("grains and gas push each other the same on 1 to 6 ranks: smoothed over a length") {
  check_layouts({GasWeights::smoothed, {16, 48, 72}, {false, true, false}, false, GasModel::a, DragLaw::koch_hill});
}

TEST_CASE("grains and gas push each other the same on 1 to 6 ranks: trilinear and periodic all around") {
  check_layouts({GasWeights::trilinear, {16, 48, 72}, {true, true, true}, false, GasModel::a, DragLaw::di_felice});
}

TEST_CASE("grains and gas push each other the same on 1 to 6 ranks: two dimensions, few cells") {
  check_layouts({GasWeights::trilinear, {13, 37, 1}, {false, false, false}, true});
}

TEST_CASE("gas flows without grains, and without a drag law neither feels the other, on 1, 3 and 6 ranks") {
  for (const bool has_drag : {true, false})
    for (const int n_ranks : {1, 3, 6}) {
      const std::optional<World> some = world().first(n_ranks);
      if (!some) continue;
      Scene scene = scene_of({GasWeights::trilinear, {16, 48, 72}, {false, false, false}});
      if (!has_drag) scene.gas->drag.reset();
      Coupling coupling(scene, grid_of(scene), *some, 1);
      FieldNeeds needs;
      needs.gas = true;
      Particles particles(needs);
      std::vector<GrainSeed> seeds;
      if (!has_drag && some->rank() == n_ranks - 1) seeds.push_back(grain(scene, 1, 0));
      put_grains(scene, seeds, particles);
      for (std::int32_t i = 0; i < particles.size(); ++i) particles.gas_acceleration()[0] = 1.0;
      const CouplingReport report = coupling.advance(particles, 0.0, 1e-3);
      CHECK(report.gas.n_parts >= 1);
      CHECK(report.gas.imbalance < 1e-5);
      CHECK(report.least_void_fraction == 1.0);
      CHECK(report.n_floored == 0);
      CHECK(report.momentum_error == 0.0);
      CHECK(report.fastest_exchange == 0.0);
      for (std::int32_t i = 0; i < 3 * particles.size(); ++i) CHECK(particles.gas_acceleration()[i] == 0.0);
    }
}
