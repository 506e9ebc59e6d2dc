// Checkpoints of earlier releases are read as they were written; those of later ones are refused by name.
#include <catch2/catch.hpp>
#include <fstream>

#include "engine/run/simulation.hpp"
#include "io/checkpoint/checkpoint.hpp"
#include "io/scene_toml/scene_toml.hpp"
#include "tests/unit/io_images.hpp"

using namespace moraine;
using moraine::testing::TemporaryDirectory;
namespace fs = std::filesystem;

namespace {

/// Written by version 0.1.0 from data/checkpoint.toml, on one rank (format 1), and by two with a file each (format 2):
///   moraine run checkpoint.toml --layout 1x1 --until 0.012
///   moraine run checkpoint.toml --layout 2x1 --until 0.012 --set output.distributed=true
const fs::path data = MORAINE_FAULTS_DATA;
const char* const name = "checkpoint_000000000240.h5";

void expect_all_of_it(const Checkpoint& checkpoint) {
  const Image& image = checkpoint.image;
  CHECK(checkpoint.record.version == "0.1.0");
  CHECK(image.step == 240);
  CHECK(image.n_grains == 59);
  CHECK(image.pairs.size() == 12);
  CHECK(image.walls.size() == 2);
  CHECK(image.grids.size() == 18);
  CHECK(image.hash.text() == "1c172337ff9b9302d1dac3434a702045");
  CHECK(image.accumulators.at("born") == std::vector<double>{60.0});
  CHECK(image.accumulators.at("left") == std::vector<double>{1.0});
  for (const Field field :
       {Field::position, Field::velocity, Field::angular_velocity, Field::radius, Field::inverse_mass,
        Field::inverse_inertia, Field::gid, Field::material, Field::dissipated, Field::gas_acceleration})
    CHECK(image.find(field) != nullptr);
}

}  // namespace

TEST_CASE("checkpoints of version 0.1, formats 1 and 2, are read whole, and runs go on from them") {
  for (const char* format : {"format_1", "format_2"}) {
    const Checkpoint checkpoint = read_checkpoint(data / format / name);
    INFO(format);
    expect_all_of_it(checkpoint);
    // The scene that it carries; what was set on the command line for it is in there.
    Simulation simulation(read_scene_text(checkpoint.record.scene, "scene.toml"), 1, checkpoint.image);
    CHECK(simulation.step_number() == 240);
    CHECK(simulation.state_hash() == checkpoint.image.hash);
    for (int i = 0; i < 20; ++i) simulation.step();
  }
}

TEST_CASE("a checkpoint of a later format is refused by name, whatever else is in it") {
  const TemporaryDirectory directory;
  std::string bytes = read_file(data / "format_1" / name);
  const std::string before = "Moraine checkpoint 1\n";
  REQUIRE(bytes.starts_with(before));
  bytes.replace(0, before.size(), "Moraine checkpoint 3\n");
  const fs::path path = directory.path() / name;
  std::ofstream(path, std::ios::binary) << bytes;
  CHECK_THROWS_WITH(read_checkpoint(path), path.string() +
                                               ": is written in format 3, newer than format 2 of this "
                                               "program: use a newer Moraine");
}
