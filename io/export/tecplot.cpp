#include "io/export/tecplot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <type_traits>
#include <vector>

#include "io/checkpoint/image_file.hpp"
#include "io/export/frames.hpp"

namespace moraine {

namespace {

constexpr const char* axis_names[] = {"x", "y", "z"};
constexpr const char* place_names[] = {"X", "Y", "Z"};  // in metres; readers know coordinates by these

/// One variable of a zone, with its value at each point.
struct Variable {
  std::string name;
  std::vector<double> values;
};

std::string with_unit(const std::string& name, std::string_view unit) {
  return unit.empty() ? name : fmt::format("{} [{}]", name, unit);
}

/// A file of one zone; `shape` is what the zone's header says of its points.
std::string zone_text(const std::string& title, const Image& image, const std::string& shape,
                      const std::vector<Variable>& variables) {
  std::string text = fmt::format("TITLE = \"{}\"\nVARIABLES =", title);
  for (const Variable& variable : variables) text += fmt::format(" \"{}\"", variable.name);
  text += fmt::format("\nZONE T=\"{} {:.9g} s\", {}, DATAPACKING=POINT, STRANDID=1, SOLUTIONTIME={}\n", title,
                      image.time, shape, image.time);
  const std::size_t n_points = variables[0].values.size();
  for (std::size_t i = 0; i < n_points; ++i)
    for (std::size_t k = 0; k < variables.size(); ++k)
      fmt::format_to(std::back_inserter(text), "{}{}", variables[k].values[i], k + 1 < variables.size() ? ' ' : '\n');
  return text;
}

void add_field(std::vector<Variable>& variables, const FieldArray& array) {
  const FieldInfo& row = info(array.field);
  const std::string name(row.name);
  if (row.type != FieldType::real) {  // gids are exact up to 2^53
    Variable& variable = variables.emplace_back(Variable{name, {}});
    if (row.type == FieldType::gid)
      variable.values.assign(array.gids.begin(), array.gids.end());
    else
      variable.values.assign(array.indices.begin(), array.indices.end());
    return;
  }
  const auto width = static_cast<std::size_t>(row.components);
  for (std::size_t c = 0; c < width; ++c) {
    const std::string part = width == 1   ? name
                             : width == 3 ? fmt::format("{}_{}", name, axis_names[c])
                                          : fmt::format("{}_{}", name, c);
    const bool is_place = array.field == Field::position;
    Variable& variable = variables.emplace_back(Variable{is_place ? place_names[c] : with_unit(part, row.unit), {}});
    for (std::size_t i = c; i < array.reals.size(); i += width) variable.values.push_back(array.reals[i]);
  }
}

}  // namespace

std::string tecplot_grains(const Image& image) {
  const FieldArray* const positions = image.find(Field::position);
  if (positions == nullptr) throw ExportError("Tecplot files need the field position in the snapshot");
  std::vector<Variable> variables;
  add_field(variables, *positions);
  for (const FieldArray& array : image.fields)
    if (array.field != Field::position) add_field(variables, array);
  const auto n = image.n_grains;
  if (n == 0) return zone_text("grains", image, "I=0, J=1, K=1", variables);
  // Tecplot would take an ordered zone along one line as well, but VTK's reader leaves such zones out.
  std::string text =
      zone_text("grains", image, fmt::format("NODES={}, ELEMENTS={}, ZONETYPE=FETRIANGLE", n, n), variables);
  for (std::remove_const_t<decltype(n)> i = 1; i <= n; ++i)
    fmt::format_to(std::back_inserter(text), "{0} {0} {0}\n", i);
  return text;
}

std::string tecplot_gas(const Image& image) {
  if (image.grids.empty()) return {};
  const std::array<int, 3> n = gas_cells(image);
  const Vec3 low = image.domain.low, size = image.domain.size();
  std::vector<Variable> variables(3);
  for (std::size_t axis = 0; axis < 3; ++axis) variables[axis].name = place_names[axis];
  std::array<int, 3> at{};
  for (at[2] = 0; at[2] < n[2]; ++at[2])
    for (at[1] = 0; at[1] < n[1]; ++at[1])
      for (at[0] = 0; at[0] < n[0]; ++at[0])
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const int a = static_cast<int>(axis);
          variables[axis].values.push_back(low[a] + (at[axis] + 0.5) * size[a] / n[axis]);
        }
  for (const GridArray& array : image.grids)
    if (array.n == n) variables.push_back({with_unit(array.name, array.unit), array.values});
  return zone_text("gas", image, fmt::format("I={}, J={}, K={}", n[0], n[1], n[2]), variables);
}

}  // namespace moraine
