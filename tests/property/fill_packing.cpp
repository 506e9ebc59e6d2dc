// What every random fill must show, over many seeds, fractions, sizes and boxes.
#include <catch2/catch.hpp>

#include <algorithm>
#include <set>

#include "../unit/fill_scenes.hpp"

using namespace moraine;
using namespace moraine::fill_tests;

namespace {

Scene packed(std::array<bool, 3> periodic, double size, double fraction, double size_ratio, std::uint64_t seed) {
  Scene scene = box_scene({size, size, size}, periodic);
  ParticleGroup group = group_of(0.004);
  if (size_ratio > 1.0) {
    group.diameter.kind = SizeDistribution::Kind::uniform;
    group.diameter.low = 0.004 / size_ratio;
    group.diameter.high = 0.004;
  }
  group.fill = random_fraction(BoxRegion{scene.domain.box()}, fraction);
  group.seed = seed;
  scene.particles.push_back(group);
  return scene;
}

/// Radial distribution function of equal spheres in a periodic cube, in bins of width `bin` times the diameter.
std::vector<double> radial_distribution(const Scene& scene, const std::vector<GrainSeed>& grains, double bin,
                                        int n_bins) {
  std::vector<double> g(static_cast<std::size_t>(n_bins), 0.0);
  const double diameter = 2.0 * grains[0].radius;
  for (std::size_t i = 0; i < grains.size(); ++i)
    for (std::size_t j = i + 1; j < grains.size(); ++j) {
      const double r = length(nearest(scene.domain, grains[i].position, grains[j].position)) / diameter;
      if (r < bin * n_bins) g[static_cast<std::size_t>(r / bin)] += 2.0;
    }
  const double n = static_cast<double>(grains.size());
  const double density = n / scene.domain.box().volume() * std::pow(diameter, 3);
  for (int b = 0; b < n_bins; ++b) {
    const double shell = 4.0 / 3.0 * std::numbers::pi * (std::pow((b + 1) * bin, 3) - std::pow(b * bin, 3));
    g[static_cast<std::size_t>(b)] /= n * density * shell;
  }
  return g;
}

}  // namespace

TEST_CASE("random fills never overlap and reach their fraction", "[fill]") {
  struct Case {
    std::array<bool, 3> periodic;
    double fraction, size_ratio;
  };
  const Case cases[] = {{{false, false, false}, 0.05, 1.0}, {{true, true, true}, 0.2, 4.0},
                        {{true, false, true}, 0.3, 1.0},    {{false, false, false}, 0.45, 3.0},
                        {{true, false, false}, 0.55, 1.0},  {{true, true, true}, 0.6, 1.0},
                        {{true, true, true}, 0.63, 4.0}};
  for (const Case& c : cases)
    for (const std::uint64_t seed : {1U, 77U}) {
      CAPTURE(c.fraction, c.size_ratio, seed);
      const Scene scene = packed(c.periodic, c.size_ratio > 1.0 ? 0.04 : 0.06, c.fraction, c.size_ratio, seed);
      const std::vector<GrainSeed> grains = make_grains(scene, 1);
      CHECK(overlapping_pairs(scene, grains) == 0);
      CHECK(solid_volume(grains) / scene.domain.box().volume() == Approx(c.fraction).epsilon(0.005));
      CHECK(count_grains(scene) == static_cast<std::int64_t>(grains.size()));
      for (const GrainSeed& grain : grains)
        for (int k = 0; k < 3; ++k) {
          const double margin = c.periodic[static_cast<std::size_t>(k)] ? 0.0 : grain.radius;
          CHECK(grain.position[k] >= margin);
          CHECK(grain.position[k] <= scene.domain.high[k] - margin);
        }
    }
}

TEST_CASE("sizes of one to ten pack without overlap, the small between the large", "[fill]") {
  const Scene scene = packed({true, true, true}, 0.03, 0.6, 10.0, 3);
  const std::vector<GrainSeed> grains = make_grains(scene, 1);
  CHECK(overlapping_pairs(scene, grains) == 0);
  CHECK(solid_volume(grains) / scene.domain.box().volume() == Approx(0.6).epsilon(0.005));
}

TEST_CASE("the same seed gives the same bits on any number of threads, another seed other grains", "[fill]") {
  for (const double fraction : {0.2, 0.5}) {
    const Scene scene = packed({true, false, false}, 0.06, fraction, 2.0, 5);
    const std::vector<GrainSeed> once = make_grains(scene, 1);
    CHECK(same_bits(once, make_grains(scene, 1)));
    CHECK(same_bits(once, make_grains(scene, 4)));
    CHECK_FALSE(same_bits(once, make_grains(packed({true, false, false}, 0.06, fraction, 2.0, 6), 1)));
  }
}

TEST_CASE("a packing of several blocks has the same bits on one thread and on three", "[fill]") {
  const Scene scene = packed({true, true, false}, 0.126, 0.5, 1.3, 8);  // some 40,000 grains
  const std::vector<GrainSeed> one = make_grains(scene, 1);
  CHECK(one.size() > 40000);
  CHECK(same_bits(one, make_grains(scene, 3)));
}

TEST_CASE("two groups of one seed do not draw the same numbers", "[fill]") {
  Scene scene = packed({false, false, false}, 0.06, 0.05, 2.0, 5);
  scene.particles.push_back(scene.particles[0]);
  const std::vector<GrainSeed> grains = make_grains(scene, 1);
  std::set<double> radii;
  for (const GrainSeed& grain : grains) radii.insert(grain.radius);
  CHECK(radii.size() == grains.size());
}

TEST_CASE("two groups that fill one region are packed together, each to its own fraction", "[fill]") {
  Scene scene = packed({true, true, true}, 0.05, 0.3, 1.0, 5);
  scene.particles.push_back(scene.particles[0]);
  scene.particles[1].diameter.value = 0.0035;
  scene.particles[1].fill = random_fraction(BoxRegion{scene.domain.box()}, 0.28);
  const std::vector<GrainSeed> grains = make_grains(scene, 1);
  CHECK(overlapping_pairs(scene, grains) == 0);
  std::vector<GrainSeed> large, small;
  for (const GrainSeed& grain : grains) (grain.radius > 0.0018 ? large : small).push_back(grain);
  CHECK(solid_volume(large) / scene.domain.box().volume() == Approx(0.3).epsilon(0.005));
  CHECK(solid_volume(small) / scene.domain.box().volume() == Approx(0.28).epsilon(0.005));
}

TEST_CASE("grains lie across a periodic face as they lie across any other plane", "[fill]") {
  const Scene scene = packed({true, true, true}, 0.08, 0.55, 1.0, 9);
  const std::vector<GrainSeed> grains = make_grains(scene, 1);
  // Share of grains cut by the plane x = c: diameter over box size, whatever c is.
  const double share = 0.004 / 0.08;
  const double expected = share * static_cast<double>(grains.size());
  for (const double plane : {0.0, 0.03}) {
    double n_cut = 0.0;
    for (const GrainSeed& grain : grains)
      n_cut +=
          std::abs(nearest(scene.domain, grain.position, {plane, grain.position.y, grain.position.z}).x) < grain.radius;
    CHECK(n_cut == Approx(expected).margin(4 * std::sqrt(expected)));
  }
}

TEST_CASE("a dense random packing looks like one: touching neighbours, no lattice", "[fill]") {
  const Scene scene = packed({true, true, true}, 0.08, 0.6, 1.0, 2);
  const std::vector<GrainSeed> grains = make_grains(scene, 1);
  const std::vector<double> g = radial_distribution(scene, grains, 0.05, 100);
  const auto at = [&](double r) { return g[static_cast<std::size_t>(r / 0.05)]; };
  // Nothing below contact, the first peak at contact.
  for (int b = 0; b < 20; ++b) CHECK(g[static_cast<std::size_t>(b)] == 0.0);
  CHECK(std::max_element(g.begin(), g.end()) - g.begin() == 20);
  CHECK(at(1.01) > 4.0);
  // The depletion behind the first shell, the broad second peak between sqrt(3) and 2 diameters.
  CHECK(at(1.42) < 1.0);
  CHECK(at(1.76) > 1.0);
  CHECK(at(1.96) > 1.0);
  CHECK(at(2.2) < 1.1);
  // In a face-centred cubic or hexagonal crystal 6 neighbours sit at sqrt(2) diameters: a peak where a glass has its
  // minimum.
  CHECK(at(1.42) < at(1.27));
  // Far away everything is even.
  for (int b = 80; b < 100; ++b) CHECK(g[static_cast<std::size_t>(b)] == Approx(1.0).margin(0.08));
}

TEST_CASE("a loose random fill is evenly spread over its region", "[fill]") {
  const Scene scene = packed({true, true, true}, 0.12, 0.1, 1.0, 4);
  const std::vector<GrainSeed> grains = make_grains(scene, 1);
  for (int axis = 0; axis < 3; ++axis) {
    std::array<double, 8> n{};
    for (const GrainSeed& grain : grains) n[static_cast<std::size_t>(grain.position[axis] / 0.12 * 8)] += 1.0;
    const double expected = static_cast<double>(grains.size()) / 8;
    double chi = 0.0;
    for (const double count : n) chi += (count - expected) * (count - expected) / expected;
    CHECK(chi <
          24.3);  // 7 degrees of freedom: exceeded once in a thousand (and grains that exclude each other vary less)
  }
}
