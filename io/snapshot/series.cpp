#include "io/snapshot/series.hpp"

#include <fmt/format.h>

#include <cstdlib>
#include <stdexcept>
#include <string_view>

#include "io/checkpoint/agreement.hpp"
#include "io/checkpoint/rank_files.hpp"
#include "io/snapshot/snapshot.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view entry_start = "    <Grid Name=\"step ";
constexpr std::string_view entry_end = "    </Grid>\n";

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

std::string entry_of(const Image& image) {
  if (image.find(Field::position) == nullptr) throw std::logic_error("a snapshot needs the positions of its grains");
  std::string text =
      fmt::format("{}{}\" GridType=\"Uniform\">\n      <Time Value=\"{}\"/>\n", entry_start, image.step, image.time);
  text += fmt::format("      <Topology TopologyType=\"Polyvertex\" NumberOfElements=\"{}\" NodesPerElement=\"1\"/>\n",
                      image.n_grains);
  text += fmt::format("      <Geometry GeometryType=\"XYZ\">{}</Geometry>\n", data_item(info(Field::position), image));
  for (const FieldArray& array : image.fields) {
    const FieldInfo& row = info(array.field);
    if (array.field == Field::position) continue;
    const char* kind = row.components == 1 ? "Scalar" : row.components == 3 ? "Vector" : "Matrix";
    text += fmt::format("      <Attribute Name=\"{}\" AttributeType=\"{}\" Center=\"Node\">{}</Attribute>\n", row.name,
                        kind, data_item(row, image));
  }
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
  agree_on_root(world, directory, [&] { make_directory(directory); });
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
