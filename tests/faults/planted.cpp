// Faults of the physics, planted into sound states: each stops the run or warns, in so many steps, and leaves a record.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <set>
#include <sstream>

#include "engine/run/flight_record.hpp"
#include "engine/run/simulation.hpp"
#include "io/checkpoint/checkpoint.hpp"
#include "io/cli/run_command.hpp"
#include "io/cli/watch.hpp"
#include "io/scene_toml/scene_toml.hpp"
#include "tests/support/flow_scenes.hpp"
#include "tests/unit/io_images.hpp"

using namespace moraine;
using moraine::testing::TemporaryDirectory;

namespace {

std::vector<double>& reals(Image& image, Field field) {
  for (FieldArray& array : image.fields)
    if (array.field == field) return array.reals;
  throw std::logic_error("no such field");
}

struct Ending {
  int n_steps = -1;  // until the run stopped; 0: it did not start
  std::string why;
  std::string record;
  FlightRecord gas;
};

/// Steps a scene, or goes on from an image, until it stops.
Ending ending_of(const std::function<Simulation()>& make, int most) {
  Ending end;
  try {
    Simulation simulation = make();
    for (end.n_steps = 1; end.n_steps <= most; ++end.n_steps) simulation.step();
    end.why = "it did not stop";
  } catch (const RecordedRunError& error) {
    end.why = error.what();
    end.record = error.record.grains;
    end.gas = error.record;
  } catch (const RunError& error) {
    end.why = error.what();
  } catch (const SceneError& error) {
    end.why = error.what();
    end.n_steps = 0;
  }
  return end;
}

/// A state of the scene after some steps, altered.
Ending planted(const Scene& scene, const std::function<void(Image&)>& alter, int most) {
  Simulation sound(scene, 1);
  for (int i = 0; i < 40; ++i) sound.step();
  Image image = sound.checkpoint();
  alter(image);
  return ending_of([&] { return Simulation(scene, 1, image); }, most);
}

void report(const char* what, int n_steps) { std::printf("planted: %-50s found after %d steps\n", what, n_steps); }

struct Row {
  int step;
  std::string grain, touches;
  double overlap;
};

std::vector<Row> rows_of(const std::string& record) {
  std::vector<Row> rows;
  std::istringstream lines(record);
  std::string line;
  std::getline(lines, line);
  while (std::getline(lines, line)) {
    std::vector<std::string> cells;
    std::istringstream in(line);
    for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
    REQUIRE(cells.size() >= 10);
    rows.push_back({std::stoi(cells[0]), cells[2], cells[9],
                    cells.size() > 11 && !cells[11].empty() ? std::stod(cells[11]) : 0.0});
  }
  return rows;
}

std::ptrdiff_t lines_of(const std::string& text) { return std::count(text.begin(), text.end(), '\n'); }

/// To run a scene of this text in the directory.
RunRequest request_of(const TemporaryDirectory& directory, const std::string& layout, const std::string& scene) {
  RunRequest request;
  request.scene_file = directory.path() / "scene.toml";
  std::ofstream(request.scene_file) << scene;
  request.layout = layout;
  request.out = directory.path() / "run";
  return request;
}

/// Two grains of the flow scenes in a domain of 1 m without walls.
Scene two_grains(const GrainSeed& first, const GrainSeed& second) {
  Scene scene = scenes::basic();
  scene.domain.high = {1, 1, 1};
  scene.particles = {scenes::listed({first, second})};
  return scene;
}

}  // namespace

TEST_CASE("a velocity that is not a number is found in the next step, with a record of the grain") {
  const Ending end = planted(
      scenes::gas(), [](Image& image) { reals(image, Field::velocity)[3 * 17] = std::nan(""); }, 10);
  report("velocity not a number", end.n_steps);
  CHECK(end.n_steps == 1);
  CHECK_THAT(end.why, Catch::Contains("the velocity of grain 17"));
  CHECK(rows_of(end.record).back().grain == "17");
}

TEST_CASE("a grain that has become far too fast is found in the next step") {
  const Ending end = planted(
      scenes::gas(), [](Image& image) { reals(image, Field::velocity)[3 * 5 + 2] = 3000.0; }, 10);
  report("runaway speed", end.n_steps);
  CHECK(end.n_steps == 1);
  CHECK_THAT(end.why, Catch::Contains("grain 5 ") && Catch::Contains("of its radius in one step"));
  CHECK(rows_of(end.record).back().grain == "5");
}

TEST_CASE("a grain put into another is found in the next step, and both are in the record with their forces") {
  const Ending end = planted(
      scenes::settled_bed(),
      [](Image& image) {
        std::vector<double>& x = reals(image, Field::position);
        for (std::size_t axis = 0; axis < 3; ++axis) x[axis] = x[3 + axis];
        x[2] += 0.2 * scenes::d;
      },
      10);
  report("overlap", end.n_steps);
  CHECK(end.n_steps == 1);
  CHECK_THAT(end.why, Catch::Contains("overlap runs away") || Catch::Contains("of its radius in one step"));
  std::set<std::string> grains;
  for (const Row& row : rows_of(end.record)) grains.insert(row.grain);
  CHECK((grains.contains("0") || grains.contains("1")));
}

TEST_CASE("a grain outside the domain is refused before the first step, and found in the step in which it gets there") {
  const Ending outside = planted(
      scenes::settled_bed(), [](Image& image) { reals(image, Field::position)[0] = 1e6; }, 10);
  report("place outside the domain, in a checkpoint", outside.n_steps);
  CHECK(outside.n_steps == 0);
  CHECK_THAT(outside.why, Catch::Contains("grain 0 is at (1e+06, ") && Catch::Contains("outside the domain"));

  const Scene scene = two_grains({{0.5, 0.5, 0.5}, {}, {}, 0.0, 0}, {{0.995, 0.5, 0.5}, {1.0, 0, 0}, {}, 0.0, 0});
  const Ending lost = ending_of([&] { return Simulation(scene, 1); }, 100000);
  const double step = Simulation(scene, 1).time_step();
  report("grain that leaves where there is no outlet", lost.n_steps - static_cast<int>(0.005 / step));
  CHECK(lost.n_steps == static_cast<int>(std::floor(0.005 / step)) + 1);
  CHECK_THAT(lost.why, Catch::Contains("grain 1 ") && Catch::Contains("has left the domain through x-high"));
  CHECK(rows_of(lost.record).back().grain == "1");
}

TEST_CASE("a contact that deepens over several steps leaves a record of these steps") {
  const Scene scene =
      two_grains({{0.49, 0.5, 0.5}, {8.0, 0, 0}, {}, 0.0, 0}, {{0.51, 0.5, 0.5}, {-8.0, 0, 0}, {}, 0.0, 0});
  const Ending end = ending_of([&] { return Simulation(scene, 1); }, 100);
  INFO(end.record);
  CHECK_THAT(end.why, Catch::Contains("overlap runs away"));
  const std::vector<Row> rows = rows_of(end.record);
  std::set<int> steps;
  for (const Row& row : rows) steps.insert(row.step);
  CHECK(steps.size() >= 3);
  CHECK(rows.front().overlap > 0.24);
  CHECK(rows.front().overlap < rows.back().overlap);
  CHECK(rows.back().overlap > 0.5);
  CHECK(((rows.back().grain == "1" && rows.back().touches == "grain 0") ||
         (rows.back().grain == "0" && rows.back().touches == "grain 1")));
}

TEST_CASE("deep but lasting contacts are watched for a while, and change neither the run nor its bits") {
  Scene watched = scenes::settled_bed();
  watched.run.max_overlap = 2e-3;  // half of it is common in this bed
  Scene plain = watched;
  plain.run.max_overlap = 0.5;
  int n_deep = 0;
  Simulation a(watched, 1), b(plain, 1);
  try {
    for (; n_deep < 300; ++n_deep) a.step();
  } catch (const RunError&) { /* as deep as that: it is compared up to there */
  }
  for (int i = 0; i < n_deep; ++i) b.step();
  if (n_deep == 300) CHECK(a.state_hash() == b.state_hash());
  CHECK(n_deep > 0);
}

TEST_CASE("a gas step whose pressure equation is not solved stops the run, or warns where little is missing") {
  Scene scene = scenes::fluidised_bed();
  scene.gas->tolerance = 1e-4;
  Simulation loose(scene, 1);
  Scene strict = scene;
  strict.gas->tolerance = 1e-9;
  Watch watch(strict);
  std::vector<Warning> warnings;
  int n_steps = 0;
  for (; n_steps < 200 && warnings.empty(); ++n_steps) {
    loose.step();
    warnings = watch.look(*loose.gas_totals(), loose.time());
  }
  report("gas mass imbalance", n_steps);
  REQUIRE(warnings.size() == 1);
  CHECK_THAT(warnings[0].text,
             Catch::Contains("of its gas in one gas step") && Catch::Contains("gas.tolerance is 1e-09"));
  CHECK(watch.look(*loose.gas_totals(), loose.time()).empty());  // once

  scene.gas->tolerance = 0.9;
  const Ending end = ending_of([&] { return Simulation(scene, 1); }, 400);
  report("gas that does not balance by more than a hundredth", end.n_steps);
  CHECK_THAT(end.why, Catch::Contains("the gas does not balance"));
  CHECK_THAT(end.gas.gas_cells, Catch::Contains("worst balanced") && Catch::Contains("densest"));
  CHECK(lines_of(end.gas.gas_steps) >= 2);  // header, and the step that was not solved
  CHECK(rows_of(end.record).size() >= 1);   // grains are in the densest cell at least
}

TEST_CASE("many cells at the least void fraction for long are told of, once") {
  Scene scene = scenes::fluidised_bed();
  scene.gas->least_void_fraction = 0.9;
  Watch watch(scene);
  Simulation simulation(scene, 1);
  std::vector<Warning> warnings;
  int n_steps = 0;
  for (; n_steps < 6000 && warnings.empty(); ++n_steps) {
    simulation.step();
    warnings = watch.look(*simulation.gas_totals(), simulation.time());
  }
  report("void fraction at its floor", n_steps);
  REQUIRE(warnings.size() == 1);
  CHECK(simulation.gas_totals()->n_steps <= 201);
  CHECK_THAT(warnings[0].text, Catch::Contains("gas.least_void_fraction = 0.9 for 200 gas steps"));
}

TEST_CASE("an energy ledger that does not close is told of at its next row, and one that closes is not") {
  Scene scene = scenes::settled_bed();
  scene.output.energy = true;
  Simulation sound(scene, 1);
  for (int i = 0; i < 200; ++i) sound.step();
  Watch watch(scene);
  CHECK(watch.look(sound.energy(), sound.time()).empty());
  Image image = sound.checkpoint();
  image.accumulators["energy_initial"][0] += 1.0;  // [J]
  Simulation broken(scene, 1, image);
  broken.step();
  const std::vector<Warning> warnings = watch.look(broken.energy(), broken.time());
  report("energy from nowhere", 1);
  REQUIRE(warnings.size() == 1);
  CHECK_THAT(warnings[0].text, Catch::Contains("the energy ledger is open by"));

  broken.begin_record(warnings[0].concern);
  CHECK(broken.take_records().empty());
  for (int i = 0; i < 40; ++i) broken.step();
  Simulation untold(scene, 1, image);
  for (int i = 0; i < 41; ++i) untold.step();
  CHECK(untold.state_hash() == broken.state_hash());
  const std::vector<FlightRecord> records = broken.take_records();
  REQUIRE(records.size() == 1);
  CHECK(records[0].subject == "energy");
  const std::vector<Row> rows = rows_of(records[0].grains);
  CHECK(rows.back().step == rows.front().step + 31);  // and every one between
  std::set<int> steps;
  for (const Row& row : rows) steps.insert(row.step);
  CHECK(steps.size() == 32);
  CHECK(broken.take_records(true).empty());
}

TEST_CASE("a run that goes on after a warning keeps a record of grains, cells and gas steps, and changes no bit") {
  const TemporaryDirectory directory;
  const RunRequest request = request_of(directory, "1x2", R"(
[domain]
low = [0, 0, 0]
high = [0.06, 0.06, 0.12]
[time]
step = 1e-4
end = 0.06
gravity = [0, 0, -9.81]
[[material]]
name = "glass"
density = 500.0
[[contact.pair]]
normal_stiffness = 100.0
restitution = 0.5
[[particles]]
diameter = 0.009
fill = { region = { box = { low = [0, 0, 0], high = [0.06, 0.06, 0.05] } }, lattice = "cubic", spacing = 0.01 }
[[wall]]
name = "box"
box = { low = [0, 0, 0], high = [0.06, 0.06, 0.12] }
[gas]
cells = [3, 3, 6]
step = 2e-4
density = 1.2
viscosity = 1.8e-5
drag = "gidaspow"
least_void_fraction = 0.8
[[gas.boundary]]
face = "z-low"
type = "velocity"
velocity = [0, 0, 0.5]
[[gas.boundary]]
face = "z-high"
type = "pressure"
)");
  Log log(true);
  REQUIRE(run_scene(request, log) == 0);
  CHECK_THAT(read_file(*request.out / "log.txt"),
             Catch::Contains("denser than gas.least_void_fraction") &&
                 Catch::Contains("concerned: " + (*request.out / "flight_record_void_fraction").string() + "*"));
  const std::vector<Row> rows = rows_of(read_file(*request.out / "flight_record_void_fraction.csv"));
  REQUIRE(!rows.empty());
  CHECK(rows.back().step == rows.front().step + 31);
  CHECK_THAT(read_file(*request.out / "flight_record_void_fraction_cells.csv"), Catch::Contains(",densest,"));
  CHECK(lines_of(read_file(*request.out / "flight_record_void_fraction_gas.csv")) == 33);

  RunRequest strict = request;
  strict.overrides = {"run.stop_on=[\"void_fraction\"]"};
  strict.out = directory.path() / "strict";
  Log strict_log(true);
  CHECK(run_scene(strict, strict_log) == 1);
  CHECK_THAT(read_file(*strict.out / "log.txt"), Catch::Contains("ended as run.stop_on asks: "));
  CHECK(read_file(*strict.out / "flight_record_void_fraction.csv") ==
        read_file(*request.out / "flight_record_void_fraction.csv"));

  Scene scene = read_scene(request.scene_file, {});
  Simulation untold(scene, 1);
  while (untold.step_number() < untold.plan().n_steps) untold.step();
  CHECK(read_checkpoint(checkpoint_directory(*request.out) / checkpoint_name(untold.step_number())).image.hash ==
        untold.state_hash());
}

TEST_CASE("a run that the guard stops writes the flight record into its directory, and names it") {
  const TemporaryDirectory directory;
  const RunRequest request = request_of(directory, "1x1", R"(
[domain]
low = [0, 0, 0]
high = [1, 1, 1]
[time]
end = 1.0
step = 4e-5
[[material]]
name = "glass"
density = 2500.0
[[contact.pair]]
normal_stiffness = 10.0
[[particles]]
diameter = 0.01
velocity = [10, 0, 0]
fill = { positions = [[0.8, 0.5, 0.5]] }
[[wall]]
name = "end"
plane = { point = [0.85, 0, 0], normal = "-x" }
)");
  Log log(true);
  CHECK(run_scene(request, log) == 1);
  CHECK_THAT(read_file(*request.out / "log.txt"), Catch::Contains("the last steps of the grains concerned: " +
                                                                  (*request.out / "flight_record.csv").string()));
  const std::vector<Row> rows = rows_of(read_file(*request.out / "flight_record.csv"));
  REQUIRE(rows.size() >= 3);
  CHECK(rows.back().touches == "wall end");
  CHECK(rows.back().overlap > 0.5);
}
