// Grains and gas at the edge: liquids, packed and empty cells, thin gas, fast jets, cells as small as grains, long gas steps. The bounds
// are those of physics: weights carried, closed forms, terminal velocities.
#include <regex>

#include "kernels/base/sphere.hpp"
#include "kernels/drag/laws.hpp"
#include "tests/stability/cases.hpp"

using namespace moraine;
using namespace moraine::cases;

namespace {

constexpr double gravity = 9.81;

/// A fluid on cells of a domain.
Gas fluid(const Scene& scene, double spacing, double density, double viscosity, double step) {
  Gas gas;
  for (int axis = 0; axis < 3; ++axis)
    gas.cells[static_cast<std::size_t>(axis)] =
        static_cast<int>(std::lround((scene.domain.high[axis] - scene.domain.low[axis]) / spacing));
  gas.density = density;
  gas.viscosity = viscosity;
  gas.step = step;
  gas.drag = DragLaw::di_felice;
  return gas;
}

GasBoundary boundary(GasBoundary::Kind kind, int face, Vec3 velocity = {}) {
  GasBoundary made;
  made.kind = kind;
  made.face = face;
  made.velocity = velocity;
  return made;
}

/// [m/s] at which drag carries what is left of a lone grain's weight.
double terminal_velocity(DragLaw law, double diameter, double density, double fluid_density, double viscosity) {
  const double weight = sphere_volume(0.5 * diameter) * std::abs(density - fluid_density) * gravity;
  double low = 0.0, high = 100.0;
  for (int i = 0; i < 100; ++i) {
    const double v = 0.5 * (low + high);
    const double drag = 3.0 * std::numbers::pi * viscosity * diameter * v *
                        drag_factor(law, 1.0, fluid_density * v * diameter / viscosity);
    (drag < weight ? low : high) = v;
  }
  return low;
}

/// [m/s] largest component of the gas velocity at a cell.
double fastest_gas(const Simulation& run) {
  double most = 0.0;
  for (const GridArray& array : run.snapshot().grids)
    if (array.name.starts_with("gas_velocity"))
      for (const double v : array.values) most = std::max(most, std::isfinite(v) ? std::abs(v) : 1e300);
  return most;
}

/// A closed column, periodic across, in which grains that nearly touch hang in the middle and are let go.
struct Suspension {
  double diameter = 1e-3, density = 2500.0, fluid_density = 1000.0, viscosity = 1e-3;
  double stiffness = 20.0, step = 5e-4;
  GasModel model = GasModel::a;

  /// Of a lattice in which neighbours are 1.07 diameters apart: void fraction 0.4.
  double cell() const { return 1.07 * std::numbers::sqrt2 * diameter; }
  double width() const { return 4 * cell(); }

  Scene scene() const {
    const double height = 20 * cell();
    Scene s = empty_scene({0, 0, 0}, {width(), width(), height}, density, stiffness, 0.8, 0.3);
    s.domain.periodic = {true, true, false};
    s.time.gravity = {0, 0, -gravity};
    s.time.steps_per_contact = 20.0;
    add_grains(s, diameter, cubic_layers(cell(), 4, 27, 3.3 * cell()));
    add_plane(s, "floor", {0, 0, 0}, {0, 0, 1});
    add_plane(s, "lid", {0, 0, height}, {0, 0, -1});
    s.gas = fluid(s, 4.0 / 3.0 * cell(), fluid_density, viscosity, step);
    s.gas->model = model;
    s.gas->boundaries = {boundary(GasBoundary::Kind::free_slip, 4), boundary(GasBoundary::Kind::free_slip, 5)};
    add_probe(s, Probe::Kind::pressure_drop, "drop");
    return s;
  }
  /// [Pa] of all grains over the cross section, buoyancy off.
  double weight(const Simulation& run) const {
    return static_cast<double>(run.n_grains()) * sphere_volume(0.5 * diameter) * (density - fluid_density) * gravity /
           (width() * width());
  }
};

void check_balances(const Simulation& run) {
  const GasTotals gas = *run.gas_totals();
  CHECK(gas.imbalance < 2e-5);
  CHECK(gas.momentum_error < 1e-12);
}

/// The suspension is let go for some relaxation times: the fluid then carries it, steadily, and nothing is faster than a lone grain.
void check_suspension(const Suspension& suspension, double time, int n_looks = 40) {
  INFO("grains of " << suspension.density << " kg/m3");
  const Scene scene = suspension.scene();
  Simulation run(scene, 1);
  advance_past_restart(run, scene, static_cast<std::int64_t>(time / run.time_step()));
  const double weight = suspension.weight(run);
  double sum = 0.0, squares = 0.0, fastest = 0.0;
  for (int look = 0; look < n_looks; ++look) {
    advance(run, static_cast<std::int64_t>(suspension.step / run.time_step()) + 1);
    const double carried = run.probe_row(0)[2] / weight;
    sum += carried / n_looks;
    squares += carried * carried / n_looks;
    fastest = std::max(fastest, largest_speed(run));
  }
  const double swing = std::sqrt(std::max(0.0, squares - sum * sum));
  const double lone = terminal_velocity(DragLaw::di_felice, suspension.diameter, suspension.density,
                                        suspension.fluid_density, suspension.viscosity);
  report(
      "%4.0f kg/m3 in %.0f kg/m3: the fluid carries %.3f of the weight, +- %.3f; fastest grain %.3f of a lone one's "
      "velocity (%.3g m/s)",
      suspension.density, suspension.fluid_density, sum, swing, fastest / lone, lone);
  CHECK(std::abs(sum - 1.0) < 0.08);
  CHECK(swing < 0.2);
  CHECK(fastest < lone);
  check_balances(run);
}

}  // namespace

TEST_CASE("grains from a tenth to two and a half times the density of water settle or rise in it without a swing") {
  for (const auto& [density, step] :
       {std::pair{2500.0, 1e-3}, {1050.0, 3e-4}, {700.0, 4e-4}, {300.0, 1e-4}, {100.0, 3e-5}})
    check_suspension({.density = density, .step = step}, 0.03);
  check_suspension({.density = 300.0, .step = 1e-4, .model = GasModel::b}, 0.01);
}

TEST_CASE("grains as heavy as the fluid hang in it at rest") {
  const Suspension neutral{.density = 1000.0, .step = 1e-3};
  const Scene scene = neutral.scene();
  Simulation run(scene, 1);
  advance_past_restart(run, scene, static_cast<std::int64_t>(0.02 / run.time_step()));
  CHECK(largest_speed(run) < 1e-12);
  CHECK(fastest_gas(run) < 1e-12);
}

TEST_CASE(
    "a gas step too long for a powder ends the run early, and the step that the message advises carries the powder") {
  Suspension powder{
      .diameter = 1e-4, .density = 1500.0, .fluid_density = 1.2, .viscosity = 1.8e-5, .stiffness = 2.0, .step = 8e-3};
  Simulation run(powder.scene(), 1);
  const std::string error = error_of(run, static_cast<std::int64_t>(0.1 / run.time_step()));
  INFO(error);
  std::smatch advice;
  REQUIRE(std::regex_search(error, advice,
                            std::regex("at 0 s: the gas step of 0\\.00[78].* times as long as the gas takes "
                                       "to drag a grain along.*set gas.step to ([0-9.e-]+) s or less")));
  powder.step = std::stod(advice[1]);
  check_suspension(powder, 0.003, 8);
}

namespace {

/// The densest packing on a floor, so that each gas cell holds the same four grains, below nothing: 0.26 beside 1.
struct DensestBed {
  static constexpr double diameter = 1e-3, cell = diameter * std::numbers::sqrt2;
  static constexpr int n_across = 3, n_bed = 6, n_above = 6;
  static constexpr double void_fraction = 1.0 - std::numbers::pi / (3.0 * std::numbers::sqrt2);

  static Scene scene(double superficial) {
    const double width = n_across * cell;
    Scene s = empty_scene({0, 0, 0}, {width, width, (n_bed + n_above) * cell}, 2500.0, 2e3, 0.5, 0.5);
    s.domain.periodic = {true, true, false};
    s.time.gravity = {0, 0, -gravity};
    add_grains(s, diameter, cubic_layers(cell, n_across, 2 * n_bed, 0.5 * diameter));
    add_plane(s, "floor", {0, 0, 0}, {0, 0, 1});
    s.gas = fluid(s, cell, 1.2, 1.8e-5, 1e-4);
    s.gas->drag = DragLaw::ergun;
    s.gas->weights = GasWeights::cell;
    s.gas->least_void_fraction = 0.2;
    s.gas->boundaries = {boundary(GasBoundary::Kind::pressure, 4),
                         boundary(GasBoundary::Kind::velocity, 5, {0, 0, -superficial})};
    add_probe(s, Probe::Kind::pressure, "p");
    s.output.probes[0].points = {{0.5 * cell, 0.5 * cell, 1.5 * cell},
                                 {0.5 * cell, 0.5 * cell, (n_bed - 1.5) * cell},
                                 {0.5 * cell, 0.5 * cell, (n_bed + 1.5) * cell},
                                 {0.5 * cell, 0.5 * cell, (n_bed + n_above - 1.5) * cell}};
    return s;
  }
  /// [Pa/m] Ergun (1952).
  static double ergun(double superficial) {
    const double solid = 1.0 - void_fraction, e3 = std::pow(void_fraction, 3);
    return 150.0 * 1.8e-5 * solid * solid / (e3 * diameter * diameter) * superficial +
           1.75 * 1.2 * solid / (e3 * diameter) * superficial * superficial;
  }
};

}  // namespace

TEST_CASE(
    "gas blown from empty cells into the densest packing, 0.26 beside 1, is pressed as Ergun says and nowhere faster") {
  for (const double superficial : {0.1, 1.0}) {
    const Scene scene = DensestBed::scene(superficial);
    Simulation run(scene, 1);
    advance_past_restart(run, scene, static_cast<std::int64_t>(0.01 / run.time_step()), 200);
    const std::vector<double> row = run.probe_row(0);
    const auto at = [&](std::size_t point) { return row[point]; };
    const double inside = (at(1) - at(0)) / ((DensestBed::n_bed - 3) * DensestBed::cell);
    report("%.1f m/s: gradient in the bed %.4f of Ergun's; fastest gas %.4f of that between grains; void fraction %.4f",
           superficial, inside / DensestBed::ergun(superficial),
           fastest_gas(run) / (superficial / DensestBed::void_fraction), run.gas_totals()->least_void_fraction);
    CHECK(inside == Approx(DensestBed::ergun(superficial)).epsilon(0.01));
    CHECK(std::abs(at(3) - at(2)) <
          1e-3 * std::abs(at(1) - at(0)));  // nothing takes pressure where there are no grains
    CHECK(fastest_gas(run) < 1.01 * superficial / DensestBed::void_fraction);
    CHECK(run.gas_totals()->least_void_fraction == Approx(DensestBed::void_fraction).epsilon(1e-3));
    CHECK(largest_speed(run) < 0.01);
    check_balances(run);
  }
}

namespace {

/// Grains in rows fall in thin gas, far from all walls, before any touch.
Scene thin_gas(double density, double viscosity) {
  const double d = 1e-3;
  Scene s = empty_scene({0, 0, 0}, {6 * d, 6 * d, 30 * d}, 2500.0, 1e3, 0.8, 0.3);
  s.domain.periodic = {true, true, false};
  s.time.gravity = {0, 0, -gravity};
  s.time.step = 1e-5;
  add_lattice(s, d, LatticeFill::Kind::cubic, {{0, 0, 15 * d}, {6 * d, 6 * d, 25 * d}}, 1.5 * d);
  s.gas = fluid(s, 2 * d, density, viscosity, 5e-4);
  s.gas->boundaries = {boundary(GasBoundary::Kind::free_slip, 4), boundary(GasBoundary::Kind::pressure, 5)};
  return s;
}

}  // namespace

TEST_CASE("in a gas next to nothing grains fall as in a vacuum") {
  for (const double density : {1e-4, 1e-9}) {
    const Scene scene = thin_gas(density, 1.5e-5 * density);
    Simulation run(scene, 1);
    const Image before = run.snapshot({"position"});
    advance_past_restart(run, scene, static_cast<std::int64_t>(0.03 / run.time_step()), 100);
    const double t = run.time();
    const Image after = run.snapshot({"position", "velocity"});
    double most = 0.0;
    for (std::size_t i = 0; i < before.n_grains; ++i) {
      const Vec3 path = vector_of(after, Field::position, i) - vector_of(before, Field::position, i);
      most = std::max(most, length(path - Vec3{0, 0, -0.5 * gravity * t * t}) / (0.5 * gravity * t * t));
    }
    report("%.0e kg/m3: paths within %.1e of free fall", density, most);
    CHECK(most < 1e-6 + 0.1 * density);  // drag goes with the viscosity, 1.5e-5 times the density
    check_balances(run);
  }
}

TEST_CASE(
    "thin gas with the viscosity of air, which explicit friction cannot follow, is refused before the run, with a "
    "cure") {
  try {
    Simulation run(thin_gas(1e-9, 1.8e-5), 1);
    FAIL("was taken");
  } catch (const SceneError& error) {
    REQUIRE(error.problems.size() == 1);
    CHECK(error.problems[0].key == "gas.viscosity");
    CHECK(error.problems[0].message ==
          "is 1.8e-05 Pa s, 1.8e+04 m2/s over the density: so viscous for its cells that the gas step of 0.0005 s has "
          "to be "
          "divided into 6e+07 parts; at most 10000 are possible: use larger cells, or a gas.step of at most 4.2e-08 s "
          "(the "
          "work stays the same)");
  }
}

namespace {

/// A bed with a jet of 100 m/s through a ninth of its floor, at once.
Scene shot_bed() {
  const double d = 1e-3;
  Scene s = empty_scene({0, 0, 0}, {6 * d, 6 * d, 30 * d}, 2500.0, 4e3, 0.8, 0.3);
  s.time.gravity = {0, 0, -gravity};
  s.time.step = 2e-6;
  add_lattice(s, d, LatticeFill::Kind::hexagonal, {{0, 0, 0}, {6 * d, 6 * d, 10 * d}}, 1.001 * d);
  for (int axis = 0; axis < 2; ++axis)
    for (const double side : {1.0, -1.0}) {
      Vec3 normal;
      normal[axis] = side;
      add_plane(s, "wall" + std::to_string(2 * axis) + (side > 0 ? "low" : "high"),
                side > 0 ? s.domain.low : s.domain.high, normal);
    }
  add_plane(s, "floor", {0, 0, 0}, {0, 0, 1});
  s.outlets.push_back({"top", 5});
  s.gas = fluid(s, 2 * d, 1.2, 1.8e-5, 1e-5);
  s.gas->drag = DragLaw::gidaspow;
  GasBoundary jet = boundary(GasBoundary::Kind::velocity, 4, {0, 0, 100.0});
  jet.part = Box{{2 * d, 2 * d, -1}, {4 * d, 4 * d, 1}};
  s.gas->boundaries = {boundary(GasBoundary::Kind::no_slip, 4), jet, boundary(GasBoundary::Kind::pressure, 5)};
  return s;
}

}  // namespace

TEST_CASE("a jet of 100 m/s shot at a bed at once blows it out: gas and grains stay bounded, none is lost") {
  const Scene scene = shot_bed();
  Simulation run(scene, 1);
  const auto n_steps = static_cast<std::int64_t>(0.01 / run.time_step());
  double gas = 0.0, grains = 0.0;
  for (int part = 0; part < 10; ++part) {
    advance_past_restart(run, scene, n_steps / 10, part % 5 == 0 ? 60 : 0);
    gas = std::max(gas, fastest_gas(run));
    grains = std::max(grains, largest_speed(run));
  }
  const GasTotals totals = *run.gas_totals();
  report(
      "fastest gas %.1f m/s, grain %.1f m/s; %llu of %llu grains blown out; void fraction at least %.3f; %.2f "
      "iterations a part",
      gas, grains, static_cast<unsigned long long>(run.n_left()), static_cast<unsigned long long>(run.n_born()),
      totals.least_void_fraction, static_cast<double>(totals.n_iterations) / static_cast<double>(totals.n_parts));
  CHECK(gas < 100.0 / run.scene().gas->least_void_fraction);  // the jet's between the grains that it meets
  CHECK(grains < 100.0);
  CHECK(run.n_born() == run.n_grains() + run.n_left());
  CHECK(totals.n_iterations < 12 * totals.n_parts);
  check_balances(run);
}

namespace {

/// Grains in rows, everywhere, that sink through a liquid which a mean pressure gradient holds up.
Scene sinking(double spacing, GasWeights weights, double smoothing) {
  const double d = 1e-3, apart = 1.6 * d;
  Scene s = empty_scene({0, 0, 0}, {5 * apart, 5 * apart, 5 * apart}, 2500.0, 20.0, 0.8, 0.3);
  s.domain.periodic = {true, true, true};
  s.time.gravity = {0, 0, -gravity};
  add_lattice(s, d, LatticeFill::Kind::cubic, s.domain.box(), apart);
  s.gas = fluid(s, spacing, 1000.0, 1e-2, 5e-4);
  s.gas->weights = weights;
  s.gas->smoothing = smoothing;
  const double solid = sphere_volume(0.5 * d) / std::pow(apart, 3);
  s.gas->pressure_gradient = {0, 0, -solid * 1500.0 * gravity};
  return s;
}

/// [m/s] slip at which Di Felice's drag carries what the pressure gradient leaves of the weight.
double sinking_slip() {
  const double d = 1e-3, solid = sphere_volume(0.5 * d) / std::pow(1.6 * d, 3), eps = 1.0 - solid;
  const double weight = sphere_volume(0.5 * d) * 1500.0 * gravity * eps;
  double low = 0.0, high = 10.0;
  for (int i = 0; i < 100; ++i) {
    const double v = 0.5 * (low + high);
    const double drag =
        3.0 * std::numbers::pi * 1e-2 * d * eps * v * drag_factor(DragLaw::di_felice, eps, eps * 1000.0 * v * d / 1e-2);
    (drag < weight ? low : high) = v;
  }
  return low;
}

/// [m/s] mean slip of the grains against the gas between them, downwards.
double slip_of(const Simulation& run) {
  const Image image = run.snapshot();
  double grains = 0.0, gas = 0.0, room = 0.0;
  for (std::size_t i = 0; i < image.n_grains; ++i)
    grains += vector_of(image, Field::velocity, i).z / static_cast<double>(image.n_grains);
  const auto grid = [&](const std::string& name) -> const std::vector<double>& {
    for (const GridArray& array : image.grids)
      if (array.name == name) return array.values;
    FAIL("no " << name);
    return image.grids[0].values;
  };
  const std::vector<double>&eps = grid("void_fraction"), &u = grid("gas_velocity_z");
  for (std::size_t c = 0; c < eps.size(); ++c) gas += eps[c] * u[c], room += eps[c];
  return gas / room - grains;
}

}  // namespace

TEST_CASE("grains sink at the speed that drag and weight give, in cells from four diameters down to half of one") {
  struct Cells {
    double spacing;
    GasWeights weights;
    double smoothing;
    double within;
  };
  for (const Cells& cells :
       {Cells{4e-3, GasWeights::trilinear, 0.0, 0.005}, Cells{2e-3, GasWeights::trilinear, 0.0, 0.01},
        Cells{1.6e-3, GasWeights::trilinear, 0.0, 0.01}, Cells{1e-3, GasWeights::smoothed, 1.5e-3, 0.02},
        Cells{0.5e-3, GasWeights::smoothed, 1.5e-3, 0.02}, Cells{0.5e-3, GasWeights::smoothed, 1e-3, 0.05}}) {
    const Scene scene = sinking(cells.spacing, cells.weights, cells.smoothing);
    Simulation run(scene, 1);
    advance_past_restart(run, scene, static_cast<std::int64_t>(0.1 / run.time_step()), 200);
    const double slip = slip_of(run) / sinking_slip();
    report("cells of %.1f diameters, %s: slip %.4f of that of the drag law", cells.spacing / 1e-3,
           cells.weights == GasWeights::smoothed ? "smoothed" : "trilinear", slip);
    CHECK(slip == Approx(1.0).margin(cells.within));
    check_balances(run);
  }
}

TEST_CASE("cells into which grains do not fit end the run at once, with the cure") {
  Simulation run(sinking(0.5e-3, GasWeights::trilinear, 0.0), 1);
  const std::string error = error_of(run, 10);
  INFO(error);
  CHECK(std::regex_match(error,
                         std::regex("at 0 s: grains take up [0-9.]+ times the volume of a gas cell \\(0.0005 x 0.0005 "
                                    "x 0.0005 m\\), for the cells are too small for gas.weights = \"trilinear\"; use "
                                    "\"smoothed\" with a smoothing of about a diameter, or larger cells")));
}
