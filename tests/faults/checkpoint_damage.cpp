// What happens to checkpoints in bad hands and on bad disks: never a crash, never a silent acceptance, always a name.
#include <fcntl.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <fstream>
#include <set>

#include "io/checkpoint/checkpoint.hpp"
#include "io/snapshot/snapshot.hpp"
#include "tests/unit/io_images.hpp"

using namespace moraine;
using moraine::testing::make_image;
using moraine::testing::TemporaryDirectory;
namespace fs = std::filesystem;

namespace {

const RunRecord record{"title = \"a bed\"\n", "0.1.0", "abc123"};

/// "" where the file is taken, else the message; a message must name the file.
template <class Read>
std::string refusal(const fs::path& path, Read read) {
  try {
    read(path);
    return {};
  } catch (const StorageError& error) {
    const std::string text = error.what();
    if (text.find(path.string() + ": ") != 0) return {};
    return text;
  }
}

void write_bytes(const fs::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary | std::ios::trunc)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

/// Every byte of the first kilobytes, and a spread over the rest, altered in one bit.
template <class Read>
void flip_bytes(const fs::path& path, Read read) {
  const std::string sound = read_file(path);
  std::size_t n_accepted = 0, first_accepted = 0;
  FileHandle file(path, O_RDWR);
  for (std::size_t at = 0; at < sound.size(); at += at < 6000 ? 1 : 37) {
    const char altered = static_cast<char>(sound[at] ^ (1 << (at % 8)));
    file.write(&altered, 1, at);
    if (refusal(path, read).empty() && n_accepted++ == 0) first_accepted = at;
    file.write(&sound[at], 1, at);
  }
  INFO("first accepted at byte " << first_accepted);
  CHECK(n_accepted == 0);
  CHECK_NOTHROW(read(path));
}

template <class Read>
void cut_lengths(const fs::path& path, Read read) {
  const std::string sound = read_file(path);
  std::size_t n_accepted = 0;
  FileHandle file(path, O_RDWR);
  for (std::size_t length = sound.size() - 1; length > 0;
       length -= length > 5000 ? 101 : std::min<std::size_t>(length, 7)) {
    file.resize(length);
    n_accepted += refusal(path, read).empty();
  }
  CHECK(n_accepted == 0);
}

/// A disk of its own, full quickly. Needs the right to mount.
class SmallDisk {
 public:
  SmallDisk(const fs::path& place, const char* size) : place_(place) {
    fs::create_directories(place_);
    is_mounted_ = ::mount("tmpfs", place_.c_str(), "tmpfs", 0, size) == 0;
  }
  ~SmallDisk() {
    if (is_mounted_) ::umount2(place_.c_str(), MNT_DETACH);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  bool is_mounted() const { return is_mounted_; }

 private:
  fs::path place_;
  bool is_mounted_ = false;
};

std::size_t n_files(const fs::path& directory) {
  return static_cast<std::size_t>(std::distance(fs::directory_iterator(directory), fs::directory_iterator()));
}

}  // namespace

TEST_CASE("a checkpoint with any one byte altered is refused by name") {
  const TemporaryDirectory directory;
  write_checkpoint(directory.path() / "c.h5", make_image(40), record);
  flip_bytes(directory.path() / "c.h5", [](const fs::path& path) { read_checkpoint(path); });
}

TEST_CASE("a snapshot with any one byte altered is refused by name") {
  const TemporaryDirectory directory;
  write_snapshot(directory.path() / "s.h5", make_image(40));
  flip_bytes(directory.path() / "s.h5", [](const fs::path& path) { read_snapshot(path); });
}

TEST_CASE("a checkpoint cut at any length is refused by name") {
  const TemporaryDirectory directory;
  write_checkpoint(directory.path() / "c.h5", make_image(40), record);
  cut_lengths(directory.path() / "c.h5", [](const fs::path& path) { read_checkpoint(path); });
}

TEST_CASE("a snapshot cut at any length is refused by name") {
  const TemporaryDirectory directory;
  write_snapshot(directory.path() / "s.h5", make_image(40));
  cut_lengths(directory.path() / "s.h5", [](const fs::path& path) { read_snapshot(path); });
}

TEST_CASE("a block of zeros, of noise, or of another checkpoint in the midst of a checkpoint is refused") {
  const TemporaryDirectory directory;
  const fs::path path = directory.path() / "c.h5";
  write_checkpoint(path, make_image(300, 120, 1), record);
  const std::string sound = read_file(path);
  write_checkpoint(path, make_image(300, 120, 2), record);
  const std::string other = read_file(path);
  REQUIRE(other.size() == sound.size());
  for (std::size_t at = 0; at + 4096 < sound.size(); at += 4096)
    for (int kind = 0; kind < 3; ++kind) {
      std::string bytes = sound;
      for (std::size_t i = at; i < at + 4096; ++i)
        bytes[i] = kind == 0   ? '\0'
                   : kind == 1 ? static_cast<char>(random_bits(1, i, RandomPurpose::choice))
                               : other[i];
      if (bytes == sound) continue;
      write_bytes(path, bytes);
      INFO("block at " << at << ", kind " << kind);
      CHECK_FALSE(refusal(path, [](const fs::path& p) { read_checkpoint(p); }).empty());
    }
}

TEST_CASE("a full disk is named, however little room is missing, and the old checkpoint stays as it was") {
  const TemporaryDirectory directory;
  const fs::path disk = directory.path() / "disk";
  const SmallDisk small(disk, "size=1m");
  if (!small.is_mounted()) {
    WARN("skipped: mounting a small disk needs root");
    return;
  }
  const fs::path path = disk / "c.h5";
  write_checkpoint(path, make_image(100, 7), record);
  const std::string old = read_file(path);
  const Image larger = make_image(2000, 8);  // some 600 kB
  std::set<std::string> messages;
  // Room from nothing up to just too little.
  for (std::size_t ballast = 1000; ballast >= 300; ballast -= 20) {
    const fs::path filler = disk / "filler";
    write_bytes(filler, std::string(ballast * 1024, 'f'));
    try {
      write_checkpoint(path, larger, record);
      REQUIRE(read_checkpoint(path).image.step == 8);  // enough room: then it must be whole
      write_bytes(path, old);
    } catch (const StorageError& error) {
      messages.insert(error.what());
      CHECK(error.path == path);
      CHECK_THAT(error.what(), Catch::Contains(path.string()) && Catch::Contains("no space left on the disk"));
    }
    CHECK(read_file(path) == old);
    fs::remove(filler);
    CHECK(n_files(disk) == 1);
  }
  CHECK(messages == std::set<std::string>{path.string() + ": cannot be written: no space left on the disk"});
}

TEST_CASE("a directory that is missing or cannot be written is named, and the old checkpoint stays as it was") {
  const TemporaryDirectory directory;
  const fs::path missing = directory.path() / "no" / "c.h5";
  CHECK_THROWS_WITH(write_checkpoint(missing, make_image(3), record),
                    missing.string() + ": cannot be written: no such file or directory");
  const fs::path disk = directory.path() / "disk";
  SmallDisk small(disk, "size=4m");
  if (!small.is_mounted()) {
    WARN("skipped: mounting a read-only disk needs root");
    return;
  }
  const fs::path path = disk / "c.h5";
  write_checkpoint(path, make_image(3, 7), record);
  REQUIRE(::mount(nullptr, disk.c_str(), nullptr, MS_REMOUNT | MS_RDONLY, nullptr) == 0);
  CHECK_THROWS_WITH(write_checkpoint(path, make_image(3, 8), record),
                    path.string() + ": cannot be written: the file system is read-only");
  CHECK(read_checkpoint(path).image.step == 7);
}
