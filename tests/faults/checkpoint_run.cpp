// Runs on bad disks and from bad checkpoints.
#include <sys/mount.h>

#include <catch2/catch.hpp>
#include <fstream>

#include "engine/run/simulation.hpp"
#include "io/checkpoint/checkpoint.hpp"
#include "io/cli/file_commands.hpp"
#include "io/cli/run_command.hpp"
#include "io/scene_toml/scene_toml.hpp"
#include "tests/unit/io_images.hpp"

using namespace moraine;
using moraine::testing::TemporaryDirectory;
namespace fs = std::filesystem;

namespace {

const char* scene_text = R"(
[domain]
low = [0, 0, 0]
high = [0.1, 0.1, 0.2]
[time]
end = 0.05
step = 5e-5
gravity = [0, 0, -9.81]
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
diameter = 0.005
fill = { region = { box = { low = [0, 0, 0], high = [0.1, 0.1, 0.2] } }, count = 1000 }
[[wall]]
name = "box"
box = { low = [0, 0, 0], high = [0.1, 0.1, 0.2] }
[output]
snapshots = 0.01
checkpoints = 0.01
)";

RunRequest request_in(const fs::path& directory, const fs::path& out) {
  std::ofstream(directory / "bed.toml") << scene_text;
  RunRequest request;
  request.scene_file = directory / "bed.toml";
  request.layout = "1x1";
  request.out = out;
  return request;
}

int run(const RunRequest& request) {
  Log log(true);
  return run_scene(request, log);
}

void damage(const fs::path& path) {
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(static_cast<std::streamoff>(fs::file_size(path) / 2));
  file.put('!').put('?').put('!');
}

}  // namespace

TEST_CASE("a run whose newest checkpoint is damaged goes on from the one before, says so, and ends the same") {
  const TemporaryDirectory directory;
  RunRequest request = request_in(directory.path(), directory.path() / "run");
  REQUIRE(run(request) == 0);
  request.out = directory.path() / "damaged";
  request.until = 0.035;
  REQUIRE(run(request) == 0);
  const std::vector<fs::path> checkpoints = list_checkpoints(*request.out);
  REQUIRE(checkpoints.size() == 2);
  damage(checkpoints[0]);
  request.until.reset();
  request.restart = "auto";
  REQUIRE(run(request) == 0);
  CHECK(compare_files(directory.path() / "run", *request.out).is_equal);
  CHECK(read_file(directory.path() / "run" / "hashes.csv") == read_file(*request.out / "hashes.csv"));
  CHECK_THAT(read_file(*request.out / "log.txt"),
             Catch::Contains(checkpoints[0].string() + ": is damaged") && Catch::Contains("taking the one before it"));
}

TEST_CASE("a run all of whose checkpoints are damaged is not started, and nothing of it is changed") {
  const TemporaryDirectory directory;
  RunRequest request = request_in(directory.path(), directory.path() / "run");
  REQUIRE(run(request) == 0);
  for (const fs::path& path : list_checkpoints(*request.out)) damage(path);
  const std::string hashes = read_file(*request.out / "hashes.csv"), log = read_file(*request.out / "log.txt");
  request.restart = "auto";
  CHECK_THROWS_WITH(run(request), Catch::Contains("holds no sound checkpoint"));
  request.restart = list_checkpoints(*request.out)[0].string();
  CHECK_THROWS_WITH(run(request), Catch::Contains(*request.restart + ": is damaged"));
  CHECK(read_file(*request.out / "hashes.csv") == hashes);
  CHECK(read_file(*request.out / "log.txt") == log);
}

TEST_CASE("a checkpoint that does not restore the state whose hash it carries is refused") {
  const TemporaryDirectory directory;
  RunRequest request = request_in(directory.path(), directory.path() / "run");
  REQUIRE(run(request) == 0);
  const fs::path path = list_checkpoints(*request.out)[0];
  Checkpoint checkpoint = read_checkpoint(path);
  checkpoint.image.hash.low ^= 1;
  write_checkpoint(directory.path() / "other.h5", checkpoint.image, checkpoint.record);
  request.restart = (directory.path() / "other.h5").string();
  request.out = directory.path() / "other";
  CHECK_THROWS_WITH(run(request), Catch::Contains("other.h5: cannot be gone on from: the state restored has the hash"));
  CHECK_FALSE(fs::exists(directory.path() / "other"));
}

TEST_CASE("a run whose disk is full ends with its name, exit code 1, and sound checkpoints that it can go on from") {
  const TemporaryDirectory directory;
  const fs::path disk = directory.path() / "disk";
  fs::create_directories(disk);
  RunRequest request = request_in(directory.path(), directory.path() / "run");
  REQUIRE(run(request) == 0);
  if (::mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=900k") != 0) {
    WARN("skipped: mounting a small disk needs root");
    return;
  }
  request.out = disk / "run";
  CHECK(run(request) == exit_code::failed);
  const auto latest = find_latest_checkpoint(*request.out);
  REQUIRE(latest.has_value());
  CHECK(latest->warnings.empty());
  // With room again it goes on and ends as it should.
  REQUIRE(::mount("tmpfs", disk.c_str(), "tmpfs", MS_REMOUNT, "size=20m") == 0);
  request.restart = "auto";
  CHECK(run(request) == 0);
  CHECK(compare_files(directory.path() / "run", *request.out).is_equal);
  CHECK(read_file(directory.path() / "run" / "hashes.csv") == read_file(*request.out / "hashes.csv"));
  ::umount2(disk.c_str(), MNT_DETACH);
}

TEST_CASE("a directory that cannot be made is named") {
  const TemporaryDirectory directory;
  const RunRequest request = request_in(directory.path(), "/proc/moraine-run");
  CHECK_THROWS_WITH(run(request), Catch::StartsWith("/proc/moraine-run: the directory cannot be made: "));
}
