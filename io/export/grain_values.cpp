#include "io/export/grain_values.hpp"

#include <algorithm>
#include <cmath>

#include "io/export/frames.hpp"

namespace moraine {

namespace {

std::string with_unit(const std::string& name, std::string_view unit) {
  return unit.empty() ? name : name + " [" + std::string(unit) + "]";
}

std::vector<double> component(const FieldArray& array, std::size_t c) {
  const auto width = static_cast<std::size_t>(info(array.field).components);
  std::vector<double> values;
  switch (info(array.field).type) {
    case FieldType::real:
      for (std::size_t i = c; i < array.reals.size(); i += width) values.push_back(array.reals[i]);
      break;
    case FieldType::gid: values.assign(array.gids.begin(), array.gids.end()); break;
    case FieldType::index: values.assign(array.indices.begin(), array.indices.end()); break;
  }
  return values;
}

std::vector<double> lengths(const FieldArray& array) {
  const auto width = static_cast<std::size_t>(info(array.field).components);
  std::vector<double> values(array.reals.size() / width);
  for (std::size_t i = 0; i < values.size(); ++i) {
    double sum = 0.0;
    for (std::size_t c = 0; c < width; ++c) sum += array.reals[i * width + c] * array.reals[i * width + c];
    values[i] = std::sqrt(sum);
  }
  return values;
}

/// Names that stand for something computed from a field.
struct Derived {
  const char* name;
  Field field;
  int component;  // -1: the length
  const char* unit;
  double (*change)(double);
};
constexpr Derived derived[] = {
    {"speed", Field::velocity, -1, "m/s", [](double v) { return v; }},
    {"diameter", Field::radius, 0, "m", [](double r) { return 2.0 * r; }},
    {"mass", Field::inverse_mass, 0, "kg", [](double m) { return m > 0.0 ? 1.0 / m : 0.0; }},
    {"x", Field::position, 0, "m", [](double v) { return v; }},
    {"y", Field::position, 1, "m", [](double v) { return v; }},
    {"z", Field::position, 2, "m", [](double v) { return v; }},
};

std::string known_names(const Image& image) {
  std::string names;
  for (const FieldArray& array : image.fields)
    names += std::string(names.empty() ? "" : ", ") + std::string(info(array.field).name);
  for (const Derived& row : derived)
    if (image.find(row.field) != nullptr) names += std::string(", ") + row.name;
  return names + "; a component of a vector by .x, .y, .z";
}

}  // namespace

GrainValues grain_values(const Image& image, const std::string& name) {
  for (const Derived& row : derived) {
    const FieldArray* array = image.find(row.field);
    if (name != row.name || array == nullptr) continue;
    GrainValues found{with_unit(name, row.unit),
                      row.component < 0 ? lengths(*array) : component(*array, static_cast<std::size_t>(row.component))};
    for (double& value : found.values) value = row.change(value);
    return found;
  }
  const std::size_t dot = name.rfind('.');
  const bool has_component =
      dot != std::string::npos && name.size() == dot + 2 && name[dot + 1] >= 'x' && name[dot + 1] <= 'z';
  const std::optional<Field> field = field_by_name(has_component ? name.substr(0, dot) : name);
  const FieldArray* array = field ? image.find(*field) : nullptr;
  if (array == nullptr || (has_component && info(*field).components != 3))
    throw ExportError("field \"" + name + "\" is not in the snapshot; it has " + known_names(image));
  const std::string label = with_unit(name, info(*field).unit);
  if (has_component) return {label, component(*array, static_cast<std::size_t>(name[dot + 1] - 'x'))};
  return {label, info(*field).components == 1 ? component(*array, 0) : lengths(*array)};
}

std::pair<double, double> usual_range(const std::vector<double>& values) {
  std::vector<double> sorted;
  for (const double value : values)
    if (std::isfinite(value)) sorted.push_back(value);
  if (sorted.empty()) return {0.0, 0.0};
  const std::size_t cut = sorted.size() / 200;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(cut), sorted.end());
  const double low = sorted[cut];
  const std::size_t top = sorted.size() - 1 - cut;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(top), sorted.end());
  // A scale that nearly starts at zero starts at zero.
  return {low > 0.0 && low < 0.1 * sorted[top] ? 0.0 : low, sorted[top]};
}

}  // namespace moraine
