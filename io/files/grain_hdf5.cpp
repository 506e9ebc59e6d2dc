// Lists of grains as HDF5: the datasets of a snapshot.
#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>

#include "io/files/files.hpp"

namespace moraine {

namespace {

/// A handle of the library, closed when it goes.
class Handle {
 public:
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
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
      : path_(path), file_(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose) {
    if (!file_.is_open()) throw FileError(fmt::format("is not an HDF5 file, or a damaged one: {}", path.string()));
  }

  bool has(const std::string& name) const {
    return H5Lexists(file_, "/particles", H5P_DEFAULT) > 0 &&
           H5Lexists(file_, ("/particles/" + name).c_str(), H5P_DEFAULT) > 0;
  }

  /// Rows of `components` doubles; `rows` is the number expected, or -1 for any.
  std::vector<double> read(const std::string& name, int components, std::int64_t rows) const {
    const std::string dataset_name = "/particles/" + name;
    const auto fail = [&](const std::string& what) {
      throw FileError(fmt::format("dataset {}: {}: {}", dataset_name, what, path_.string()));
    };
    if (!has(name)) fail("missing");
    const Handle dataset(H5Dopen2(file_, dataset_name.c_str(), H5P_DEFAULT), H5Dclose);
    if (!dataset.is_open()) fail("cannot be opened");
    const Handle space(H5Dget_space(dataset), H5Sclose);
    hsize_t size[2] = {0, 1};
    const int rank = H5Sget_simple_extent_ndims(space);
    if (rank < 1 || rank > 2) fail(fmt::format("has {} dimensions; expected {}", rank, components == 1 ? 1 : 2));
    H5Sget_simple_extent_dims(space, size, nullptr);
    if (size[1] != static_cast<hsize_t>(components))
      fail(fmt::format("has {} columns; expected {}", size[1], components));
    if (rows >= 0 && size[0] != static_cast<hsize_t>(rows))
      fail(fmt::format("has {} rows; position has {}", size[0], rows));
    const Handle type(H5Dget_type(dataset), H5Tclose);
    if (const H5T_class_t kind = H5Tget_class(type); kind != H5T_FLOAT && kind != H5T_INTEGER)
      fail("does not hold numbers");
    std::vector<double> values(static_cast<std::size_t>(size[0] * size[1]));
    if (!values.empty() && H5Dread(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0)
      fail("cannot be read; the file is damaged");
    return values;
  }

 private:
  const std::filesystem::path& path_;
  Handle file_;
};

Vec3 row(const std::vector<double>& values, std::size_t i) {
  return {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
}

std::uint16_t material_number(double value, std::size_t grain, const GrainFileContext& context,
                              const std::filesystem::path& file) {
  if (value >= 0.0 && value < static_cast<double>(context.materials.size())) return static_cast<std::uint16_t>(value);
  throw FileError(
      fmt::format("dataset /particles/material: grain {} has material number {}, the scene has {} materials: {}", grain,
                  value, context.materials.size(), file.string()));
}

}  // namespace

ListedGrains files::load_grain_hdf5(const std::filesystem::path& file, const GrainFileContext& context) {
  const Quiet quiet;
  const SnapshotReader in(file);
  const std::vector<double> positions = in.read("position", 3, -1);
  const std::size_t n = positions.size() / 3;
  const auto rows = static_cast<std::int64_t>(n);
  if (n == 0) throw FileError(fmt::format("dataset /particles/position: holds no grains: {}", file.string()));
  const auto read_if_there = [&](const char* name, int components) {
    return in.has(name) ? in.read(name, components, rows) : std::vector<double>();
  };
  const std::vector<double> radii = read_if_there("radius", 1);
  const std::vector<double> velocities = read_if_there("velocity", 3);
  const std::vector<double> spins = read_if_there("angular_velocity", 3);
  const std::vector<double> materials = read_if_there("material", 1);

  ListedGrains listed;
  listed.source = file.filename().string();
  listed.has_radius = !radii.empty();
  listed.has_velocity = !velocities.empty() || !spins.empty();
  listed.has_material = !materials.empty();
  listed.grains.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    GrainSeed& seed = listed.grains[i];
    seed.position = row(positions, i);
    if (!radii.empty()) seed.radius = radii[i];
    seed.velocity = velocities.empty() ? context.velocity : row(velocities, i);
    seed.angular_velocity = spins.empty() ? context.angular_velocity : row(spins, i);
    const bool is_told = materials.empty() || context.material;
    seed.material = is_told ? context.material.value_or(0) : material_number(materials[i], i, context, file);
  }
  return listed;
}

}  // namespace moraine
