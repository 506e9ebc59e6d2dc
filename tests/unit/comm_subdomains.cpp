// Subdomains: every point has one owner, parts tile space, cuts are fair and the same whoever holds the points.
#include "comm/subdomains.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numeric>

#include "engine/contacts/ghost_rule.hpp"
#include "kernels/base/random.hpp"

using namespace moraine;

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr int part_counts[] = {1, 2, 3, 5, 7, 8, 13, 64};

Vec3 random_point(const Box& box, std::uint64_t number, std::uint64_t seed = 1) {
  Vec3 point;
  for (int axis = 0; axis < 3; ++axis)
    point[axis] = box.low[axis] + box.size()[axis] * random_uniform(seed, number, RandomPurpose::position,
                                                                    static_cast<std::uint64_t>(axis));
  return point;
}

/// Points that grow denser towards the bottom, with weights from 1 to 3.
std::vector<WeightedPoint> heap(const Box& box, std::size_t n) {
  std::vector<WeightedPoint> points;
  for (std::size_t i = 0; i < n; ++i) {
    Vec3 point = random_point(box, i);
    const double z = (point.z - box.low.z) / box.size().z;
    point.z = box.low.z + z * z * box.size().z;
    points.push_back({point, static_cast<float>(1.0 + 2.0 * random_uniform(2, i, RandomPurpose::choice))});
  }
  return points;
}

CutSpace space_of(int periodic_mask, double cell_width = 0.1) {
  CutSpace space;
  space.domain = {{-0.5, 1.0, 20.0}, {0.6, 3.1, 21.5}};
  space.cell_width = cell_width;
  for (std::size_t axis = 0; axis < 3; ++axis) space.periodic[axis] = (periodic_mask >> axis & 1) != 0;
  return space;
}

/// Parts whose boxes contain the point.
std::vector<int> holders(const Subdomains& parts, Vec3 point) {
  std::vector<int> found;
  for (int part = 0; part < parts.size(); ++part)
    if (!parts.is_empty(part) && parts.box(part).contains(point)) found.push_back(part);
  return found;
}

bool is_less(const Subdomains::Near& a, const Subdomains::Near& b) {
  return a.part != b.part ? a.part < b.part : a.steps < b.steps;
}

bool is_same(const Subdomains::Near& a, const Subdomains::Near& b) { return a.part == b.part && a.steps == b.steps; }

std::vector<Subdomains::Near> near_by_brute_force(const Subdomains& parts, const CutSpace& space, int part,
                                                  double reach) {
  std::vector<Subdomains::Near> found;
  const Box& own = parts.box(part);
  if (parts.is_empty(part)) return found;
  std::array<int, 3> most{};
  for (int axis = 0; axis < 3; ++axis)
    most[static_cast<std::size_t>(axis)] = space.periodic[static_cast<std::size_t>(axis)] && parts.is_cut(axis) ? 1 : 0;
  for (int other = 0; other < parts.size(); ++other)
    for (int x = -most[0]; x <= most[0]; ++x)
      for (int y = -most[1]; y <= most[1]; ++y)
        for (int z = -most[2]; z <= most[2]; ++z) {
          if (other == part || parts.is_empty(other)) continue;
          const std::array<int, 3> steps = {x, y, z};
          double squared = 0.0;
          for (int axis = 0; axis < 3; ++axis) {
            const double by = steps[static_cast<std::size_t>(axis)] * space.domain.size()[axis];
            const Box& there = parts.box(other);
            const double gap =
                std::max({0.0, there.low[axis] - own.high[axis] - by, own.low[axis] + by - there.high[axis]});
            squared += gap * gap;
          }
          if (squared < reach * reach) found.push_back({other, steps});
        }
  return found;
}

}  // namespace

TEST_CASE("every point has one owner, whose box holds it, also outside a domain that is not periodic") {
  for (const int mask : {0, 1, 6, 7})
    for (const int n_parts : part_counts) {
      const CutSpace space = space_of(mask);
      const Subdomains parts = Subdomains::cut(World(), n_parts, heap(space.domain, 2000), space);
      REQUIRE(parts.size() == n_parts);
      Box wide = space.domain;
      for (int axis = 0; axis < 3; ++axis)
        if (!space.periodic[static_cast<std::size_t>(axis)]) {
          wide.low[axis] -= 5.0;
          wide.high[axis] += 5.0;
        }
      for (std::uint64_t i = 0; i < 500; ++i)
        for (const Box& from : {space.domain, wide}) {
          const Vec3 point = random_point(from, i, 3);
          REQUIRE(holders(parts, point) == std::vector<int>{parts.owner(point)});
        }
    }
}

TEST_CASE("a point on a cut belongs to the part above it") {
  const CutSpace space = space_of(0);
  const Subdomains parts = Subdomains::cut(World(), 13, heap(space.domain, 2000), space);
  int n_faces = 0;
  for (int part = 0; part < parts.size(); ++part)
    for (int axis = 0; axis < 3; ++axis) {
      const Box& box = parts.box(part);
      if (std::isinf(box.low[axis])) continue;
      Vec3 point;  // on the lower face, else inside
      for (int other = 0; other < 3; ++other)
        point[other] = other == axis                ? box.low[axis]
                       : std::isinf(box.low[other]) ? std::min(box.high[other], 1e3) - 0.01
                                                    : box.low[other] + 0.01;
      CHECK(parts.owner(point) == part);
      ++n_faces;
    }
  CHECK(n_faces >= 12);
}

TEST_CASE("parts fill a periodic domain exactly, and none is narrower than it may be") {
  for (const int n_parts : part_counts) {
    const CutSpace space = space_of(7);
    const Subdomains parts = Subdomains::cut(World(), n_parts, heap(space.domain, 3000), space);
    if (n_parts == 1) continue;  // all of space
    double volume = 0.0;
    for (int part = 0; part < n_parts; ++part) {
      const Box& box = parts.box(part);
      volume += parts.is_empty(part) ? 0.0 : box.volume();
      if (parts.is_empty(part)) continue;
      for (int axis = 0; axis < 3; ++axis) CHECK(box.high[axis] - box.low[axis] > (1.0 - 1e-9) * space.cell_width);
    }
    CHECK(volume == Approx(space.domain.volume()).epsilon(1e-12));
  }
}

TEST_CASE("outer faces lie at infinity where the domain is not periodic, and at its faces where it is") {
  const CutSpace space = space_of(2);
  const Subdomains parts = Subdomains::cut(World(), 64, heap(space.domain, 5000), space);
  Box all = Box::empty();
  for (int part = 0; part < parts.size(); ++part) {
    all.include(parts.box(part).low);
    all.include(parts.box(part).high);
  }
  CHECK(all.low == Vec3{-infinite, space.domain.low.y, -infinite});
  CHECK(all.high == Vec3{infinite, space.domain.high.y, infinite});
}

TEST_CASE("where there is no room for all parts, those left over are empty and the others own everything") {
  const CutSpace space = space_of(0, 0.7);  // room for 1 x 3 x 2
  for (const int n_parts : {7, 13, 64}) {
    const Subdomains parts = Subdomains::cut(World(), n_parts, heap(space.domain, 500), space);
    int n_filled = 0;
    for (int part = 0; part < n_parts; ++part) n_filled += parts.is_empty(part) ? 0 : 1;
    CHECK(n_filled <= 6);
    CHECK(n_filled >= 4);
    for (std::uint64_t i = 0; i < 200; ++i) {
      const int owner = parts.owner(random_point(space.domain, i, 4));
      CHECK_FALSE(parts.is_empty(owner));
    }
    for (int part = 0; part < n_parts; ++part)
      if (parts.is_empty(part)) {
        CHECK(parts.near(part, 10.0).empty());
        CHECK(std::isinf(squared_distance({}, parts.box(part))));
      }
  }
}

TEST_CASE("space without points is cut as well, and a single point and a flat layer are") {
  const CutSpace space = space_of(4);
  const Vec3 middle = {0.0, 2.0, 20.5};
  std::vector<WeightedPoint> layer;
  for (std::uint64_t i = 0; i < 300; ++i) {
    Vec3 point = random_point(space.domain, i);
    point.x = 0.25;
    layer.push_back({point, 1.0F});
  }
  for (const std::vector<WeightedPoint>& points : {std::vector<WeightedPoint>{}, {{middle, 1.0F}}, layer}) {
    const Subdomains parts = Subdomains::cut(World(), 5, points, space);
    for (std::uint64_t i = 0; i < 200; ++i) {
      const Vec3 point = random_point(space.domain, i, 5);
      REQUIRE(holders(parts, point) == std::vector<int>{parts.owner(point)});
    }
  }
}

TEST_CASE("the heaviest part of a bed of many grains is within two percent of the mean") {
  CutSpace space = space_of(3, 0.02);
  const std::vector<WeightedPoint> points = heap(space.domain, 400000);
  for (const int n_parts : {2, 3, 7, 8, 13}) {
    const Subdomains parts = Subdomains::cut(World(), n_parts, points, space);
    std::vector<double> work(static_cast<std::size_t>(n_parts));
    for (const WeightedPoint& point : points)
      work[static_cast<std::size_t>(parts.owner(point.position))] += point.weight;
    const double mean = std::accumulate(work.begin(), work.end(), 0.0) / n_parts;
    CHECK(*std::max_element(work.begin(), work.end()) < 1.02 * mean);
  }
}

TEST_CASE("cuts do not depend on the order of the points") {
  const CutSpace space = space_of(5);
  std::vector<WeightedPoint> points = heap(space.domain, 5000);
  const Subdomains parts = Subdomains::cut(World(), 13, points, space);
  std::reverse(points.begin(), points.end());
  CHECK(Subdomains::cut(World(), 13, points, space) == parts);
  points[0].weight += 1e6F;
  CHECK_FALSE(Subdomains::cut(World(), 13, points, space) == parts);
}

TEST_CASE("near parts are those that brute force finds, and each finds the other with the steps negated") {
  for (const int mask : {0, 2, 5, 7})
    for (const int n_parts : part_counts)
      for (const double reach : {0.0, 0.05, 0.1}) {
        const CutSpace space = space_of(mask);
        const Subdomains parts = Subdomains::cut(World(), n_parts, heap(space.domain, 2000), space);
        std::size_t n_links = 0;
        for (int part = 0; part < n_parts; ++part) {
          std::vector<Subdomains::Near> found = parts.near(part, reach);
          REQUIRE(std::is_sorted(found.begin(), found.end(), [](auto& a, auto& b) { return a.part < b.part; }));
          std::sort(found.begin(), found.end(), is_less);
          const auto expected = near_by_brute_force(parts, space, part, reach);
          REQUIRE(std::equal(found.begin(), found.end(), expected.begin(), expected.end(), is_same));
          n_links += found.size();
          for (const Subdomains::Near& other : found) {
            const Subdomains::Near back{part, {-other.steps[0], -other.steps[1], -other.steps[2]}};
            const auto theirs = parts.near(other.part, reach);
            REQUIRE(std::any_of(theirs.begin(), theirs.end(), [&](const auto& n) { return is_same(n, back); }));
          }
        }
        if (reach > 0.0 && n_parts > 1) CHECK(n_links >= static_cast<std::size_t>(n_parts));
        if (reach == 0.0) CHECK(n_links == 0);
      }
}

TEST_CASE("parts that share a face are linked, and all hang together by as many links as are foretold") {
  for (const int mask : {0, 2, 5, 7})
    for (const int n_parts : {1, 2, 3, 7, 8, 13, 64, 200})
      for (const double width : {0.1, 0.7}) {
        const CutSpace space = space_of(mask, width);
        const Subdomains parts = Subdomains::cut(World(), n_parts, heap(space.domain, 2000), space);
        const auto n = static_cast<std::size_t>(n_parts);
        std::vector<std::vector<int>> hops(n, std::vector<int>(n, n_parts));
        for (int part = 0; part < n_parts; ++part) {
          const std::vector<int> links = parts.linked(part);
          REQUIRE(std::is_sorted(links.begin(), links.end()));
          REQUIRE(std::adjacent_find(links.begin(), links.end()) == links.end());
          hops[static_cast<std::size_t>(part)][static_cast<std::size_t>(part)] = 0;
          for (const int other : links) {
            REQUIRE(other != part);
            hops[static_cast<std::size_t>(part)][static_cast<std::size_t>(other)] = 1;
            const std::vector<int> back = parts.linked(other);
            REQUIRE(std::find(back.begin(), back.end(), part) != back.end());
            if (parts.is_empty(part) || parts.is_empty(other)) continue;
            const auto near = parts.near(part, 1e-6);
            REQUIRE(std::any_of(near.begin(), near.end(), [&](const auto& x) { return x.part == other; }));
          }
        }
        for (std::size_t by = 0; by < n; ++by)
          for (std::size_t from = 0; from < n; ++from)
            for (std::size_t to = 0; to < n; ++to)
              hops[from][to] = std::min(hops[from][to], hops[from][by] + hops[by][to]);
        int most = 0;
        for (const auto& row : hops) most = std::max(most, *std::max_element(row.begin(), row.end()));
        REQUIRE(most < std::max(2, n_parts));
        const int foretold = parts.most_hops();
        CHECK((n_parts <= 128 ? foretold == most : foretold >= most && foretold <= 2 * most));
      }
  CutSpace row = space_of(0);
  row.domain.high.x = row.domain.low.x + 10.0;
  CHECK(Subdomains::cut(World(), 8, heap(row.domain, 2000), row).most_hops() == 7);
}

TEST_CASE("a part spans a periodic axis that no cut divides for it, and the narrowest part is known") {
  const CutSpace space = space_of(7);
  const std::vector<WeightedPoint> points = heap(space.domain, 3000);
  const Subdomains two = Subdomains::cut(World(), 2, points, space);  // y is longest
  CHECK_FALSE(two.is_cut(0));
  CHECK(two.is_cut(1));
  for (int part = 0; part < 2; ++part) {
    CHECK(two.spans(part, 0));
    CHECK_FALSE(two.spans(part, 1));
    CHECK(two.spans(part, 2));
  }
  CHECK(two.narrowest() == std::min(two.box(0).size().y, two.box(1).size().y));
  CHECK(std::isinf(Subdomains::cut(World(), 2, points, space_of(0)).narrowest()));
  CHECK_FALSE(Subdomains::cut(World(), 2, points, space_of(0)).spans(0, 0));
  CHECK(Subdomains().spans(0, 0) == false);
}

TEST_CASE("a ghost is needed where a part, or an image of it, is nearer than the reach, and each part is named once") {
  for (const int mask : {0, 3, 7})
    for (const int n_parts : {2, 5, 13, 64}) {
      const CutSpace space = space_of(mask);
      const Subdomains parts = Subdomains::cut(World(), n_parts, heap(space.domain, 2000), space);
      const double reach = 0.09;
      std::size_t n_named = 0;
      for (std::uint64_t i = 0; i < 300; ++i) {
        const Vec3 point = random_point(space.domain, i, 6);
        const int part = parts.owner(point);
        const double own_reach = i % 2 ? reach : 0.5 * reach;
        std::vector<int> expected, named;
        for (int other = 0; other < n_parts; ++other) {
          bool is_needed = false;
          for (int image = 0; image < 27; ++image) {
            Vec3 p = point;
            int at = image;
            for (int axis = 0; axis < 3; ++axis, at /= 3)
              if (space.periodic[static_cast<std::size_t>(axis)]) p[axis] += (at % 3 - 1) * space.domain.size()[axis];
            is_needed = is_needed || squared_distance(p, parts.box(other)) < own_reach * own_reach;
          }
          if (is_needed && other != part) expected.push_back(other);
        }
        const auto near = parts.near(part, reach);
        for_each_needing(parts, part, near, point, own_reach, [&](int other) { named.push_back(other); });
        REQUIRE(named == expected);
        n_named += named.size();
      }
      CHECK(n_named > 0);
    }
}
