// Grains in a gas: drag laws against a table, a grain that falls against the flow, a fixed bed, and what gas and grains give each other.
#include "engine/coupling/coupling.hpp"

#include <catch2/catch.hpp>
#include <cmath>

#include "kernels/drag/laws.hpp"
#include "tests/physics/laboratory.hpp"

using namespace moraine;
using namespace moraine::physics;

namespace {

GasGrid grid_of(const Scene& scene) {
  GasGrid grid;
  grid.n = scene.gas->cells;
  grid.low = scene.domain.low;
  for (int a = 0; a < 3; ++a)
    grid.spacing[a] = (scene.domain.high[a] - scene.domain.low[a]) / grid.n[static_cast<std::size_t>(a)];
  grid.periodic = scene.domain.periodic;
  grid.is_flat = scene.domain.dimensions == 2;
  return grid;
}

/// A column along z with smooth walls, an inlet below and an outlet above.
Scene column(std::array<int, 3> cells, Vec3 spacing, double density, double viscosity, double superficial) {
  Scene scene = empty_scene({0, 0, 0}, {cells[0] * spacing.x, cells[1] * spacing.y, cells[2] * spacing.z}, 1e-5);
  Gas gas;
  gas.cells = cells;
  gas.density = density;
  gas.viscosity = viscosity;
  gas.velocity = {0, 0, superficial};
  for (int face = 0; face < 6; ++face) {
    GasBoundary boundary;
    boundary.face = face;
    boundary.kind = face < 4    ? GasBoundary::Kind::free_slip
                    : face == 4 ? GasBoundary::Kind::velocity
                                : GasBoundary::Kind::pressure;
    if (face == 4) boundary.velocity = gas.velocity;
    gas.boundaries.push_back(boundary);
  }
  scene.gas = gas;
  return scene;
}

Particles particles_of(const Scene& scene, const std::vector<GrainSeed>& seeds) {
  FieldNeeds needs;
  needs.rotation = false;
  needs.gas = true;
  Particles particles(needs);
  put_grains(scene, seeds, particles);
  return particles;
}

GrainSeed grain_at(Vec3 position, double radius) {
  GrainSeed seed;
  seed.position = position;
  seed.radius = radius;
  return seed;
}

/// MFiX's DEM06: a grain of 0.1 mm let go at rest in a gas that rises at 0.4 m/s; its velocity at some times.
class FallingGrain {
 public:
  FallingGrain(bool moves_gas, int cells_across, double spacing, double step)
      : scene_(column({cells_across, cells_across, 24}, {spacing, spacing, spacing}, 1.2, 1.8e-5, 0.4)), step_(step) {
    scene_.time.gravity = {0, 0, -9.80665};
    scene_.materials = {{"grain", 2000.0, 0.0, 0.3}};
    scene_.gas->drag = DragLaw::schiller_naumann;
    scene_.gas->moves_gas = moves_gas;
  }
  std::vector<double> velocities(const std::vector<double>& times) const {
    const Vec3 middle = 0.5 * (scene_.domain.low + scene_.domain.high);
    Particles grains = particles_of(scene_, {grain_at(middle + 0.3 * grid_of(scene_).spacing, 0.5e-4)});
    Coupling coupling(scene_, grid_of(scene_), World(), 1);
    std::vector<double> result;
    double speed = 0.0, place = grains.position(0).z;
    for (int n = 0; result.size() < times.size(); ++n) {
      if (n * step_ > times[result.size()] - 0.5 * step_) result.push_back(speed);
      coupling.advance(grains, n * step_, step_);
      const double change = step_ * (grains.gas_acceleration()[2] + scene_.time.gravity.z);
      place += step_ * (speed + 0.5 * change);
      speed += change;
      grains.set_real(Field::velocity, 0, 2, speed);
      grains.set_real(Field::position, 0, 2, place);
    }
    return result;
  }

 private:
  Scene scene_;
  double step_;
};

/// A bed of fixed grains, eight in each cell, from the inlet to the outlet.
struct FixedBed {
  static constexpr double diameter = 1e-3, void_fraction = 0.451335, depth = 15.6e-3, density = 10.0,
                          viscosity = 1.5e-3;
  static constexpr int n_bed = 10, n_across = 2;
  Scene scene;
  Particles grains;
  Coupling coupling;

  static Scene make(double superficial, GasModel model, GasWeights weights) {
    const double height = depth / n_bed;
    const double width = std::sqrt(8.0 * pi / 6.0 * diameter * diameter * diameter / (1.0 - void_fraction) / height);
    Scene scene = column({n_across, n_across, n_bed}, {width, width, height}, density, viscosity, superficial);
    scene.materials = {{"grain", 2500.0, 0.0, 0.3}};
    scene.gas->drag = DragLaw::ergun;
    scene.gas->model = model;
    scene.gas->weights = weights;
    return scene;
  }
  static std::vector<GrainSeed> seeds(const GasGrid& grid) {
    std::vector<GrainSeed> all;
    for (int k = 0; k < 2 * n_bed; ++k)
      for (int j = 0; j < 2 * n_across; ++j)
        for (int i = 0; i < 2 * n_across; ++i)
          all.push_back(grain_at(
              {(0.5 * i + 0.25) * grid.spacing.x, (0.5 * j + 0.25) * grid.spacing.y, (0.5 * k + 0.25) * grid.spacing.z},
              0.5 * diameter));
    return all;
  }
  FixedBed(double superficial, GasModel model, GasWeights weights)
      : scene(make(superficial, model, weights)),
        grains(particles_of(scene, seeds(grid_of(scene)))),
        coupling(scene, grid_of(scene), World(), 2) {}

  /// [Pa] once the flow is steady: between the first and the last centre, taken over the whole depth.
  double pressure_drop(double step, int n_steps) {
    for (int n = 0; n < n_steps; ++n) last = coupling.advance(grains, n * step, step);
    const GridField<>& p = coupling.flow()->pressure();
    return (p(0, 0, 0) - p(0, 0, n_bed - 1)) * n_bed / (n_bed - 1);
  }
  CouplingReport last;
};

}  // namespace

TEST_CASE("drag laws have the tabulated values to five digits") {
  constexpr DragLaw columns[] = {DragLaw::gidaspow, DragLaw::wen_yu,    DragLaw::di_felice,
                                 DragLaw::beetstra, DragLaw::koch_hill, DragLaw::syamlal_obrien};
  int n_values = 0;
  for (const std::vector<double>& row : read_numbers(data_file("drag_table.csv"))) {
    REQUIRE(row.size() == 8);
    for (std::size_t law = 0; law < 6; ++law, ++n_values) {
      INFO("column " << law + 2 << ", void fraction " << row[0] << ", Re " << row[1]);
      CHECK(drag_factor(columns[law], row[0], row[1]) == Approx(row[law + 2]).epsilon(5e-6));
    }
  }
  CHECK(n_values == 240);
}

TEST_CASE("a grain that does not move the gas falls as Schiller and Naumann say") {
  const std::vector<double> times = {0.01, 0.05, 0.1, 0.35},
                            exact = {-0.01255261, -0.04078891, -0.05263133, -0.05739251};
  const std::vector<double> found = FallingGrain(false, 3, 1e-3, 1e-5).velocities(times);
  for (std::size_t i = 0; i < times.size(); ++i) {
    report("one way: v(%g s) = %.8f m/s, exact %.8f", times[i], found[i], exact[i]);
    CHECK(found[i] == Approx(exact[i]).epsilon(i == 3 ? 1e-5 : 2e-4));
  }
}

TEST_CASE("a grain that moves the gas falls within 1 percent of one that does not") {
  const std::vector<double> found = FallingGrain(true, 3, 5e-3, 5e-4).velocities({0.35});
  report("two ways: v(0.35 s) = %.8f m/s, exact %.8f", found[0], -0.05739251);
  CHECK(found[0] == Approx(-0.05739251).epsilon(0.01));
}

TEST_CASE("the pressure drop of a fixed bed is Ergun's, in models A and B, and its grains carry it") {
  for (const GasModel model : {GasModel::a, GasModel::b})
    for (const GasWeights weights : {GasWeights::cell, GasWeights::trilinear})
      for (const auto& [superficial, exact] : {std::pair(0.002, 22.992), std::pair(0.02, 230.507)}) {
        FixedBed bed(superficial, model, weights);
        const double drop = bed.pressure_drop(1e-3, 30);
        double force = 0.0;
        for (std::int32_t i = 0; i < bed.grains.size(); ++i)
          force += bed.grains.gas_acceleration()[3 * i + 2] / bed.grains.inverse_mass(i);
        const GasGrid& grid = bed.coupling.grid();
        const double carried = force / (grid.n[0] * grid.spacing.x * grid.n[1] * grid.spacing.y);
        report("model %s, %g m/s: drop %.4f Pa, carried by grains %.4f Pa, Ergun %.4f Pa",
               model == GasModel::a ? "A" : "B", superficial, drop, carried, exact);
        CHECK(drop == Approx(exact).epsilon(0.005));
        CHECK(carried == Approx(exact).epsilon(0.005));
        CHECK(bed.last.momentum_error < 1e-10);
        CHECK(bed.last.n_floored == 0);
        CHECK(bed.last.least_void_fraction == Approx(FixedBed::void_fraction).epsilon(1e-9));
      }
}

TEST_CASE("cells denser than the floor are taken as it, counted and told of, and momentum is not lost by it") {
  Scene scene = column({3, 3, 8}, {0.01, 0.01, 0.01}, 1.2, 1.8e-5, 0.5);
  scene.materials = {{"grain", 2500.0, 0.0, 0.3}};
  scene.gas->drag = DragLaw::gidaspow;
  scene.gas->weights = GasWeights::cell;
  scene.gas->least_void_fraction = 0.35;
  const double radius = 1.5e-3, share = 4.0 / 3.0 * pi * radius * radius * radius / 1e-6;  // of a cell
  std::vector<GrainSeed> seeds;
  const auto pile = [&](Vec3 middle, int n) {  // all in one cell, through one another
    for (int i = 0; i < n; ++i) seeds.push_back(grain_at(middle + Vec3{0.0, 0.0, 1e-4 * i}, radius));
  };
  pile({0.005, 0.005, 0.032}, 52);  // 0.265 of its cell is empty
  pile({0.015, 0.025, 0.042}, 48);  // 0.321
  pile({0.025, 0.005, 0.052}, 44);  // 0.378
  Particles grains = particles_of(scene, seeds);
  Coupling coupling(scene, grid_of(scene), World(), 2);
  for (int n = 0; n < 3; ++n) {
    const CouplingReport report = coupling.advance(grains, n * 1e-4, 1e-4);
    CHECK(report.n_floored == 2);
    CHECK(report.least_void_fraction == Approx(1.0 - 52 * share).epsilon(1e-9));
    CHECK(report.momentum_error < 1e-10);
    CHECK(coupling.flow()->void_fraction()(0, 0, 3) == 0.35);
    CHECK(coupling.flow()->void_fraction()(1, 2, 4) == 0.35);
    CHECK(coupling.flow()->void_fraction()(2, 0, 5) == Approx(1.0 - 44 * share).epsilon(1e-9));
  }
}

TEST_CASE(
    "momentum of gas, grains and boundaries closes to 1e-10, with a moving heap, for all weights and both models") {
  for (const GasModel model : {GasModel::a, GasModel::b})
    for (const GasWeights weights : {GasWeights::cell, GasWeights::trilinear, GasWeights::smoothed}) {
      Scene scene = column({7, 6, 20}, {0.01, 0.012, 0.011}, 1.2, 1.8e-5, 1.5);
      scene.domain.periodic = {true, false, false};
      std::erase_if(scene.gas->boundaries, [](const GasBoundary& boundary) { return boundary.face < 2; });
      scene.gas->boundaries[0].kind = GasBoundary::Kind::no_slip;
      scene.time.gravity = {0, 0, -9.81};
      scene.materials = {{"grain", 2500.0, 0.0, 0.3}};
      scene.gas->drag = DragLaw::beetstra;
      scene.gas->model = model;
      scene.gas->weights = weights;
      scene.gas->smoothing = 0.013;
      scene.gas->tolerance = 1e-9;
      std::vector<GrainSeed> seeds;
      for (int i = 0; i < 2000; ++i) {
        const auto number = [&](int which) { return std::fmod(0.5 + i * (0.6180339887 + 0.1732050808 * which), 1.0); };
        seeds.push_back(grain_at({0.07 * number(0), 0.072 * number(1), 0.1 * number(2)}, 0.5e-3 + 1e-3 * number(3)));
        seeds.back().velocity = {number(4) - 0.5, number(5) - 0.5, number(6) - 0.8};
      }
      Particles grains = particles_of(scene, seeds);
      Coupling coupling(scene, grid_of(scene), World(), 2);
      const double step = 1e-3;
      double worst_sum = 0.0, worst_pair = 0.0, worst_exchange = 0.0;
      for (int n = 0; n < 8; ++n) {
        const Vec3 before = coupling.flow()->budget().momentum;
        const CouplingReport report = coupling.advance(grains, n * step, step);
        const GasFlow::Budget budget = coupling.flow()->budget();
        Vec3 on_grains;
        double given = 0.0;
        for (std::int32_t i = 0; i < grains.size(); ++i) {
          const double r = grains.radius(i), volume = 4.0 / 3.0 * pi * r * r * r;
          const double* const a = grains.gas_acceleration() + 3 * i;
          const Vec3 force = Vec3{a[0], a[1], a[2]} / grains.inverse_mass(i) + 1.2 * volume * scene.time.gravity;
          on_grains += force;
          given += length(force);
        }
        CHECK(report.n_floored == 0);
        const Vec3 sum = budget.momentum - before - step * (budget.boundary_force + budget.drag);
        if (n > 0) worst_sum = std::max(worst_sum, length(sum) / (step * given));
        worst_pair = std::max(worst_pair, length(on_grains + budget.drag) / given);
        worst_exchange = std::max(worst_exchange, report.momentum_error);
      }
      report("model %s, weights %d: gas and boundaries %.1e, gas and grains %.1e, drag %.1e",
             model == GasModel::a ? "A" : "B", static_cast<int>(weights), worst_sum, worst_pair, worst_exchange);
      CHECK(worst_sum < 1e-10);
      CHECK(worst_pair < 1e-10);
      CHECK(worst_exchange < 1e-10);
    }
}
