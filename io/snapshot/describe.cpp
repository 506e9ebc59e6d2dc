#include "io/snapshot/describe.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "io/snapshot/snapshot.hpp"

namespace moraine {

namespace {

struct Extremes {
  double least = 0.0, greatest = 0.0;
  std::size_t n_not_finite = 0;
};

template <class T>
Extremes extremes(const std::vector<T>& values, std::size_t first, std::size_t stride) {
  Extremes found;
  bool is_empty = true;
  for (std::size_t i = first; i < values.size(); i += stride) {
    const auto value = static_cast<double>(values[i]);
    if (!std::isfinite(value)) {
      ++found.n_not_finite;
      continue;
    }
    found.least = is_empty ? value : std::min(found.least, value);
    found.greatest = is_empty ? value : std::max(found.greatest, value);
    is_empty = false;
  }
  return found;
}

std::string field_lines(const FieldArray& array) {
  const FieldInfo& row = info(array.field);
  const auto width = static_cast<std::size_t>(row.components);
  constexpr const char* axes[] = {"x", "y", "z"};
  std::string text;
  for (std::size_t c = 0; c < width; ++c) {
    const Extremes found = row.type == FieldType::real  ? extremes(array.reals, c, width)
                           : row.type == FieldType::gid ? extremes(array.gids, c, width)
                                                        : extremes(array.indices, c, width);
    const std::string name = width == 1   ? std::string(row.name)
                             : width == 3 ? fmt::format("{}.{}", row.name, axes[c])
                                          : fmt::format("{}[{}]", row.name, c);
    text += fmt::format("  {:<20}{:>16.8g}{:>16.8g}  {}", name, found.least, found.greatest, row.unit);
    if (found.n_not_finite > 0) text += fmt::format("  ({} values are not numbers)", found.n_not_finite);
    while (!text.empty() && text.back() == ' ') text.pop_back();
    text += '\n';
  }
  return text;
}

std::string gas_lines(const Image& image) {
  if (image.grids.empty()) return {};
  const std::array<int, 3> cells = gas_cells(image);
  std::string text = fmt::format("gas          {} x {} x {} cells\n", cells[0], cells[1], cells[2]);
  for (const GridArray& array : image.grids) {
    const Extremes found = extremes(array.values, 0, 1);
    text += fmt::format("  {:<20}{:>16.8g}{:>16.8g}  {}", array.name, found.least, found.greatest, array.unit);
    if (found.n_not_finite > 0) text += fmt::format("  ({} values are not numbers)", found.n_not_finite);
    while (text.back() == ' ') text.pop_back();
    text += '\n';
  }
  return text;
}

std::string map_lines(const Image& image) {
  std::string text;
  for (const WallMap& map : image.maps) {
    text += fmt::format("forces on    {}, {} triangles\n", map.name, map.n_triangles());
    for (const auto& [name, values] : {std::pair("pressure", &map.pressure), std::pair("shear", &map.shear)}) {
      const Extremes found = extremes(*values, 0, 1);
      text += fmt::format("  {:<20}{:>16.8g}{:>16.8g}  Pa\n", name, found.least, found.greatest);
    }
  }
  return text;
}

std::string domain_line(const Image& image) {
  const Vec3 low = image.domain.low, high = image.domain.high;
  std::string text =
      fmt::format("domain       ({}, {}, {}) to ({}, {}, {}) m", low.x, low.y, low.z, high.x, high.y, high.z);
  std::string axes;
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (image.periodic[axis]) axes += (axes.empty() ? "" : ", ") + std::string(1, "xyz"[axis]);
  return text + (axes.empty() ? "\n" : ", periodic in " + axes + '\n');
}

}  // namespace

std::string describe(const std::filesystem::path& path) {
  const ImageFile file = read_image_file(path);
  const Image& image = file.image;
  std::string text = fmt::format("{}\nkind         {}\n", path.string(), file.kind);
  if (file.n_rank_files > 0) text += fmt::format("parts        {}, one file a rank\n", file.n_rank_files);
  if (file.record) text += fmt::format("written by   Moraine {} ({})\n", file.record->version, file.record->commit);
  text +=
      fmt::format("step         {}\ntime         {} s\ntime step    {} s\n", image.step, image.time, image.time_step);
  text += domain_line(image);
  text += fmt::format("grains       {}\n", image.n_grains);
  if (file.kind == "checkpoint") {
    text += fmt::format("histories    {} of pairs, {} of walls\n", image.pairs.size(), image.walls.size());
    if (!image.accumulators.empty()) {
      std::string names;
      for (const auto& [name, values] : image.accumulators) names += (names.empty() ? "" : ", ") + name;
      text += fmt::format("counters     {}\n", names);
    }
  }
  text += fmt::format("fields       {:>25}{:>16}\n", "least", "greatest");
  for (const FieldArray& array : image.fields) text += field_lines(array);
  for (const std::string& name : file.unknown) text += fmt::format("  {} (not known to this program)\n", name);
  text += gas_lines(image);
  text += map_lines(image);
  return text + fmt::format("state hash: {}\n", image.hash.text());
}

}  // namespace moraine
