#include "io/snapshot/series.hpp"

#include <fmt/format.h>

#include <array>
#include <cstdlib>
#include <stdexcept>
#include <string_view>

#include "io/checkpoint/agreement.hpp"
#include "io/checkpoint/image_file.hpp"
#include "io/checkpoint/rank_files.hpp"
#include "io/checkpoint/subdirectory.hpp"
#include "io/snapshot/snapshot.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view entry_start = "    <Grid Name=\"step ";
constexpr std::string_view entry_end = "\n    </Grid>\n";

/// Types as ParaView's readers know them: they have no unsigned 64-bit integers, and HDF5 converts on the way.
std::string data_item(const FieldInfo& row, const Image& image) {
  const char* type = row.type == FieldType::real ? "Float" : "Int";
  const int precision = row.type == FieldType::index ? 4 : 8;
  const std::string shape =
      row.components == 1 ? fmt::format("{}", image.n_grains) : fmt::format("{} {}", image.n_grains, row.components);
  return fmt::format(
      "<DataItem Format=\"HDF\" NumberType=\"{}\" Precision=\"{}\" "
      "Dimensions=\"{}\">snapshots/{}:/particles/{}</DataItem>",
      type, precision, shape, snapshot_name(image.step), row.name);
}

/// Names are free text.
std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text)
    out += c == '&' ? "&amp;" : c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '"' ? "&quot;" : std::string(1, c);
  return out;
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
    text += fmt::format("      <Attribute Name=\"{}\" AttributeType=\"{}\" Center=\"Node\">{}</Attribute>\n", row.name,
                        kind, data_item(row, image));
  }
  return text;
}

/// The cells of the gas; quantities on faces are left out, ParaView has no place for them.
std::string gas_of(const Image& image) {
  const std::array<int, 3> n = gas_cells(image);
  const Vec3 low = image.domain.low, size = image.domain.size();
  const auto triple = [](double z, double y, double x) {
    return fmt::format(
        "<DataItem Format=\"XML\" NumberType=\"Float\" Precision=\"8\" Dimensions=\"3\">{} {} {}</DataItem>", z, y, x);
  };
  std::string text = fmt::format("      <Topology TopologyType=\"3DCoRectMesh\" Dimensions=\"{} {} {}\"/>\n", n[2] + 1,
                                 n[1] + 1, n[0] + 1);
  text += fmt::format("      <Geometry GeometryType=\"ORIGIN_DXDYDZ\">{}{}</Geometry>\n", triple(low.z, low.y, low.x),
                      triple(size.z / n[2], size.y / n[1], size.x / n[0]));
  for (const GridArray& array : image.grids)
    if (array.n == n)
      text += fmt::format(
          "      <Attribute Name=\"{}\" AttributeType=\"Scalar\" Center=\"Cell\"><DataItem Format=\"HDF\" "
          "NumberType=\"Float\" Precision=\"8\" Dimensions=\"{} {} {}\">snapshots/{}:/{}</DataItem></Attribute>\n",
          escaped(array.name), n[2], n[1], n[0], snapshot_name(image.step), escaped(gas_dataset(array)));
  return text;
}

/// The grains alone, or grains and gas side by side.
std::string entry_of(const Image& image) {
  if (image.find(Field::position) == nullptr) throw std::logic_error("a snapshot needs the positions of its grains");
  const std::string time = fmt::format("      <Time Value=\"{}\"/>\n", image.time);
  std::string text;
  if (image.grids.empty()) {
    text = fmt::format("{}{}\" GridType=\"Uniform\">\n", entry_start, image.step) + time + grains_of(image);
  } else {
    const auto part = [](const char* name, const std::string& content) {
      return fmt::format("      <Grid Name=\"{}\" GridType=\"Uniform\">\n{}      </Grid>\n", name, content);
    };
    text = fmt::format("{}{}\" GridType=\"Collection\" CollectionType=\"Spatial\">\n", entry_start, image.step) + time +
           part("grains", grains_of(image)) + part("gas", gas_of(image));
  }
  text.pop_back();  // the end begins with a new line
  return text.append(entry_end);
}

/// The entries of a series file that we wrote, by step.
std::map<std::uint64_t, std::string> parse_entries(const std::string& text) {
  std::map<std::uint64_t, std::string> entries;
  for (std::size_t at = text.find(entry_start); at != std::string::npos; at = text.find(entry_start, at + 1)) {
    const std::size_t end = text.find(entry_end, at);
    if (end == std::string::npos) break;
    entries[std::strtoull(text.c_str() + at + entry_start.size(), nullptr, 10)] =
        text.substr(at, end + entry_end.size() - at);
  }
  return entries;
}

}  // namespace

SnapshotSeries::SnapshotSeries(const fs::path& run_directory) : run_directory_(run_directory) {
  std::map<std::uint64_t, std::string> listed;
  if (fs::exists(file())) listed = parse_entries(read_file(file()));
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

void SnapshotSeries::write() const {
  std::string text =
      "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<!DOCTYPE Xdmf SYSTEM \"Xdmf.dtd\" []>\n<Xdmf Version=\"2.0\">\n "
      "<Domain>\n"
      "  <Grid Name=\"grains\" GridType=\"Collection\" CollectionType=\"Temporal\">\n";
  for (const auto& [step, entry] : entries_) text += entry;
  text += "  </Grid>\n </Domain>\n</Xdmf>\n";
  write_file(file(), text);
}

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
