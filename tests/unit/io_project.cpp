// moraine project: networks from files, requests that cannot be met, and what is said and written.
#include <catch2/catch.hpp>
#include <filesystem>
#include <sstream>

#include "io/checkpoint/durable_file.hpp"
#include "io/cli/layout.hpp"
#include "io/cli/network_file.hpp"
#include "io/cli/project_command.hpp"
#include "io/scene_toml/scene_toml.hpp"
#include "tests/unit/io_images.hpp"

using namespace moraine;
using moraine::testing::TemporaryDirectory;
namespace fs = std::filesystem;

namespace {

constexpr const char* small_bed = R"(
[domain]
low = [0, 0, 0]
high = [0.1, 0.1, 0.05]
periodic = [true, true, false]
[time]
end = 1.0
[[material]]
name = "glass"
density = 2500.0
[contact]
normal = "linear"
tangential = "none"
rotation = false
[[contact.pair]]
normal_stiffness = 1000.0
restitution = 0.9
[[particles]]
diameter = 0.004
fill = { lattice = "cubic", jitter = 0.9 }
[[wall]]
name = "floor"
plane = { point = [0, 0, 0], normal = "z" }
)";

std::string network_error(const fs::path& file, const std::string& text) {
  write_file(file, text);
  try {
    read_network(file);
  } catch (const UsageError& error) {
    return error.what();
  } catch (const SceneFileError& error) {
    return std::string("not TOML: ") + error.what();
  }
  return "no error";
}

std::string request_error(const ProjectRequest& request) {
  try {
    project_text(request);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("the networks of the examples can be read, and the default is one of them") {
  const fs::path folder = fs::path(MORAINE_EXAMPLES) / "networks";
  const Network qdr = read_network(folder / "infiniband_qdr_40gbps.toml"), standard = default_network();
  CHECK(qdr.name == standard.name);
  CHECK(qdr.latency == standard.latency);
  CHECK(qdr.bandwidth == standard.bandwidth);
  const Network shared = read_network(folder / "shared_memory.toml");
  CHECK(shared.latency < qdr.latency);
}

TEST_CASE("a network file that is wrong is refused with the key and what was expected") {
  const TemporaryDirectory directory;
  const fs::path file = directory.path() / "network.toml";
  CHECK(network_error(file, "latency = 1e-6\nbandwidth = 1e9\n") == "no error");
  CHECK(network_error(file, "latency = 1e-6\n") ==
        file.string() + ": \"bandwidth\" [bytes/s] is missing; a network has name, latency [s], bandwidth [bytes/s]");
  CHECK(network_error(file, "latency = 1e-6\nbandwith = 1e9\n") ==
        file.string() + ":2: unknown key \"bandwith\"; a network has name, latency [s], bandwidth [bytes/s]");
  CHECK(network_error(file, "bandwidth = 1e9\nlatency = -1\n") ==
        file.string() + ":2: latency: expected a number above 0 [s], found -1");
  CHECK(network_error(file, "bandwidth = \"fast\"\nlatency = 1e-6\n").find("found \"fast\"") != std::string::npos);
  CHECK(network_error(file, "latency = ").substr(0, 9) == "not TOML:");
  CHECK_THROWS_AS(read_network(directory.path() / "none.toml"), StorageError);
}

TEST_CASE("a projection says what each number of ranks would hold, and writes it down") {
  const TemporaryDirectory directory;
  ProjectRequest request;
  request.scene_file = directory.path() / "scene.toml";
  request.csv = directory.path() / "table.csv";
  request.ranks = {1, 4, 32};
  write_file(request.scene_file, small_bed);
  const std::string text = project_text(request);
  INFO(text);
  for (const char* part :
       {"\n1 rank\n", "\n4 ranks\n", "\n32 ranks\n", "48 bytes a ghost", "efficiency", "assumptions"})
    CHECK(text.find(part) != std::string::npos);
  std::istringstream csv(read_file(*request.csv));
  std::string line;
  std::getline(csv, line);
  CHECK(line.substr(0, 34) == "ranks,parts,grains_mean,grains_lar");
  const auto n_commas = std::count(line.begin(), line.end(), ',');
  for (const int n : request.ranks) {
    REQUIRE(std::getline(csv, line));
    CHECK(line.substr(0, line.find(',')) == std::to_string(n));
    CHECK(std::count(line.begin(), line.end(), ',') == n_commas);
  }
  CHECK_FALSE(std::getline(csv, line));
}

TEST_CASE(
    "a larger bed is shown by as many ranks as hold as much each, or refused where the scene is too small for it") {
  const TemporaryDirectory directory;
  ProjectRequest request;
  request.scene_file = directory.path() / "scene.toml";
  write_file(request.scene_file, small_bed);
  request.ranks = {100};
  request.grains = 5e4;  // the scene has 6912
  const std::string text = project_text(request);
  INFO(text);
  CHECK(text.find("100 ranks with 50 000 grains, as the 14 that hold as many each of 6 912\n") != std::string::npos);
  request.ranks = {10};
  CHECK(request_error(request).find("10 ranks with 50 000 grains hold 5 000 each: the scene's ") == 0);
  request.grains = 10.0;
  CHECK(request_error(request).find("--grains 10: fewer than the scene has") == 0);
}

TEST_CASE("requests for no ranks or for more threads than there are cores are refused before any work") {
  ProjectRequest request;
  request.scene_file = "nowhere.toml";
  CHECK(request_error(request).find("--ranks: expected") == 0);
  request.ranks = {4, 0};
  CHECK(request_error(request) == "--ranks: expected numbers of at least 1, found 0");
  request.ranks = {4};
  request.threads = available_cores() + 1;
  CHECK(request_error(request).find("--layout-threads") == 0);
}
