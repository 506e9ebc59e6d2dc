#include "io/snapshot/series.hpp"

#include <fmt/format.h>

#include <array>
#include <stdexcept>

#include "io/checkpoint/agreement.hpp"
#include "io/checkpoint/image_file.hpp"
#include "io/checkpoint/rank_files.hpp"
#include "io/checkpoint/subdirectory.hpp"
#include "io/snapshot/snapshot.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

std::string file_of(const Image& image) { return "snapshots/" + snapshot_name(image.step); }

/// Types as ParaView's readers know them: they have no unsigned 64-bit integers, and HDF5 converts on the way.
std::string data_item(const FieldInfo& row, const Image& image) {
  const std::string shape =
      row.components == 1 ? fmt::format("{}", image.n_grains) : fmt::format("{} {}", image.n_grains, row.components);
  return xdmf::data_item(file_of(image), "particles/" + std::string(row.name), shape,
                         row.type == FieldType::real ? "Float" : "Int", row.type == FieldType::index ? 4 : 8);
}

/// The grains: topology, geometry, attributes.
std::string grains_of(const Image& image) {
  std::string text = fmt::format(
      "      <Topology TopologyType=\"Polyvertex\" NumberOfElements=\"{}\" NodesPerElement=\"1\"/>\n", image.n_grains);
  text += fmt::format("      <Geometry GeometryType=\"XYZ\">{}</Geometry>\n", data_item(info(Field::position), image));
  for (const FieldArray& array : image.fields) {
    const FieldInfo& row = info(array.field);
    if (array.field == Field::position) continue;
    const char* kind = row.components == 1 ? "Scalar" : row.components == 3 ? "Vector" : "Matrix";
    text += xdmf::attribute(std::string(row.name), kind, "Node", data_item(row, image));
  }
  return text;
}

/// The cells of the gas; quantities on faces are left out, ParaView has no place for them.
std::string gas_of(const Image& image) {
  const std::array<int, 3> n = gas_cells(image);
  std::string text = xdmf::cells(n, image.domain);
  for (const GridArray& array : image.grids)
    if (array.n == n) text += xdmf::on_cells(array.name, n, file_of(image), gas_dataset(array));
  return text;
}

/// The triangles of a wall that has a force map.
std::string wall_of(const WallMap& map, const Image& image) {
  const std::size_t n = map.n_triangles();
  const auto item = [&](const char* what, const std::string& shape, const char* type = "Float") {
    return xdmf::data_item(file_of(image), map_dataset(map, what), shape, type);
  };
  const std::string threes = fmt::format("{} 3", n), ones = fmt::format("{}", n);
  return fmt::format("      <Topology TopologyType=\"Triangle\" NumberOfElements=\"{}\">{}</Topology>\n", n,
                     item("triangles", threes, "Int")) +
         fmt::format("      <Geometry GeometryType=\"XYZ\">{}</Geometry>\n",
                     item("points", fmt::format("{} 3", 3 * n))) +
         xdmf::attribute("force", "Vector", "Cell", item("force", threes)) +
         xdmf::attribute("pressure", "Scalar", "Cell", item("pressure", ones)) +
         xdmf::attribute("shear", "Scalar", "Cell", item("shear", ones));
}

/// The grains alone, or grains, gas and walls side by side.
std::string entry_of(const Image& image) {
  if (image.find(Field::position) == nullptr) throw std::logic_error("a snapshot needs the positions of its grains");
  if (image.grids.empty() && image.maps.empty()) return xdmf::entry(image.step, image.time, grains_of(image));
  std::string parts = xdmf::part("grains", grains_of(image));
  if (!image.grids.empty()) parts += xdmf::part("gas", gas_of(image));
  for (const WallMap& map : image.maps) parts += xdmf::part(map.name, wall_of(map, image));
  return xdmf::entry_of_parts(image.step, image.time, parts);
}

}  // namespace

SnapshotSeries::SnapshotSeries(const fs::path& run_directory) : run_directory_(run_directory) {
  xdmf::Entries listed;
  if (fs::exists(file())) listed = xdmf::parse(read_file(file()));
  for (const fs::path& path : list_snapshots(run_directory_)) {
    const std::uint64_t step = *snapshot_step(path);
    const auto known = listed.find(step);
    if (known != listed.end()) {
      entries_.insert(*known);
      continue;
    }
    const Image image = read_snapshot(path);
    if (image.step == step) entries_[step] = entry_of(image);
  }
}

void SnapshotSeries::write() const { write_file(file(), xdmf::series("grains", entries_)); }

void SnapshotSeries::add(const Image& image, const World& world, bool distributed) {
  const std::string entry = entry_of(image);
  const fs::path directory = snapshot_directory(run_directory_);
  agree_on_root(world, directory, [&] { make_subdirectory(directory); });
  write_snapshot(directory / snapshot_name(image.step), image, world, distributed);
  entries_[image.step] = entry;
  agree_on_root(world, file(), [&] { write(); });
}

int SnapshotSeries::drop_from(std::uint64_t step) {
  int n_dropped = 0;
  // The series first, so that it never lists a file that is gone.
  std::erase_if(entries_, [&](const auto& entry) { return entry.first >= step; });
  write();
  for (const fs::path& path : list_snapshots(run_directory_)) {
    if (*snapshot_step(path) < step) continue;
    remove_with_rank_files(path);
    ++n_dropped;
  }
  return n_dropped;
}

}  // namespace moraine
