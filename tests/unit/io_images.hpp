// Images with invented but well-spread content, and places to write them, for tests of files.
#pragma once

#include <algorithm>
#include <array>
#include <filesystem>
#include <string>

#include <unistd.h>

#include "engine/run/image.hpp"
#include "kernels/base/random.hpp"

namespace moraine::testing {

/// A directory of its own under the system's temporary one, removed at the end of the test.
class TemporaryDirectory {
 public:
  TemporaryDirectory() {
    std::string name = (std::filesystem::temp_directory_path() / "moraine-test-XXXXXX").string();
    path_ = mkdtemp(name.data());
  }
  ~TemporaryDirectory() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// An image with every field of the table, pair and wall histories, and accumulators.
inline Image make_image(std::uint64_t n_grains, std::uint64_t step = 120, std::uint64_t seed = 1) {
  Image image;
  image.step = step;
  image.time_step = 1e-4;
  image.time = static_cast<double>(step) * image.time_step;
  image.domain = {{0, -1, 0}, {2, 1, 3}};
  image.periodic = {true, false, false};
  image.n_grains = n_grains;
  image.hash = {0x0123456789abcdefULL + seed, 0xfedcba9876543210ULL};
  std::uint64_t counter = 0;
  const auto draw = [&] { return random_uniform(seed, counter++, RandomPurpose::position); };
  for (const FieldInfo& row : field_table) {
    FieldArray array;
    array.field = row.field;
    const std::uint64_t n = n_grains * static_cast<std::uint64_t>(row.components);
    for (std::uint64_t i = 0; i < n; ++i) {
      if (row.type == FieldType::real)
        array.reals.push_back(row.field == Field::radius ? 0.02 + 0.03 * draw() : draw());
      if (row.type == FieldType::gid) array.gids.push_back(3 * i + 1);
      if (row.type == FieldType::index) array.indices.push_back(static_cast<std::uint16_t>(i % 3));
    }
    image.fields.push_back(std::move(array));
  }
  for (std::uint64_t i = 0; i + 1 < n_grains; ++i)
    image.pairs.push_back({3 * i + 1, 3 * i + 4, i % 2, {draw(), -draw(), 1e-300}, draw()});
  for (std::uint64_t i = 0; i < n_grains; i += 2)
    image.walls.push_back({3 * i + 1, i % 6, {0, 0, 1}, {draw(), 0, -0.0}, draw(), {draw(), 0, draw()}, 1.0});
  for (std::uint64_t i = 0; i + 1 < n_grains; i += 3)
    image.further.push_back({3 * i + 1, 3 * i + 4, i % 2, {draw(), draw(), -draw()}, 1.0});
  image.accumulators["born"] = {static_cast<double>(n_grains)};
  image.accumulators["probe/wall 50%"] = {draw(), draw(), 0.1};
  image.accumulators["nothing"] = {};
  return image;
}

/// Adds gas of `cells` to an image: two quantities on cells, in the order of their names, and one on faces along z.
inline void add_gas(Image& image, std::array<int, 3> cells, std::uint64_t seed = 7) {
  std::uint64_t counter = 0;
  const auto add = [&](const char* name, const char* unit, std::array<int, 3> n) {
    GridArray array{name, unit, n, {}};
    array.values.resize(static_cast<std::size_t>(n[0]) * static_cast<std::size_t>(n[1]) *
                        static_cast<std::size_t>(n[2]));
    for (double& value : array.values) value = random_uniform(seed, counter++, RandomPurpose::position);
    image.grids.push_back(std::move(array));
  };
  add("a/b & \"c\"", "", cells);
  add("face_z", "m/s", {cells[0], cells[1], cells[2] + 1});
  add("pressure", "Pa", cells);
}

inline bool is_same(const GridArray& a, const GridArray& b) {
  return a.name == b.name && a.unit == b.unit && a.n == b.n && a.values == b.values;
}

/// Equal in all that a checkpoint must keep, bit for bit.
inline bool is_same(const Image& a, const Image& b) {
  if (a.step != b.step || a.time != b.time || a.time_step != b.time_step || !(a.domain == b.domain) ||
      a.periodic != b.periodic || a.n_grains != b.n_grains || !(a.hash == b.hash) || a.fields.size() != b.fields.size())
    return false;
  for (std::size_t i = 0; i < a.fields.size(); ++i)
    if (a.fields[i].field != b.fields[i].field || a.fields[i].reals != b.fields[i].reals ||
        a.fields[i].gids != b.fields[i].gids || a.fields[i].indices != b.fields[i].indices)
      return false;
  if (!std::equal(a.grids.begin(), a.grids.end(), b.grids.begin(), b.grids.end(),
                  [](const GridArray& x, const GridArray& y) { return is_same(x, y); }))
    return false;
  return a.pairs == b.pairs && a.further == b.further && a.walls == b.walls && a.accumulators == b.accumulators;
}

}  // namespace moraine::testing
