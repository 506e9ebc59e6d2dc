// Room for each grain: while none has used up its own, all that touch are in the list; and the list is short where grains keep their places.
#include <catch2/catch.hpp>

#include "engine/contacts/rooms.hpp"
#include "kernels/motion/motion.hpp"
#include "tests/unit/contacts_scenes.hpp"

using namespace moraine;
using namespace moraine::contacts_test;

namespace {

double used(const Rooms& rooms, const Particles& particles, double age) {
  return rooms.measure(particles, age, 2).in_frames;
}

/// Grains that move as `flow` says, and the list that is made for that.
struct Moving {
  Particles particles;
  std::vector<Vec3> by;  // [m/s] of each sorted grain
  Rooms rooms;
  std::vector<double> room;
  Built built;

  Moving(Particles grains, const Setting& setting, Flow flow, std::uint64_t seed, bool is_even, int n_threads)
      : particles(std::move(grains)) {
    shapes::Dice dice(seed);
    const std::array<Vec3, 4> chosen = {dice.direction(), dice.direction(), dice.direction(), dice.direction()};
    for (std::int32_t i = 0; i < particles.size(); ++i) {
      const Vec3 v = moved(flow, particles.position(i), setting, chosen, dice);
      for (int axis = 0; axis < 3; ++axis) particles.set_real(Field::velocity, i, axis, v[axis]);
    }
    build(built, particles, setting, needs_of(setting), {}, n_threads, [&](const Cells& cells) {
      const ListWidth width = {setting.skin, setting.skin, 1e-3, setting.smallest + setting.largest, is_even};
      room = rooms.begin(particles, cells, width, 2.0 * setting.largest, n_threads);
      return room;
    });
    for (std::int32_t i = 0; i < particles.size(); ++i) by.push_back(particles.velocity(i));
  }
};

/// Lets the grains go by `by` as long as the list is good, and looks for pairs that touch then. Returns how many of them did not before.
std::size_t go_as_far_as_is_good(Moving& moving, const Setting& setting) {
  const PairCount before = pairs_by_brute_force(moving.particles, setting, 0.0);
  const auto go = [&](double time) {
    move(moving.particles, moving.by, time, setting, &moving.built.list,
         [&](std::int32_t i, Vec3 shift) { moving.rooms.follow(i, shift); });
  };
  // What is used grows in proportion to time: one short one tells how long the list is good.
  const double little = 1e-5;
  go(little);
  const double share = used(moving.rooms, moving.particles, little);
  REQUIRE(share > 0.0);
  // All alike could go on for ever.
  const double age = std::min({0.9999 * little / share, 0.9999 * moving.rooms.good_for(), 0.3});
  go(age - little);
  CHECK(used(moving.rooms, moving.particles, age) <= 1.0);
  const PairCount listed = pairs_of(moving.built.list, moving.particles);
  std::size_t n_new = 0;
  for (const auto& [key, count] : pairs_by_brute_force(moving.particles, setting, 0.0)) {
    REQUIRE(listed.contains(key));
    n_new += !before.contains(key);
  }
  return n_new;
}

}  // namespace

TEST_CASE("while no grain has used up its room, all that touch are in the list, however they turn meanwhile") {
  std::uint64_t seed = 1;
  std::size_t n_new = 0;
  for (Setting setting : settings_of_all_shapes())
    for (const Flow flow : all_flows)
      for (const int variant : {0, 1, 2, 3}) {
        INFO("seed " << seed);
        shapes::Dice dice(++seed);
        const bool is_even = variant & 1, turn_away = variant & 2;
        setting.skin = dice.uniform(0.1, 0.9) * setting.largest;
        Moving moving(random_particles(setting, seed), setting, flow, seed, is_even, 1 + variant % 3);
        for (std::size_t i = 0; i < moving.by.size(); ++i) {
          REQUIRE(moving.room[i] > 0.0);
          REQUIRE(moving.room[i] <= 0.5 * setting.skin * (1.0 + 1e-12));
          if (turn_away) moving.by[i] += 0.5 * dice.point({-1, -1, -1}, {1, 1, 1});
        }
        n_new += go_as_far_as_is_good(moving, setting);
      }
  CHECK(n_new > 100);
}

TEST_CASE("while no grain has used up its room, bodies that come together have not met outside of the list") {
  std::size_t n_new = 0, n_expired = 0;
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    INFO("seed " << seed);
    shapes::Dice dice(seed);
    Setting setting;
    const double gap = dice.uniform(0.0, 0.25);
    setting.domain = {{dice.uniform(-1, 0), 0, 0}, {1.0, 0.3, 0.3}};
    setting.domain.high.x = setting.domain.low.x + 0.7 + gap;
    setting.smallest = setting.largest = 0.03;
    setting.skin = dice.uniform(0.1, 1.0) * setting.largest;
    setting.n = 300;
    Particles particles = random_particles(setting, seed);
    const double middle = 0.5 * (setting.domain.low.x + setting.domain.high.x);
    for (std::int32_t i = 0; i < particles.size(); ++i) {  // none between the bodies
      const double x = particles.position(i).x, end = x < middle ? setting.domain.low.x : setting.domain.high.x;
      particles.set_real(Field::position, i, 0, end + (x - end) * 0.7 / (0.7 + gap));
    }
    Moving moving(std::move(particles), setting, Flow::halves, seed, dice.index(2) == 0, 1);
    n_expired += moving.rooms.good_for() < 0.3;
    n_new += go_as_far_as_is_good(moving, setting);
  }
  CHECK(n_new > 100);
  CHECK(n_expired > 100);
}

TEST_CASE("grains that keep their places get little room, and those that go fast get as much as the list lasts") {
  Setting setting;
  setting.domain = {{0, 0, 0}, {1, 1, 1}};
  setting.smallest = setting.largest = 0.02;
  setting.skin = 0.02;
  setting.n = 8000;
  // One in ten flies about in the upper half; the lower rests.
  Particles particles = random_particles(setting, 3);
  shapes::Dice dice(4);
  for (std::int32_t i = 0; i < particles.size(); ++i)
    if (particles.position(i).z > 0.6 && dice.index(10) == 0) {
      const Vec3 v = dice.direction();
      for (int axis = 0; axis < 3; ++axis) particles.set_real(Field::velocity, i, axis, v[axis]);
    }
  Built narrow, wide;
  Rooms rooms;
  std::vector<double> room;
  build(narrow, particles, setting, needs_of(setting), {}, 1, [&](const Cells& cells) {
    return room = rooms.begin(particles, cells, {setting.skin, setting.skin, 1e-4, 0.04, false}, 0.04, 1);
  });
  double most_at_rest = 0.0, least_fast = infinity;
  for (std::int32_t i = 0; i < particles.size(); ++i) {
    if (particles.position(i).z < 0.3)
      most_at_rest = std::max(most_at_rest, room[static_cast<std::size_t>(i)]);
    else if (length(particles.velocity(i)) > 0.5)
      least_fast = std::min(least_fast, room[static_cast<std::size_t>(i)]);
  }
  CHECK(most_at_rest < 0.02 * 0.04);
  CHECK(least_fast > 0.3 * 0.5 * setting.skin);
  CHECK(rooms.wanted_skin() > 0.0);
  const std::int64_t n_narrow = narrow.list.size();
  build(wide, particles, setting, needs_of(setting), {}, 1);
  CHECK(static_cast<double>(n_narrow) < 0.7 * static_cast<double>(wide.list.size()));
}

TEST_CASE("where cells say nothing of who may meet, all grains have half the skin, wherever all go") {
  Setting setting = settings_of_all_shapes().front();
  Particles particles = random_particles(setting, 5);
  Rooms rooms;
  const std::vector<double> room = rooms.begin_at_rest(particles, setting.skin, 3);
  for (const double r : room) CHECK(r == 0.5 * setting.skin);
  move(particles, std::vector<Vec3>(room.size(), {0.6, 0.0, 0.8}), 0.25 * setting.skin, setting, nullptr,
       [](std::int32_t, Vec3) {});
  CHECK(used(rooms, particles, 1.0) == Approx(0.5));
  CHECK(rooms.furthest(particles, 2) == Approx(0.25 * setting.skin));
}
