// Probes of a region and profiles, against plain sums over the grains of a snapshot.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "engine/run/simulation.hpp"
#include "tests/support/flow_scenes.hpp"

using namespace moraine;

namespace {

struct Grain {
  Vec3 position, velocity;
  double radius = 0.0;
  double density = 0.0;
  std::string material;
  double volume() const { return 4.0 / 3.0 * std::numbers::pi * radius * radius * radius; }
  double mass() const { return density * volume(); }
};

std::vector<Grain> grains_of(const Simulation& run) {
  const Image image = run.snapshot({"position", "velocity", "radius", "material"});
  const auto vector = [&](Field field, std::size_t i) {
    const std::vector<double>& v = image.find(field)->reals;
    return Vec3{v[3 * i], v[3 * i + 1], v[3 * i + 2]};
  };
  std::vector<Grain> grains;
  const std::vector<double>& radii = image.find(Field::radius)->reals;
  for (std::size_t i = 0; i < radii.size(); ++i) {
    const Material& material = run.scene().materials[image.find(Field::material)->indices[i]];
    grains.push_back(
        {vector(Field::position, i), vector(Field::velocity, i), radii[i], material.density, material.name});
  }
  return grains;
}

/// Glass below and smaller steel above stream past each other, and mix.
Simulation mixed_flow(Box region) {
  Scene scene = scenes::periodic_flow();
  scene.particles[1].diameter.value = 0.8 * scenes::d;
  scene.output.probes.clear();
  scenes::add_probe(scene, Probe::Kind::region, "region");
  scenes::add_probe(scene, Probe::Kind::profile, "profile");
  for (Probe& probe : scene.output.probes) {
    probe.by_material = true;
    probe.region = region;
    probe.axis = 2;
  }
  return Simulation(scene, 2);
}

const Box region = {{-0.005, 0.01, 0.04}, {0.06, 0.08, 0.1}};

}  // namespace

TEST_CASE("a region's values of each material are those of its grains alone, and together they are those of all") {
  Simulation run = mixed_flow(region);
  for (int i = 0; i < 800; ++i) run.step();
  const std::vector<std::string> names = run.probe_columns(0);
  const std::vector<double> row = run.probe_row(0);
  REQUIRE(row.size() == names.size());
  const auto value = [&](const std::string& name) {
    const auto at = std::find(names.begin(), names.end(), name);
    INFO(name);
    REQUIRE(at != names.end());
    return row[static_cast<std::size_t>(at - names.begin())];
  };
  const std::vector<Grain> grains = grains_of(run);
  double n_all = 0.0, fraction_of_all = 0.0;
  for (const std::string material : {"glass", "steel"}) {
    INFO(material);
    double n = 0.0, mass = 0.0, volume = 0.0, square = 0.0;
    Vec3 velocity, centre;
    const auto is_meant = [&](const Grain& g) { return g.material == material && region.contains(g.position); };
    for (const Grain& g : grains) {
      if (!is_meant(g)) continue;
      n += 1.0;
      mass += g.mass();
      volume += g.volume();
      velocity += g.mass() * g.velocity;
      centre += g.mass() * g.position;
    }
    REQUIRE(n > 20.0);
    velocity = velocity / mass;
    centre = centre / mass;
    for (const Grain& g : grains)
      if (is_meant(g)) square += g.mass() * squared_length(g.velocity - velocity) / mass;
    CHECK(value(material + " grains") == n);
    CHECK(value(material + " mass [kg]") == Approx(mass).epsilon(1e-12));
    CHECK(value(material + " solid fraction") == Approx(volume / region.volume()).epsilon(1e-12));
    CHECK(value(material + " granular temperature [m2/s2]") == Approx(square / 3.0).epsilon(1e-10));
    for (int axis = 0; axis < 3; ++axis) {
      const std::string letter(1, "xyz"[axis]);
      CHECK(value(material + " velocity " + letter + " [m/s]") == Approx(velocity[axis]).margin(1e-12));
      CHECK(value(material + " centre " + letter + " [m]") == Approx(centre[axis]).margin(1e-12));
    }
    n_all += n;
    fraction_of_all += volume / region.volume();
  }
  CHECK(value("grains") == n_all);
  CHECK(value("solid fraction") == Approx(fraction_of_all).epsilon(1e-12));
}

TEST_CASE("a profile's slices of each material are those of its grains alone, and together they are those of all") {
  Simulation run = mixed_flow(region);
  for (int i = 0; i < 800; ++i) run.step();
  const std::vector<std::string> names = run.probe_columns(1);
  const std::vector<double> row = run.probe_row(1);
  REQUIRE(row.size() == names.size());
  constexpr std::size_t n_bins = 5, n_values = 4;
  REQUIRE(row.size() == 3 * n_bins * n_values);
  const double thickness = region.size().z / n_bins;
  const std::vector<Grain> grains = grains_of(run);
  const std::vector<std::string> groups = {"", "glass", "steel"};
  for (std::size_t group = 0; group < groups.size(); ++group)
    for (std::size_t bin = 0; bin < n_bins; ++bin) {
      const std::size_t at = (group * n_bins + bin) * n_values;
      INFO(names[at]);
      CHECK(names[at].starts_with(groups[group].empty() ? "solid" : groups[group] + " solid"));
      Box slice = region;
      slice.low.z = region.low.z + static_cast<double>(bin) * thickness;
      slice.high.z = slice.low.z + thickness;
      double n = 0.0, volume = 0.0;
      Vec3 velocity;
      for (const Grain& g : grains) {
        if (!slice.contains(g.position) || (!groups[group].empty() && g.material != groups[group])) continue;
        n += 1.0;
        volume += g.volume();
        velocity += g.velocity;
      }
      CHECK(row[at] == Approx(volume / slice.volume()).epsilon(1e-12));
      for (int axis = 0; axis < 3; ++axis)
        CHECK(row[at + 1 + static_cast<std::size_t>(axis)] == Approx(n > 0.0 ? velocity[axis] / n : 0.0).margin(1e-12));
    }
}
