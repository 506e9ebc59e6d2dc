#include "bench/kernels/suspension.hpp"

#include <cmath>
#include <map>
#include <memory>

#include "engine/contacts/cells.hpp"
#include "kernels/base/random.hpp"

namespace moraine::bench {

namespace {

constexpr double pitch =
    1.2 * Suspension::diameter;  // of the lattice that grains are shaken from: a solid fraction of 0.3

double random(std::uint64_t gid, std::uint64_t draw) {  // in [-1, 1)
  return 2.0 * random_uniform(5, gid, RandomPurpose::choice, draw) - 1.0;
}

}  // namespace

Suspension::Suspension(std::int32_t n, bool has_rotation) : particles({has_rotation, false, false, false, true}) {
  const auto side = static_cast<std::int32_t>(std::ceil(std::cbrt(static_cast<double>(n))));
  const int cells = static_cast<int>(std::ceil(side * pitch / spacing));
  grid.n = {cells, cells, cells};
  grid.spacing = {spacing, spacing, spacing};
  particles.resize(n);
  const double mass = 2500.0 * 0.5236 * diameter * diameter * diameter;
  for (std::int32_t i = 0; i < n; ++i) {
    const auto gid = static_cast<std::uint64_t>(i);
    const std::array<std::int32_t, 3> site = {i % side, i / side % side, i / side / side};
    for (int c = 0; c < 3; ++c) {
      const auto draw = static_cast<std::uint64_t>(c);
      particles.set_real(Field::position, i, c,
                         pitch * (site[static_cast<std::size_t>(c)] + 0.5 + 0.4 * random(gid, draw)));
      particles.set_real(Field::velocity, i, c, 0.1 * random(gid, draw + 3));
      if (has_rotation) particles.set_real(Field::angular_velocity, i, c, random(gid, draw + 6));
    }
    particles.set_real(Field::radius, i, 0, 0.5 * diameter);
    particles.set_real(Field::inverse_mass, i, 0, 1.0 / mass);
    if (has_rotation) particles.set_real(Field::inverse_inertia, i, 0, 10.0 / (mass * diameter * diameter));
    particles.set_gid(i, gid);
    particles.set_material(i, 0);
  }
  Cells order;
  const double length = cells * spacing;
  order.sort(Centres::of(particles), {{}, {length, length, length}}, {false, false, false}, 1.2 * diameter, 1);
  particles.reorder(order.order(), 1);
}

CellWeights Suspension::weights(GasWeights kind) const {
  return CellWeights(kind, grid.n, grid.low, grid.spacing, grid.periodic);
}

CellWindow Suspension::window(const CellWeights& weights) const {
  const GrainExtent all = extent(grains());
  return weights.around(all.low, all.high);
}

Suspension& suspension(std::int32_t n, bool has_rotation) {
  static std::map<std::pair<std::int32_t, bool>, std::unique_ptr<Suspension>> kept;
  std::unique_ptr<Suspension>& found = kept[{n, has_rotation}];
  if (!found) found = std::make_unique<Suspension>(n, has_rotation);
  return *found;
}

std::string name_of(std::int32_t n) {
  return n >= 1000000 ? std::to_string(n / 1000000) + "M" : std::to_string(n / 1000) + "k";
}

}  // namespace moraine::bench
