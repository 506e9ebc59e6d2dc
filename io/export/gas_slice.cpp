#include "io/export/gas_slice.hpp"

#include <cmath>

#include "io/checkpoint/image_file.hpp"
#include "io/export/frames.hpp"

namespace moraine {

namespace {

const GridArray* find(const Image& image, const std::array<int, 3>& cells, const std::string& name) {
  for (const GridArray& array : image.grids)
    if (array.name == name && array.n == cells) return &array;
  return nullptr;
}

std::string known_names(const Image& image, const std::array<int, 3>& cells) {
  std::string names = "gas_speed";
  for (const GridArray& array : image.grids)
    if (array.n == cells) names += ", " + array.name;
  return names;
}

}  // namespace

GasSlice gas_slice(const Image& image, const std::string& name, int axis) {
  if (image.grids.empty()) throw ExportError("there is no gas in the snapshot, and so no \"" + name + "\" of it");
  const std::array<int, 3> cells = gas_cells(image);
  std::vector<const GridArray*> parts;
  for (const std::string& part : name == "gas_speed"
                                     ? std::vector<std::string>{"gas_velocity_x", "gas_velocity_y", "gas_velocity_z"}
                                     : std::vector{name})
    if (const GridArray* const array = find(image, cells, part)) parts.push_back(array);
  if (parts.empty())
    throw ExportError("\"" + name + "\" is no quantity of the gas in the snapshot; it has " +
                      known_names(image, cells));

  GasSlice slice;
  slice.axis = axis;
  slice.label = name == "gas_speed" ? "gas speed" : name;
  if (!parts[0]->unit.empty()) slice.label += " [" + parts[0]->unit + "]";
  const auto across = static_cast<std::size_t>(axis);
  const std::size_t u = across == 0 ? 1 : 0, v = across == 2 ? 1 : 2;
  slice.n = {cells[u], cells[v]};
  std::array<int, 3> at{};
  at[across] = cells[across] / 2;
  slice.place = image.domain.low[axis] + (at[across] + 0.5) * image.domain.size()[axis] / cells[across];
  for (at[v] = 0; at[v] < cells[v]; ++at[v])
    for (at[u] = 0; at[u] < cells[u]; ++at[u]) {
      const auto cell = static_cast<std::size_t>((std::int64_t{at[2]} * cells[1] + at[1]) * cells[0] + at[0]);
      double squares = 0.0;
      for (const GridArray* const array : parts) squares += array->values[cell] * array->values[cell];
      slice.values.push_back(parts.size() == 1 ? parts[0]->values[cell] : std::sqrt(squares));
    }
  return slice;
}

}  // namespace moraine
