// How much nearer to each other grains have come: a bound for all that might meet, and not a wide one where they move together.
#include <catch2/catch.hpp>

#include "engine/contacts/travel.hpp"
#include "tests/unit/contacts_scenes.hpp"

using namespace moraine;
using namespace moraine::contacts_test;

namespace {

void move(Particles& particles, std::span<const Vec3> by, double scale, const Setting& setting, TravelWatch& travel,
          PairList* list) {
  move(particles, by, scale, setting, list, [&](std::int32_t i, Vec3 shift) { travel.follow(i, shift); });
}

constexpr Box everywhere = {{-infinity, -infinity, -infinity}, {infinity, infinity, infinity}};

}  // namespace

TEST_CASE(
    "as long as no grains have come nearer by the skin, all that touch are in the pair list, however far they went") {
  std::uint64_t seed = 1;
  int n_far = 0;
  std::size_t n_new = 0;
  for (const Setting& setting : settings_of_all_shapes())
    for (const Flow flow : all_flows)
      for (const int n_threads : {1, 3}) {
        INFO("seed " << seed);
        shapes::Dice dice(++seed);
        Particles particles = random_particles(setting, seed);
        Built built;
        build(built, particles, setting, needs_of(setting), {}, n_threads);
        TravelWatch travel;
        travel.begin(particles, everywhere, n_threads);
        const std::array<Vec3, 4> chosen = {dice.direction(), dice.direction(), dice.direction(), dice.direction()};
        std::vector<Vec3> by;
        for (std::int32_t i = 0; i < particles.size(); ++i)
          by.push_back(moved(flow, particles.position(i), setting, chosen, dice));
        // The bound grows in proportion to the displacements: one small move tells how far grains may go.
        const double small = 1e-3 * setting.skin;
        move(particles, by, small, setting, travel, &built.list);
        const double bound = travel.measure(particles, built.cells, setting.skin, n_threads).of_pairs();
        const PairCount before = pairs_by_brute_force(particles, setting, 0.0);
        move(particles, by, small * (0.4999 * setting.skin / bound - 1.0), setting, travel, &built.list);
        const Travelled travelled = travel.measure(particles, built.cells, setting.skin, n_threads);
        CHECK(travelled.of_pairs() == Approx(0.4999 * setting.skin).epsilon(1e-6));
        CHECK(travelled.border == 0.0);
        CHECK(travelled.furthest >= travelled.of_pairs());
        n_far += travelled.furthest > setting.skin;
        const PairCount listed = pairs_of(built.list, particles);
        for (const auto& [key, n] : pairs_by_brute_force(particles, setting, 0.0)) {
          REQUIRE(listed.contains(key));
          n_new += !before.contains(key);
        }
      }
  CHECK(n_far > 64);  // all that move together, and others
  CHECK(n_new > 100);
}

TEST_CASE("what moves together may go as far as half a cell") {
  Setting setting = settings_of_all_shapes().front();
  Particles particles = random_particles(setting, 5);
  Built built;
  build(built, particles, setting, needs_of(setting), {}, 1);
  TravelWatch travel;
  travel.begin(particles, everywhere, 1);
  const double reach = built.cells.reach();
  move(particles, std::vector<Vec3>(static_cast<std::size_t>(particles.size()), {0.6, 0.0, 0.8}), 0.5 * reach, setting,
       travel, nullptr);
  const Travelled travelled = travel.measure(particles, built.cells, setting.skin, 1);
  CHECK(travelled.furthest == Approx(0.5 * reach));
  CHECK(travelled.of_pairs() == Approx(0.5 * setting.skin));
  CHECK(travel.measure(particles, 1).of_pairs() == Approx(0.5 * reach));  // without cells, as if they went apart
}

TEST_CASE("grains of two ranks do not meet outside of the list before their bounds together make up the skin") {
  std::size_t n_met = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    INFO("seed " << seed);
    shapes::Dice dice(seed);
    Setting setting;
    setting.largest = 0.05;
    setting.smallest = 0.03;
    setting.skin = dice.uniform(0.002, 0.02);
    setting.n = 150;
    const double middle = 0.5;
    std::array<Particles, 2> ranks = {Particles(FieldNeeds{}), Particles(FieldNeeds{})};
    std::array<double, 2> bounds{};
    std::array<std::vector<Vec3>, 2> places;
    const Vec3 together = dice.direction();
    for (std::size_t rank = 0; rank < 2; ++rank) {
      setting.domain = {{rank == 0 ? 0.0 : middle, 0, 0}, {rank == 0 ? middle : 1.0, 0.3, 0.3}};
      Particles& particles = ranks[rank] = random_particles(setting, 1000 * seed + rank);
      Built built;
      build(built, particles, setting, needs_of(setting), {}, 1);
      for (std::int32_t i = 0; i < particles.size(); ++i) places[rank].push_back(particles.position(i));
      Box inner = everywhere;
      (rank == 0 ? inner.high : inner.low).x = middle + (rank == 0 ? -2.0 : 2.0) * built.cells.reach();
      TravelWatch travel;
      travel.begin(particles, inner, 1);
      std::vector<Vec3> by;
      const double noise = dice.uniform(0, 0.02);
      for (std::int32_t i = 0; i < particles.size(); ++i)
        by.push_back((rank == 0 ? 0.02 : -0.01) * together + noise * dice.direction());
      move(particles, by, 1.0, setting, travel, nullptr);
      bounds[rank] = travel.measure(particles, built.cells, setting.skin, 1).of_pairs();
    }
    for (std::int32_t i = 0; i < ranks[0].size(); ++i)
      for (std::int32_t j = 0; j < ranks[1].size(); ++j) {
        const double radii = ranks[0].radius(i) + ranks[1].radius(j);
        const Vec3 was = places[0][static_cast<std::size_t>(i)] - places[1][static_cast<std::size_t>(j)];
        if (length(was) < radii + setting.skin) continue;  // in the list
        const bool meet = length(ranks[0].position(i) - ranks[1].position(j)) < radii;
        n_met += meet;
        if (meet) REQUIRE(bounds[0] + bounds[1] > setting.skin);
      }
  }
  CHECK(n_met > 50);
}
