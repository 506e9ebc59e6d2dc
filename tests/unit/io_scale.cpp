// Scaling sweeps: which runs there are, what is done already, and what the tables make of them.
#include <catch2/catch.hpp>
#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "io/checkpoint/durable_file.hpp"
#include "io/cli/child.hpp"
#include "io/cli/interrupt.hpp"
#include "io/cli/programs.hpp"
#include "io/cli/scale_report.hpp"
#include "tests/unit/io_images.hpp"

using namespace moraine;
using moraine::testing::TemporaryDirectory;
namespace fs = std::filesystem;

namespace {

std::string texts(const std::vector<Layout>& layouts) {
  std::string text;
  for (const Layout& layout : layouts) {
    if (!text.empty()) text += ' ';
    text += layout.text();
  }
  return text;
}

/// A run of 100 steps of 1000 grains that took so long; each rank waits for a quarter of the time.
RunSummary make_run(const Layout& layout, double seconds, const std::string& hash = "aa") {
  RunSummary run;
  run.scene_file = "bed.toml";
  run.title = "a bed, of 'grains'";
  run.version = "1.2.3";
  run.commit = "cafe";
  run.processor = "a processor";
  run.n_cpus = 8;
  run.layout = layout.text();
  run.directory = "runs/bed";
  run.time_step = 1e-5;
  run.time = 0.1 + 0.2;  // not a round number
  run.n_steps = 100;
  run.n_warm_up = 50;
  run.n_born = run.n_grains = 1000;
  run.particle_steps = 1e5;
  run.n_rebuilds = 3;
  run.n_looks = 7;
  run.n_cuts = 2;
  run.hash = hash;
  run.phases = {"contacts, motion", "waiting for ghosts", "other"};
  for (int r = 0; r < layout.ranks; ++r) {
    RankSummary rank;
    rank.stepping = seconds;
    rank.start = 0.5;
    rank.phases = {0.7 * seconds, 0.25 * seconds, 0.05 * seconds};
    rank.reductions = layout.ranks > 1 ? 0.02 * seconds : 0.0;
    rank.parcels = layout.ranks > 1 ? 0.01 * seconds : 0.0;
    rank.n_grains = static_cast<std::uint64_t>(1000 / layout.ranks);
    rank.n_pairs = r == 0 ? 6000 : 3000;
    rank.n_ghosts = layout.ranks > 1 ? 100 : 0;
    rank.n_messages = layout.ranks > 1 ? 2 : 0;
    rank.n_bytes = layout.ranks > 1 ? 4800 : 0;
    rank.peak_memory = 1e7;
    rank.places.node = "here";
    rank.places.n_allowed = layout.threads;
    for (int t = 0; t < layout.threads; ++t) {
      rank.places.cpus_before.push_back(r * layout.threads + t);
      rank.places.cpus.push_back(r * layout.threads + t);
      rank.places.cores.push_back(r * layout.threads + t);
    }
    run.ranks.push_back(rank);
  }
  return run;
}

ScaleResults make_results() {
  ScaleResults results;
  results.scene_file = "bed.toml";
  results.title = "a bed, of 'grains'";
  results.machine = "here: a processor, 4 CPUs";
  results.steps = 100;
  results.warm_up = 50;
  for (const auto& [layout, seconds] :
       {std::pair(Layout{1, 1}, 4.0), std::pair(Layout{1, 2}, 2.5), std::pair(Layout{2, 1}, 2.0)})
    results.layouts.push_back(result_of(
        layout, {make_run(layout, seconds), make_run(layout, 2.0 * seconds), make_run(layout, 1.1 * seconds)}));
  compare_layouts(results.layouts);
  return results;
}

SweepIdentity make_identity() { return {"strong", "title = \"a bed\"\n", "", "abcd", "here: 4 CPUs", 100, 50}; }

void write_run(const SweepDirectory& directory, const SweepRun& run, const RunSummary& summary) {
  make_directory(directory.run_directory(run.name()));
  write_file(directory.run_directory(run.name()) / "summary.json", summary_json(summary));
}

/// The cells of a line of CSV without commas in quotes counted as separators.
std::size_t n_cells(const std::string& line) {
  std::size_t n = 1;
  bool is_quoted = false;
  for (const char c : line) {
    if (c == '"') is_quoted = !is_quoted;
    if (c == ',' && !is_quoted) ++n;
  }
  return n;
}

}  // namespace

TEST_CASE("a sweep runs every split of 1, 2, 4 ... cores and of all cores into ranks and threads") {
  CHECK(texts(layouts_up_to(1)) == "1x1");
  CHECK(texts(layouts_up_to(4)) == "1x1 1x2 2x1 1x4 2x2 4x1");
  CHECK(texts(layouts_up_to(6)) == "1x1 1x2 2x1 1x4 2x2 4x1 1x6 2x3 3x2 6x1");
  CHECK(texts(layouts_up_to(8)).ends_with("1x8 2x4 4x2 8x1"));
}

TEST_CASE("a list of layouts is put in order, each once; one that cannot be read is refused") {
  CHECK(texts(parse_layouts("2x2,1x1,4x1,2x2")) == "1x1 2x2 4x1");
  for (const char* text : {"", "1x1,", ",1x1", "1x1;2x2", "1x1,two"}) CHECK_THROWS_AS(parse_layouts(text), UsageError);
}

TEST_CASE("layouts are run by turns") {
  std::string names;
  for (const SweepRun& run : runs_by_turns({{1, 1}, {2, 1}}, 2)) names += run.name() + ' ';
  CHECK(names == "1x1-1 2x1-1 1x1-2 2x1-2 ");
}

TEST_CASE("the account of a run is read back as it was written") {
  const TemporaryDirectory directory;
  const fs::path file = directory.path() / "summary.json";
  RunSummary run = make_run({2, 3}, 1.0 / 3.0);
  run.signal = 15;
  write_file(file, summary_json(run));
  CHECK(read_summary(file) == run);
}

TEST_CASE("a summary that is cut off, of another format, or not one at all is refused by name") {
  const TemporaryDirectory directory;
  const fs::path file = directory.path() / "summary.json";
  const std::string good = summary_json(make_run({2, 1}, 1.0));
  std::string other = good;
  other.replace(other.find("\"format\": 1"), 11, "\"format\": 9");
  std::string lacking = good;
  lacking.replace(lacking.find("\"state_hash\""), 12, "\"state_hush\"");
  for (const std::string& text : {good.substr(0, good.size() / 2), other, lacking, std::string("[]"), std::string()}) {
    write_file(file, text);
    CHECK_THROWS_WITH(read_summary(file), Catch::StartsWith(file.string() + ": is not the summary of a run"));
  }
}

TEST_CASE("imbalance is the largest over the mean, and waiting is what phases call so") {
  const RunSummary run = make_run({2, 1}, 2.0);
  CHECK(run.grain_imbalance() == 1.0);
  CHECK(run.work_imbalance() == Approx(8000.0 / 6500.0));  // pairs + 4 grains
  CHECK(run.waiting().mean == 0.5);
  CHECK(run.speed() == Approx(5e4));
}

TEST_CASE("threads on one core or that change their CPU are counted, on each machine by itself") {
  const ThreadPlaces first{"a", {0, 1}, {0, 2}, {0, 2}, 4};
  CHECK(pinning_of({first}).n_moved == 1);
  CHECK(pinning_of({first}).n_on_shared_cpus == 0);
  const ThreadPlaces elsewhere{"b", {0, 2}, {0, 2}, {0, 2}, 4};
  CHECK(pinning_of({first, elsewhere}).n_on_shared_cores == 0);
  const ThreadPlaces beside{"a", {3, 2}, {3, 2}, {2, 2}, 4};  // CPUs 2 and 3 are one core
  CHECK(pinning_of({first, beside}).n_on_shared_cpus == 2);
  CHECK(pinning_of({first, beside}).n_on_shared_cores == 3);
  CHECK(pinning_of({first, beside}).n_threads == 4);
}

TEST_CASE("speed-up and efficiency are of the median, against the fastest layout of the fewest cores") {
  const ScaleResults results = make_results();
  const LayoutResult &one = results.layouts[0], &two = results.layouts[2];
  CHECK(one.median == Approx(4.4));
  CHECK(one.least == 4.0);
  CHECK(one.efficiency == 1.0);
  CHECK(two.speed_up == Approx(2.0));
  CHECK(two.efficiency == Approx(1.0));
  CHECK(results.layouts[1].efficiency == Approx(0.8));
  CHECK(two.waiting == Approx(0.25));
  CHECK(two.n_messages == 4.0);
  CHECK(best_layout(results.layouts) == 2);
  CHECK(best_layout(results.layouts, 1) == 0);
}

TEST_CASE("without a run on one core efficiency is against the fewest that there are") {
  std::vector<LayoutResult> layouts = {result_of({1, 2}, {make_run({1, 2}, 3.0)}),
                                       result_of({2, 1}, {make_run({2, 1}, 2.0)}),
                                       result_of({4, 1}, {make_run({4, 1}, 1.0)})};
  compare_layouts(layouts);
  CHECK(layouts[1].efficiency == Approx(1.0));
  CHECK(layouts[1].speed_up == Approx(2.0));  // of a core
  CHECK(layouts[2].speed_up == Approx(4.0));
  CHECK(layouts[0].efficiency == Approx(2.0 / 3.0));
}

TEST_CASE("an even number of runs has the median between the middle two") {
  CHECK(result_of({1, 1}, {make_run({1, 1}, 1.0), make_run({1, 1}, 4.0)}).median == 2.5);
}

TEST_CASE("runs of the same grains that end in different states are an error with both hashes") {
  ScaleResults results = make_results();
  CHECK(hash_fault(results).empty());
  results.layouts[2] = result_of({2, 1}, {make_run({2, 1}, 1.0, "aa"), make_run({2, 1}, 1.0, "bb")});
  CHECK_THAT(hash_fault(results), Catch::Contains("layout 1x1 with the hash aa, layout 2x1 with bb"));
  results.kind = ScaleKind::weak;  // 1x2 has the grains of 2x1, but 1x1 has not
  CHECK_THAT(hash_fault(results), Catch::Contains("layout 1x2 with the hash aa, layout 2x1 with bb"));
  results.layouts[2] = result_of({2, 1}, {make_run({2, 1}, 1.0, "aa")});
  results.layouts[0] = result_of({1, 1}, {make_run({1, 1}, 1.0, "cc")});
  CHECK(hash_fault(results).empty());
}

TEST_CASE("a sweep goes on with the runs that are not done") {
  const TemporaryDirectory place;
  const fs::path path = place.path() / "sweep";
  const SweepDirectory first(path, make_identity());
  const SweepRun done{{1, 2}, 1}, interrupted{{2, 1}, 1}, shorter{{1, 1}, 1}, broken{{1, 1}, 2}, missing{{4, 1}, 1};
  write_run(first, done, make_run({1, 2}, 1.0));
  RunSummary run = make_run({2, 1}, 1.0);
  run.signal = SIGINT;
  write_run(first, interrupted, run);
  run = make_run({1, 1}, 1.0);
  run.n_steps = 99;
  write_run(first, shorter, run);
  write_run(first, broken, make_run({1, 1}, 1.0));
  write_file(first.run_directory(broken.name()) / "summary.json", "{");

  const SweepDirectory again(path, make_identity());
  CHECK(again.remark().empty());
  REQUIRE(again.find(done));
  CHECK(*again.find(done) == make_run({1, 2}, 1.0));
  for (const SweepRun& other : {interrupted, shorter, broken, missing}) {
    INFO(other.name());
    CHECK_FALSE(again.find(other));
  }
  again.clear(broken.name());
  CHECK_FALSE(fs::exists(again.run_directory(broken.name())));
}

TEST_CASE("a sweep of something else is set aside, and what has changed is said") {
  const TemporaryDirectory place;
  const fs::path path = place.path() / "sweep";
  write_run(SweepDirectory(path, make_identity()), {{1, 1}, 1}, make_run({1, 1}, 1.0));
  SweepIdentity changed = make_identity();
  changed.scene += "# more\n";
  changed.steps = 200;
  const SweepDirectory second(path, changed);
  CHECK_THAT(second.remark(),
             Catch::Contains(": the scene, the number of steps (100, now 200);") && Catch::Contains("sweep.old"));
  CHECK_FALSE(second.find(SweepRun{{1, 1}, 1}));
  CHECK(fs::exists(place.path() / "sweep.old" / "runs" / "1x1-1" / "summary.json"));
  changed.program = "dcba";
  CHECK_THAT(SweepDirectory(path, changed).remark(), Catch::Contains("the program") && Catch::Contains("sweep.old-2"));
}

TEST_CASE("a directory that holds something else is not touched") {
  const TemporaryDirectory place;
  write_file(place.path() / "letter", "dear");
  CHECK_THROWS_AS(SweepDirectory(place.path(), make_identity()), UsageError);
  CHECK(std::distance(fs::directory_iterator(place.path()), fs::directory_iterator()) == 1);
}

TEST_CASE("a file that a scene names and that has changed makes another sweep") {
  const TemporaryDirectory place;
  const fs::path file = place.path() / "grains.csv";
  write_file(file, "x,y,z\n");
  const std::string before = state_of_files({file});
  CHECK(state_of_files({file}) == before);
  write_file(file, "x,y,z\n1,2,3\n");
  CHECK(state_of_files({file}) != before);
}

TEST_CASE("time left is judged by runs of the same layout, or by cores where there are none yet") {
  SweepClock strong(ScaleKind::strong), weak(ScaleKind::weak);
  CHECK_FALSE(strong.expected({1, 1}));
  for (SweepClock* clock : {&strong, &weak}) {
    clock->add({1, 1}, make_run({1, 1}, 10.0));  // and 5 s of warm-up, 0.5 s of start
    CHECK(*clock->expected({1, 1}) == Approx(15.8));
  }
  CHECK(*strong.expected({2, 2}) == Approx(0.8 + 3.75));
  CHECK(*weak.expected({2, 2}) == Approx(15.8));
  strong.add({2, 2}, make_run({2, 2}, 4.0));
  CHECK(*strong.expected({2, 2}) == Approx(6.8));
}

TEST_CASE("the table has a row for each layout and a column of phases for each, and names the best") {
  ScaleResults results = make_results();
  results.projected.push_back({64, 1000, 1e-3, 51.2, 0.8, 1.1, 0.05, 0.1});
  const std::string table = scale_table(results);
  INFO(table);
  CHECK_THAT(table, Catch::Contains("\n2x1            2   1 000  2.200 s  2.000 s") && Catch::Contains("100.0 %"));
  CHECK_THAT(table, Catch::Contains("\nprojected     64") && Catch::Contains("not measured"));
  CHECK_THAT(table, Catch::Contains("percent of the steps              1x1   1x2   2x1\n"
                                    "contacts, motion                 70.0  70.0  70.0\n"));
  CHECK_THAT(table, Catch::Contains("\nof these: reductions              0.0   0.0   2.0\n"
                                    "of these: migration, new ghosts   0.0   0.0   1.0\n"));
  CHECK_THAT(table, Catch::Contains("every thread had a core of its own; none changed its CPU"));
  CHECK_THAT(table, Catch::Contains("best on 2 cores: 2x1") && Catch::Contains("best layout: 2x1"));
}

TEST_CASE("layouts whose threads shared cores are named") {
  RunSummary run = make_run({1, 2}, 1.0);
  run.ranks[0].places.cpus = run.ranks[0].places.cores = {1, 1};
  ScaleResults results;
  results.layouts = {result_of({1, 2}, {make_run({1, 2}, 1.0), run})};
  compare_layouts(results.layouts);
  CHECK_THAT(scale_table(results), Catch::Contains("shared a core with another: 1x2 (2 of 2); changed their CPU "
                                                   "meanwhile: 1x2 (1 of 2)"));
}

TEST_CASE("the CSV file has as many cells in each row, and marks what is projected") {
  ScaleResults results = make_results();
  results.projected.push_back({64, 1000, 1e-3, 51.2, 0.8, 1.1, 0.05, 0.1});
  std::istringstream csv(scale_csv(results));
  std::string head, line;
  std::getline(csv, head);
  CHECK_THAT(head, Catch::Contains(",efficiency,") && Catch::EndsWith(",share of other"));
  std::vector<std::string> kinds;
  while (std::getline(csv, line)) {
    CHECK(n_cells(line) == n_cells(head));
    kinds.push_back(line.substr(0, line.find(',')));
  }
  CHECK(kinds == std::vector<std::string>{"measured", "measured", "measured", "projected"});
}

TEST_CASE("the JSON file holds layouts, shares, hashes and projections") {
  ScaleResults results = make_results();
  results.projected.push_back({64, 1000, 1e-3, 51.2, 0.8, 1.1, 0.05, 0.1});
  const nlohmann::json json = nlohmann::json::parse(scale_json(results));
  CHECK(json["kind"] == "strong");
  CHECK(json["best_layout"] == "2x1");
  CHECK(json["is_same_state"] == true);
  REQUIRE(json["layouts"].size() == 3);
  CHECK(json["layouts"][2]["speed_up"] == Approx(2.0));
  CHECK(json["layouts"][2]["phase_shares"]["waiting for ghosts"] == Approx(0.25));
  CHECK(json["layouts"][2]["state_hashes"] == std::vector<std::string>{"aa"});
  CHECK(json["projected"][0]["efficiency"] == 0.8);
}

TEST_CASE("the plot is drawn where gnuplot is installed, and else the package is named") {
  const TemporaryDirectory place;
  ScaleResults results = make_results();
  results.projected.push_back({64, 1000, 1e-3, 51.2, 0.8, 1.1, 0.05, 0.1});
  const std::string said = write_scale_report(results, place.path());
  for (const char* name : {"scale.csv", "scale.json", "scale.gnuplot"}) CHECK(fs::exists(place.path() / name));
  if (find_program({"gnuplot"})) {
    CHECK_THAT(said, Catch::EndsWith("plot: scale.svg, scale.png"));
    for (const char* word : {"projected, not measured", "threads only", "contacts, motion", "a bed, of"})
      CHECK_THAT(read_file(place.path() / "scale.svg"), Catch::Contains(word));
    CHECK(read_file(place.path() / "scale.png").substr(1, 3) == "PNG");
  } else {
    CHECK_THAT(said, Catch::Contains("gnuplot-nox"));
  }
}

TEST_CASE("a program that is run gives its exit code, or the signal that ended it, and its words to a file") {
  const TemporaryDirectory place;
  const fs::path talk = place.path() / "talk";
  const auto shell = [&](const std::string& script) {
    return run_child({"/bin/sh", "-c", script}, place.path(), talk);
  };
  CHECK(shell("pwd; echo no >&2; exit 3").code == 3);
  CHECK(read_file(talk) == fs::canonical(place.path()).string() + "\nno\n");
  CHECK(shell("kill -9 $$").killed == SIGKILL);
  CHECK(shell("true").is_good());
  CHECK_FALSE(run_child({(place.path() / "none").string()}, place.path(), talk).is_good());
}

TEST_CASE("a signal that comes while a program runs is passed on to it") {
  const TemporaryDirectory place;
  const fs::path talk = place.path() / "talk";
  const InterruptGuard guard;
  bool has_come = false;
  const ChildEnd end = run_child({"/bin/sh", "-c", "trap 'exit 7' TERM; echo ready; while :; do sleep 0.05; done"},
                                 place.path(), talk, [&] {
                                   if (has_come || !fs::exists(talk) || read_file(talk).empty()) return;
                                   raise(SIGTERM);
                                   has_come = true;
                                 });
  CHECK(end.code == 7);
}
