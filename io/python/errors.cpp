#include "io/python/errors.hpp"

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "engine/run/simulation.hpp"
#include "io/checkpoint/durable_file.hpp"
#include "io/cli/layout.hpp"
#include "io/export/frames.hpp"
#include "io/scene_toml/scene_toml.hpp"

namespace py = pybind11;

namespace moraine {

namespace {

using ProblemRow = std::tuple<std::string, std::string, std::string, std::optional<int>>;

std::vector<ProblemRow> rows_of(const SceneFileError& error) {
  std::vector<ProblemRow> rows;
  for (const SceneMessage& problem : error.problems)
    rows.emplace_back(problem.key, problem.value, problem.message,
                      problem.line > 0 ? std::optional(problem.line) : std::nullopt);
  return rows;
}

std::vector<ProblemRow> rows_of(const SceneError& error) {
  std::vector<ProblemRow> rows;
  for (const Problem& problem : error.problems) rows.emplace_back(problem.key, "", problem.message, std::nullopt);
  return rows;
}

template <typename... Arguments>
void raise(const char* type, Arguments&&... arguments) {
  const py::object kind = py::module_::import("moraine.errors").attr(type);
  PyErr_SetObject(kind.ptr(), kind(std::forward<Arguments>(arguments)...).ptr());
}

void translate(std::exception_ptr pointer) {
  try {
    if (pointer) std::rethrow_exception(pointer);
  } catch (const SceneFileError& error) {
    raise("SceneError", error.what(), rows_of(error));
  } catch (const SceneError& error) {
    raise("SceneError", error.what(), rows_of(error));
  } catch (const RunError& error) {
    raise("RunError", error.what());
  } catch (const StorageError& error) {
    raise("StorageError", error.what());
  } catch (const UsageError& error) {
    PyErr_SetString(PyExc_ValueError, error.what());
  } catch (const ExportError& error) {
    PyErr_SetString(PyExc_ValueError, error.what());
  }
}

}  // namespace

void translate_errors() { py::register_exception_translator(&translate); }

}  // namespace moraine
