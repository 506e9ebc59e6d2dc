// Invented gas and grains for tests of what looks at them: any rank can make its part of the same whole.
#pragma once

#include <array>
#include <cstdint>

#include "comm/grid_share.hpp"
#include "engine/gas/grid.hpp"
#include "engine/gas/grid_field.hpp"
#include "engine/particles/particles.hpp"
#include "engine/run/gas_probes.hpp"
#include "engine/scene/scene.hpp"
#include "kernels/base/random.hpp"

namespace moraine::gas_fields {

/// 6 x 10 x 8 cells of 0.1 x 0.05 x 0.05 m.
inline Scene scene() {
  Scene scene;
  scene.domain = {{0, 0, 0}, {0.6, 0.5, 0.4}};
  scene.gas.emplace();
  scene.gas->cells = {6, 10, 8};
  return scene;
}

inline GasGrid grid(const Scene& scene) {
  GasGrid grid;
  grid.n = scene.gas->cells;
  grid.low = scene.domain.low;
  const Vec3 size = scene.domain.box().size();
  grid.spacing = {size.x / grid.n[0], size.y / grid.n[1], size.z / grid.n[2]};
  grid.periodic = scene.domain.periodic;
  return grid;
}

/// The gas of one rank: pressure linear in space, ghost layers full of nonsense; other fields at random.
struct InventedGas {
  GasGrid grid;
  GridShare share;
  CellBlock block;
  GridField<> pressure, void_fraction;
  std::array<GridField<>, 3> velocity;
  GasMeans means;

  InventedGas(const Scene& scene, int n_ranks, int rank) : grid(gas_fields::grid(scene)) {
    share = share_out(grid.n, grid.periodic, n_ranks, 1);
    if (rank < share.n_ranks()) block = share.block(rank);
    means = GasMeans(scene, block);
    if (block.is_empty()) return;
    const GridLayout layout(block, gas_ghosts);
    constexpr double nonsense = 1e6;
    for (GridField<>* field : {&pressure, &void_fraction, &velocity[0], &velocity[1], &velocity[2]})
      *field = GridField<>(layout, nonsense);
    for (int k = block.low[2]; k < block.high[2]; ++k)
      for (int j = block.low[1]; j < block.high[1]; ++j)
        for (int i = block.low[0]; i < block.high[0]; ++i) set({i, j, k});
  }

  static double pressure_at(Vec3 p) { return 100.0 + 7.0 * p.x - 3.0 * p.y - 50.0 * p.z; }

  GasView view() {
    if (block.is_empty()) return {grid, share, nullptr, nullptr, {}, &means};
    return {grid, share, &void_fraction, &pressure, {&velocity[0], &velocity[1], &velocity[2]}, &means};
  }

 private:
  void set(const std::array<int, 3>& cell) {
    const int i = cell[0] - block.low[0], j = cell[1] - block.low[1], k = cell[2] - block.low[2];
    const Vec3 centre = grid.low + Vec3{(cell[0] + 0.5) * grid.spacing.x, (cell[1] + 0.5) * grid.spacing.y,
                                        (cell[2] + 0.5) * grid.spacing.z};
    const auto number = static_cast<std::uint64_t>((cell[2] * grid.n[1] + cell[1]) * grid.n[0] + cell[0]);
    const auto draw = [number](std::uint64_t which) {
      return random_uniform(5, number, RandomPurpose::velocity, which);
    };
    pressure(i, j, k) = pressure_at(centre);
    void_fraction(i, j, k) = 0.4 + 0.6 * draw(0);
    for (std::size_t axis = 0; axis < 3; ++axis) velocity[axis](i, j, k) = draw(1 + axis) - 0.3;
  }
};

struct Grain {
  Vec3 position, velocity;
  double radius = 0.01;  // [m]
  double mass = 1.0;     // [kg]
};

inline Particles particles(const std::vector<Grain>& grains) {
  Particles particles(FieldNeeds{});
  particles.resize(static_cast<std::int32_t>(grains.size()));
  for (std::size_t i = 0; i < grains.size(); ++i) {
    double* const record = particles.record(static_cast<std::int64_t>(i));
    for (int axis = 0; axis < 3; ++axis) {
      record[axis] = grains[i].position[axis];
      record[4 + axis] = grains[i].velocity[axis];
    }
    record[3] = grains[i].radius;
    record[7] = 1.0 / grains[i].mass;
  }
  return particles;
}

/// Grains at random all over the domain, of very different sizes and speeds.
inline std::vector<Grain> cloud(const Scene& scene, std::uint64_t n) {
  std::vector<Grain> grains;
  const Vec3 size = scene.domain.box().size();
  for (std::uint64_t g = 0; g < n; ++g) {
    const auto draw = [g](std::uint64_t which) { return random_uniform(9, g, RandomPurpose::position, which); };
    Grain grain;
    grain.position = scene.domain.low + Vec3{size.x * draw(0), size.y * draw(1), size.z * draw(2) * draw(3)};
    grain.velocity = Vec3{draw(4) - 0.5, 3.0 * draw(5), draw(6)};
    grain.radius = 1e-4 + 1e-2 * draw(7);
    grain.mass = 1e9 * grain.radius * grain.radius * grain.radius;
    grains.push_back(grain);
  }
  return grains;
}

}  // namespace moraine::gas_fields
