// Speed against error: which settings a sweep tries, what it makes of their results, and what it says is wrong.
#include <catch2/catch.hpp>
#include <cmath>
#include <nlohmann/json.hpp>

#include "engine/run/plan.hpp"
#include "io/checkpoint/durable_file.hpp"
#include "io/cli/layout.hpp"
#include "io/cli/pareto_report.hpp"
#include "tests/unit/io_images.hpp"

using namespace moraine;
using moraine::testing::TemporaryDirectory;
namespace fs = std::filesystem;

namespace {

const std::string scene_text = R"(
title = "grains in a box"
[domain]
low = [0, 0, 0]
high = [0.1, 0.1, 0.2]
[time]
end = 0.2
gravity = [0, 0, -9.81]
[[material]]
name = "glass"
density = 2500.0
[contact]
normal = "linear"
tangential = "spring"
[[contact.pair]]
normal_stiffness = 5000.0
restitution = 0.9
friction = 0.4
[[particles]]
diameter = 0.01
fill = { count = 20 }
[[wall]]
name = "box"
box = {}
[[probe]]
kind = "region"
name = "all"
interval = 0.01
)";

struct Bench {
  TemporaryDirectory place;
  fs::path file = place.path() / "box.toml";
  explicit Bench(const std::string& pareto = "") { write_file(file, scene_text + pareto); }
  ParetoPlan plan(const std::vector<std::string>& overrides = {}, bool is_product = false) const {
    return plan_pareto(file, overrides, is_product);
  }
};

const ParetoSetting& of_kind(const ParetoPlan& plan, ParetoKind kind) {
  for (const ParetoSetting& setting : plan.settings)
    if (setting.kind == kind) return setting;
  FAIL("no setting of that kind");
  return plan.settings.front();
}

int n_of_kind(const ParetoPlan& plan, ParetoKind kind) {
  int n = 0;
  for (const ParetoSetting& setting : plan.settings) n += setting.kind == kind ? 1 : 0;
  return n;
}

ParetoResult result(const char* name, ParetoKind kind, double seconds, double error,
                    std::optional<double> half_width = {}, double step = 1e-5) {
  ParetoResult r;
  r.setting = {kind, name, name, {}, step, 50.0};
  r.n_runs = 1;
  r.seconds = seconds;
  r.speed = 1e6;
  r.times = {seconds};
  r.hashes = {name};
  if (kind != ParetoKind::reference) r.errors = {{"all.grains", error, half_width, 1.0}};
  return r;
}

ParetoResults some_results() {
  ParetoResults results;
  results.scene_file = "box.toml";
  results.title = "it's a \"box\", of grains";
  results.layout = "1x2";
  results.machine = "here";
  results.end = results.scene_end = 1.0;
  results.accept = 0.01;
  results.results = {result("reference", ParetoKind::reference, 40.0, 0.0),
                     result("scene", ParetoKind::scene, 10.0, 0.004),
                     result("fast", ParetoKind::time_step, 2.0, 0.05, {}, 4e-5),
                     result("middle", ParetoKind::time_step, 5.0, -0.008, {}, 2e-5),
                     result("slow and bad", ParetoKind::variant, 20.0, 0.2)};
  return results;
}

}  // namespace

TEST_CASE("a sweep tries time steps that fit the times at which paths are looked at") {
  const ParetoPlan plan = Bench().plan();
  CHECK(plan.measure == ParetoMeasure::paths);
  CHECK(plan.settings.front().kind == ParetoKind::reference);
  CHECK(n_of_kind(plan, ParetoKind::time_step) == 4);
  CHECK(n_of_kind(plan, ParetoKind::skin) == 2);
  const double shortest = choose_time_step(plan.scene).contact_time;
  CHECK(of_kind(plan, ParetoKind::reference).steps_per_contact == Approx(200).epsilon(0.01));
  for (const ParetoSetting& setting : plan.settings) {
    INFO(setting.name);
    const double steps = plan.sample / setting.time_step;
    CHECK(steps == Approx(std::round(steps)).epsilon(1e-12));
    CHECK(setting.steps_per_contact == Approx(shortest / setting.time_step));
  }
  CHECK(of_kind(plan, ParetoKind::time_step).steps_per_contact >= 10.0);
}

TEST_CASE("variants take the time step of their own contacts, and a product has every step with each") {
  const Bench bench(
      "[pareto]\nsteps_per_contact = [10, 40]\n[[pareto.variant]]\nname = \"stiff\"\nset = "
      "[\"contact.pair[0].normal_stiffness=20000\"]\n");
  const ParetoPlan plan = bench.plan();
  CHECK(of_kind(plan, ParetoKind::variant).time_step ==
        Approx(0.5 * of_kind(plan, ParetoKind::scene).time_step).epsilon(0.02));
  const ParetoPlan product = bench.plan({}, true);
  const int n_ways = n_of_kind(plan, ParetoKind::precision) ? 3 : 1;  // stiff, mixed, both
  CHECK(n_of_kind(product, ParetoKind::product) == 2 * n_ways);
}

TEST_CASE("gas steps and tolerances are tried where there is gas, and grain steps fit into gas steps") {
  const Bench bench(R"([gas]
cells = [4, 4, 8]
density = 1.2
viscosity = 1.8e-5
step = 2e-3
drag = "gidaspow"
[[gas.boundary]]
face = "z-high"
type = "pressure"
[pareto]
statistics = ["all.velocity z"]
)");
  const ParetoPlan plan = bench.plan();
  CHECK(plan.measure == ParetoMeasure::statistics);
  CHECK(n_of_kind(plan, ParetoKind::gas_step) == 2);
  CHECK(n_of_kind(plan, ParetoKind::gas_tolerance) == 2);
  const double steps = 2e-3 / of_kind(plan, ParetoKind::scene).time_step;
  CHECK(steps == Approx(std::round(steps)).epsilon(1e-12));
}

TEST_CASE("what is wrong with a sweep is said with its key, and what there is") {
  const auto complaint = [](const std::string& pareto) {
    try {
      Bench(pareto).plan();
    } catch (const std::exception& error) {
      return std::string(error.what());
    }
    return std::string("nothing");
  };
  CHECK_THAT(complaint("[pareto]\nstatistics = [\"al.grains\"]\n"),
             Catch::Contains("pareto.statistics: \"al.grains\"") && Catch::Contains("one of the probes \"all\""));
  CHECK_THAT(complaint("[pareto]\nvalues = [\"all.speed\"]\n"),
             Catch::Contains("no such column; it has \"grains\", \"solid fraction\", \"velocity x\""));
  CHECK_THAT(complaint("[pareto]\nvalues = [\"all.grains\"]\nstatistics = [\"all.grains\"]\n"),
             Catch::Contains("cannot be given together"));
  CHECK_THAT(complaint("[pareto]\nend = 0.3\n"), Catch::Contains("0.3 s is after time.end = 0.2 s"));
  CHECK_THAT(complaint("[pareto]\nfrom = 0.2\nstatistics = [\"all.grains\"]\n"), Catch::Contains("not before the end"));
  CHECK_THAT(complaint("[pareto]\nsteps_per_contact = [10, 1]\n"), Catch::Contains("expected numbers from 2, found 1"));
  CHECK_THAT(complaint("[pareto]\nskin = [0.1]\n"), Catch::Contains("did you mean \"skins\"?"));
  CHECK_THAT(complaint("[[pareto.variant]]\nname = \"x\"\nset = [\"contact.normal=glue\"]\n"),
             Catch::Contains("the setting \"x\" of the sweep cannot be run") && Catch::Contains("contact.normal"));
}

TEST_CASE("repeats have other seeds, and a very small velocity where nothing else is random") {
  const Scene scene = Bench().plan().scene;
  CHECK(repeat_overrides(scene, 1).empty());
  const std::vector<std::string> second = repeat_overrides(scene, 2), third = repeat_overrides(scene, 3);
  REQUIRE(second.size() == 2);
  CHECK(second[0] == "particles[0].seed=1001");
  CHECK(third[0] == "particles[0].seed=2001");
  CHECK_THAT(second[1], Catch::StartsWith("particles[0].velocity_deviation=0.0003"));
}

TEST_CASE("the interval of a mean is Student's") {
  CHECK_FALSE(half_width_of_mean({1.0}));
  CHECK(*half_width_of_mean({1.0, 3.0}) == Approx(12.706 * std::sqrt(2.0) / std::sqrt(2.0)));
  CHECK(*half_width_of_mean({2.0, 4.0, 6.0}) == Approx(4.303 * 2.0 / std::sqrt(3.0)));
}

TEST_CASE("statistics are compared repeat by repeat, so that what two runs share cancels") {
  ParetoPlan plan;
  plan.measure = ParetoMeasure::statistics;
  std::vector<ParetoRecord> reference(3), runs(3);
  for (std::size_t i = 0; i < 3; ++i) {
    const double level = 10.0 * static_cast<double>(i + 1);  // 10, 20, 30: the seed's
    reference[i].means = {level};
    reference[i].deviations = {1.0};
    runs[i].means = {level + 1.0};
  }
  const ParetoError error = errors_between(plan, {{"a.b", "a", "b", "b"}}, runs, reference).front();
  CHECK(error.value == Approx(1.0 / 20.0));
  CHECK(*error.half_width == Approx(0.0).margin(1e-12));
  CHECK(error.reference == 20.0);
}

TEST_CASE("a row that is due where averages begin counts, also where its step came a little early") {
  const Bench bench("[pareto]\nstatistics = [\"all.grains\"]\nfrom = 0.02\n");
  RunSummary summary;
  summary.time_step = 1e-3;
  summary.ranks.emplace_back();
  write_file(bench.place.path() / "summary.json", summary_json(summary));
  const auto mean = [&](const std::string& times) {
    write_file(bench.place.path() / "all.csv", "step,time [s],grains\n" + times);
    return read_record(bench.plan(), {{"all.grains", "all", "grains", "grains"}}, bench.place.path()).means.front();
  };
  CHECK(mean("1,0.01,100\n2,0.0196,20\n3,0.03,40\n") == 30.0);
  CHECK(mean("1,0.01,100\n2,0.0204,20\n3,0.03,40\n") == 30.0);
  CHECK_THROWS_WITH(mean("1,0.01,100\n"), Catch::Contains("has no rows from 0.02 s on"));
}

TEST_CASE("paths are compared by the shortest way around a periodic box, and without the grains that have left") {
  ParetoPlan plan = Bench().plan();
  plan.scene.domain.periodic = {true, false, false};
  ParetoRecord reference, run;
  const double gone = std::nan("");
  reference.paths = {{0.001, 0.0, 0.0, gone, gone, gone}};
  run.paths = {{0.099, 0.0, 0.0, 0.5, 0.5, 0.5}};
  CHECK(errors_between(plan, {}, {run}, {reference}).front().value == Approx(0.002 / 0.01));
}

TEST_CASE("the front holds what nothing else beats, and the fastest that is good enough is recommended") {
  ParetoResults results = some_results();
  judge(results);
  CHECK(results.results[0].standing == ParetoStanding::beaten);  // the reference is no candidate
  CHECK(results.results[1].standing == ParetoStanding::front);
  CHECK(results.results[2].standing == ParetoStanding::front);
  CHECK(results.results[3].standing == ParetoStanding::front);
  CHECK(results.results[4].standing == ParetoStanding::beaten);
  REQUIRE(results.recommended);
  CHECK(results.results[*results.recommended].setting.name == "middle");
  CHECK_THAT(results.advice, Catch::Contains("error 0.8 % in all.grains") && Catch::Contains("within 1 %"));
  SECTION("an interval counts as error: what is not known to be good is not recommended as such") {
    results.measure = ParetoMeasure::statistics;
    results.results[3].errors[0].half_width = 0.02;
    judge(results);
    CHECK(results.results[*results.recommended].setting.name == "scene");
    CHECK(results.results[*results.recommended].standing != ParetoStanding::beaten);
    results.results[1].errors[0].half_width = 0.02;
    judge(results);
    CHECK_THAT(results.advice, Catch::Contains("none is known to be within 1 %") && Catch::Contains("--repeats"));
    CHECK(results.results[*results.recommended].standing != ParetoStanding::beaten);
  }
  SECTION("a setting whose error is small by chance alone beats none, and neither is known to be on the front") {
    results.measure = ParetoMeasure::statistics;
    results.results.push_back(result("lucky", ParetoKind::time_step, results.results[3].seconds, 1e-6, 0.5, 3e-5));
    judge(results);
    CHECK(results.results[3].standing == ParetoStanding::open);
    CHECK(results.results.back().standing == ParetoStanding::open);
    CHECK(results.results[*results.recommended].setting.name == "middle");
  }
  SECTION("paths that do not come together are not taken for errors") {
    results.results[2].errors[0].value = 3.0;
    results.results[3].errors[0].value = 2.5;
    judge(results);
    CHECK(results.is_chaotic);
    CHECK_FALSE(results.recommended);
    CHECK_THAT(results.advice, Catch::Contains("chaotic") && Catch::Contains("statistics"));
  }
}

TEST_CASE("what repeats leave open of times and errors is said to be open") {
  ParetoResults results = some_results();
  results.measure = ParetoMeasure::statistics;
  ParetoResult scene = result("scene", ParetoKind::scene, 10.0, 0.004, 0.002);
  ParetoResult coarse = result("coarse", ParetoKind::time_step, 5.0, 0.05, 0.01);
  scene.times = {10.0, 20.0, 11.0};  // the machine was slow in the second repeat
  coarse.times = {5.0, 10.0, 5.4};
  const auto standing = [&](const char* name) {
    results.results = {result("reference", ParetoKind::reference, 40.0, 0.0), scene, coarse};
    judge(results);
    for (const ParetoResult& r : results.results)
      if (r.setting.name == name) return r.standing;
    return ParetoStanding::beaten;
  };
  SECTION("errors that are told apart, and times of each repeat") {
    CHECK(standing("scene") == ParetoStanding::front);
    CHECK(standing("coarse") == ParetoStanding::front);
  }
  SECTION("errors that are not") {
    coarse.errors[0] = {"all.grains", 0.006, 0.004, 1.0};
    CHECK(standing("scene") == ParetoStanding::open);
    CHECK(standing("coarse") == ParetoStanding::front);  // nothing else is as fast
  }
  SECTION("a setting that is faster, and more accurate beyond both intervals") {
    coarse.errors[0] = {"all.grains", 0.0005, 0.0005, 1.0};
    CHECK(standing("scene") == ParetoStanding::beaten);
    results.results[1].errors[0].half_width = 0.0035;  // now they overlap
    judge(results);
    CHECK(results.results[1].standing == ParetoStanding::open);
  }
  SECTION("a faster one, sometimes") {
    coarse.times = {5.0, 25.0, 10.0};
    CHECK(standing("coarse") == ParetoStanding::open);
    CHECK(standing("scene") == ParetoStanding::front);
  }
  SECTION("the same states: only time counts") {
    coarse.hashes = scene.hashes;
    coarse.errors = scene.errors;
    CHECK(standing("scene") == ParetoStanding::beaten);
    coarse.times = {5.0, 25.0, 10.0};
    CHECK(standing("scene") == ParetoStanding::open);
  }
  SECTION("the largest error of several counts") {
    scene.errors.push_back({"all.velocity z", 0.07, 0.001, 1.0});
    coarse.errors.push_back({"all.velocity z", 0.0, 0.001, 1.0});
    CHECK(standing("scene") == ParetoStanding::beaten);
  }
  CHECK_THAT(pareto_csv(results), Catch::Contains(",on front,"));
}

TEST_CASE("table, CSV, JSON and plot of a sweep hold the same, also of settings that stopped") {
  ParetoResults results = some_results();
  ParetoResult stopped = result("too long", ParetoKind::time_step, 0.0, 0.0, {}, 1e-3);
  stopped.errors.clear();
  stopped.failure = "step 3: overlap runs away, of \"grain\" 7";
  results.results.push_back(stopped);
  judge(results);
  const std::string table = pareto_table(results);
  INFO(table);
  CHECK_THAT(table, Catch::Contains("stopped: too long: step 3") && Catch::Contains("recommended: middle"));
  const auto json = nlohmann::json::parse(pareto_json(results));
  CHECK(json["settings"].size() == 6);
  CHECK(json["settings"][3]["is_recommended"] == true);
  CHECK(json["settings"][5]["failure"] == stopped.failure);
  const std::string csv = pareto_csv(results);
  CHECK(std::count(csv.begin(), csv.end(), '\n') == 7);
  CHECK_THAT(csv, Catch::Contains("\"step 3: overlap runs away, of \"\"grain\"\" 7\""));
  CHECK_THAT(pareto_gnuplot(results),
             Catch::Contains("efficient front") && Catch::Contains("it''s a \"box\"") && !Catch::Contains("too long"));
}
