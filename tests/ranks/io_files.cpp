// Checkpoints and snapshots of several ranks: the same file as one rank writes, read by any number of ranks, whole or
// not at all.
#include <fcntl.h>
#include <sys/mount.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <set>
#include <thread>

#include "io/checkpoint/checkpoint.hpp"
#include "io/snapshot/compare.hpp"
#include "io/snapshot/describe.hpp"
#include "io/snapshot/series.hpp"
#include "io/snapshot/snapshot.hpp"
#include "tests/ranks/ranks.hpp"
#include "tests/unit/io_images.hpp"

using namespace moraine;
using moraine::ranks::is_same_on_all;
using moraine::ranks::SharedDirectory;
using moraine::testing::add_gas;
using moraine::testing::is_same;
using moraine::testing::make_image;
namespace fs = std::filesystem;

namespace {

const RunRecord record{"title = \"a bed\"\n", "0.1.0", "abc123"};

/// Where the rows of each rank begin: as a share of all rows, for ranks 0, 1, ... and the end.
using Cuts = std::vector<double>;

std::vector<Cuts> some_cuts(int n_ranks) {
  const auto n = static_cast<std::size_t>(n_ranks);
  Cuts even(n + 1), uneven(n + 1), all_last(n + 1, 0.0), all_first(n + 1, 1.0), outer(n + 1, 0.4);
  for (std::size_t i = 0; i <= n; ++i) {
    even[i] = static_cast<double>(i) / static_cast<double>(n);
    uneven[i] = even[i] * even[i];
  }
  all_last[n] = outer[n] = 1.0;
  all_first[0] = outer[0] = 0.0;
  return {even, uneven, all_last, all_first, outer};
}

template <class T>
std::vector<T> part_of(const std::vector<T>& rows, std::uint64_t first, std::uint64_t n, std::size_t width = 1) {
  const auto begin = rows.begin() + static_cast<std::ptrdiff_t>(first * width);
  return rows.empty() ? rows : std::vector<T>(begin, begin + static_cast<std::ptrdiff_t>(n * width));
}

using Share = std::function<RowRange(std::uint64_t n_rows)>;

/// One rank's rows of a whole image.
Image rows_of(const Image& whole, const Share& share) {
  Image image = whole;
  const RowRange grains = share(whole.n_grains);
  for (FieldArray& array : image.fields) {
    const auto width = static_cast<std::size_t>(info(array.field).components);
    array.reals = part_of(array.reals, grains.first, grains.n, width);
    array.gids = part_of(array.gids, grains.first, grains.n, width);
    array.indices = part_of(array.indices, grains.first, grains.n, width);
  }
  const RowRange pairs = share(whole.pairs.size()), walls = share(whole.walls.size());
  image.pairs = part_of(whole.pairs, pairs.first, pairs.n);
  image.walls = part_of(whole.walls, walls.first, walls.n);
  const RowRange further = share(whole.further.size());
  image.further = part_of(whole.further, further.first, further.n);
  for (GridArray& array : image.grids) {
    const RowRange values = share(array.values.size());
    array.values = part_of(array.values, values.first, values.n);
  }
  return image;
}

Image rows_of(const Image& whole, const World& world, const Cuts& cuts) {
  const auto rank = static_cast<std::size_t>(world.rank());
  return rows_of(whole, [&](std::uint64_t n) {
    const auto at = [&](std::size_t i) { return static_cast<std::uint64_t>(cuts[i] * static_cast<double>(n)); };
    return RowRange{at(rank), at(rank + 1) - at(rank)};
  });
}

Image equal_share(const Image& whole, const World& world) {
  return rows_of(whole, [&](std::uint64_t n) { return share_of(n, world); });
}

/// An image of grains and gas.
Image make_bed(std::uint64_t n_grains, std::uint64_t step = 120, std::uint64_t seed = 1) {
  Image image = make_image(n_grains, step, seed);
  add_gas(image, {5, 4, 3});
  return image;
}

/// This rank's rows, shared out evenly, of an image that all ranks invent alike.
Image even_rows(std::uint64_t n_grains, std::uint64_t step = 120, std::uint64_t seed = 1) {
  return rows_of(make_bed(n_grains, step, seed), ranks::world(), some_cuts(ranks::world().size())[0]);
}

/// What the call throws, which must be the same on all ranks; "" where it throws nothing.
template <class Call>
std::string common_failure(Call call) {
  std::string message;
  try {
    call();
  } catch (const StorageError& error) {
    message = error.what();
  }
  CHECK(is_same_on_all(ranks::world(), message));
  return message;
}

std::set<std::string> names_in(const fs::path& directory) {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(directory)) names.insert(entry.path().filename().string());
  return names;
}

/// The files of the ranks beside a file, in order.
std::vector<fs::path> rank_files_of(const fs::path& path) {
  std::vector<fs::path> files;
  for (const std::string& name : names_in(path.parent_path()))
    if (name.starts_with(path.stem().string() + ".rank-")) files.push_back(path.parent_path() / name);
  return files;
}

void flip_byte(const fs::path& path, std::uint64_t at) {
  FileHandle file(path, O_RDWR);
  char byte = 0;
  file.read(&byte, 1, at);
  byte = static_cast<char>(byte ^ 0x10);
  file.write(&byte, 1, at);
}

/// At the root, between two steps of all.
template <class Work>
void at_root(Work work) {
  ranks::world().wait_for_all();
  if (ranks::world().is_root()) work();
  ranks::world().wait_for_all();
}

/// A disk of its own, full quickly. Needs the right to mount, else it is not there for any rank.
class SmallDisk {
 public:
  SmallDisk(const fs::path& place, const char* size) : place_(place) {
    std::string answer;
    if (ranks::world().is_root()) {
      fs::create_directories(place_);
      if (::mount("tmpfs", place_.c_str(), "tmpfs", 0, size) == 0) answer = "mounted";
    }
    ranks::world().broadcast(answer);
    is_mounted_ = !answer.empty();
  }
  ~SmallDisk() {
    at_root([&] {
      if (is_mounted_) ::umount2(place_.c_str(), MNT_DETACH);
    });
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  bool is_mounted() const { return is_mounted_; }

 private:
  fs::path place_;
  bool is_mounted_ = false;
};

/// Files of this process cannot grow beyond so many bytes while it lives.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) {
    std::signal(SIGXFSZ, SIG_IGN);
    ::getrlimit(RLIMIT_FSIZE, &before_);
    rlimit limit = before_;
    limit.rlim_cur = bytes;
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() { ::setrlimit(RLIMIT_FSIZE, &before_); }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit before_{};
};

std::string output_of(const std::string& command) {
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  std::string output;
  std::array<char, 4096> buffer;
  for (std::size_t n; (n = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0;) output.append(buffer.data(), n);
  pclose(pipe);
  return output;
}

}  // namespace

TEST_CASE(
    "any share of the rows on the ranks, none on some or on all, gives the file that one rank writes, byte for byte") {
  const World& world = ranks::world();
  const SharedDirectory directory(world);
  for (const std::uint64_t n : {0u, 1u, 2u, 700u}) {
    Image whole = make_image(n);
    if (n != 1) add_gas(whole, {7, 5, 3});
    at_root([&] {
      write_checkpoint(directory.path() / "alone.h5", whole, record);
      write_snapshot(directory.path() / "alone_s.h5", whole);
    });
    for (const Cuts& cuts : some_cuts(world.size())) {
      write_checkpoint(directory.path() / "c.h5", rows_of(whole, world, cuts), record, world);
      write_snapshot(directory.path() / "s.h5", rows_of(whole, world, cuts), world);
      CHECK(read_file(directory.path() / "c.h5") == read_file(directory.path() / "alone.h5"));
      CHECK(read_file(directory.path() / "s.h5") == read_file(directory.path() / "alone_s.h5"));
      at_root([&] {
        CHECK(names_in(directory.path()) == std::set<std::string>{"alone.h5", "alone_s.h5", "c.h5", "s.h5"});
      });
    }
  }
}

TEST_CASE("more rows than are written at a time, on ranks of which one has none, give the file that one rank writes") {
  const World& world = ranks::world();
  const SharedDirectory directory(world);
  Image whole = make_image(200'000);
  add_gas(whole, {61, 67, 43});
  at_root([&] { write_checkpoint(directory.path() / "alone.h5", whole, record); });
  write_checkpoint(directory.path() / "c.h5", rows_of(whole, world, some_cuts(world.size()).back()), record, world);
  CHECK(read_file(directory.path() / "c.h5") == read_file(directory.path() / "alone.h5"));
  CHECK(is_same(read_checkpoint(directory.path() / "c.h5", world).image, equal_share(whole, world)));
}

TEST_CASE("a scene without rotation, energies and touching grains gives the same file on any number of ranks") {
  const World& world = ranks::world();
  const SharedDirectory directory(world);
  Image whole = make_image(50);
  std::erase_if(whole.fields, [](const FieldArray& array) { return info(array.field).need != Need::always; });
  whole.pairs.clear();
  whole.further.clear();
  for (WallHistory& wall : whole.walls) {
    wall.energy = wall.bond = 0.0;
    std::fill_n(wall.angle, 3, 0.0);
  }
  at_root([&] { write_checkpoint(directory.path() / "alone.h5", whole, record); });
  for (const bool distributed : {false, true}) {
    const fs::path path = directory.path() / (distributed ? "d.h5" : "c.h5");
    write_checkpoint(path, equal_share(whole, world), record, world, distributed);
    CHECK(is_same(read_checkpoint(path, world).image, equal_share(whole, world)));
    if (!distributed) CHECK(read_file(path) == read_file(directory.path() / "alone.h5"));
  }
}

TEST_CASE("an energy that only the last rank has is not lost, and a single one in the midst of zeros is enough") {
  const World& world = ranks::world();
  const SharedDirectory directory(world);
  Image whole = make_image(50);
  for (PairHistory& pair : whole.pairs) pair.energy = 0.0;
  whole.pairs.back().energy = 0.125;
  for (const bool distributed : {false, true}) {
    const fs::path path = directory.path() / (distributed ? "d.h5" : "c.h5");
    write_checkpoint(path, equal_share(whole, world), record, world, distributed);
    CHECK(is_same(read_checkpoint(path).image, whole));
  }
}

TEST_CASE("any number of ranks reads a file of any number of ranks, each its equal share") {
  const World& world = ranks::world();
  const SharedDirectory directory(world);
  for (const std::uint64_t n : {0u, 2u, 1000u}) {
    Image whole = make_image(n);
    add_gas(whole, {4, 9, 6});
    for (int n_writing = 1; n_writing <= world.size(); ++n_writing)
      for (const bool distributed : {false, true}) {
        const fs::path path = directory.path() / "c.h5";
        if (const auto writing = world.first(n_writing))
          write_checkpoint(path, equal_share(whole, *writing), record, *writing, distributed);
        world.wait_for_all();
        for (int n_reading = 1; n_reading <= world.size(); ++n_reading)
          if (const auto reading = world.first(n_reading)) {
            const Checkpoint read = read_checkpoint(path, *reading);
            CHECK(is_same(read.image, equal_share(whole, *reading)));
            CHECK(read.record.scene == record.scene);
            CHECK(read.record.commit == record.commit);
          }
        world.wait_for_all();
      }
  }
}

TEST_CASE("a distributed file of any share of the rows reads like the shared one, by every reader of ours") {
  const World& world = ranks::world();
  const SharedDirectory directory(world);
  const fs::path shared = directory.path() / "shared.h5", parted = directory.path() / "100%s parted.h5";
  for (const std::uint64_t n : {0u, 1u, 700u}) {
    Image whole = make_image(n);
    add_gas(whole, {n == 0 ? 1 : 5, 6, n == 1 ? 1 : 4});
    for (const Cuts& cuts : some_cuts(world.size())) {
      write_checkpoint(shared, rows_of(whole, world, cuts), record, world);
      write_checkpoint(parted, rows_of(whole, world, cuts), record, world, true);
      at_root([&] {
        CHECK(rank_files_of(parted).size() == static_cast<std::size_t>(world.size()));
        CHECK(names_in(directory.path()).size() == static_cast<std::size_t>(world.size()) + 2);
        CHECK(is_same(read_checkpoint(parted).image, whole));
        CHECK(compare(read_image_file(shared).image, read_image_file(parted).image).is_equal);
      });
    }
  }
  at_root([&] {
    std::string text = describe(parted), expected = describe(shared);
    const std::size_t at = text.find("parts        3, one file a rank\n");
    CHECK(at != std::string::npos);
    text.erase(at, text.find('\n', at) + 1 - at);
    CHECK(text.substr(text.find('\n')) == expected.substr(expected.find('\n')));
  });
}

TEST_CASE(
    "h5py sees the same attributes, datasets, units and values in a distributed file as in a shared one, from "
    "anywhere") {
  const World& world = ranks::world();
  const SharedDirectory directory(world);
  write_checkpoint(directory.path() / "shared.h5", even_rows(500), record, world);
  write_checkpoint(directory.path() / "parted.h5", even_rows(500), record, world, true);
  at_root([&] {
    const std::string python = "/usr/bin/python3";
    if (std::system((python + " -c 'import h5py, numpy' >/dev/null 2>&1").c_str()) != 0) {
      WARN("skipped: no python3 with h5py");
      return;
    }
    std::ofstream(directory.path() / "script.py") << R"(
import h5py, sys
a, b = (h5py.File(name, "r") for name in sys.argv[1:])
def content(f):
    found = {}
    f.visititems(lambda name, item: found.update({name: item}) if isinstance(item, h5py.Dataset) else None)
    return found
x, y = content(a), content(b)
assert x.keys() == y.keys(), (x.keys(), y.keys())
for name in x:
    assert x[name].shape == y[name].shape and x[name].dtype == y[name].dtype, name
    assert x[name][()].tobytes() == y[name][()].tobytes() if x[name].shape else x[name][()] == y[name][()], name
    assert dict(x[name].attrs) == dict(y[name].attrs), name
for name in a.attrs:
    assert name == "format" or repr(a.attrs[name]) == repr(b.attrs[name]), name
print(len(x), sum(d.is_virtual for d in y.values()), a.attrs["format"], b.attrs["format"])
)";
    const std::string files =
        " '" + (directory.path() / "shared.h5").string() + "' '" + (directory.path() / "parted.h5").string() + "'";
    const std::string output =
        output_of("cd / && " + python + " '" + (directory.path() / "script.py").string() + "'" + files);
    // fields, five columns each of pairs and walls, seven of what both remember further, three accumulators, the scene
    CHECK(output == std::to_string(n_fields + 24) + ' ' + std::to_string(n_fields + 20) + " 1 2\n");
  });
}

TEST_CASE("a distributed checkpoint with any one byte altered, in any of its files, is refused by name") {
  const World& world = ranks::world();
  const SharedDirectory directory(world);
  const fs::path path = directory.path() / "c.h5";
  write_checkpoint(path, even_rows(40), record, world, true);
  at_root([&] {
    std::vector<fs::path> files = rank_files_of(path);
    files.push_back(path);
    for (const fs::path& file : files) {
      std::size_t n_accepted = 0;
      const std::uint64_t size = fs::file_size(file);
      for (std::uint64_t at = 0; at < size; at += at < 4000 ? 7 : 97) {
        flip_byte(file, at);
        try {
          read_checkpoint(path);
          ++n_accepted;
        } catch (const StorageError& error) {
          const std::string text = error.what();
          n_accepted += !text.starts_with(path.string() + ": ") ||
                        (file != path && text.find("its part " + file.filename().string()) == std::string::npos);
        }
        flip_byte(file, at);
      }
      INFO(file);
      CHECK(n_accepted == 0);
    }
    CHECK_NOTHROW(read_checkpoint(path));
  });
}

TEST_CASE("a part that is missing, damaged or of another file is named, in the same words on all ranks") {
  const World& world = ranks::world();
  const SharedDirectory directory(world);
  const fs::path path = directory.path() / "c.h5", other = directory.path() / "other.h5";
  write_checkpoint(path, even_rows(300), record, world, true);
  write_checkpoint(other, even_rows(300, 120, 2), record, world, true);
  const fs::path part = rank_files_of(path)[1], aside = directory.path() / "aside";
  const std::string begin = path.string() + ": cannot be used: its part " + part.filename().string();
  const auto read = [&] { read_checkpoint(path, world); };

  at_root([&] { fs::rename(part, aside); });
  CHECK(common_failure(read) == begin + " is missing");
  at_root([&] { fs::copy_file(rank_files_of(other)[1], part); });
  CHECK(common_failure(read) == begin + " belongs to another file");
  at_root([&] {
    fs::copy_file(aside, part, fs::copy_options::overwrite_existing);
    const Image whole = make_bed(300);
    const std::string radii(reinterpret_cast<const char*>(&whole.find(Field::radius)->reals[100]), 64);
    flip_byte(part, read_file(part).find(radii) + 3);
  });
  CHECK(common_failure(read) == begin + " is damaged: particles/radius does not agree with the checksum");
  CHECK(common_failure([&] { read_image_file(path); }) ==
        begin + " is damaged: particles/radius does not agree with the checksum");
  at_root([&] { fs::resize_file(part, 3000); });
  CHECK_THAT(common_failure(read), Catch::StartsWith(begin + " is cut short: 3000 "));
  at_root([&] { fs::rename(aside, part); });
  CHECK(common_failure(read).empty());
  CHECK(common_failure([&] { read_checkpoint(part, world); }) ==
        part.string() + ": is a Moraine part, expected a Moraine checkpoint");
}

TEST_CASE("what cannot be read is refused in the same words on all ranks") {
  const World& world = ranks::world();
  const SharedDirectory directory(world);
  const fs::path path = directory.path() / "c.h5";
  CHECK(common_failure([&] { read_checkpoint(path, world); }) ==
        path.string() + ": cannot be read: no such file or directory");
  write_checkpoint(path, even_rows(100), record, world);
  at_root([&] { flip_byte(path, fs::file_size(path) / 2); });
  CHECK_THAT(common_failure([&] { read_checkpoint(path, world); }),
             Catch::StartsWith(path.string() + ": is damaged: "));
}

TEST_CASE("all ranks go on from the newest sound checkpoint, shared or distributed, and name the damaged one alike") {
  const World& world = ranks::world();
  const SharedDirectory run(world);
  CHECK_FALSE(find_latest_checkpoint(run.path(), world).has_value());
  at_root([&] { fs::create_directories(checkpoint_directory(run.path())); });
  const auto place = [&](std::uint64_t step) { return checkpoint_directory(run.path()) / checkpoint_name(step); };
  write_checkpoint(place(100), even_rows(50, 100), record, world);
  write_checkpoint(place(200), even_rows(50, 200), record, world, true);
  write_checkpoint(place(300), even_rows(50, 300), record, world, true);
  at_root([&] { fs::remove(rank_files_of(place(300))[2]); });
  auto latest = find_latest_checkpoint(run.path(), world);
  CHECK((latest && latest->path == place(200) && latest->warnings.size() == 1));
  CHECK((latest && is_same(latest->checkpoint.image, equal_share(make_bed(50, 200), world))));
  CHECK(is_same_on_all(world, latest ? latest->warnings[0] : "none"));
  at_root([&] { flip_byte(rank_files_of(place(200))[0], 5000); });
  latest = find_latest_checkpoint(run.path(), world);
  CHECK((latest && latest->path == place(100) && latest->warnings.size() == 2));
  at_root([&] { flip_byte(place(100), 5000); });
  CHECK_THAT(
      common_failure([&] { find_latest_checkpoint(run.path(), world); }),
      Catch::Contains("holds no sound checkpoint") && Catch::Contains("its part checkpoint_000000000300.rank-0002"));
}

TEST_CASE("old checkpoints go with their parts, and so do the parts and passing files of interrupted writes") {
  const World& world = ranks::world();
  const SharedDirectory run(world);
  const fs::path directory = checkpoint_directory(run.path());
  at_root([&] { fs::create_directories(directory); });
  for (const std::uint64_t step : {10u, 20u, 30u})
    write_checkpoint(directory / checkpoint_name(step), even_rows(20, step), record, world, step != 20);
  at_root([&] {
    for (const char* name :
         {"checkpoint_000000000040.rank-0000.0123abcd.h5", "checkpoint_000000000040.rank-0001.h5.tmp",
          "checkpoint_000000000040.h5.tmp", "checkpoint_000000000030.rank-0001.0123abcd.h5"})
      std::ofstream(directory / name) << "left by a crash";
    remove_old_checkpoints(run.path(), 2);
    std::set<std::string> expected{checkpoint_name(20), checkpoint_name(30)};
    for (const fs::path& path : rank_files_of(directory / checkpoint_name(30)))
      expected.insert(path.filename().string());
    CHECK(expected.size() == 5);
    CHECK(names_in(directory) == expected);
    CHECK(read_checkpoint(directory / checkpoint_name(30)).image.step == 30);
    remove_old_checkpoints(run.path(), 1);
    CHECK(names_in(directory).size() == 4);
  });
}

TEST_CASE(
    "a distributed checkpoint written anew replaces the old one with all its parts; one set aside keeps its own") {
  const World& world = ranks::world();
  const SharedDirectory directory(world);
  const fs::path path = directory.path() / "c.h5", aside = directory.path() / "c.h5.old";
  const auto n_files = [&] { return names_in(directory.path()).size(); };
  write_checkpoint(path, even_rows(60, 5, 1), record, world, true);
  const std::set<std::string> first = names_in(directory.path());
  write_checkpoint(path, even_rows(60, 5, 1), record, world, true);  // the same bits, the same names
  at_root([&] { CHECK(names_in(directory.path()) == first); });
  write_checkpoint(path, even_rows(60, 5, 2), record, world, true);
  at_root([&] {
    CHECK(n_files() == 4);
    CHECK(is_same(read_checkpoint(path).image, make_bed(60, 5, 2)));
    fs::rename(path, aside);
  });
  write_checkpoint(path, even_rows(60, 5, 3), record, world, true);
  at_root([&] {
    CHECK(n_files() == 8);
    CHECK(is_same(read_checkpoint(aside).image, make_bed(60, 5, 2)));
    CHECK(is_same(read_checkpoint(path).image, make_bed(60, 5, 3)));
    fs::remove(aside);
  });
  write_checkpoint(path, even_rows(60, 5, 4), record, world);
  at_root([&] { CHECK(names_in(directory.path()) == std::set<std::string>{"c.h5"}); });
}

TEST_CASE("a full disk gives one error on all ranks, leaves nothing behind and the old checkpoint as it was") {
  const World& world = ranks::world();
  const SharedDirectory directory(world);
  const fs::path disk = directory.path() / "disk";
  const SmallDisk small(disk, "size=2m");
  if (!small.is_mounted()) {
    if (world.is_root()) WARN("skipped: mounting a small disk needs root");
    return;
  }
  for (const bool distributed : {false, true}) {
    const fs::path path = disk / "c.h5", filler = disk / "filler";
    write_checkpoint(path, even_rows(100, 7), record, world, distributed);
    const std::set<std::string> names = names_in(disk);
    std::size_t n_refused = 0, n_written = 0;
    // From no room at all to enough.
    for (std::size_t ballast = 2000; ballast >= 400; ballast -= 100) {
      at_root([&] { std::ofstream(filler) << std::string(ballast * 1024, 'f'); });
      const std::string message =
          common_failure([&] { write_checkpoint(path, even_rows(2000, 8), record, world, distributed); });
      at_root([&] { fs::remove(filler); });
      const Checkpoint found = read_checkpoint(path);
      if (message.empty()) {
        ++n_written;
        CHECK(is_same(found.image, make_bed(2000, 8)));
        world.wait_for_all();
        write_checkpoint(path, even_rows(100, 7), record, world, distributed);
      } else {
        ++n_refused;
        CHECK_THAT(message, Catch::StartsWith((disk / "c").string()) && Catch::EndsWith("no space left on the disk"));
        CHECK(is_same(found.image, make_bed(100, 7)));
      }
      CHECK(names_in(disk) == names);
      world.wait_for_all();
    }
    CHECK(n_refused > 0);
    CHECK(n_written > 0);
  }
}

TEST_CASE("a disk that others fill as soon as there is room again gives one error, and the ranks end in peace") {
  const World& world = ranks::world();
  const SharedDirectory directory(world);
  const fs::path disk = directory.path() / "disk";
  const SmallDisk small(disk, "size=2m");
  if (!small.is_mounted()) return;
  for (const bool distributed : {false, true}) {
    const fs::path path = disk / "c.h5", filler = disk / "filler", others = disk / "others";
    write_checkpoint(path, even_rows(100, 7), record, world, distributed);
    // Room for a first file of each rank, and not for what they write; it is gone as soon as they have tried.
    at_root([&] { std::ofstream(filler) << std::string(1024 * (distributed ? 1200 : 1500), 'f'); });
    std::jthread greedy;
    if (world.is_root())
      greedy = std::jthread([&others, before = fs::space(disk).available](const std::stop_token& stop) {
        const int file = ::open(others.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
        while (!stop.stop_requested() && fs::space(others.parent_path()).available >= before) {}
        for (off_t size = 0; !stop.stop_requested();)
          if (::posix_fallocate(file, size, 4096) == 0) size += 4096;
        ::close(file);
      });
    const std::string message =
        common_failure([&] { write_checkpoint(path, even_rows(20000, 8), record, world, distributed); });
    if (greedy.joinable()) {
      greedy.request_stop();
      greedy.join();
    }
    CHECK_THAT(message, Catch::StartsWith((disk / "c").string()) && Catch::EndsWith("no space left on the disk"));
    at_root([&] {
      fs::remove(filler);
      fs::remove(others);
    });
    CHECK(is_same(read_checkpoint(path).image, make_bed(100, 7)));
    world.wait_for_all();
  }
}

TEST_CASE(
    "one rank that cannot write gives one error on all ranks, nobody waits for it, and the old checkpoint stays as it "
    "was") {
  const World& world = ranks::world();
  const SharedDirectory directory(world);
  const fs::path path = directory.path() / "c.h5";
  for (const bool distributed : {false, true})
    for (int rank = 0; rank < world.size(); ++rank) {
      write_checkpoint(path, even_rows(100, 7), record, world, distributed);
      const std::set<std::string> names = names_in(directory.path());
      world.wait_for_all();
      std::optional<FileSizeLimit> limit;
      if (world.rank() == rank) limit.emplace(200'000);
      CHECK_THAT(common_failure([&] { write_checkpoint(path, even_rows(200'000, 8), record, world, distributed); }),
                 Catch::StartsWith((directory.path() / "c").string()) && Catch::Contains("cannot be written"));
      limit.reset();
      CHECK(names_in(directory.path()) == names);
      CHECK(is_same(read_checkpoint(path, world).image, equal_share(make_bed(100, 7), world)));
    }
}

TEST_CASE("a directory that is missing is named alike on all ranks") {
  const World& world = ranks::world();
  const SharedDirectory directory(world);
  const fs::path path = directory.path() / "no" / "c.h5";
  CHECK(common_failure([&] { write_checkpoint(path, even_rows(10), record, world); }) ==
        path.string() + ": cannot be written: no such file or directory");
  CHECK(common_failure([&] { write_checkpoint(path, even_rows(10), record, world, true); }) ==
        (directory.path() / "no" / "c.rank-0000.h5").string() + ": cannot be written: no such file or directory");
}

TEST_CASE(
    "a series of shared and distributed snapshots is the series that one rank writes, and dropping one drops its "
    "parts") {
  const World& world = ranks::world();
  const SharedDirectory directory(world);
  const fs::path run = directory.path() / "run", alone = directory.path() / "alone";
  at_root([&] {
    fs::create_directories(run);
    fs::create_directories(alone);
    SnapshotSeries series(alone);
    for (const std::uint64_t step : {0u, 100u, 200u}) series.add(make_bed(40, step));
  });
  SnapshotSeries series(run);
  for (const std::uint64_t step : {0u, 100u, 200u}) series.add(even_rows(40, step), world, step == 200);
  CHECK(series.contains(200));
  at_root([&] {
    CHECK(read_file(series.file()) == read_file(SnapshotSeries(alone).file()));
    CHECK(names_in(snapshot_directory(run)).size() == 6);
    CHECK(SnapshotSeries(run).size() == 3);
    CHECK(SnapshotSeries(run).drop_from(150) == 1);
    CHECK(names_in(snapshot_directory(run)) == std::set<std::string>{snapshot_name(0), snapshot_name(100)});
  });
}
