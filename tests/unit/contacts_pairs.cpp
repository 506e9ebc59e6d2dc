// The pair list: complete, without doubles, the right way round, and indexed for the sums.
#include <catch2/catch.hpp>

#include <set>

#include "tests/unit/contacts_scenes.hpp"

using namespace moraine;
using namespace moraine::contacts_test;

namespace {

/// Boxes from wide to hardly wider than a grain, in all combinations of periodic directions.
std::vector<Setting> settings() {
  std::vector<Setting> all;
  const Vec3 sizes[] = {
      {1.0, 1.1, 1.2}, {0.9, 0.201, 0.3}, {0.25, 0.41, 0.42}, {0.201, 0.203, 0.202}, {2.0, 0.15, 0.45}};
  for (const Vec3 size : sizes)
    for (int mask = 0; mask < 8; ++mask)
      for (const double skin : {0.0, 0.02}) {
        Setting setting;
        setting.domain.low = {-0.3, 0.1, 7.0};
        setting.domain.high = setting.domain.low + size;
        setting.periodic = {(mask & 1) != 0, (mask & 2) != 0, (mask & 4) != 0};
        double widest = 1.0;
        for (int axis = 0; axis < 3; ++axis)
          if (setting.periodic[static_cast<std::size_t>(axis)]) widest = std::min(widest, size[axis]);
        setting.largest =
            std::min(0.1, 0.499 * (widest - skin));  // the widest that the run allows: 2 r + skin < period
        setting.smallest = 0.3 * setting.largest;
        setting.skin = skin;
        setting.n = static_cast<int>(80 + 40 * (mask % 3));
        all.push_back(setting);
      }
  return all;
}

}  // namespace

TEST_CASE("the pair list holds every near pair of grains and images once, from the lower gid, for any threads") {
  std::uint64_t seed = 1;
  std::size_t n_pairs = 0, n_through = 0;
  for (const Setting& setting : settings()) {
    const PairCount expected = pairs_by_brute_force(random_particles(setting, seed), setting, setting.skin);
    for (const auto& [key, n] : expected) n_through += std::get<2>(key) != 0;
    n_pairs += expected.size();
    for (const int n_threads : {1, 2, 5}) {
      INFO("seed " << seed << ", " << n_threads << " threads");
      Particles particles = random_particles(setting, seed);
      Built built;
      build(built, particles, setting, needs_of(setting), {}, n_threads);
      REQUIRE(difference(expected, pairs_of(built.list, particles)) == "");
      REQUIRE(built.list.size() == static_cast<std::int64_t>(expected.size()));
    }
    ++seed;
  }
  CHECK(n_pairs > 50000);
  CHECK(n_through > 10000);
}

TEST_CASE(
    "a grain that nearly fills a periodic box is a pair with its own images, once each, and with none where nothing is "
    "periodic") {
  for (int mask = 0; mask < 8; ++mask) {
    Setting setting;
    setting.domain = {{0, 0, 0}, {1.01, 1.02, 1.03}};
    setting.periodic = {(mask & 1) != 0, (mask & 2) != 0, (mask & 4) != 0};
    setting.smallest = setting.largest = 0.5;
    setting.skin = 0.05;
    setting.n = 1;
    Particles particles = random_particles(setting, 3);
    Built built;
    build(built, particles, setting, needs_of(setting), {}, 1);
    const PairCount expected = pairs_by_brute_force(particles, setting, setting.skin);
    CHECK(expected.size() == static_cast<std::size_t>((mask & 1) + (mask >> 1 & 1) + (mask >> 2)));
    CHECK(difference(expected, pairs_of(built.list, particles)) == "");
  }
}

TEST_CASE("threads whose pairs take longer get fewer of them, until all take the same time") {
  Setting setting;
  setting.domain = {{0, 0, 0}, {1.0, 0.3, 0.3}};
  setting.smallest = setting.largest = 0.02;
  setting.skin = 0.01;
  setting.n = 3000;
  constexpr int n_threads = 4;
  Particles particles = random_particles(setting, 1);
  Built built;
  const auto seconds = [&] {  // in one corner a grain costs five times as much as elsewhere
    std::vector<double> of_threads;
    for (const ThreadPairs& share : built.list.threads()) {
      double sum = 0.0;
      for (std::int32_t i = share.grain_begin; i < share.grain_end; ++i) {
        const double work = 4.0 + 0.5 * built.list.n_pairs_of(i);
        sum += particles.position(i).x < 0.25 ? 5.0 * work : work;
      }
      of_threads.push_back(sum);
    }
    return of_threads;
  };
  const auto imbalance = [](const std::vector<double>& times) {
    return n_threads * *std::max_element(times.begin(), times.end()) / std::accumulate(times.begin(), times.end(), 0.0);
  };
  build(built, particles, setting, needs_of(setting), {}, n_threads);
  CHECK(imbalance(seconds()) > 1.5);
  for (int rebuild = 0; rebuild < 10; ++rebuild) {
    built.list.note_times(seconds());
    build(built, particles, setting, needs_of(setting), {}, n_threads);
  }
  CHECK(imbalance(seconds()) < 1.05);
  REQUIRE(difference(pairs_by_brute_force(particles, setting, setting.skin), pairs_of(built.list, particles)) == "");
  // Other numbers of threads, and a thread that had nothing to do.
  build(built, particles, setting, needs_of(setting), {}, 3);
  built.list.note_times(std::vector<double>{1.0, 0.0, 1.0});
  build(built, particles, setting, needs_of(setting), {}, 3);
  REQUIRE(difference(pairs_by_brute_force(particles, setting, setting.skin), pairs_of(built.list, particles)) == "");
  build(built, particles, setting, needs_of(setting), {}, n_threads);
  CHECK(imbalance(seconds()) > 1.5);  // as at the start
}

TEST_CASE("sorting puts every grain in its place once and leaves out those that have left") {
  Setting setting;
  setting.domain = {{0, 0, 0}, {1, 1, 1}};
  setting.largest = setting.smallest = 0.05;
  setting.n = 500;
  Particles particles = random_particles(setting, 9);
  std::set<std::uint64_t> expected;
  for (std::int32_t i = 0; i < setting.n; ++i) {
    if (i % 7 == 3) {
      particles.set_real(Field::position, i, 0, std::nan(""));
    } else {
      expected.insert(particles.gid(i));
    }
  }
  Cells cells;
  cells.sort(Centres::of(particles), setting.domain, setting.periodic, 0.1, 3);
  particles.reorder(cells.order(), 3);
  REQUIRE(particles.size() == static_cast<std::int32_t>(expected.size()));
  std::set<std::uint64_t> found(particles.gids(), particles.gids() + particles.size());
  CHECK(found == expected);
}

TEST_CASE("the order of the grains does not depend on the number of threads") {
  Setting setting;
  setting.domain = {{0, 0, 0}, {1, 2, 3}};
  setting.largest = 0.05;
  setting.smallest = 0.02;
  setting.n = 2000;
  const Particles particles = random_particles(setting, 10);
  Cells one, many;
  one.sort(Centres::of(particles), setting.domain, {true, false, true}, 0.11, 1);
  many.sort(Centres::of(particles), setting.domain, {true, false, true}, 0.11, 7);
  CHECK(one.order() == many.order());
}

TEST_CASE(
    "entries of every grain are complete, in order of the other's gid, with the sign of its side and a slot of their "
    "own") {
  std::uint64_t seed = 101;
  std::size_t n_kept = 0, n_ring = 0;
  for (Setting setting : settings()) {
    if (setting.skin == 0.0) continue;
    setting.n *= 3;
    setting.largest *= 0.6;
    setting.smallest *= 0.6;
    for (const int n_threads : {1, 3}) {
      Particles particles = random_particles(setting, seed);
      Built built;
      build(built, particles, setting, needs_of(setting), {}, n_threads);
      // The slot of each pair, as the sweeps will fill it.
      struct Slot {
        std::int32_t a, b;
        std::uint8_t image;
      };
      std::map<std::uint32_t, Slot> kept;
      std::vector<std::map<std::uint32_t, Slot>> ring(built.list.threads().size());
      for (std::size_t t = 0; t < built.list.threads().size(); ++t) {
        const ThreadPairs& mine = built.list.threads()[t];
        for (const Tile& tile : mine.tiles)
          for (std::int64_t k = tile.ring_begin; k < tile.pair_end; ++k) {
            const auto p = static_cast<std::size_t>(k);
            const Slot slot{mine.a[p], mine.b[p], mine.image.size() ? mine.image[p] : std::uint8_t{0}};
            if (slot.a == particles.dummy()) continue;
            const bool is_new =
                k < tile.kept_begin
                    ? ring[t].emplace(static_cast<std::uint32_t>(k), slot).second
                    : kept.emplace(tile.kept_slot + static_cast<std::uint32_t>(k - tile.kept_begin), slot).second;
            REQUIRE(is_new);
          }
      }
      std::vector<int> n_ends(static_cast<std::size_t>(particles.size()), 0);
      built.list.for_each(particles.dummy(), [&](std::int32_t a, std::int32_t b, std::uint8_t, const PairMemory*) {
        ++n_ends[static_cast<std::size_t>(a)];
        ++n_ends[static_cast<std::size_t>(b)];
      });
      for (std::size_t t = 0; t < built.list.threads().size(); ++t) {
        const ThreadPairs& mine = built.list.threads()[t];
        for (std::int32_t i = mine.grain_begin; i < mine.grain_end; ++i) {
          const auto first = static_cast<std::size_t>(i - mine.grain_begin);
          REQUIRE(static_cast<int>(mine.offsets[first + 1] - mine.offsets[first]) ==
                  n_ends[static_cast<std::size_t>(i)]);
          std::tuple<std::uint64_t, int, int> last{0, -1, -1};
          for (std::uint32_t q = mine.offsets[first]; q < mine.offsets[first + 1]; ++q) {
            const Entry entry = mine.entries[q];
            const bool is_b = (entry & entry_is_b) != 0, is_kept = !built.list.is_in_ring(entry);
            const auto& slots = is_kept ? kept : ring[t];
            (is_kept ? n_kept : n_ring) += 1;
            const auto slot =
                slots.find(is_kept ? entry >> 1 : static_cast<std::uint32_t>(mine.pair_in_ring(i, entry >> 1)));
            REQUIRE(slot != slots.end());
            REQUIRE((is_b ? slot->second.b : slot->second.a) == i);
            const std::int32_t other = is_b ? slot->second.a : slot->second.b;
            const std::tuple<std::uint64_t, int, int> key{particles.gid(other), slot->second.image, is_b};
            REQUIRE(last < key);
            last = key;
          }
        }
      }
    }
    ++seed;
  }
  CHECK(n_kept > 1000);
  CHECK(n_ring > 10000);
}

TEST_CASE("ring slots of a tile's grains are not overwritten before the tile is summed") {
  Setting setting;
  setting.domain = {{0, 0, 0}, {4, 1, 1}};
  setting.largest = 0.06;
  setting.smallest = 0.03;
  setting.skin = 0.01;
  setting.n = 5000;
  for (const std::array<bool, 3> periodic : {std::array{false, false, false}, std::array{true, true, true}})
    for (const int n_threads : {1, 3}) {
      setting.periodic = periodic;
      Particles particles = random_particles(setting, 55);
      Built built;
      build(built, particles, setting, needs_of(setting), {}, n_threads);
      int n_tiles = 0;
      for (const ThreadPairs& mine : built.list.threads())
        for (const Tile& tile : mine.tiles) {
          ++n_tiles;
          const std::int64_t newest = tile.kept_begin;
          for (std::int32_t i = tile.grain_begin; i < tile.grain_end; ++i)
            for (std::uint32_t q = mine.offsets[static_cast<std::size_t>(i - mine.grain_begin)];
                 q < mine.offsets[static_cast<std::size_t>(i - mine.grain_begin) + 1]; ++q) {
              if (!built.list.is_in_ring(mine.entries[q])) continue;
              const std::uint32_t place = mine.entries[q] >> 1;
              const std::int64_t pair = mine.pair_in_ring(i, place);
              REQUIRE((mine.a[static_cast<std::size_t>(pair)] == i || mine.b[static_cast<std::size_t>(pair)] == i));
              REQUIRE(place == mine.ring_slot + (static_cast<std::uint32_t>(pair) & mine.ring_mask));
              REQUIRE(pair < newest);                                      // filled by now ...
              REQUIRE(newest - pair <= std::int64_t{mine.ring_mask} + 1);  // ... and still there
            }
        }
      CHECK(n_tiles > 5);
    }
}

TEST_CASE("a wide bed is walked in columns: the same pairs, and rings that do not grow with its width") {
  std::uint32_t widest_ring = 0;
  for (const double width : {0.6, 1.2, 2.4}) {
    Setting setting;
    setting.domain = {{0, 0, 0}, {2.5, width, 0.02}};
    setting.periodic = {true, false, false};
    setting.smallest = setting.largest = 0.01;
    setting.skin = 0.002;
    setting.n = static_cast<int>(3000 * width);
    for (const int n_threads : {1, 3}) {
      Particles particles = random_particles(setting, 21);
      Built built;
      build(built, particles, setting, needs_of(setting), {}, n_threads);
      CHECK((built.cells.n_columns() > 1) == (width > 1.1));
      if (width < 2.0)
        REQUIRE(difference(pairs_by_brute_force(particles, setting, setting.skin), pairs_of(built.list, particles)) ==
                "");
      if (width < 1.0)
        widest_ring = std::max(widest_ring, built.list.threads()[0].ring_mask);
      else
        CHECK(built.list.threads()[0].ring_mask <= 2 * widest_ring + 1);  // they are powers of two
    }
  }
}

TEST_CASE("where sizes differ by up to 1:100, every near pair of grains and images is found once, for any threads") {
  std::uint64_t seed = 501;
  std::size_t n_pairs = 0;
  for (Setting setting : settings())
    for (const double ratio : {10.0, 100.0}) {
      setting.smallest = setting.largest / ratio;
      setting.is_by_factors = true;
      setting.n = 150;
      const PairCount expected = pairs_by_brute_force(random_particles(setting, seed), setting, setting.skin);
      n_pairs += expected.size();
      for (const int n_threads : {1, 2}) {
        INFO("seed " << seed << ", " << n_threads << " threads");
        Particles particles = random_particles(setting, seed);
        Built built;
        build(built, particles, setting, needs_of(setting), {}, n_threads);
        REQUIRE(difference(expected, pairs_of(built.list, particles)) == "");
        REQUIRE(built.list.size() == static_cast<std::int64_t>(expected.size()));
      }
      ++seed;
    }
  CHECK(n_pairs > 20000);
}

TEST_CASE("a boulder of ten or a hundred times the size among fines costs no more tests a pair than one size") {
  // Fines on a shaken lattice above and around the top of a boulder, or in its stead.
  const double fine = 0.01, step = 0.021;
  double of_one_size = 0.0;
  for (const double boulder : {0.0, 10.0 * fine, 100.0 * fine}) {
    Setting setting;
    setting.domain = {{-2, -2, -2}, {2, 2, 2}};
    setting.skin = 0.002;
    shapes::Dice dice(7);
    std::vector<Vec3> places;
    if (boulder > 0.0) places.push_back({0, 0, -boulder});
    for (double x = -0.3; x < 0.3; x += step)
      for (double y = -0.3; y < 0.3; y += step)
        for (double z = -0.15; z < 0.1; z += step)
          if (length(Vec3{x, y, z + boulder}) >= boulder + fine)
            places.push_back(Vec3{x, y, z} + dice.point({-0.001, -0.001, -0.001}, {0.001, 0.001, 0.001}));
    setting.n = static_cast<int>(places.size());
    setting.largest = boulder > 0.0 ? boulder : fine;  // the first
    setting.smallest = fine;
    Particles particles = random_particles(setting, 3);
    for (std::int32_t i = 0; i < setting.n; ++i) {
      const Vec3 p = places[static_cast<std::size_t>(i)];
      for (int c = 0; c < 3; ++c) particles.set_real(Field::position, i, c, p[c]);
      if (i > 0) particles.set_real(Field::radius, i, 0, fine);
    }
    Built built;
    build(built, particles, setting, needs_of(setting), {}, 2);
    INFO(setting.n << " grains, " << built.list.size() << " pairs, " << built.list.n_tested() << " tested");
    const double tests_a_pair = static_cast<double>(built.list.n_tested()) / static_cast<double>(built.list.size());
    if (boulder == 0.0) of_one_size = tests_a_pair;
    CHECK(built.list.size() > 300);
    CHECK(tests_a_pair < 1.3 * of_one_size);
  }
}

TEST_CASE("more pairs or grains than the places of slots and the marks of entries can tell apart are refused") {
  const auto refuses = [](std::int32_t n_grains, std::int64_t n_pairs, std::int64_t n_kept, int n_threads) {
    std::vector<ThreadPairs> threads(static_cast<std::size_t>(n_threads));
    for (ThreadPairs& t : threads) {
      t.grain_end = n_grains;
      t.n_pairs = n_pairs;
      t.ring_mask = (1u << 20) - 1;
      t.tiles.emplace_back().pair_end = n_kept;
    }
    try {
      check_sizes(threads);
    } catch (const SceneError& error) {
      CHECK(error.problems.front().message.find("use more") != std::string::npos);
      return true;
    }
    return false;
  };
  CHECK_FALSE(refuses(50'000'000, 200'000'000, 10'000'000, 8));
  CHECK(refuses(70'000'000, 200'000'000, 10'000'000, 1));
  CHECK(refuses(1'000'000, 3'000'000'000, 10'000'000, 1));  // rows of many words
  CHECK(refuses(10'000'000, 500'000'000, 500'000'000, 5));
  CHECK_FALSE(refuses(10'000'000, 500'000'000, 500'000'000, 4));
}

TEST_CASE("what pairs remember follows them through rebuilds, sorting, crossing of faces and changes of thread count") {
  Setting setting;
  setting.domain = {{0, 0, 0}, {0.9, 0.5, 0.25}};
  setting.periodic = {true, true, true};
  setting.largest = 0.1;
  setting.smallest = 0.04;
  setting.skin = 0.03;
  setting.n = 400;
  Particles particles = random_particles(setting, 77);
  Built built;
  build(built, particles, setting, needs_of(setting), {}, 2);
  // A mark for each pair that is a function of its two gids and of how its grains really lie: crossing changes the image, not that.
  const std::vector<Vec3> shifts = image_shifts(setting.domain);
  std::map<std::uint64_t, std::array<int, 3>> crossings;  // of each gid so far
  const auto mark = [&](std::int32_t a, std::int32_t b, std::uint8_t code) {
    const auto steps = image::steps(code);
    const auto& ca = crossings[particles.gid(a)];
    const auto& cb = crossings[particles.gid(b)];
    double sum = 1.0 + static_cast<double>(particles.gid(a)) * 1e4 + static_cast<double>(particles.gid(b));
    for (std::size_t axis = 0; axis < 3; ++axis)
      sum += std::pow(0.01, static_cast<double>(axis) + 1) * (10 + steps[axis] + ca[axis] - cb[axis]);
    return sum;
  };
  for (ThreadPairs& t : built.list.threads())
    for (const Tile& tile : t.tiles)
      for (std::int64_t k = tile.ring_begin; k < tile.pair_end; ++k) {
        const auto p = static_cast<std::size_t>(k);
        if (t.a[p] != particles.dummy()) t.set_memory(k, {{mark(t.a[p], t.b[p], t.image[p]), 0.0, 0.0}, 0.0, {}});
      }
  PairCount before = pairs_of(built.list, particles);
  shapes::Dice dice(5);
  std::size_t n_kept = 0;
  int n_crossings = 0;
  for (int round = 0; round < 12; ++round) {
    // Grains tremble by less than half the skin, some across faces.
    for (std::int32_t i = 0; i < particles.size(); ++i) {
      std::array<int, 3> steps{};
      for (int axis = 0; axis < 3; ++axis) {
        double x = particles.position(i)[axis] + 0.4 * setting.skin * dice.uniform(-0.5, 0.5);
        const double low = setting.domain.low[axis], high = setting.domain.high[axis];
        const int by = x < low ? 1 : x >= high ? -1 : 0;
        steps[static_cast<std::size_t>(axis)] = by;
        x += by * (high - low);
        particles.set_real(Field::position, i, axis, x);
        crossings[particles.gid(i)][static_cast<std::size_t>(axis)] += by;
        n_crossings += by != 0;
      }
      if (steps[0] || steps[1] || steps[2]) built.list.shift_images(i, steps);
    }
    const PairCarry carry = built.list.carry(particles, {}, true, 3);
    build(built, particles, setting, needs_of(setting), carry, 1 + round % 4);
    built.list.for_each(particles.dummy(),
                        [&](std::int32_t a, std::int32_t b, std::uint8_t code, const PairMemory* memory) {
                          if (memory->displacement[0] == 0.0) return;  // new in the list, or gone for a while
                          ++n_kept;
                          REQUIRE(memory->displacement[0] == Approx(mark(a, b, code)).epsilon(1e-14));
                        });
  }
  CHECK(n_crossings > 100);
  CHECK(n_kept > 8 * before.size());
}
