#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>

#include "io/checkpoint/checkpoint.hpp"
#include "tests/unit/io_images.hpp"

using namespace moraine;
using moraine::testing::add_gas;
using moraine::testing::is_same;
using moraine::testing::make_image;
using moraine::testing::TemporaryDirectory;
namespace fs = std::filesystem;

namespace {

const RunRecord record{"title = \"a bed\"\n[domain]\n", "0.1.0", "abc123"};

fs::path place_checkpoint(const fs::path& run, std::uint64_t step) {
  fs::create_directories(checkpoint_directory(run));
  const fs::path path = checkpoint_directory(run) / checkpoint_name(step);
  write_checkpoint(path, make_image(20, step), record);
  return path;
}

void flip_byte(const fs::path& path, std::streamoff at) {
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekg(at);
  const int byte = file.get();
  file.seekp(at);
  file.put(static_cast<char>(byte ^ 0x10));
}

std::string message_of(const fs::path& path) {
  try {
    read_checkpoint(path);
  } catch (const StorageError& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("a checkpoint gives back every bit of the image it was written from") {
  const TemporaryDirectory directory;
  for (const std::uint64_t n : {0u, 1u, 2u, 1000u}) {
    const Image image = make_image(n);
    const fs::path path = directory.path() / checkpoint_name(image.step);
    write_checkpoint(path, image, record);
    const Checkpoint read = read_checkpoint(path);
    CHECK(is_same(read.image, image));
    CHECK(std::signbit(n == 0 ? -0.0 : read.image.walls[0].displacement[2]));
    CHECK(read.record.scene == record.scene);
    CHECK(read.record.version == record.version);
    CHECK(read.record.commit == record.commit);
  }
}

TEST_CASE("a checkpoint gives back every bit of the gas, on cells and on faces") {
  const TemporaryDirectory directory;
  for (const std::array<int, 3> cells :
       {std::array{1, 1, 1}, std::array{4, 1, 3}, std::array{5, 6, 1}, std::array{50, 60, 70}}) {
    Image image = make_image(3);
    add_gas(image, cells);
    write_checkpoint(directory.path() / "c.h5", image, record);
    CHECK(is_same(read_checkpoint(directory.path() / "c.h5").image, image));
  }
}

TEST_CASE("a damaged quantity of the gas is named") {
  const TemporaryDirectory directory;
  Image image = make_image(3);
  add_gas(image, {20, 20, 20});
  const fs::path path = directory.path() / "c.h5";
  write_checkpoint(path, image, record);
  const std::string text = read_file(path), pressure(reinterpret_cast<const char*>(image.grids[2].values.data()), 64);
  const std::size_t at = text.find(pressure);
  REQUIRE(at != std::string::npos);
  flip_byte(path, static_cast<std::streamoff>(at) + 8000);
  CHECK(message_of(path) == path.string() + ": is damaged: gas/pressure does not agree with the checksum");
}

TEST_CASE("gas with another number of values than its grid is not written") {
  const TemporaryDirectory directory;
  Image image = make_image(3);
  add_gas(image, {2, 3, 4});
  image.grids[1].values.pop_back();
  CHECK_THROWS_AS(write_checkpoint(directory.path() / "c.h5", image, record), std::logic_error);
}

TEST_CASE("a field that the scene does not need is neither written nor read") {
  const TemporaryDirectory directory;
  Image image = make_image(10);
  std::erase_if(image.fields, [](const FieldArray& array) { return info(array.field).need != Need::always; });
  write_checkpoint(directory.path() / "c.h5", image, record);
  const Checkpoint read = read_checkpoint(directory.path() / "c.h5");
  CHECK(is_same(read.image, image));
  CHECK(read.image.find(Field::angular_velocity) == nullptr);
}

TEST_CASE("the same state written twice gives the same bytes") {
  const TemporaryDirectory directory;
  write_checkpoint(directory.path() / "a.h5", make_image(50), record);
  write_checkpoint(directory.path() / "b.h5", make_image(50), record);
  CHECK(read_file(directory.path() / "a.h5") == read_file(directory.path() / "b.h5"));
}

TEST_CASE("scene texts longer than an HDF5 attribute may be, empty ones and ones with umlauts survive a checkpoint") {
  const TemporaryDirectory directory;
  for (const std::string& text :
       {std::string(200'000, 'x'), std::string(), std::string("title = \"Schüttgut – Böschung\"\n")}) {
    write_checkpoint(directory.path() / "c.h5", make_image(3), {text, "", ""});
    CHECK(read_checkpoint(directory.path() / "c.h5").record.scene == text);
  }
}

TEST_CASE("a new checkpoint replaces the old one whole and leaves nothing beside it") {
  const TemporaryDirectory directory;
  const fs::path path = directory.path() / "c.h5";
  write_checkpoint(path, make_image(10, 1), record);
  write_checkpoint(path, make_image(30, 2), record);
  CHECK(read_checkpoint(path).image.step == 2);
  CHECK(std::distance(fs::directory_iterator(directory.path()), fs::directory_iterator()) == 1);
}

TEST_CASE("only the newest checkpoints are kept") {
  const TemporaryDirectory run;
  for (const std::uint64_t step : {10u, 20u, 30u, 40u}) place_checkpoint(run.path(), step);
  std::ofstream(checkpoint_directory(run.path()) / "checkpoint_000000000050.h5.tmp") << "left by a crash";
  remove_old_checkpoints(run.path(), 2);
  const std::vector<fs::path> left = list_checkpoints(run.path());
  REQUIRE(left.size() == 2);
  CHECK(checkpoint_step(left[0]) == 40u);
  CHECK(checkpoint_step(left[1]) == 30u);
  CHECK_FALSE(fs::exists(checkpoint_directory(run.path()) / "checkpoint_000000000050.h5.tmp"));
  remove_old_checkpoints(run.path(), 0);
  CHECK(list_checkpoints(run.path()).size() == 1);
}

TEST_CASE("the latest checkpoint is the one of the highest step, whatever the order of writing") {
  const TemporaryDirectory run;
  CHECK_FALSE(find_latest_checkpoint(run.path()).has_value());
  for (const std::uint64_t step : {300u, 1000u, 20u}) place_checkpoint(run.path(), step);
  const auto latest = find_latest_checkpoint(run.path());
  REQUIRE(latest.has_value());
  CHECK(latest->checkpoint.image.step == 1000);
  CHECK(latest->warnings.empty());
}

TEST_CASE("where the newest checkpoint is damaged, the previous one is taken and the damaged one named") {
  const TemporaryDirectory run;
  place_checkpoint(run.path(), 100);
  const fs::path newest = place_checkpoint(run.path(), 200);
  flip_byte(newest, static_cast<std::streamoff>(fs::file_size(newest) / 2));
  const auto latest = find_latest_checkpoint(run.path());
  REQUIRE(latest.has_value());
  CHECK(latest->checkpoint.image.step == 100);
  REQUIRE(latest->warnings.size() == 1);
  CHECK(latest->warnings[0].find(newest.string() + ": is damaged") == 0);
}

TEST_CASE("a run all of whose checkpoints are damaged is refused with the damage of each") {
  const TemporaryDirectory run;
  const fs::path a = place_checkpoint(run.path(), 100), b = place_checkpoint(run.path(), 200);
  fs::resize_file(a, 5000);
  fs::resize_file(b, 100);
  CHECK_THROWS_WITH(find_latest_checkpoint(run.path()),
                    Catch::Contains("holds no sound checkpoint") && Catch::Contains(a.string()) &&
                        Catch::Contains(b.string()) && Catch::Contains("cut short"));
}

TEST_CASE("what is wrong with a checkpoint is said in its name") {
  const TemporaryDirectory directory;
  const fs::path path = directory.path() / "c.h5";
  CHECK(message_of(path) == path.string() + ": cannot be read: no such file or directory");
  CHECK(message_of(directory.path()) == directory.path().string() + ": is a directory, expected a file");
  std::ofstream(path).close();
  CHECK(message_of(path) == path.string() + ": is empty, expected a Moraine checkpoint");
  std::ofstream(path) << std::string(600, 'a');
  CHECK(message_of(path) ==
        path.string() + ": is not a Moraine file, or its first line is damaged; expected a Moraine checkpoint");

  write_checkpoint(path, make_image(100), record);
  const auto size = fs::file_size(path);
  fs::resize_file(path, size - 1);
  CHECK(message_of(path) ==
        path.string() + ": is cut short: " + std::to_string(size - 1) + " of " + std::to_string(size) + " bytes");
  fs::resize_file(path, size + 1);
  CHECK(message_of(path) ==
        path.string() + ": is too long: " + std::to_string(size + 1) + " of " + std::to_string(size) + " bytes");
}

TEST_CASE("a checkpoint of a newer format is refused by name") {
  const TemporaryDirectory directory;
  const fs::path path = directory.path() / "c.h5";
  write_checkpoint(path, make_image(5), record);
  std::fstream(path, std::ios::in | std::ios::out | std::ios::binary).seekp(19).put('7');  // "Moraine checkpoint 7"
  CHECK(message_of(path) ==
        path.string() + ": is written in format 7, newer than format 2 of this program: use a newer Moraine");
}

TEST_CASE("a damaged dataset is named") {
  const TemporaryDirectory directory;
  const fs::path path = directory.path() / "c.h5";
  const Image image = make_image(500);
  write_checkpoint(path, image, record);
  const std::string bytes = read_file(path);
  const std::vector<double>& radii = image.find(Field::radius)->reals;
  const std::size_t at = bytes.find(std::string(reinterpret_cast<const char*>(radii.data()), 64));
  REQUIRE(at != std::string::npos);
  flip_byte(path, static_cast<std::streamoff>(at + 3));
  CHECK(message_of(path) == path.string() + ": is damaged: particles/radius does not agree with the checksum");
}
