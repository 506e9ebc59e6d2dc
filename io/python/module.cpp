// The Python module's part in C++: what moraine/__init__.py gives names that people read.
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "io/cli/version.hpp"
#include "io/python/arrays.hpp"
#include "io/python/errors.hpp"
#include "io/python/script_scene.hpp"
#include "io/python/scripted_run.hpp"
#include "io/snapshot/snapshot.hpp"

namespace py = pybind11;
using namespace moraine;

namespace {

using Path = std::filesystem::path;

void add_scene(py::module_& module) {
  py::class_<ScriptScene>(module, "Scene")
      .def(py::init([](const Path& file, const std::vector<std::string>& overrides) {
        return scene_from_file(file, overrides, world_of_script());
      }))
      .def(py::init([](const std::string& text, const std::string& name, const std::vector<std::string>& overrides,
                       const Path& base, bool has_lines) {
        return scene_from_text(text, name, overrides, base, has_lines, world_of_script());
      }))
      .def_readonly("text", &ScriptScene::text, "The scene file that repeats it: changes applied, file names absolute.")
      .def_readonly("warnings", &ScriptScene::warnings, "Doubts, one text each.")
      .def_property_readonly("title", [](const ScriptScene& scene) { return scene.content->title; })
      .def_property_readonly(
          "end", [](const ScriptScene& scene) { return scene.content->time.end; }, "[s]");
}

/// One attribute for each row of the field table.
void add_fields(py::class_<ScriptedRun>& run) {
  for (const FieldInfo& row : field_table) {
    const std::string name(row.name);
    const std::string text = name + (row.unit.empty() ? "" : " [" + std::string(row.unit) + "]") +
                             " of this rank's grains, where it lies: read only, good until the next step.";
    run.def_property_readonly(
        name.c_str(), [name](ScriptedRun& self) { return self.array(name); }, text.c_str());
  }
}

void add_run(py::module_& module) {
  py::class_<ScriptedRun> run(module, "Simulation");
  run.def(py::init<const ScriptScene&, std::optional<int>, const std::optional<Path>&, const std::optional<Path>&>())
      .def("step", &ScriptedRun::step, py::arg("n") = 1, "Takes n time steps. All ranks.")
      .def("run", &ScriptedRun::run, py::arg("until") = py::none(),
           "Steps until that time [s], by default to the end of the scene; with `out` writes what is due then. All "
           "ranks.")
      .def("stop", &ScriptedRun::stop, "In a callback: step() or run() returns after this step. All ranks.")
      .def("_add_callback", &ScriptedRun::add_callback)
      .def("forget", &ScriptedRun::remove_callback, py::arg("function"), "Ends the calls that every() has begun.")
      .def("set_body_force", &ScriptedRun::set_body_force, py::arg("function"),
           "function(run) gives the force per mass of each grain [m/s2], an array that broadcasts to (n, 3), in every "
           "step; None "
           "ends it. All ranks.")
      .def(
          "set_wall_motion", &ScriptedRun::set_wall_motion, py::arg("wall"), py::arg("function"), py::arg("every") = 1,
          "Moves a wall whose motion in the scene is {type = \"script\", max_speed = ...}: function(time) gives the "
          "velocity [m/s] of its origin, or (velocity, angular velocity [rad/s]), held for `every` steps; `time` is in "
          "the middle of these. To be called before the first step, and again after a restart. All ranks.")
      .def("array", &ScriptedRun::array, py::arg("name"), "A field by name, as its attribute.")
      .def("_writable", &ScriptedRun::writable)
      .def("_grains_changed", &ScriptedRun::grains_changed)
      .def("_snapshot", &ScriptedRun::snapshot)
      .def("gather", &ScriptedRun::gather, py::arg("name"),
           "A field of all grains in order of gid, copied, on the first rank; None on the others. All ranks.")
      .def("probe", &ScriptedRun::probe, py::arg("name"), "The row of a probe of the scene now, by column. All ranks.")
      .def("energy", &ScriptedRun::energy, "The energy ledger [J]; the scene must keep it (output.energy). All ranks.")
      .def(
          "state_hash", [](const ScriptedRun& self) { return self.whole().state_hash().text(); },
          "32 digits: equal hashes mean equal bits. All ranks.")
      .def("write_snapshot", &ScriptedRun::write_snapshot, py::arg("path"), "All ranks.")
      .def("write_checkpoint", &ScriptedRun::write_checkpoint, py::arg("path"), "All ranks.");
  const auto property = [&](const char* name, auto get, const char* text) {
    run.def_property_readonly(
        name, [get](const ScriptedRun& self) { return get(self.simulation()); }, text);
  };
  property(
      "time", [](const Simulation& s) { return s.time(); }, "[s]");
  property(
      "time_step", [](const Simulation& s) { return s.time_step(); }, "[s]");
  property(
      "step_number", [](const Simulation& s) { return s.step_number(); }, "Steps since the start of the scene.");
  property(
      "n_steps", [](const Simulation& s) { return s.plan().n_steps; }, "Steps to the end of the scene.");
  property(
      "n_grains", [](const Simulation& s) { return s.n_grains(); }, "Of all ranks, when they last counted.");
  property(
      "n_born", [](const Simulation& s) { return s.n_born(); }, "Of all ranks, when they last counted.");
  property(
      "n_left", [](const Simulation& s) { return s.n_left(); }, "Of all ranks, when they last counted.");
  property(
      "n_rebuilds", [](const Simulation& s) { return s.n_rebuilds(); },
      "Changes where arrays become old: grains have new places.");
  property(
      "warnings", [](const Simulation& s) { return s.plan().warnings; }, "Doubts of the plan, one text each.");
  property(
      "probes",
      [](const Simulation& s) {
        std::vector<std::string> names;
        for (const Probe& probe : s.scene().output.probes) names.push_back(probe.name);
        return names;
      },
      "Names of the scene's probes.");
  run.def_property_readonly("threads", &ScriptedRun::threads, "Threads of this rank.");
  run.def_property_readonly("fields", &ScriptedRun::fields,
                            "Name to (unit, shape) of each field that the grains have.");
  add_fields(run);
}

}  // namespace

PYBIND11_MODULE(_engine, module) {
  module.doc() = "The engine of the module moraine.";
  translate_errors();
  world_of_script();
  add_scene(module);
  add_run(module);
  module.def("version", &program_version);
  module.def(
      "rank", [] { return world_of_script().rank(); }, "Number of this rank, from 0.");
  module.def(
      "size", [] { return world_of_script().size(); }, "Number of ranks.");
  module.def("abort", [](int code) { world_of_script().abort(code); });
  module.def("close", &close_all_runs);
  module.def("read_image", [](const Path& path) { return dict_of(read_image_file(path).image); });
  module.def("scene_of_checkpoint", [](const Path& path) {
    const auto record = read_image_file(path).record;
    if (!record) throw StorageError(path, "is not a checkpoint, and holds no scene");
    return record->scene;
  });
  module.def("snapshots", &list_snapshots, py::arg("run"), "The snapshots of a run directory, in order of step.");
}
