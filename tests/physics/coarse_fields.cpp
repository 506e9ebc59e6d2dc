// Coarse-grained fields: mass and momentum balance of what a grid shows (Goldhirsch 2010, Granular Matter 12, 239; Weinhart et al. 2012,
// Granular Matter 14, 289), and the maps of forces on meshes.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "tests/physics/laboratory.hpp"
#include "tests/support/flow_scenes.hpp"

using namespace moraine;
using namespace moraine::physics;

namespace {

/// A field image by name and place.
class Grid {
 public:
  explicit Grid(FieldImage image) : image_(std::move(image)) {}
  const FieldImage& image() const { return image_; }
  double spacing(int axis) const { return image_.box.size()[axis] / image_.n[static_cast<std::size_t>(axis)]; }
  double cell_volume() const { return spacing(0) * spacing(1) * spacing(2); }
  const std::vector<double>& values(const std::string& name) const {
    for (const GridArray& array : image_.arrays)
      if (array.name == name) return array.values;
    throw std::logic_error("there is no field " + name);
  }
  double at(const std::string& name, std::array<int, 3> cell) const {
    for (std::size_t a = 0; a < 3; ++a) cell[a] = (cell[a] + image_.n[a]) % image_.n[a];
    return values(name)[static_cast<std::size_t>((cell[2] * image_.n[1] + cell[1]) * image_.n[0] + cell[0])];
  }
  /// Integral over the grid.
  double total(const std::string& name) const {
    double sum = 0.0;
    for (const double value : values(name)) sum += value;
    return sum * cell_volume();
  }
  /// Central difference along an axis.
  double slope(const std::string& name, std::array<int, 3> cell, int axis) const {
    std::array<int, 3> low = cell, high = cell;
    --low[static_cast<std::size_t>(axis)];
    ++high[static_cast<std::size_t>(axis)];
    return (at(name, high) - at(name, low)) / (2.0 * spacing(axis));
  }

 private:
  FieldImage image_;
};

constexpr const char* axes[] = {"x", "y", "z"};

std::string stress_name(const char* kind, int a, int b) { return std::string(kind) + "_stress_" + axes[a] + axes[b]; }
/// Symmetric ones are kept once.
std::string kinetic_name(int a, int b) { return stress_name("kinetic", std::min(a, b), std::max(a, b)); }

Grid fields_of(Simulation& run, std::size_t probe = 0) {
  run.begin_fields(probe);
  run.probe_row(probe);
  return Grid(run.fields(probe));
}

/// The periodic flow of two materials without dashpots, so that forces begin and end softly; `fine`: cells for the same weight.
Scene smooth_flow(int fine) {
  Scene scene = scenes::periodic_flow();
  scene.output.probes.clear();
  scene.contact.tangential = TangentialLaw::spring;
  for (PairLaw& law : scene.contact.pairs) {
    law.restitution = 1.0;
    law.tangential_damping = 0.0;
  }
  scenes::add_fields(scene, scene.domain.box(), {6 * fine, 6 * fine, 6 * fine}, false, fine);
  return scene;
}

/// How far momentum is from balance: root of the mean square of d(j)/dt + div(rho V V + stress) - forces over that of the forces of contacts.
double imbalance(int fine, double step) {
  Scene scene = smooth_flow(fine);
  scene.time.step = step;
  Simulation run(scene, 2);
  while (run.time() < 0.02 - 1.5 * step) run.step();
  const Grid before = fields_of(run);
  run.step();
  const Grid now = fields_of(run);
  run.step();
  const Grid after = fields_of(run);
  const std::array<int, 3> n = now.image().n;
  // The flux of momentum, rho V V and both stresses, so that its slope is that of one field.
  double squared_error = 0.0, squared_force = 0.0;
  for (int k = 0; k < n[2]; k += fine)
    for (int j = 0; j < n[1]; j += fine)
      for (int i = 0; i < n[0]; i += fine)
        for (int a = 0; a < 3; ++a) {
          const std::array<int, 3> cell = {i, j, k};
          const auto name = [&](const char* what, int axis) { return std::string(what) + axes[axis]; };
          double change = (after.at(name("momentum_", a), cell) - before.at(name("momentum_", a), cell)) / (2.0 * step);
          double divergence = 0.0;
          for (int b = 0; b < 3; ++b) {
            const double contact = now.slope(stress_name("contact", a, b), cell, b);
            divergence += contact + now.slope(kinetic_name(a, b), cell, b);
            squared_force += contact * contact;
            std::array<int, 3> low = cell, high = cell;
            --low[static_cast<std::size_t>(b)];
            ++high[static_cast<std::size_t>(b)];
            const auto carried = [&](const std::array<int, 3>& where) {
              return now.at(name("momentum_", a), where) * now.at(name("velocity_", b), where);
            };
            divergence += (carried(high) - carried(low)) / (2.0 * now.spacing(b));
          }
          const double force = now.at(name("body_force_", a), cell) + now.at(name("wall_force_", a), cell);
          const double error = change + divergence - force;
          squared_error += error * error;
        }
  return std::sqrt(squared_error / squared_force);
}

/// A bed at rest on a floor between periodic sides.
Scene bed_at_rest() {
  Scene scene = scenes::settled_bed();
  scene.output.probes.clear();
  scene.time.gravity = {0.0, 0.0, -9.81};
  scene.time.damping = 20.0;
  for (PairLaw& law : scene.contact.pairs) law.restitution = 0.3;
  return scene;
}

}  // namespace

TEST_CASE("what a grid shows adds up to the mass, the momentum and the virial of the grains, to round-off",
          "[fields]") {
  Scene scene = scenes::polydisperse();
  scene.output.probes.clear();
  scenes::add_fields(scene, scene.domain.box(), {5, 4, 6}, true);
  scenes::add_fields(scene, scene.domain.box(), {1, 7, 1}, false, 3);
  Simulation run(scene, 2);
  for (int i = 0; i < 2000; ++i) run.step();
  const State state = state_of(run);
  const Image image = run.snapshot({"inverse_mass", "material"});
  double mass = 0.0, glass = 0.0;
  for (std::size_t i = 0; i < state.position.size(); ++i) {
    const double m = 1.0 / image.find(Field::inverse_mass)->reals[i];
    mass += m;
    if (image.find(Field::material)->indices[i] == 0) glass += m;
  }
  const std::vector<double> row = run.probe_row(0);
  CHECK(row[1] == Approx(mass).epsilon(1e-13));
  CHECK(row[2] == Approx(mass).epsilon(1e-14));
  for (const std::size_t probe : {0u, 1u}) {
    const Grid grid = fields_of(run, probe);
    CHECK(grid.total("density") == Approx(mass).epsilon(1e-13));
    CHECK(grid.total("number_density") == Approx(static_cast<double>(state.position.size())).epsilon(1e-13));
    // Momentum changes by walls and weight alone, and both grids see the same stress.
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        CHECK(grid.total(stress_name("contact", a, b)) ==
              Approx(fields_of(run, 1 - probe).total(stress_name("contact", a, b))).epsilon(1e-11).margin(1e-12));
    CHECK(grid.total("body_force_z") == Approx(-9.81 * mass).epsilon(1e-13));
  }
  const Grid grid = fields_of(run);
  CHECK(grid.total("glass.density") == Approx(glass).epsilon(1e-13));
  CHECK(grid.total("steel.density") == Approx(mass - glass).epsilon(1e-12));
  CHECK(grid.total("glass.solid_fraction") == Approx(glass / 2500.0).epsilon(1e-12));
}

TEST_CASE("in a flow momentum changes by the divergence of stress and by forces, to the second order", "[fields]") {
  const double coarse = imbalance(1, 4e-5), middle = imbalance(2, 2e-5), fine = imbalance(4, 1e-5);
  report(
      "momentum balance in a flow: off by %.4f, %.4f, %.4f of the forces of contacts with 1, 2, 4 cells between knots",
      coarse, middle, fine);
  CHECK(std::log2(middle / fine) == Approx(2.0).margin(0.3));
  CHECK(coarse > 2.5 * middle);
  CHECK(fine < 0.06);
}

TEST_CASE("in a bed at rest the divergence of stress is its weight, and the floor carries it", "[fields]") {
  Scene scene = bed_at_rest();
  for (const int fine : {1, 2, 4})
    scenes::add_fields(scene, {{0.0, 0.0, 0.0}, {scene.domain.high.x, scene.domain.high.y, 0.1}}, {1, 1, 8 * fine},
                       false, fine);
  Simulation run(scene, 2);
  for (int i = 0; i < 12000; ++i) run.step();
  std::vector<double> errors;
  for (std::size_t probe = 0; probe < 3; ++probe) {
    const Grid grid = fields_of(run, probe);
    const double weight = -grid.total("body_force_z");
    CHECK(grid.total("wall_force_z") == Approx(weight).epsilon(1e-3));
    CHECK(grid.total("granular_temperature") < 1e-8);
    double squared_error = 0.0, squared_force = 0.0;
    for (int k = 1; k + 1 < grid.image().n[2]; ++k) {
      const std::array<int, 3> cell = {0, 0, k};
      const double force = grid.at("body_force_z", cell) + grid.at("wall_force_z", cell);
      const double error = grid.slope("contact_stress_zz", cell, 2) - force;
      squared_error += error * error;
      squared_force += force * force;
    }
    errors.push_back(std::sqrt(squared_error / squared_force));
  }
  report("bed at rest: stress and weight differ by %.4f, %.4f, %.4f with 1, 2, 4 cells between knots", errors[0],
         errors[1], errors[2]);
  CHECK(std::log2(errors[1] / errors[2]) == Approx(2.0).margin(0.3));
  CHECK(errors[2] < 0.03);
}

TEST_CASE("a homogeneous gas has the granular temperature and the kinetic pressure of its grains", "[fields]") {
  Scene scene = scenes::gas();
  scene.output.probes.clear();
  scene.particles[0].velocity = {0.3, -0.2, 0.1};
  scenes::add_fields(scene, scene.domain.box(), {1, 1, 1});
  Simulation run(scene, 1);
  const State state = state_of(run);
  Vec3 mean;
  for (const Vec3 v : state.velocity) mean += v / static_cast<double>(state.velocity.size());
  double square = 0.0;
  for (const Vec3 v : state.velocity) square += squared_length(v - mean) / static_cast<double>(state.velocity.size());
  const Grid grid = fields_of(run);
  const double temperature = grid.at("granular_temperature", {0, 0, 0}), density = grid.at("density", {0, 0, 0});
  CHECK(temperature == Approx(square / 3.0).epsilon(1e-10));
  CHECK(grid.at("velocity_x", {0, 0, 0}) == Approx(mean.x).epsilon(1e-12));
  const double pressure = (grid.at("kinetic_stress_xx", {0, 0, 0}) + grid.at("kinetic_stress_yy", {0, 0, 0}) +
                           grid.at("kinetic_stress_zz", {0, 0, 0})) /
                          3.0;
  CHECK(pressure == Approx(density * temperature).epsilon(1e-12));
  // Velocities were drawn with a deviation of 0.6 m/s.
  const double n = static_cast<double>(state.velocity.size());
  CHECK(temperature == Approx(0.36).margin(4.0 * 0.36 * std::sqrt(2.0 / (3.0 * n))));
}

TEST_CASE("granular temperature is shared among the dimensions that there are, of all grains and of one material alike",
          "[fields]") {
  for (const int dimensions : {2, 3}) {
    Scene scene = scenes::gas();
    scene.output.probes.clear();
    scene.domain.dimensions = dimensions;
    if (dimensions == 2) {
      scene.domain.high.z = 0.02;
      scene.domain.periodic[2] = false;
      scene.particles = {scenes::lattice(scene.domain.box(), 0.017)};
      scene.particles[0].velocity_deviation = 0.6;
    }
    scenes::add_probe(scene, Probe::Kind::region, "region");
    scene.output.probes[0].by_material = true;
    Simulation run(scene, 1);
    const State state = state_of(run);
    Vec3 mean;
    const double n = static_cast<double>(state.velocity.size());
    for (const Vec3 v : state.velocity) mean += v / n;
    double square = 0.0;
    for (const Vec3 v : state.velocity) square += squared_length(v - mean) / n;
    const std::vector<double> row = run.probe_row(0);
    REQUIRE(row.size() == 7 + 10);
    CHECK(row[5] == Approx(square / dimensions).epsilon(1e-10));
    CHECK(row[7 + 6] == Approx(square / dimensions).epsilon(1e-10));
  }
}

TEST_CASE("the forces on the triangles of a mesh add up to the force on the wall", "[fields]") {
  Scene scene = scenes::hopper(1.0);
  scene.output.probes.clear();
  scenes::add_probe(scene, Probe::Kind::wall_force, "cone", "cone");
  Simulation run(scene, 2);
  for (int i = 0; i < 3000; ++i) run.step();
  run.begin_force_maps();
  Vec3 expected;
  const int n = 400;
  for (int i = 0; i < n; ++i) {
    const std::vector<double> row = run.probe_row(0);  // what the step to come applies
    expected += Vec3{row[0], row[1], row[2]} / n;
    run.step();
  }
  const std::vector<WallMap> maps = run.snapshot().maps;
  REQUIRE(maps.size() == 1);
  const WallMap& map = maps[0];
  Vec3 sum, pushed;
  std::size_t n_loaded = 0;
  for (std::size_t t = 0; t < map.n_triangles(); ++t) {
    const auto corner = [&](std::size_t k) {
      return Vec3{map.corners[9 * t + 3 * k], map.corners[9 * t + 3 * k + 1], map.corners[9 * t + 3 * k + 2]};
    };
    sum += Vec3{map.force[3 * t], map.force[3 * t + 1], map.force[3 * t + 2]};
    const Vec3 twice_area = cross(corner(1) - corner(0), corner(2) - corner(0));
    const Vec3 outward = corner(0).x * twice_area.x + corner(0).y * twice_area.y > 0.0 ? twice_area : -twice_area;
    pushed += 0.5 * map.pressure[t] * outward;
    n_loaded += map.pressure[t] > 0.0 ? 1 : 0;
    CHECK(map.pressure[t] >= 0.0);
    CHECK(map.shear[t] <= 0.3 * map.pressure[t] * 1.05);  // what friction allows, but for dashpots that pull
  }
  CHECK(n_loaded > map.n_triangles() / 2);
  for (int a = 0; a < 3; ++a) CHECK(sum[a] == Approx(expected[a]).epsilon(1e-9).margin(1e-9 * length(expected)));
  // Pressure alone carries the most of the weight on the cone.
  CHECK(pushed.z < 0.0);
  CHECK(std::abs(pushed.z) > 0.5 * std::abs(sum.z));
}
