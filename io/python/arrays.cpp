#include "io/python/arrays.hpp"

#include <pybind11/stl.h>

#include <memory>
#include <string>
#include <utility>

namespace py = pybind11;

namespace moraine {

namespace {

py::dtype type_of(FieldType type) {
  return type == FieldType::real  ? py::dtype::of<double>()
         : type == FieldType::gid ? py::dtype::of<std::uint64_t>()
                                  : py::dtype::of<std::uint16_t>();
}

/// Something on the heap that goes when Python has no more use of it.
template <typename T>
py::capsule held(T value) {
  return py::capsule(new T(std::move(value)), [](void* pointer) { delete static_cast<T*>(pointer); });
}

/// The vector becomes the array.
template <typename T>
py::array array_from(std::vector<T> values, std::vector<py::ssize_t> shape) {
  auto owner = std::make_unique<std::vector<T>>(std::move(values));
  T* const data = owner->data();
  const py::capsule keeper(owner.release(), [](void* pointer) { delete static_cast<std::vector<T>*>(pointer); });
  return py::array_t<T>(std::move(shape), data, keeper);
}

std::vector<py::ssize_t> shape_of(std::size_t n_values, int components) {
  const auto rows = static_cast<py::ssize_t>(n_values) / components;
  return components == 1 ? std::vector<py::ssize_t>{rows} : std::vector<py::ssize_t>{rows, components};
}

py::array array_of(FieldArray& array) {
  const FieldInfo& row = info(array.field);
  switch (row.type) {
    case FieldType::gid: {
      const auto shape = shape_of(array.gids.size(), 1);
      return array_from(std::move(array.gids), shape);
    }
    case FieldType::index: {
      const auto shape = shape_of(array.indices.size(), 1);
      return array_from(std::move(array.indices), shape);
    }
    case FieldType::real: break;
  }
  const auto shape = shape_of(array.reals.size(), row.components);
  return array_from(std::move(array.reals), shape);
}

/// (z, y, x); of several ranks each has a part of the values, in one row.
py::array array_of(GridArray& grid) {
  const auto n = [&](std::size_t axis) { return static_cast<py::ssize_t>(grid.n[axis]); };
  const auto size = static_cast<py::ssize_t>(grid.values.size());
  const bool is_whole = n(0) * n(1) * n(2) == size;
  return array_from(std::move(grid.values),
                    is_whole ? std::vector<py::ssize_t>{n(2), n(1), n(0)} : std::vector<py::ssize_t>{size});
}

}  // namespace

py::array array_of(const FieldView& view, bool is_writable) {
  const py::dtype type = type_of(view.info->type);
  std::vector<py::ssize_t> shape = {view.n}, strides = {view.stride};
  if (view.info->components > 1) {
    shape.push_back(view.info->components);
    strides.push_back(type.itemsize());
  }
  py::array array(type, std::move(shape), std::move(strides), view.values, held(view.keeper));
  if (!is_writable) array.attr("flags").attr("writeable") = false;
  return array;
}

py::dict dict_of(Image image) {
  py::dict fields, gas, units;
  for (FieldArray& array : image.fields) {
    const std::string name(info(array.field).name);
    units[name.c_str()] = std::string(info(array.field).unit);
    fields[name.c_str()] = array_of(array);
  }
  for (GridArray& grid : image.grids) {
    units[grid.name.c_str()] = grid.unit;
    gas[grid.name.c_str()] = array_of(grid);
  }
  const auto vector = [](Vec3 v) { return py::make_tuple(v.x, v.y, v.z); };
  py::dict all;
  all["step"] = image.step;
  all["time"] = image.time;
  all["time_step"] = image.time_step;
  all["domain"] = py::make_tuple(vector(image.domain.low), vector(image.domain.high));
  all["periodic"] = py::make_tuple(image.periodic[0], image.periodic[1], image.periodic[2]);
  all["hash"] = image.hash.text();
  all["fields"] = fields;
  all["gas"] = gas;
  all["units"] = units;
  return all;
}

}  // namespace moraine
