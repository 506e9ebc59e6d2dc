// Packs at the edge: tall columns at rest for long, shear to and fro, jammed and squeezed.
#include "kernels/base/sphere.hpp"
#include "tests/stability/cases.hpp"

using namespace moraine;
using namespace moraine::cases;

namespace {

constexpr double gravity = 9.81;
constexpr double d = 0.01;  // [m] of the largest grains

/// Grains on top of each other, each sunk into the one below by the weight that it bears.
Scene column(int n, double stiffness) {
  const double weight = 2500.0 * sphere_volume(0.5 * d) * gravity;
  Scene s = empty_scene({-0.1, -0.1, 0}, {0.1, 0.1, 1.01 * n * d}, 2500.0, stiffness, 0.5, 0.3);
  s.time.gravity = {0, 0, -gravity};
  s.time.steps_per_contact = 20.0;
  std::vector<GrainSeed> grains(static_cast<std::size_t>(n));
  double z = -0.5 * d;
  for (int i = 0; i < n; ++i) {
    z += d - weight * (n - i) / stiffness;
    grains[static_cast<std::size_t>(i)].position = {0, 0, z};
  }
  add_grains(s, d, grains);
  add_plane(s, "floor", {0, 0, 0}, {0, 0, 1});
  return s;
}

/// A column in equilibrium stays there for so many times the length of a contact.
void check_column(int n, double contacts) {
  const Scene s = column(n, 1e6);
  Simulation run(s, 1);
  const Image before = run.snapshot({"position"});
  double fastest = 0.0;
  for (int part = 0; part < 10; ++part) {
    advance_past_restart(run, s, static_cast<std::int64_t>(0.1 * contacts * s.time.steps_per_contact),
                         part == 5 ? 1000 : 0);
    fastest = std::max(fastest, largest_speed(run));
  }
  const Image after = run.snapshot({"position"});
  double creep = 0.0;
  for (std::size_t i = 0; i < before.n_grains; ++i)
    creep = std::max(creep, length(vector_of(after, Field::position, i) - vector_of(before, Field::position, i)));
  report("column of %d, %.0f contact times: creep %.1e m, fastest %.1e m/s", n, contacts, creep, fastest);
  CHECK(creep < 1e-13 * n);    // round-off of heights of n diameters
  CHECK(fastest < 1e-12 * n);  // as of the weights
}

/// Grains at random above a floor, periodic across: so many, up to a height, in a domain of another.
Scene pack(std::uint64_t count, double filled, double height, double restitution, double friction) {
  Scene s = empty_scene({0, 0, 0}, {4 * d, 4 * d, height}, 2500.0, 1e4, restitution, friction);
  s.domain.periodic = {true, true, false};
  s.time.steps_per_contact = 25.0;
  s.output.energy = true;
  ParticleGroup group;
  group.material = "grain";
  group.diameter.kind = SizeDistribution::Kind::uniform;
  group.diameter.low = 0.8 * d;
  group.diameter.high = d;
  group.fill = RandomFill{BoxRegion{{{0, 0, 0}, {4 * d, 4 * d, filled}}}, {}, count};
  s.particles = {group};
  add_plane(s, "floor", {0, 0, 0}, {0, 0, 1});
  return s;
}

/// Grains that settle under gravity on a floor that swings along itself.
Scene shaken_pack(double amplitude, double frequency) {
  Scene s = pack(115, 9 * d, 10 * d, 0.5, 0.5);
  s.time.gravity = {0, 0, -gravity};
  WallMotion swing;
  swing.kind = WallMotion::Kind::vibrate;
  swing.axis = {1, 0, 0};
  swing.amplitude = amplitude;
  swing.frequency = frequency;
  s.walls[0].motion = {swing};
  return s;
}

}  // namespace

TEST_CASE("a column of 200 grains in equilibrium does not creep") { check_column(200, 100.0); }

TEST_CASE("a column of 1000 grains in equilibrium does not creep for 100 000 contact times", "[.long][long]") {
  check_column(1000, 1e5);
}

namespace {

/// The mean over a part of the cycles, given as shares of all.
double mean_over(const std::vector<double>& of, double from, double to) {
  const auto first = static_cast<std::size_t>(from * static_cast<double>(of.size()));
  const auto last = static_cast<std::size_t>(to * static_cast<double>(of.size()));
  double sum = 0.0;
  for (std::size_t k = first; k < last; ++k) sum += of[k] / static_cast<double>(last - first);
  return sum;
}

/// What shear to and fro leaves: elastic energy at the end of each cycle, and what the floor has given for it. Gives the elastic energy of the last tenth
/// of the cycles over that when settled.
double check_shear(int n_cycles, std::uint64_t seed, double steps_per_contact) {
  const double frequency = 20.0, start = 0.6;
  Scene s = shaken_pack(4e-5, frequency);  // 0.064 g: less than friction bears
  s.particles[0].seed = seed;
  s.time.steps_per_contact = steps_per_contact;
  Simulation run(s, 1);
  advance(run, static_cast<std::int64_t>(start / run.time_step()));
  const EnergyLedger settled = run.energy();
  const double held = settled.elastic_normal + settled.elastic_tangential;
  const auto end_of = [&](int cycle) {  // [steps] always at the same phase of the floor
    return std::llround((start + (cycle + 1) / frequency) / run.time_step());
  };
  std::vector<double> elastic, kinetic, potential;
  double work = 0.0;
  for (int cycle = 0; cycle < n_cycles; ++cycle) {
    advance_past_restart(run, s, end_of(cycle) - static_cast<std::int64_t>(run.step_number()),
                         cycle == n_cycles / 2 ? 500 : 0);
    const EnergyLedger now = run.energy();
    elastic.push_back((now.elastic_normal + now.elastic_tangential) / held);
    kinetic.push_back((now.kinetic + now.rotational) / held);
    potential.push_back((now.potential - settled.potential) / held);
    work = now.wall_work;
  }
  const double early = mean_over(elastic, 0.1, 0.2), late = mean_over(elastic, 0.9, 1.0);
  const EnergyLedger end = run.energy();
  const double turned_over = std::abs(end.initial) + std::abs(end.wall_work);
  report(
      "%d reversals, seed %d, %.0f steps a contact: elastic energy %.4f of that when settled early, %.4f late; kinetic "
      "%.1e, %.1e; potential %+.4f, %+.4f; the ledger is open by %.1e",
      n_cycles, static_cast<int>(seed), steps_per_contact, early, late, mean_over(kinetic, 0.1, 0.2),
      mean_over(kinetic, 0.9, 1.0), mean_over(potential, 0.1, 0.2), mean_over(potential, 0.9, 1.0),
      end.error() / turned_over);
  CHECK(work > 0.0);
  CHECK(late == Approx(1.0).margin(0.1));
  CHECK(mean_over(kinetic, 0.9, 1.0) < 2.0 * mean_over(kinetic, 0.1, 0.2) + 1e-6);
  // rearrangement lets a pack sink; what gathered energy from errors would lift it
  CHECK(mean_over(potential, 0.9, 1.0) < mean_over(potential, 0.1, 0.2) + 1e-3);
  CHECK(std::abs(end.error()) < 0.05 * turned_over);
  return late;
}

}  // namespace

TEST_CASE("a pack sheared to and fro 10 times does not gather energy") { check_shear(10, 1, 25.0); }

TEST_CASE("packs sheared to and fro 1000 times sink, and gather energy no more often than they lose it",
          "[.long][long]") {
  double sum = 0.0;
  for (const std::uint64_t seed : {1, 2, 3})
    for (const double steps_per_contact : {25.0, 50.0}) sum += check_shear(1000, seed, steps_per_contact) - 1.0;
  report("mean change of the elastic energy: %+.4f", sum / 6.0);
  CHECK(std::abs(sum / 6.0) < 0.03);
}

namespace {

/// Grains between a floor and a lid that comes down half of the way and goes up again.
struct Squeeze {
  static constexpr double speed = 0.1, far = 4.7 * d;
  static Scene scene(double max_overlap);
};

Scene Squeeze::scene(double max_overlap) {
  Scene s = pack(128, 7.9 * d, 8 * d, 0.8, 0.4);
  s.run.max_overlap = max_overlap;
  add_plane(s, "lid", {0, 0, 8 * d}, {0, 0, -1});
  WallMotion down;
  down.places = {{0.0, 0, 0, 0}, {far / speed, 0, 0, -far}, {2 * far / speed, 0, 0, 0}};
  s.walls[1].motion = {down};
  add_probe(s, Probe::Kind::contacts, "contacts");
  add_probe(s, Probe::Kind::wall_force, "lid_force", "lid");
  return s;
}

}  // namespace

TEST_CASE(
    "a jammed pack squeezed until overlaps are a tenth of a diameter pushes back ever harder, and gives back less") {
  const Scene s = Squeeze::scene(0.95);
  Simulation run(s, 1);
  const auto part = static_cast<std::int64_t>(0.05 * Squeeze::far / Squeeze::speed / run.time_step());
  double deepest = 0.0, most = 0.0, before = 0.0;
  int n_falls = 0;
  for (int k = 0; k < 20; ++k) {
    advance_past_restart(run, s, part, k == 18 ? 500 : 0);
    deepest = std::max(deepest, run.probe_row(0)[1]);
    const double push = std::abs(run.probe_row(1)[2]);
    if (deepest > 0.02 && push < before) ++n_falls;
    before = push;
    most = std::max(most, push);
  }
  const double work_in = run.energy().wall_work;
  advance_past_restart(run, s, 20 * part, 500);
  const EnergyLedger end = run.energy();
  report(
      "squeezed to a mean overlap of %.3f radii with %.3g N: the lid gave %.3g J and got %.3g J back; ledger open by "
      "%.1e",
      deepest, most, work_in, work_in - end.wall_work, end.error() / work_in);
  CHECK(deepest > 0.2);  // radii
  CHECK(n_falls == 0);
  CHECK(end.wall_work > 0.0);  // what it gets back is less than what it gave
  CHECK(std::abs(end.error()) < 0.02 * work_in);
  CHECK(run.n_grains() == 128);
}

TEST_CASE(
    "beyond the deepest overlap that the scene allows a squeezed pack ends the run with the grain and its contacts") {
  const Scene s = Squeeze::scene(0.2);
  Simulation run(s, 1);
  const auto n_steps = static_cast<std::int64_t>(Squeeze::far / Squeeze::speed / run.time_step());
  advance(run, n_steps / 2);
  Simulation restored(s, 2, run.checkpoint());
  const std::string error = error_of(run, n_steps - n_steps / 2);
  CHECK(error_of(restored, n_steps - n_steps / 2) == error);
  CHECK_THAT(error, Catch::Contains("overlap runs away: grain ") && Catch::Contains("(limit run.max_overlap = 0.2)") &&
                        Catch::Contains("likely cause: grains too soft for their load"));
}
