#include <sched.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <limits>

#include "io/cli/layout.hpp"
#include "io/cli/run_directory.hpp"
#include "io/cli/schedule.hpp"
#include "io/cli/table_file.hpp"
#include "io/cli/text.hpp"
#include "tests/unit/io_images.hpp"

using namespace moraine;
using moraine::testing::TemporaryDirectory;
namespace fs = std::filesystem;

TEST_CASE("an output is due once for each multiple of its interval, at the step nearest to it") {
  for (const auto& [interval, step] :
       {std::pair(0.02, 5.75094e-06), std::pair(0.1, 1e-4), std::pair(1e-3, 3e-4), std::pair(0.1, 0.1 / 3)}) {
    const Schedule schedule(interval, step);
    std::uint64_t n_due = 0;
    for (std::uint64_t i = 0; i <= 100'000; ++i) {
      if (!schedule.is_due(i)) continue;
      CHECK(std::abs(static_cast<double>(i) * step - static_cast<double>(n_due) * interval) <= 0.5 * step * (1 + 1e-9));
      ++n_due;
    }
    CHECK(n_due == static_cast<std::uint64_t>(std::floor(100'000.5 * step / interval)) + 1);
  }
}

TEST_CASE("the next output after any step is the first that is due, wherever one starts to ask") {
  const Schedule schedule(0.00123, 1e-4);
  std::uint64_t expected = 0;
  for (std::uint64_t i = 0; i < 3000; ++i) {
    if (i >= expected)
      for (expected = i + 1; !schedule.is_due(expected);) ++expected;
    REQUIRE(schedule.next_after(i) == expected);
  }
}

TEST_CASE("an interval shorter than the step is due at each step, an interval of zero never") {
  const Schedule often(1e-5, 1e-4), never(0.0, 1e-4);
  for (const std::uint64_t i : {0u, 1u, 2u, 77u}) {
    CHECK(often.is_due(i));
    CHECK_FALSE(never.is_due(i));
  }
  CHECK(often.next_after(5) == 6);
  CHECK(never.next_after(5) == std::numeric_limits<std::uint64_t>::max());
}

TEST_CASE("a time that is a whole number of steps, but for rounding, takes that many") {
  CHECK(steps_until(10.0, 1e-4) == 100'000);
  CHECK(steps_until(0.3, 0.1) == 3);
  CHECK(steps_until(0.7, 0.1) == 7);
  CHECK(steps_until(0.71, 0.1) == 8);
  CHECK(steps_until(0.0, 0.1) == 0);
  CHECK(steps_until(1e-9, 0.1) == 1);
}

TEST_CASE("a table that goes on keeps the rows before the restart and is then that of an unbroken run") {
  const TemporaryDirectory directory;
  const auto fill = [](TableFile& table, std::uint64_t from, std::uint64_t to) {
    for (std::uint64_t i = from; i <= to; i += 10) table.add(i, {static_cast<double>(i) / 3.0, 1e-300, -0.0});
  };
  const std::vector<std::string> columns = {"time [s]", "a, b", "c"};
  {
    TableFile unbroken(directory.path() / "a.csv", columns, std::nullopt);
    fill(unbroken, 0, 100);
    TableFile broken(directory.path() / "b.csv", columns, std::nullopt);
    fill(broken, 0, 80);
  }
  std::ofstream(directory.path() / "b.csv", std::ios::app) << "90,1.25,3";  // cut off by a crash, without its newline
  TableFile table(directory.path() / "b.csv", columns, 51);
  fill(table, 60, 100);
  table.sync();
  CHECK(read_file(directory.path() / "b.csv") == read_file(directory.path() / "a.csv"));
  CHECK(
      read_file(directory.path() / "a.csv").starts_with("step,time [s],a  b,c\n0,0,1e-300,-0\n10,3.3333333333333335,"));
}

TEST_CASE("a table of other columns is not written on") {
  const TemporaryDirectory directory;
  const fs::path path = directory.path() / "a.csv";
  TableFile(path, {"x"}, std::nullopt).add(0, {1});
  const std::string before = read_file(path);
  CHECK_THROWS_WITH(TableFile(path, {"x", "y"}, 5), Catch::StartsWith(path.string() + ": has other columns"));
  CHECK(read_file(path) == before);
}

TEST_CASE("auto takes the cores that the process was started with, whatever its main thread is bound to since") {
  cpu_set_t all;
  CPU_ZERO(&all);
  REQUIRE(sched_getaffinity(0, sizeof all, &all) == 0);
  const std::string of_all = "1x" + std::to_string(CPU_COUNT(&all));
  CHECK(available_cores() == CPU_COUNT(&all));
  CHECK(parse_layout("auto").text() == of_all);
  cpu_set_t one;
  CPU_ZERO(&one);
  for (int cpu = 0; cpu < CPU_SETSIZE && CPU_COUNT(&one) == 0; ++cpu)
    if (CPU_ISSET(cpu, &all)) CPU_SET(cpu, &one);
  REQUIRE(sched_setaffinity(0, sizeof one, &one) == 0);
  CHECK(parse_layout("auto").text() == of_all);
  take_back_cpus();
  cpu_set_t now;
  REQUIRE(sched_getaffinity(0, sizeof now, &now) == 0);
  CHECK(CPU_EQUAL(&now, &all));
}

TEST_CASE("a layout is ranks x threads; what is not is refused with what to type instead") {
  CHECK(parse_layout("1x8").threads == 8);
  CHECK(parse_layout("12x4").ranks == 12);
  CHECK(parse_layout("12x4").total() == 48);
  for (const char* text : {"", "8", "1x", "x4", "0x4", "1x0", "1x-2", "1 x 4", "1x4x2", "1x99999999999", "AUTO"})
    CHECK_THROWS_WITH(parse_layout(text), Catch::Contains("expected \"auto\" or RANKSxTHREADS"));
}

TEST_CASE("a run is named after its scene file, or after the folder of a scene.toml") {
  CHECK(run_name("examples/hopper/scene.toml") == "hopper");
  CHECK(run_name("examples/hopper/full.toml") == "full");
  CHECK(run_name("./box.toml") == "box");
}

TEST_CASE("a new run takes the first free directory and never one that holds something") {
  const TemporaryDirectory directory;
  Scene scene;
  scene.output.directory = (directory.path() / "bed").string();
  const fs::path base = directory.path() / "bed";
  CHECK(new_run_directory("bed.toml", scene, std::nullopt) == base);
  fs::create_directories(base);  // empty: free
  CHECK(new_run_directory("bed.toml", scene, std::nullopt) == base);
  CHECK_FALSE(newest_run_directory("bed.toml", scene).has_value());
  std::ofstream(base / "scene.toml") << "x";
  CHECK(new_run_directory("bed.toml", scene, std::nullopt) == base.string() + "-2");
  for (const char* name : {"bed-2", "bed-10", "bed-x", "bed-3x", "bedding-99"}) {
    fs::create_directories(directory.path() / name);
    std::ofstream(directory.path() / name / "scene.toml") << "x";
  }
  CHECK(new_run_directory("bed.toml", scene, std::nullopt) == base.string() + "-3");
  CHECK(newest_run_directory("bed.toml", scene) == base.string() + "-10");
}

TEST_CASE("--out is taken where it is free and refused where it is not") {
  const TemporaryDirectory directory;
  const Scene scene;
  const fs::path out = directory.path() / "out";
  CHECK(new_run_directory("a.toml", scene, out) == out);
  fs::create_directories(out / "snapshots");
  CHECK_THROWS_WITH(new_run_directory("a.toml", scene, out),
                    Catch::Contains("holds a run already") && Catch::Contains("--restart auto"));
  std::ofstream(directory.path() / "file") << "x";
  CHECK_THROWS_WITH(new_run_directory("a.toml", scene, directory.path() / "file"), Catch::Contains("is a file"));
  std::ofstream(directory.path() / "notes.txt") << "x";
  CHECK_THROWS_WITH(new_run_directory("a.toml", scene, directory.path()), Catch::Contains("is not empty"));
}

TEST_CASE("a checkpoint knows its run directory") {
  CHECK(run_directory_of("runs/a/checkpoints/checkpoint_1.h5") == fs::path("runs/a"));
  CHECK(run_directory_of("checkpoints/checkpoint_1.h5") == fs::current_path());
  CHECK_FALSE(run_directory_of("elsewhere/checkpoint_1.h5").has_value());
}

TEST_CASE("numbers are written as people read them") {
  CHECK(duration_text(0.123) == "0.12 s");
  CHECK(duration_text(59.4) == "59 s");
  CHECK(duration_text(200) == "3 min 20 s");
  CHECK(duration_text(7500) == "2 h 05 min");
  CHECK(duration_text(1e6) == "11 d 13 h");
  CHECK(duration_text(std::numeric_limits<double>::infinity()) == "unknown");
  CHECK(bytes_text(640) == "640 B");
  CHECK(bytes_text(12'340'000) == "12.3 MB");
  CHECK(count_text(7) == "7");
  CHECK(count_text(1234567) == "1 234 567");
  CHECK(counted(1, "grain") == "1 grain");
}
