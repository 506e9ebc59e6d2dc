// The motion kernel against plain code, the pair filter against comparing with everything, exact sums against known results.
#include <catch2/catch.hpp>

#include <array>
#include <bit>
#include <cmath>
#include <map>
#include <numeric>
#include <vector>

#include "kernels/base/exact_sum.hpp"
#include "kernels/motion/motion.hpp"
#include "kernels/search/pair_filter.hpp"
#include "kernels/search/row_order.hpp"
#include "tests/unit/kernels_contacts.hpp"

using namespace moraine;
using namespace moraine::kernels_test;

namespace {

/// Grains with random entries in a ring and in kept slots, and wall touches.
struct MotionSetup {
  bool has_rotation, has_ledger;
  int n = 301;
  AlignedArray<double> records, slots, walls, dissipated;
  std::vector<std::uint32_t> offsets;
  std::vector<Entry> entries;
  std::vector<std::int32_t> wall_grain;
  std::vector<double> force, torque;
  GrainSums sums;

  MotionSetup(bool rotation, bool ledger, bool is_flat) : has_rotation(rotation), has_ledger(ledger) {
    shapes::Dice dice(31);
    const auto slot = static_cast<std::size_t>(slot_size(rotation, ledger));
    const auto stride = static_cast<std::size_t>(record_size(rotation));
    const auto count = static_cast<std::size_t>(n);
    const auto fill = [&](AlignedArray<double>& array, std::size_t size) {
      array.resize_discarding(size);
      for (double& x : array) x = dice.uniform(-1.0, 1.0);
    };
    fill(records, (count + 1) * stride);
    fill(slots, 556 * slot);
    fill(walls, 200 * slot);
    fill(dissipated, 4 * count);
    for (std::size_t i = 0; i < count; ++i) records[i * stride + 3] = records[i * stride + 7] = dice.uniform(0.5, 2.0);
    offsets.push_back(0);
    for (int i = 0; i < n; ++i) {
      const int n_entries = dice.index(9);
      for (int q = 0; q < n_entries; ++q) {
        const int place = dice.index(556);
        entries.push_back(make_entry(static_cast<std::uint32_t>(place), dice.index(2) == 0));
      }
      offsets.push_back(static_cast<std::uint32_t>(entries.size()));
      for (int q = dice.index(3); q > 1 && wall_grain.size() < 200; --q) wall_grain.push_back(i);
    }
    force.assign(3 * count, 7.0);
    torque.assign(3 * count, 7.0);
    sums.records = records.data();
    sums.offsets = offsets.data();
    sums.entries = entries.data();
    sums.slots = slots.data();
    sums.wall_grain = wall_grain.data();
    sums.wall_slots = walls.data();
    sums.n_wall = static_cast<std::int64_t>(wall_grain.size());
    sums.inside = {{-2, -2, -2}, {2, 2, 2}};
    sums.kick = {0.9, 0.01, 0.02, 0.03, 0.004, {1.0, -2.0, 3.0}, is_flat};
    sums.dissipated = ledger ? dissipated.data() : nullptr;
    sums.force = force.data();
    sums.torque = rotation ? torque.data() : nullptr;
  }
};

/// The same in plain code, in long doubles.
struct PlainGrain {
  long double x[3], v[3], w[3], force[3] = {0, 0, 0}, moment[3] = {0, 0, 0}, lost[4];
};

PlainGrain plain_advance(const MotionSetup& m, int i) {
  const auto slot = static_cast<std::size_t>(slot_size(m.has_rotation, m.has_ledger));
  const double* const r = m.records.data() + i * record_size(m.has_rotation);
  PlainGrain g{};
  if (m.has_ledger)
    for (std::size_t k = 0; k < 4; ++k) g.lost[k] = m.dissipated[4 * static_cast<std::size_t>(i) + k];
  const auto add = [&](const double* s, bool is_b) {
    for (int k = 0; k < 3; ++k) {
      g.force[k] += is_b ? -s[k] : s[k];
      if (m.has_rotation) g.moment[k] -= static_cast<long double>(is_b ? s[7] : s[3]) * s[4 + k];
      if (m.has_ledger && !is_b) g.lost[k] += s[slot - 4 + static_cast<std::size_t>(k)];
    }
  };
  for (std::uint32_t q = m.offsets[static_cast<std::size_t>(i)]; q < m.offsets[static_cast<std::size_t>(i) + 1]; ++q) {
    const Entry entry = m.entries[q];
    add(m.slots.data() + (entry >> 1) * slot, (entry & entry_is_b) != 0);
  }
  for (std::size_t w = 0; w < m.wall_grain.size(); ++w)
    if (m.wall_grain[w] == i) add(m.walls.data() + w * slot, false);
  const Kick& kick = m.sums.kick;
  long double squares = 0, turns = 0;
  for (int k = 0; k < 3; ++k) {
    const bool moves = !(kick.is_flat && k == 2), spins = !(kick.is_flat && k != 2);
    const long double a = moves ? g.force[k] * r[7] + kick.gravity[k] : 0.0L;
    g.v[k] = kick.keep * r[4 + k] + a * kick.gain;
    g.x[k] = r[k] + kick.drift * g.v[k];
    squares += (g.v[k] + r[4 + k]) * (g.v[k] + r[4 + k]);
    if (m.has_rotation) {
      g.w[k] = kick.keep * r[8 + k] + (spins ? g.moment[k] * r[11] * kick.gain : 0.0L);
      turns += (g.w[k] + r[8 + k]) * (g.w[k] + r[8 + k]);
    }
  }
  if (m.has_ledger) g.lost[3] += kick.drag_loss / r[7] * squares;
  if (m.has_ledger && m.has_rotation && r[11] > 0.0) g.lost[3] += kick.drag_loss / r[11] * turns;
  return g;
}

}  // namespace

TEST_CASE("the share of their room that grains have used is the largest, as plain code finds it") {
  shapes::Dice dice(7);
  for (const int stride : {8, 12})
    for (const int n : {1, 3, 8, 29}) {
      const auto count = static_cast<std::size_t>(n);
      AlignedArray<double> records, places, frames;
      const auto fill = [&](AlignedArray<double>& array, std::size_t size, double low) {
        array.resize_discarding(size);
        for (double& x : array) x = dice.uniform(low, 1.0);
      };
      fill(records, count * static_cast<std::size_t>(stride), -1.0);
      fill(places, 4 * count, 0.1);
      fill(frames, 4 * 5, 0.0);
      std::vector<std::int32_t> frame_of, list;
      for (int i = 0; i < n; ++i) frame_of.push_back(dice.index(5));
      for (int i = n - 1; i >= 0; i -= 2) list.push_back(i);
      if (n > 8) records[static_cast<std::size_t>(4 * stride)] = std::nan("");  // it has left
      const double age = 0.3;
      const auto share = [&](int i) {
        const auto at = static_cast<std::size_t>(i);
        const double* const x = records.data() + i * stride;
        const double* const place = places.data() + 4 * i;
        const double* const frame = frames.data() + 4 * frame_of[at];
        double square = 0.0;
        for (int k = 0; k < 3; ++k) square += std::pow(x[k] - place[k] - age * frame[k], 2);
        return (std::sqrt(square) + age * frame[3]) * place[3];
      };
      const auto share_at_rest = [&](int i) {
        double square = 0.0;
        for (int k = 0; k < 3; ++k) square += std::pow(records.data()[i * stride + k] - places.data()[4 * i + k], 2);
        return std::sqrt(square) * places.data()[4 * i + 3];
      };
      RoomShares of_all, of_list;
      const auto include = [&](RoomShares& most, int i) {
        if (share(i) > most.in_frames) most.in_frames = share(i);
        if (share_at_rest(i) > most.at_rest) most.at_rest = share_at_rest(i);
      };
      for (int i = 0; i < n; ++i) include(of_all, i);
      for (const int i : list) include(of_list, i);
      const RoomUse use = {records.data(), stride, places.data(), frames.data(), frame_of.data(), age};
      const RoomShares all = room_kernel()(use, nullptr, {0, n});
      CHECK(all.in_frames == Approx(of_all.in_frames).epsilon(1e-14));
      CHECK(all.at_rest == Approx(of_all.at_rest).epsilon(1e-14));
      const RoomShares some = room_kernel()(use, list.data(), {0, static_cast<std::int64_t>(list.size())});
      CHECK(some.in_frames == Approx(of_list.in_frames).epsilon(1e-14));
      CHECK(some.at_rest == Approx(of_list.at_rest).epsilon(1e-14));
    }
}

TEST_CASE("the motion kernel sums and advances as plain code does") {
  for (int bits = 0; bits < 8; ++bits) {
    const bool rotation = bits & 1, ledger = bits & 2, is_flat = bits & 4;
    INFO("rotation " << rotation << ", ledger " << ledger << ", flat " << is_flat);
    MotionSetup m(rotation, ledger, is_flat);
    std::vector<PlainGrain> expected;
    for (int i = 0; i < m.n; ++i) expected.push_back(plain_advance(m, i));
    const AlignedArray<double> before = [&] {
      AlignedArray<double> copy;
      copy.resize_discarding(m.records.size());
      std::copy(m.records.begin(), m.records.end(), copy.begin());
      return copy;
    }();
    const MotionResult result = motion_kernel(rotation, ledger)(m.sums, nullptr, {0, m.n});
    double fastest = 0.0;
    bool is_any_outside = false;
    for (int i = 0; i < m.n; ++i) {
      const PlainGrain& g = expected[static_cast<std::size_t>(i)];
      const double* const r = m.records.data() + i * record_size(rotation);
      double square = 0.0;
      for (int k = 0; k < 3; ++k) {
        REQUIRE(r[k] == Approx(static_cast<double>(g.x[k])).margin(1e-14));
        REQUIRE(r[4 + k] == Approx(static_cast<double>(g.v[k])).margin(1e-14));
        if (rotation) REQUIRE(r[8 + k] == Approx(static_cast<double>(g.w[k])).margin(1e-14));
        REQUIRE(m.force[static_cast<std::size_t>(3 * i + k)] == Approx(static_cast<double>(g.force[k])).margin(1e-13));
        if (rotation)
          REQUIRE(m.torque[static_cast<std::size_t>(3 * i + k)] ==
                  Approx(static_cast<double>(g.moment[k])).margin(1e-13));
        square += r[4 + k] * r[4 + k];
        is_any_outside = is_any_outside || r[k] < -2.0 || r[k] >= 2.0;
      }
      if (ledger)
        for (std::size_t k = 0; k < 4; ++k)
          REQUIRE(m.dissipated[static_cast<std::size_t>(4 * i) + k] ==
                  Approx(static_cast<double>(g.lost[k])).margin(1e-13));
      fastest = std::max(fastest, square);
      for (const int k : {3, 7}) REQUIRE(r[k] == before[static_cast<std::size_t>(i * record_size(rotation) + k)]);
    }
    CHECK(result.max_speed_squared >= fastest);
    CHECK(result.max_speed_squared <= 3.0 * fastest);
    CHECK(result.is_any_outside == is_any_outside);
    CHECK_FALSE(result.is_any_not_finite);
  }
}

TEST_CASE("a grain sums those of its entries whose bits are set, and sets them to zero") {
  for (const bool has_long_rows : {false, true}) {
    MotionSetup marked(true, true, false), plain(true, true, false);
    shapes::Dice dice(32);
    if (has_long_rows)  // the first grain takes over the entries of many
      for (MotionSetup* const m : {&marked, &plain})
        for (std::size_t i = 1; i < 60; ++i) m->offsets[i] = m->offsets[60];
    std::vector<std::uint32_t> first_word = {0};
    std::vector<std::uint64_t> acting;
    std::vector<Entry> kept;
    std::vector<std::uint32_t> offsets = {0};
    for (std::size_t i = 0; i + 1 < marked.offsets.size(); ++i) {
      const std::uint32_t begin = marked.offsets[i], n = marked.offsets[i + 1] - begin;
      first_word.push_back(first_word.back() + std::max(1u, (n + 63) / 64));
      acting.resize(first_word.back(), 0);
      for (std::uint32_t q = 0; q < n; ++q)
        if (dice.index(3) == 0) {
          acting[first_word[i] + q / 64] |= std::uint64_t{1} << q % 64;
          kept.push_back(marked.entries[begin + q]);
        }
      offsets.push_back(static_cast<std::uint32_t>(kept.size()));
    }
    CHECK((acting.size() > static_cast<std::size_t>(marked.n)) == has_long_rows);
    marked.sums.acting = acting.data();
    marked.sums.first_word = has_long_rows ? first_word.data() : nullptr;
    plain.sums.entries = kept.data();
    plain.sums.offsets = offsets.data();
    motion_kernel(true, true)(marked.sums, nullptr, {0, marked.n});
    motion_kernel(true, true)(plain.sums, nullptr, {0, plain.n});
    CHECK(same_bits(marked.records.data(), plain.records.data(), plain.records.size()));
    CHECK(same_bits(marked.dissipated.data(), plain.dissipated.data(), plain.dissipated.size()));
    CHECK(std::all_of(acting.begin(), acting.end(), [](std::uint64_t word) { return word == 0; }));
  }
}

TEST_CASE("every instruction set moves grains to the same bits") {
  if (targets().size() < 2) return;
  for (int bits = 0; bits < 8; ++bits) {
    std::vector<MotionSetup> all;
    all.reserve(2);
    for (const std::int64_t target : targets()) {
      const OnTarget on(target);
      all.emplace_back(bits & 1, bits & 2, bits & 4);
      motion_kernel(bits & 1, bits & 2)(all.back().sums, nullptr, {0, all.back().n});
    }
    CHECK(same_bits(all[0].records.data(), all[1].records.data(), all[0].records.size()));
    CHECK(same_bits(all[0].dissipated.data(), all[1].dissipated.data(), all[0].dissipated.size()));
  }
}

TEST_CASE("a list of grains is advanced as a range is, and no others") {
  MotionSetup by_range(true, true, false), by_list(true, true, false);
  std::vector<std::int32_t> list;
  for (std::int32_t i = 0; i < by_list.n; i += 3) list.push_back(i);
  motion_kernel(true, true)(by_range.sums, nullptr, {0, by_range.n});
  const MotionSetup before(true, true, false);
  // the kernel expects the touches of the listed grains only
  std::vector<std::int32_t> grains;
  AlignedArray<double> slots;
  slots.resize_discarding(by_list.walls.size());
  const auto slot = static_cast<std::size_t>(slot_size(true, true));
  for (std::size_t w = 0; w < by_list.wall_grain.size(); ++w)
    if (by_list.wall_grain[w] % 3 == 0) {
      std::copy_n(by_list.walls.data() + w * slot, slot, slots.data() + grains.size() * slot);
      grains.push_back(by_list.wall_grain[w]);
    }
  by_list.sums.wall_grain = grains.data();
  by_list.sums.wall_slots = slots.data();
  by_list.sums.n_wall = static_cast<std::int64_t>(grains.size());
  motion_kernel(true, true)(by_list.sums, list.data(), {0, static_cast<std::int64_t>(list.size())});
  for (std::int32_t i = 0; i < by_list.n; ++i) {
    const MotionSetup& expected = i % 3 == 0 ? by_range : before;
    REQUIRE(same_bits(by_list.records.data() + 12 * i, expected.records.data() + 12 * i, 12));
  }
}

TEST_CASE("an infinite or undefined force is noticed in whatever component and grain it is") {
  for (const double bad : {std::nan(""), infinity, -infinity})
    for (std::size_t k = 0; k < 3; ++k)
      for (const int i : {0, 150, 300}) {
        MotionSetup m(true, false, false);
        m.records[static_cast<std::size_t>(i) * 12 + 4 + k] = bad;
        CHECK(motion_kernel(true, false)(m.sums, nullptr, {0, m.n}).is_any_not_finite);
      }
}

TEST_CASE("the pair filter finds just those that comparing with everything finds, in order, wherever the run begins") {
  shapes::Dice dice(41);
  constexpr int n = 500;
  std::vector<double> x(n + 8), y(n + 8), z(n + 8), r(n + 8);
  for (std::size_t j = 0; j < n; ++j) {
    x[j] = dice.uniform(0, 1);
    y[j] = dice.uniform(0, 1);
    z[j] = dice.uniform(0, 1);
    r[j] = dice.uniform(0.01, 0.2);
  }
  const Spheres spheres{x.data(), y.data(), z.data(), r.data()};
  std::size_t n_near = 0;
  for (const std::int64_t target : targets()) {
    const OnTarget on(target);
    for (int trial = 0; trial < 2000; ++trial) {
      Range run{dice.index(n), 0};
      run.end = run.begin + dice.index(static_cast<int>(n - run.begin) + 1);
      const Vec3 centre = dice.point({-0.2, -0.2, -0.2}, {1.2, 1.2, 1.2});
      const double reach = dice.uniform(0.0, 0.3);
      std::vector<std::int32_t> found(static_cast<std::size_t>(run.size()) + 1, -7), expected;
      for (auto j = static_cast<std::size_t>(run.begin); j < static_cast<std::size_t>(run.end); ++j)
        if (length(centre - Vec3{x[j], y[j], z[j]}) < reach + r[j]) expected.push_back(static_cast<std::int32_t>(j));
      const int n_found = pair_filter()(spheres, run, centre, reach, found.data());
      REQUIRE(n_found == static_cast<int>(expected.size()));
      REQUIRE(std::equal(expected.begin(), expected.end(), found.begin()));
      REQUIRE(found.back() == -7);
      n_near += expected.size();
    }
  }
  CHECK(n_near > 10000);
}

TEST_CASE(
    "the near filter finds in all runs what comparing with everything finds, with the image of its run and its band") {
  shapes::Dice dice(42);
  constexpr int n = 400;
  std::vector<double> x(n + 8), y(n + 8), z(n + 8), r(n + 8), room(n + 8);
  for (std::size_t j = 0; j < n; ++j) {
    x[j] = dice.uniform(0, 1);
    y[j] = dice.uniform(0, 1);
    z[j] = dice.uniform(0, 1);
    room[j] = dice.uniform(0.0, 0.1);
    r[j] = dice.uniform(0.01, 0.1) + room[j];
  }
  const Spheres spheres{x.data(), y.data(), z.data(), r.data(), room.data()};
  const Vec3 image_shift[] = {{}, {1.0, 0.0, 0.0}, {0.0, -1.0, 0.5}};
  const double share[] = {0.0, 0.2, 0.5, 0.8};
  constexpr std::size_t n_bands = 4;
  struct Near {
    std::int32_t grain;
    std::uint8_t image, band;
    bool operator==(const Near&) const = default;
  };
  std::array<std::size_t, n_bands> n_in_band{};
  for (const std::int64_t target : targets()) {
    const OnTarget on(target);
    for (int trial = 0; trial < 1000; ++trial) {
      std::vector<GrainRun> runs(static_cast<std::size_t>(dice.index(12)));
      std::int64_t n_asked = 0;
      for (GrainRun& run : runs) {
        run.grains.begin = dice.index(n);
        run.grains.end = run.grains.begin + dice.index(static_cast<int>(n - run.grains.begin) + 1);
        run.image = static_cast<std::uint8_t>(dice.index(3));
        n_asked += run.grains.size();
      }
      Asking asking;
      asking.centre = dice.point({-0.2, -0.2, -0.2}, {1.2, 1.2, 1.2});
      asking.room = dice.uniform(0.0, 0.1);
      asking.reach = dice.uniform(0.0, 0.3) + asking.room;
      asking.image_shift = image_shift;
      asking.band_share = share;
      asking.n_bands = n_bands;
      std::vector<Near> expected;
      for (const GrainRun& run : runs)
        for (auto j = static_cast<std::size_t>(run.grains.begin); j < static_cast<std::size_t>(run.grains.end); ++j) {
          const double apart = length(asking.centre + image_shift[run.image] - Vec3{x[j], y[j], z[j]});
          if (!(apart < asking.reach + r[j])) continue;
          const double rooms = asking.room + room[j], gap = apart - (asking.reach + r[j] - rooms);
          std::uint8_t band = 0;
          while (band + 1u < n_bands && gap >= share[band + 1] * rooms) ++band;
          expected.push_back({static_cast<std::int32_t>(j), run.image, band});
          ++n_in_band[band];
        }
      std::vector<std::int32_t> grain(static_cast<std::size_t>(n_asked) + 1, -7);
      std::vector<std::uint8_t> image(grain.size(), 99), band(grain.size(), 99);
      const bool has_images = trial % 2 == 0;
      const int n_found = near_filter()(spheres, runs.data(), static_cast<int>(runs.size()), asking,
                                        {grain.data(), has_images ? image.data() : nullptr, band.data()});
      REQUIRE(n_found == static_cast<int>(expected.size()));
      for (std::size_t k = 0; k < expected.size(); ++k)
        REQUIRE(expected[k] == Near{grain[k], has_images ? image[k] : expected[k].image, band[k]});
      REQUIRE(grain[expected.size()] == -7);
      REQUIRE(image[expected.size()] == 99);
      REQUIRE(band[expected.size()] == 99);
    }
  }
  for (const std::size_t in_band : n_in_band) CHECK(in_band > 1000);
}

TEST_CASE("rows are put into the order of their keys, short ones and long ones, and nothing of one goes to another") {
  shapes::Dice dice(43);
  for (const std::int64_t target : targets()) {
    const OnTarget on(target);
    for (int trial = 0; trial < 300; ++trial) {
      std::vector<std::uint32_t> begins{0}, values, sorted, expected;
      std::vector<std::int64_t> keys;
      const int n_rows = dice.index(30), longest = trial % 10 == 0 ? 200 : trial % 3 == 0 ? 40 : 12;
      for (int row = 0; row < n_rows; ++row) {
        std::map<std::int64_t, std::uint32_t> of_row;
        for (int k = dice.index(longest); k > 0; --k) {
          const auto key = static_cast<std::int64_t>(dice.uniform(0.0, trial % 2 == 0 ? 100.0 : 9.2e18));
          if (!of_row.contains(key)) {
            keys.push_back(key);
            values.push_back(static_cast<std::uint32_t>(values.size() * 2654435761u));
            of_row[key] = values.back();
          }
        }
        for (const auto& [key, value] : of_row) expected.push_back(value);
        begins.push_back(static_cast<std::uint32_t>(values.size()));
      }
      keys.resize(keys.size() + 7, 5);
      sorted.assign(values.size() + 1, 77u);
      expected.push_back(77u);
      row_order()(begins.data(), n_rows, keys.data(), values.data(), sorted.data());
      REQUIRE(sorted == expected);
    }
  }
}

TEST_CASE("an exact sum does not depend on order or on how it was shared out") {
  shapes::Dice dice(51);
  std::vector<double> values;
  for (int i = 0; i < 3000; ++i) values.push_back(dice.uniform(-1, 1) * std::pow(2.0, dice.uniform(-400, 400)));
  ExactSum forward, backward;
  for (const double v : values) forward.add(v);
  for (std::size_t i = values.size(); i-- > 0;) backward.add(values[i]);
  CHECK(forward.value() == backward.value());
  for (const std::size_t n_parts : {2u, 3u, 17u}) {
    std::vector<ExactSum> parts(n_parts);
    for (std::size_t i = 0; i < values.size(); ++i) parts[i * 7919 % n_parts].add(values[i]);
    ExactSum whole;
    for (const ExactSum& part : parts) whole.add(part);
    CHECK(whole.value() == forward.value());
  }
  for (const double v : values) backward.add(-v);
  CHECK(backward.value() == 0.0);
}

TEST_CASE("an exact sum is rounded once, to the nearest double and ties to even") {
  const auto sum = [](std::vector<double> values) {
    ExactSum s;
    for (const double v : values) s.add(v);
    return s.value();
  };
  constexpr double eps = 0x1p-52;
  CHECK(sum({}) == 0.0);
  CHECK(sum({1e308, 1.0, -1e308}) == 1.0);
  CHECK(sum({1.0, 1e-300, -1.0}) == 1e-300);
  CHECK(sum({1.0, eps / 2}) == 1.0);                       // a tie, to even
  CHECK(sum({1.0 + eps, eps / 2}) == 1.0 + 2 * eps);       // a tie, to even
  CHECK(sum({1.0, eps / 2, 5e-324}) == 1.0 + eps);         // just above the tie
  CHECK(sum({1.0 + eps, eps / 2, -5e-324}) == 1.0 + eps);  // just below
  CHECK(sum({-1.0, -eps / 2, -5e-324}) == -1.0 - eps);
  CHECK(sum({5e-324, 5e-324, 5e-324}) == 3 * 5e-324);  // subnormal
  CHECK(sum({0x1p-1022, -5e-324}) == 0x1p-1022 - 5e-324);
  CHECK(sum({1e308, 1e308, -1e308}) == 1e308);  // beyond the largest double on the way
  CHECK(std::isinf(sum({1.7e308, 1.7e308})));
  CHECK(std::isnan(sum({1.0, infinity})));
  CHECK(std::isnan(sum({std::nan("")})));
  CHECK(sum({0.1, 0.2, -0.3}) == 0x1p-55);  // of the doubles nearest to these: 2^-55 just so
  shapes::Dice dice(61);
  for (int trial = 0; trial < 2000; ++trial) {  // four numbers whose sum a long double holds exactly
    std::vector<double> values;
    long double exact = 0.0L;
    for (int i = 0; i < 4; ++i) {
      values.push_back(std::ldexp(std::floor(dice.uniform(-0x1p53, 0x1p53)), dice.index(8)));
      exact += values.back();
    }
    REQUIRE(sum(values) == static_cast<double>(exact));
  }
}
