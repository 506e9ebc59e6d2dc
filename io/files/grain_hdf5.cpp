// Lists of grains as HDF5: the datasets of a snapshot.
#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <utility>

#include "io/files/files.hpp"
#include "io/files/hdf5_room.hpp"
#include "kernels/base/range.hpp"

namespace moraine {

namespace {

/// A handle of the library, closed when it goes.
class Handle {
 public:
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  operator hid_t() const { return id_; }
  bool is_open() const { return id_ >= 0; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

/// Keeps the library from printing its own stack of errors: ours name the file and the dataset.
class Quiet {
 public:
  Quiet() {
    H5Eget_auto2(H5E_DEFAULT, &print_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~Quiet() { H5Eset_auto2(H5E_DEFAULT, print_, data_); }
  Quiet(const Quiet&) = delete;
  Quiet& operator=(const Quiet&) = delete;

 private:
  H5E_auto2_t print_ = nullptr;
  void* data_ = nullptr;
};

class SnapshotReader {
 public:
  explicit SnapshotReader(const std::filesystem::path& path)
      : path_(path),
        bytes_(bytes_with_rank_files(path)),
        file_(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose) {
    if (!file_.is_open()) throw FileError(fmt::format("is not an HDF5 file, or a damaged one: {}", path.string()));
  }

  bool has(const std::string& name) const {
    return H5Lexists(file_, "/particles", H5P_DEFAULT) > 0 &&
           H5Lexists(file_, ("/particles/" + name).c_str(), H5P_DEFAULT) > 0;
  }

  /// Number of rows of a dataset.
  std::uint64_t n_rows(const std::string& name, int components) const { return open(name, components).n_rows; }

  /// These rows, of `components` doubles each, of a dataset of n_rows.
  std::vector<double> read(const std::string& name, int components, std::uint64_t n_rows, Range rows) const {
    const Dataset from = open(name, components);
    if (from.n_rows != n_rows) fail(name, fmt::format("has {} rows; position has {}", from.n_rows, n_rows));
    const Handle type(H5Dget_type(from.dataset), H5Tclose);
    if (const H5T_class_t kind = H5Tget_class(type); kind != H5T_FLOAT && kind != H5T_INTEGER)
      fail(name, "does not hold numbers");
    const hsize_t begin[2] = {static_cast<hsize_t>(rows.begin), 0};
    const hsize_t count[2] = {static_cast<hsize_t>(rows.end - rows.begin), static_cast<hsize_t>(components)};
    std::vector<double> values(static_cast<std::size_t>(count[0] * count[1]));
    if (values.empty()) return values;
    const Handle memory(H5Screate_simple(2, count, nullptr), H5Sclose);
    if (H5Sselect_hyperslab(from.space, H5S_SELECT_SET, begin, nullptr, count, nullptr) < 0 ||
        H5Dread(from.dataset, H5T_NATIVE_DOUBLE, memory, from.space, H5P_DEFAULT, values.data()) < 0)
      fail(name, "cannot be read; the file is damaged");
    return values;
  }

 private:
  struct Dataset {
    Handle dataset, space;
    std::uint64_t n_rows;
  };

  [[noreturn]] void fail(const std::string& name, const std::string& what) const {
    throw FileError(fmt::format("dataset /particles/{}: {}: {}", name, what, path_.string()));
  }

  Dataset open(const std::string& name, int components) const {
    if (!has(name)) fail(name, "missing");
    const hid_t dataset = H5Dopen2(file_, ("/particles/" + name).c_str(), H5P_DEFAULT);
    if (dataset < 0) fail(name, "cannot be opened");
    const hid_t space = H5Dget_space(dataset);
    hsize_t size[2] = {0, 1};
    const int rank = H5Sget_simple_extent_ndims(space);
    Dataset opened{{dataset, H5Dclose}, {space, H5Sclose}, 0};
    if (rank < 1 || rank > 2) fail(name, fmt::format("has {} dimensions; expected {}", rank, components == 1 ? 1 : 2));
    H5Sget_simple_extent_dims(space, size, nullptr);
    if (size[1] != static_cast<hsize_t>(components))
      fail(name, fmt::format("has {} columns; expected {}", size[1], components));
    const double n_values = static_cast<double>(size[0]) * static_cast<double>(size[1]);
    if (!files::has_room(dataset, n_values, 1, bytes_))
      fail(name, "says that it has more values than the file can hold");
    opened.n_rows = size[0];
    return opened;
  }

  /// Of the file, and of those of the ranks that it may show as its own.
  static std::uint64_t bytes_with_rank_files(const std::filesystem::path& path) {
    std::error_code ignored;
    std::uint64_t bytes = std::filesystem::file_size(path, ignored);
    const std::string begin = path.stem().string() + ".rank-";
    for (const auto& entry :
         std::filesystem::directory_iterator(std::filesystem::absolute(path).parent_path(), ignored))
      if (entry.path().filename().string().starts_with(begin)) bytes += entry.file_size(ignored);
    return bytes;
  }

  const std::filesystem::path& path_;
  std::uint64_t bytes_;
  Handle file_;
};

Vec3 row(const std::vector<double>& values, std::size_t i) {
  return {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
}

bool is_material(double number, const GrainFileContext& context) {
  return number >= 0.0 && number < static_cast<double>(context.materials.size());
}

}  // namespace

files::ShareOfList files::load_grain_hdf5(const std::filesystem::path& file, const GrainFileContext& context) {
  const Quiet quiet;
  const SnapshotReader in(file);
  const std::uint64_t n = in.n_rows("position", 3);
  if (n == 0) throw FileError(fmt::format("dataset /particles/position: holds no grains: {}", file.string()));
  ShareOfList read{{}, RowProblems(1)};
  ListedGrains& listed = read.list;
  listed.source = file.filename().string();
  listed.share = context.share;
  listed.share.block = (n + listed.share.n_ranks - 1) / listed.share.n_ranks;
  const std::uint64_t begin = std::min(n, listed.share.row(0)), end = std::min(n, begin + listed.share.block);
  const Range rows{static_cast<std::int64_t>(begin), static_cast<std::int64_t>(end)};
  const auto read_if_there = [&](const char* name, int components) {
    return in.has(name) ? in.read(name, components, n, rows) : std::vector<double>();
  };
  const std::vector<double> positions = in.read("position", 3, n, rows);
  const std::vector<double> radii = read_if_there("radius", 1);
  const std::vector<double> velocities = read_if_there("velocity", 3);
  const std::vector<double> spins = read_if_there("angular_velocity", 3);
  const std::vector<double> materials = read_if_there("material", 1);

  listed.has_radius = in.has("radius");
  listed.has_velocity = in.has("velocity") || in.has("angular_velocity");
  listed.has_material = in.has("material");
  listed.grains.resize(positions.size() / 3);
  for (std::size_t i = 0; i < listed.grains.size() && read.problems.empty(); ++i) {
    GrainSeed& seed = listed.grains[i];
    seed.position = row(positions, i);
    if (!radii.empty()) seed.radius = radii[i];
    seed.velocity = velocities.empty() ? context.velocity : row(velocities, i);
    seed.angular_velocity = spins.empty() ? context.angular_velocity : row(spins, i);
    seed.material = context.material.value_or(0);
    if (materials.empty() || context.material) continue;
    if (is_material(materials[i], context))
      seed.material = static_cast<std::uint16_t>(materials[i]);
    else
      read.problems.add(begin + i,
                        fmt::format("dataset /particles/material: grain {} has material number {}, the scene has {} "
                                    "materials: {}",
                                    begin + i, materials[i], context.materials.size(), file.string()));
  }
  return read;
}

}  // namespace moraine
