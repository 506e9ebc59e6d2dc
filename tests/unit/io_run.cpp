// Whole runs of a small scene, in this process: what they leave behind, and that breaking them off changes nothing.
#include <catch2/catch.hpp>
#include <csignal>
#include <fstream>
#include <set>
#include <thread>

#include <unistd.h>

#include "io/checkpoint/checkpoint.hpp"
#include "io/cli/check_command.hpp"
#include "io/cli/file_commands.hpp"
#include "io/cli/layout.hpp"
#include "io/cli/run_command.hpp"
#include "io/cli/summary.hpp"
#include "io/scene_toml/scene_toml.hpp"
#include "io/snapshot/snapshot.hpp"
#include "tests/unit/io_images.hpp"

using namespace moraine;
using moraine::testing::TemporaryDirectory;
namespace fs = std::filesystem;

namespace {

const char* scene_text = R"(
title = "a few grains fall into a box"
[domain]
low = [0, 0, 0]
high = [0.1, 0.1, 0.2]
[time]
end = 0.1
step = 5e-5
gravity = [0.3, 0, -9.81]
[[material]]
name = "glass"
density = 2500.0
[contact]
normal = "linear"
tangential = "spring"
[[contact.pair]]
normal_stiffness = 1000.0
restitution = 0.7
friction = 0.4
[[particles]]
diameter = [0.01, 0.012]
velocity = [0.2, 0.1, -1.0]
fill = { region = { box = { low = [0, 0, 0], high = [0.1, 0.1, 0.2] } }, count = 120 }
[[wall]]
name = "box"
box = { low = [0, 0, 0], high = [0.1, 0.1, 0.2] }
[output]
snapshots = 0.01
checkpoints = 0.03
checkpoints_kept = 10
energy = true
[[probe]]
kind = "mass"
interval = 0.004
[[probe]]
kind = "wall_pressure"
name = "pressure"
wall = "box"
bins = 3
interval = 0.007
[[probe]]
kind = "contacts"
interval = 0.01
[[probe]]
kind = "fields"
name = "flow"
cells = [3, 1, 5]
interval = 0.005
average = 0.02
from = 0.01
table = true
)";

/// A scene file in a directory of its own, and runs of it.
class Bench {
 public:
  explicit Bench(const std::string& text = scene_text) { std::ofstream(scene()) << text; }
  fs::path scene() const { return directory_.path() / "bed.toml"; }
  fs::path path(const std::string& name) const { return directory_.path() / name; }
  RunRequest request(const std::string& out) const {
    RunRequest request;
    request.scene_file = scene();
    request.layout = "1x2";
    request.out = path(out);
    return request;
  }
  static int run(const RunRequest& request) {
    Log log(true);
    return run_scene(request, log);
  }
  int run_plainly(const std::string& out) const { return run(request(out)); }

 private:
  TemporaryDirectory directory_;
};

/// Every series and snapshot, and the last checkpoint, hold the same bytes or bits.
void check_same_results(const fs::path& a, const fs::path& b) {
  for (const char* table : {"mass.csv", "pressure.csv", "contacts.csv", "energy.csv", "hashes.csv", "snapshots.xdmf",
                            "flow.csv", "flow.xdmf"}) {
    INFO(table);
    const bool is_same = read_file(a / table) == read_file(b / table);
    CHECK(is_same);
  }
  const std::vector<fs::path> snapshots_a = list_snapshots(a), snapshots_b = list_snapshots(b);
  REQUIRE(snapshots_a.size() == snapshots_b.size());
  for (std::size_t i = 0; i < snapshots_a.size(); ++i) {
    const bool is_same = read_file(snapshots_a[i]) == read_file(snapshots_b[i]);
    INFO(snapshots_a[i].string());
    CHECK(is_same);
  }
  std::set<std::string> names;
  for (const fs::path& run : {a, b})
    for (const auto& entry : fs::directory_iterator(run / "fields")) names.insert(entry.path().filename().string());
  CHECK(names.size() >= 10);  // HDF5 and CSV, each of 0.02 s
  for (const std::string& name : names) {
    INFO(name);
    const bool is_same = read_file(a / "fields" / name) == read_file(b / "fields" / name);
    CHECK(is_same);
  }
  const ComparisonText comparison = compare_files(a, b);
  INFO(comparison.text);
  CHECK(comparison.is_equal);
}

}  // namespace

TEST_CASE("a run leaves its scene, log, version, hashes, series, snapshots, checkpoints and summary") {
  const Bench bench;
  REQUIRE(bench.run_plainly("run") == 0);
  const fs::path run = bench.path("run");
  for (const char* name : {"scene.toml", "log.txt", "version.txt", "hashes.csv", "mass.csv", "energy.csv",
                           "snapshots.xdmf", "summary.txt", "summary.json"})
    CHECK(fs::exists(run / name));
  CHECK(list_snapshots(run).size() == 11);
  REQUIRE(list_checkpoints(run).size() == 4);
  CHECK(checkpoint_step(list_checkpoints(run)[0]) == 2000u);
  const std::string summary = read_file(run / "summary.txt");
  CHECK_THAT(summary, Catch::Contains("M particle-steps/s") && Catch::Contains("grains: 120 born, 120 inside, 0 left"));
  const std::string hash = read_checkpoint(list_checkpoints(run)[0]).image.hash.text();
  CHECK_THAT(summary, Catch::EndsWith("state hash: " + hash + "\n"));
  CHECK_THAT(read_file(run / "hashes.csv"), Catch::EndsWith(',' + hash + '\n'));
  CHECK_NOTHROW(read_scene(run / "scene.toml"));
}

TEST_CASE("a run for its timing leaves the warm-up out, ends after so many steps, and writes a summary only") {
  const Bench bench;
  RunRequest request = bench.request("timed");
  request.warm_up = 300;
  request.steps = 700;
  request.has_outputs = false;
  REQUIRE(Bench::run(request) == 0);
  const RunSummary run = read_summary(bench.path("timed") / "summary.json");
  CHECK(run.n_steps == 700);
  CHECK(run.n_warm_up == 300);
  CHECK(run.particle_steps == 700.0 * 120.0);
  CHECK(run.time == Approx(0.05));
  REQUIRE(run.ranks.size() == 1);
  CHECK(run.ranks[0].places.cpus.size() == 2);
  CHECK(run.ranks[0].places.cpus_before.size() == 2);
  double in_phases = 0.0;
  for (std::size_t i = 0; i < run.phases.size(); ++i) in_phases += run.phase(i).mean;
  CHECK(in_phases == Approx(run.seconds()).epsilon(0.01));  // nothing of the warm-up
  for (const auto& entry : fs::directory_iterator(bench.path("timed")))
    CHECK(std::set<std::string>{"scene.toml", "log.txt", "version.txt", "summary.txt", "summary.json"}.contains(
        entry.path().filename().string()));

  request = bench.request("written");
  request.until = 0.05;
  REQUIRE(Bench::run(request) == 0);
  const RunSummary written = read_summary(bench.path("written") / "summary.json");
  CHECK(written.hash == run.hash);
  CHECK(written.n_steps == 1000);
  CHECK(written.n_warm_up == 0);
}

TEST_CASE("so many steps are counted from where the run goes on, and end with the scene") {
  const Bench bench;
  RunRequest request = bench.request("run");
  request.steps = 500;
  REQUIRE(Bench::run(request) == 0);
  request.restart = "auto";
  request.steps = 600;
  REQUIRE(Bench::run(request) == 0);
  CHECK(checkpoint_step(list_checkpoints(bench.path("run"))[0]) == 1100u);
  CHECK(read_summary(bench.path("run") / "summary.json").n_steps == 600);
  request.steps = 5000;
  REQUIRE(Bench::run(request) == 0);
  CHECK(read_summary(bench.path("run") / "summary.json").n_steps == 900);
}

TEST_CASE("a run for its timing does not go on in the directory of another, whose results would have gaps") {
  const Bench bench;
  RunRequest request = bench.request("run");
  request.steps = 500;
  REQUIRE(Bench::run(request) == 0);
  request.restart = "auto";
  request.has_outputs = false;
  CHECK_THROWS_WITH(Bench::run(request), Catch::StartsWith("--no-output would leave gaps"));
}

TEST_CASE("a run stopped by --until and gone on with, on another layout, leaves the files of an unbroken one") {
  const Bench bench;
  REQUIRE(bench.run_plainly("unbroken") == 0);
  // At an output, between outputs, and before the first checkpoint of the schedule.
  for (const double until : {0.05, 0.0333, 0.001}) {
    const std::string name = "until-" + std::to_string(until);
    RunRequest request = bench.request(name);
    request.until = until;
    REQUIRE(Bench::run(request) == 0);
    request = bench.request(name);
    request.restart = "auto";
    request.layout = "1x1";
    REQUIRE(Bench::run(request) == 0);
    check_same_results(bench.path("unbroken"), bench.path(name));
  }
}

TEST_CASE("a run gone back on to an earlier checkpoint drops what lies after it and ends the same") {
  const Bench bench;
  REQUIRE(bench.run_plainly("unbroken") == 0);
  REQUIRE(bench.run_plainly("again") == 0);
  RunRequest request = bench.request("again");
  request.out.reset();
  request.restart = (bench.path("again") / "checkpoints" / checkpoint_name(600)).string();
  REQUIRE(Bench::run(request) == 0);
  check_same_results(bench.path("unbroken"), bench.path("again"));
  CHECK(fs::exists(bench.path("again") / "checkpoints" / (checkpoint_name(1200) + ".old")));
}

TEST_CASE("a checkpoint gone on from in a new directory gives the same end") {
  const Bench bench;
  REQUIRE(bench.run_plainly("unbroken") == 0);
  RunRequest request = bench.request("elsewhere");
  request.restart = (bench.path("unbroken") / "checkpoints" / checkpoint_name(600)).string();
  REQUIRE(Bench::run(request) == 0);
  CHECK(compare_files(bench.path("unbroken"), bench.path("elsewhere")).is_equal);
  CHECK(list_snapshots(bench.path("elsewhere")).size() == 7);
}

TEST_CASE("a run that is asked to end writes a checkpoint, says 128 + signal, and can be gone on with") {
  const Bench bench;
  RunRequest request = bench.request("run");
  request.overrides = {"time.end=3.0", "output.snapshots=0.5"};
  REQUIRE(Bench::run(request) == 0);
  for (const int signal : {SIGTERM, SIGINT}) {
    const std::string name = "broken-" + std::to_string(signal);
    request.out = bench.path(name);
    std::thread killer([&] {
      while (!fs::exists(bench.path(name) / "hashes.csv")) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      ::kill(::getpid(), signal);
    });
    const int code = Bench::run(request);
    killer.join();
    CHECK(code == 128 + signal);
    REQUIRE(list_checkpoints(bench.path(name)).size() >= 1);
    CHECK(*checkpoint_step(list_checkpoints(bench.path(name))[0]) < 60'000);
    RunRequest again = request;
    again.restart = "auto";
    REQUIRE(Bench::run(again) == 0);
    check_same_results(bench.path("run"), bench.path(name));
  }
}

TEST_CASE("--restart auto starts from the beginning where there is nothing to go on from") {
  const Bench bench;
  REQUIRE(bench.run_plainly("unbroken") == 0);
  RunRequest request = bench.request("run");
  request.restart = "auto";
  REQUIRE(Bench::run(request) == 0);
  check_same_results(bench.path("unbroken"), bench.path("run"));
  // A run that died before its first checkpoint.
  fs::remove_all(bench.path("run") / "checkpoints");
  REQUIRE(Bench::run(request) == 0);
  check_same_results(bench.path("unbroken"), bench.path("run"));
  // ... but not over that of another scene.
  fs::remove_all(bench.path("run") / "checkpoints");
  request.overrides = {"time.gravity=[0, 0, -1.62]"};
  const std::string before = read_file(bench.path("run") / "hashes.csv");
  CHECK_THROWS_AS(Bench::run(request), UsageError);
  CHECK(read_file(bench.path("run") / "hashes.csv") == before);
}

TEST_CASE("a run never overwrites another") {
  const Bench bench;
  RunRequest request = bench.request("x");
  request.out.reset();
  request.overrides = {"output.directory=\"" + bench.path("bed").string() + '"', "time.end=0.01"};
  REQUIRE(Bench::run(request) == 0);
  REQUIRE(Bench::run(request) == 0);
  CHECK(fs::exists(bench.path("bed-2") / "summary.txt"));
  CHECK(compare_files(bench.path("bed"), bench.path("bed-2")).is_equal);
  request.out = bench.path("bed");
  CHECK_THROWS_WITH(Bench::run(request), Catch::Contains("holds a run already"));
}

TEST_CASE("a bad scene, layout or end is refused before anything is written") {
  const Bench bench;
  RunRequest request = bench.request("run");
  request.overrides = {"time.ende=1", "domain.low=[1,1,1]"};
  CHECK_THROWS_WITH(Bench::run(request), Catch::Contains("time.ende") && Catch::Contains("domain"));
  request.overrides.clear();
  request.layout = "3by2";
  CHECK_THROWS_AS(Bench::run(request), UsageError);
  request = bench.request("run");
  request.scene_file = bench.path("missing.toml");
  CHECK_THROWS_AS(Bench::run(request), SceneFileError);
  CHECK_FALSE(fs::exists(bench.path("run")));
}

TEST_CASE("a check names the grains, the step and what limits it, the kernels, the walls and the memory") {
  const Bench bench;
  const std::string text = check_text(bench.scene(), {"time.step=\"auto\""}, "1x1");
  INFO(text);
  CHECK_THAT(text,
             Catch::Contains("a few grains fall into a box") && Catch::Contains("120") && Catch::Contains("(chosen)"));
  CHECK_THAT(text, Catch::Contains("limited by") && Catch::Contains("kernels") && Catch::Contains("box: box") &&
                       Catch::Contains("memory"));
}
