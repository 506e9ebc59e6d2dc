// A run on many ranks, foretold: the counts are those of brute force, and the predicted time follows from them.
#include "engine/particles/fill.hpp"
#include "engine/run/gas_projection.hpp"
#include "engine/run/plan.hpp"
#include "engine/run/projection.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <set>

#include "engine/contacts/ghost_rule.hpp"
#include "engine/run/decomposition.hpp"
#include "kernels/base/random.hpp"
#include "tests/support/flow_scenes.hpp"

using namespace moraine;

namespace {

/// Grains of 6 to 14 mm anywhere in a flat box, overlapping at will.
Scene loose_scene(int periodic_mask, bool rotation, int n = 700) {
  Scene scene = scenes::basic();
  scene.domain.low = {-0.1, 0.2, 1.0};
  scene.domain.high = {0.08, 0.42, 1.061};
  for (std::size_t axis = 0; axis < 3; ++axis) scene.domain.periodic[axis] = (periodic_mask >> axis & 1) != 0;
  scene.contact.rotation = rotation;
  ListedGrains list;
  list.has_radius = true;
  for (int i = 0; i < n; ++i) {
    const auto u = [&](std::uint64_t draw) {
      return random_uniform(11, static_cast<std::uint64_t>(i), RandomPurpose::position, draw);
    };
    GrainSeed grain;
    for (int axis = 0; axis < 3; ++axis)
      grain.position[axis] =
          scene.domain.low[axis] + scene.domain.box().size()[axis] * u(static_cast<std::uint64_t>(axis));
    grain.radius = 0.003 + 0.004 * u(3);
    list.grains.push_back(grain);
  }
  ParticleGroup group;
  group.material = "glass";
  group.fill = list;
  scene.particles = {group};
  return scene;
}

const std::vector<GrainSeed>& grains_of(const Scene& scene) {
  return std::get<ListedGrains>(scene.particles[0].fill).grains;
}

struct Expected {
  std::vector<RankCounts> ranks;
  int n_unserved = 0;  // pairs across a cut of which an owner has no ghost
};

/// Everything with everything, over 27 images.
Expected by_brute_force(const Scene& scene, int n_parts) {
  const std::vector<GrainSeed>& grains = grains_of(scene);
  const Plan plan = make_plan(scene, 1);
  double largest = 0.0;
  std::vector<Vec3> positions;
  for (const GrainSeed& grain : grains) {
    positions.push_back(grain.position);
    largest = std::max(largest, grain.radius);
  }
  const Subdomains parts = decompose(World(), n_parts, positions, {}, scene, largest, widest_skin(scene, plan));
  std::vector<Vec3> shifts;
  for (int image = 0; image < 27; ++image) {
    Vec3 shift;
    bool exists = true;
    for (int axis = 0, code = image; axis < 3; ++axis, code /= 3) {
      const int step = code % 3 - 1;
      shift[axis] = step == 0 ? 0.0 : step * scene.domain.box().size()[axis];
      exists = exists && (step == 0 || scene.domain.periodic[static_cast<std::size_t>(axis)]);
    }
    if (exists) shifts.push_back(shift);
  }
  Expected expected;
  expected.ranks.resize(static_cast<std::size_t>(n_parts));
  std::vector<std::set<int>> needed_by(grains.size());
  std::vector<std::set<std::size_t>> partners(static_cast<std::size_t>(n_parts));
  for (std::size_t i = 0; i < grains.size(); ++i) {
    const auto a = static_cast<std::size_t>(parts.owner(positions[i]));
    ++expected.ranks[a].n_grains;
    const double reach = ghost_reach(grains[i].radius, largest, plan.skin);
    for (std::size_t b = 0; b < expected.ranks.size(); ++b)
      for (const Vec3& shift : shifts)
        if (b != a && squared_distance(positions[i] + shift, parts.box(static_cast<int>(b))) < reach * reach)
          needed_by[i].insert(static_cast<int>(b));
    for (const int b : needed_by[i]) {
      ++expected.ranks[a].n_sent;
      ++expected.ranks[static_cast<std::size_t>(b)].n_ghosts;
      expected.ranks[a].bytes += scene.contact.rotation ? 72 : 48;
      partners[a].insert(static_cast<std::size_t>(b) + 1000);  // sent to
      partners[static_cast<std::size_t>(b)].insert(a + 2000);  // received from
    }
  }
  for (std::size_t r = 0; r < expected.ranks.size(); ++r) {
    std::set<std::size_t> ranks;
    for (const std::size_t p : partners[r]) {
      ranks.insert(p % 1000);
      expected.ranks[r].n_messages += p < 2000 ? 1 : 0;
    }
    expected.ranks[r].n_neighbours = static_cast<int>(ranks.size());
  }
  std::set<std::size_t> border;
  for (std::size_t i = 0; i < grains.size(); ++i)
    for (std::size_t j = i + 1; j < grains.size(); ++j)
      for (const Vec3& shift : shifts) {
        const double distance = length(positions[i] + shift - positions[j]),
                     radii = grains[i].radius + grains[j].radius;
        if (!(distance < radii + plan.skin)) continue;
        const int a = parts.owner(positions[i]), b = parts.owner(positions[j]);
        for (const int owner : std::set<int>{a, b}) {
          RankCounts& rank = expected.ranks[static_cast<std::size_t>(owner)];
          ++rank.n_pairs;
          rank.n_contacts += distance < radii ? 1 : 0;
          rank.n_border_pairs += a != b ? 1 : 0;
        }
        if (a == b) continue;
        border.insert({i, j});
        expected.n_unserved += needed_by[i].count(b) + needed_by[j].count(a) == 2 ? 0 : 1;
      }
  for (const std::size_t i : border)
    ++expected.ranks[static_cast<std::size_t>(parts.owner(positions[i]))].n_border_grains;
  return expected;
}

RankCounts even_rank(std::int64_t n) {
  RankCounts rank;
  rank.n_grains = n;
  rank.n_pairs = 4 * n;
  return rank;
}

}  // namespace

TEST_CASE("what the ranks hold and send is what brute force counts, and no pair across a cut lacks its ghost") {
  for (const int mask : {0, 1, 3, 7})
    for (const int n_parts : {1, 2, 3, 5, 8, 16}) {
      const Scene scene = loose_scene(mask, n_parts % 2 == 0);
      const Expected expected = by_brute_force(scene, n_parts);
      const std::vector<RankCounts> counted = count_ranks(scene, grains_of(scene), n_parts);
      REQUIRE(counted.size() == expected.ranks.size());
      for (std::size_t r = 0; r < counted.size(); ++r) {
        INFO("periodic " << mask << ", rank " << r << " of " << n_parts);
        CHECK(counted[r].n_grains == expected.ranks[r].n_grains);
        CHECK(counted[r].n_border_grains == expected.ranks[r].n_border_grains);
        CHECK(counted[r].n_pairs == expected.ranks[r].n_pairs);
        CHECK(counted[r].n_border_pairs == expected.ranks[r].n_border_pairs);
        CHECK(counted[r].n_contacts == expected.ranks[r].n_contacts);
        CHECK(counted[r].n_ghosts == expected.ranks[r].n_ghosts);
        CHECK(counted[r].n_sent == expected.ranks[r].n_sent);
        CHECK(counted[r].n_neighbours == expected.ranks[r].n_neighbours);
        CHECK(counted[r].n_messages == expected.ranks[r].n_messages);
        CHECK(counted[r].bytes == expected.ranks[r].bytes);
      }
      CHECK(expected.n_unserved == 0);
      std::int64_t n_border_pairs = 0;
      for (const RankCounts& rank : counted) n_border_pairs += rank.n_border_pairs;
      CHECK((n_border_pairs > 10) == (n_parts > 1));
    }
}

TEST_CASE("counts do not depend on the number of threads that count") {
  const Scene scene = loose_scene(3, true);
  const Projection one(scene, grains_of(scene), 1), three(scene, grains_of(scene), 3);
  CHECK(one.count(7) == three.count(7));
  CHECK(one.count(64) == three.count(64));  // some ranks have no grains
}

TEST_CASE("without messages and with even work, P ranks are P times as fast") {
  const std::vector<RankCounts> ranks(8, even_rank(1000));
  Rates rates;
  rates.unit = 1e-8;
  const Prediction p = predict(ranks, 8.0 * work_of(ranks[0]), 72, rates, {"any", 1e-6, 1e9});
  CHECK(p.one_rank == Approx(8.0 * 8000 * 1e-8));
  CHECK(p.step == Approx(8000 * 1e-8));
  CHECK(p.efficiency == Approx(1.0));
  CHECK(p.imbalance == Approx(1.0));
  CHECK(p.work == Approx(1.0));
  CHECK(p.messages == 0.0);
  CHECK(p.waiting == Approx(0.0).margin(1e-12));
}

TEST_CASE("the fullest rank sets the pace and the others wait for it") {
  std::vector<RankCounts> ranks(4, even_rank(1000));
  ranks[2] = even_rank(2000);
  Rates rates;
  rates.unit = 1e-8;
  const Prediction p = predict(ranks, 5.0 * 8000, 72, rates, {"any", 1e-6, 1e9});
  CHECK(p.step == Approx(16000 * 1e-8));
  CHECK(p.efficiency == Approx(5.0 / 8.0));
  CHECK(p.imbalance == Approx(1.6));
  CHECK(p.waiting == Approx(3.0 / 8.0));
}

TEST_CASE("messages cost what interior work does not hide, and packing always") {
  RankCounts rank = even_rank(1000);  // 8000 units
  rank.n_border_pairs = 1000;
  rank.n_border_grains = 250;  // interior: 6000 units
  rank.n_sent = rank.n_ghosts = 500;
  rank.n_neighbours = rank.n_messages = 2;
  const std::vector<RankCounts> ranks(2, rank);
  Rates rates;
  rates.unit = 1e-8;  // 60 us inside
  rates.copy = 1e-10;
  rates.fixed = 1e-6;
  const double packing = 2 * 500 * 72 * 1e-10;
  const Prediction fast = predict(ranks, 16000, 72, rates, {"fast", 1e-6, 1e9});  // 2 us + 36 us
  CHECK(fast.step == Approx(1e-6 + 80e-6 + packing));
  CHECK(fast.messages == Approx(packing / fast.step));
  const Prediction slow = predict(ranks, 16000, 72, rates, {"slow", 10e-6, 0.5e9});  // 20 us + 72 us
  CHECK(slow.step == Approx(1e-6 + 80e-6 + packing + 32e-6));
  CHECK(slow.messages == Approx((packing + 32e-6) / slow.step));
  CHECK(slow.work + slow.messages + slow.waiting + rates.fixed / slow.step == Approx(1.0));
}

TEST_CASE("a gas step waits for the rank with most grains, for that with most cells, for the first, and for messages") {
  Scene scene = scenes::fluidised_bed();
  GasLayout layout;
  layout.n_gas_ranks = 2;
  layout.cells_of_root = 100;
  layout.n_reductions = 7;
  layout.ranks.resize(4);
  for (GasRank& rank : layout.ranks) rank.n_grains = 1000;
  layout.ranks[3].n_grains = 2000;
  layout.ranks[0].n_cells = 5000;
  layout.ranks[1].n_cells = 7000;
  layout.ranks[1].flow.step = {{2, 2, 3000, 1000}, 1};
  layout.ranks[1].flow.part = {{1, 1, 0, 0}, 2};
  layout.ranks[1].flow.iteration = {{10, 10, 0, 0}, 3};
  const GasRates rates{1e-7, 1e-8, 1e-9, 2.0, 5.0, 1};
  Prediction steps;
  steps.step = 1e-4;
  steps.one_rank = 3.5e-4;
  const Network network{"any", 1e-6, 1e9};
  const GasPrediction p = predict_gas(scene, layout, rates, {}, network, steps);
  CHECK(p.grain_steps == static_cast<int>(make_plan(scene, 1).gas_steps));
  CHECK(p.grains == Approx(2000 * 1e-8));
  CHECK(p.cells == Approx(7000 * 1e-7));
  CHECK(p.root == Approx(5 * 100 * 1e-9));
  // 2 + 2 + 50 messages and 3 us for 3000 bytes; 1 + 4 + 15 reductions of two ranks and 7 of four.
  CHECK(p.messages == Approx(54e-6 + 3e-6 + 20 * 2e-6 + 7 * 4e-6));
  CHECK(p.whole == Approx(p.grain_steps * 1e-4 + p.grains + p.cells + p.root + p.messages));
  CHECK(p.one_rank == Approx(p.grain_steps * 3.5e-4 + 5000 * 1e-8 + 12000 * 1e-7));
  CHECK(p.efficiency == Approx(p.one_rank / (4.0 * p.whole)));
}

TEST_CASE("a gas lies on as many ranks as its cells are worth, and its rates are measured without moving grains") {
  Scene scene = scenes::fluidised_bed();
  const std::vector<GrainSeed> grains = make_grains(scene, 1);
  std::vector<Vec3> positions;
  for (const GrainSeed& grain : grains) positions.push_back(grain.position);
  const std::vector<std::int32_t> owners(grains.size(), 0);
  CHECK(lay_out_gas(scene, positions, owners, 4).n_gas_ranks == 1);
  scene.gas->cells = {48, 24, 96};  // nearly cubes: halved along all axes
  const GasLayout layout = lay_out_gas(scene, positions, owners, 4);
  CHECK(layout.n_gas_ranks == 4);
  std::int64_t n_cells = 0;
  for (const GasRank& rank : layout.ranks) n_cells += rank.n_cells;
  CHECK(n_cells == 48 * 24 * 96);
  CHECK(layout.ranks[0].n_grains == static_cast<std::int64_t>(grains.size()));
  CHECK(layout.ranks[0].exchange.n_sent > 0);
  CHECK(layout.ranks[3].exchange.n_received <= layout.ranks[0].exchange.n_sent);
  // 24 x 12 x 48 cells and coarser ones are the first rank's alone.
  CHECK(layout.cells_of_root == 24 * 12 * 48 + 12 * 6 * 24 + 6 * 3 * 12 + 3 * 2 * 6 + 2 * 1 * 3 + 1 * 1 * 2 + 1);
  const GasRates rates = measure_gas_rates(scene, grains, 1, 0.02);
  CHECK(rates.n_steps >= 3);
  CHECK(rates.n_parts >= 1.0);
  CHECK(rates.cell > 0.0);
  CHECK(rates.grain > 0.0);
  CHECK(rates.root_cell > 0.0);
}

TEST_CASE("rates are measured on a part of a large scene and on all of a small one") {
  Scene scene = scenes::periodic_flow();
  std::vector<GrainSeed> grains;
  const Vec3 low = scene.domain.low, size = scene.domain.box().size();
  const int n = 9;
  for (int i = 0; i < n * n * n; ++i) {
    GrainSeed grain;
    const int cell[3] = {i % n, i / n % n, i / n / n};
    for (int axis = 0; axis < 3; ++axis) grain.position[axis] = low[axis] + (cell[axis] + 0.5) * size[axis] / n;
    grain.radius = 0.45 * std::min({size.x, size.y, size.z}) / n;
    grains.push_back(grain);
  }
  const Rates all = measure_rates(scene, grains, 1, 100000, 0.05), part = measure_rates(scene, grains, 1, 300, 0.05);
  CHECK(all.n_grains == n * n * n);
  CHECK(part.n_grains <= 400);
  CHECK(part.n_grains >= 100);
  for (const Rates& rates : {all, part}) {
    CHECK(rates.n_steps >= 5);
    CHECK(rates.unit > 1e-10);
    CHECK(rates.unit < 1e-5);
    CHECK(rates.copy > 1e-12);
    CHECK(rates.copy < 1e-7);
    CHECK(rates.fixed >= 0.0);
    CHECK(rates.bytes_per_grain > 64.0);
  }
}
