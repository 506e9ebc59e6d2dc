#include "io/python/scripted_run.hpp"

#include <fmt/format.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <set>

#include "engine/run/flight_record.hpp"
#include "io/checkpoint/checkpoint.hpp"
#include "io/cli/layout.hpp"
#include "io/cli/run_directory.hpp"
#include "io/cli/schedule.hpp"
#include "io/cli/version.hpp"
#include "io/python/arrays.hpp"
#include "io/snapshot/snapshot.hpp"

namespace py = pybind11;
namespace fs = std::filesystem;

namespace moraine {

namespace {

/// How often signals are looked for: short for a person, long for a processor.
constexpr std::chrono::milliseconds between_looks{50};

std::optional<World>& joined_world() {
  static std::optional<World> world;
  return world;
}

std::set<ScriptedRun*>& all_runs() {
  static std::set<ScriptedRun*> runs;
  return runs;
}

int choose_threads(const Scene& scene, std::optional<int> threads, const World& world) {
  if (threads && *threads < 1) throw UsageError(fmt::format("threads = {}: expected at least 1", *threads));
  if (World::is_launched()) {
    std::optional<std::string> asked;
    if (threads) asked = Layout{world.size(), *threads}.text();
    return layout_of_given_ranks(asked, scene.run.layout, world).layout.threads;
  }
  if (threads) return *threads;
  const Layout layout = parse_layout(scene.run.layout);
  if (layout.ranks > 1)
    throw UsageError(
        fmt::format("the scene asks for {} ranks (run.layout): start the script by mpirun -n {}, or give threads",
                    layout.ranks, layout.ranks));
  return layout.threads;
}

std::unique_ptr<Simulation> go_on_from(const fs::path& path, const Scene& scene, int threads, const World& world) {
  const Checkpoint checkpoint = read_checkpoint(path, world);
  auto simulation = std::make_unique<Simulation>(scene, threads, checkpoint.image, world);
  if (!(simulation->state_hash() == checkpoint.image.hash))
    throw StorageError(path,
                       "cannot be gone on from: the state restored has another hash than the one stored; this "
                       "program and the one that wrote it differ");
  return simulation;
}

[[noreturn]] void raise_interrupt() {
  PyErr_SetNone(PyExc_KeyboardInterrupt);
  throw py::error_already_set();
}

/// A Python function that may be let go of by whoever holds it, with Python's lock or without.
struct Held {
  explicit Held(py::function f) : function(std::move(f)) {}
  ~Held() {
    const py::gil_scoped_acquire lock;
    function = py::function();
  }
  Held(const Held&) = delete;
  Held& operator=(const Held&) = delete;
  py::function function;
};

/// What the motion of a wall says: a velocity, or a velocity and an angular velocity.
WallRates rates_of(const py::object& said) {
  const auto values = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(said);
  if (!values) PyErr_Clear();
  const bool has_spin = values && values.ndim() == 2 && values.shape(0) == 2 && values.shape(1) == 3;
  if (!has_spin && !(values && values.ndim() == 1 && values.shape(0) == 3))
    throw py::value_error(
        "a wall's motion gives a velocity [m/s], three numbers, or (velocity, angular velocity [rad/s])");
  const double* const v = values.data();
  return {{v[0], v[1], v[2]}, has_spin ? Vec3{v[3], v[4], v[5]} : Vec3{}};
}

/// While it lives a flag is up.
class Raised {
 public:
  explicit Raised(bool& flag) : flag_(flag), before_(flag) { flag_ = true; }
  ~Raised() { flag_ = before_; }
  Raised(const Raised&) = delete;
  Raised& operator=(const Raised&) = delete;

 private:
  bool& flag_;
  bool before_;
};

}  // namespace

const World& world_of_script() {
  if (!joined_world()) joined_world() = World::join();
  return *joined_world();
}

void close_all_runs() {
  while (!all_runs().empty()) {
    ScriptedRun* const run = *all_runs().begin();
    const py::object kept = py::cast(run);  // what it lets go of may hold the last reference to it, or to another run
    all_runs().erase(run);
    run->close();
  }
  joined_world() = World();
}

ScriptedRun::ScriptedRun(const ScriptScene& scene, std::optional<int> threads, const std::optional<fs::path>& out,
                         const std::optional<fs::path>& restart)
    : record_{scene.text, program_version(), program_commit()},
      log_(world_of_script().is_root() ? Log(true) : Log::mute()) {
  threads_ = choose_threads(*scene.content, threads, world_of_script());
  {
    const py::gil_scoped_release free;
    start(scene, out, restart);
  }
  all_runs().insert(this);
}

ScriptedRun::~ScriptedRun() {
  close();
  all_runs().erase(this);
}

void ScriptedRun::close() {
  why_over_ = "the run has been closed";
  outputs_.reset();
  simulation_.reset();
  callbacks_.clear();
}

void ScriptedRun::start(const ScriptScene& scene, const std::optional<fs::path>& out,
                        const std::optional<fs::path>& restart) {
  const World& world = world_of_script();
  std::optional<fs::path> directory;
  if (out) {
    directory = new_run_directory(*out, *scene.content, out);  // refused where it holds anything
    world.wait_for_all();
  }
  simulation_ = restart ? go_on_from(*restart, *scene.content, threads_, world)
                        : std::make_unique<Simulation>(*scene.content, threads_, world);
  if (!directory) return;
  if (world.is_root()) {
    make_directory(*directory);
    log_.open(*directory / "log.txt");
    log_.note(program_identity());
    write_file(*directory / "scene.toml", record_.scene);
    write_file(*directory / "version.txt",
               program_identity() + "\nlayout " + Layout{world.size(), threads_}.text() + ", from Python\n");
  }
  world.wait_for_all();
  outputs_.emplace(*directory, *simulation_, record_, std::nullopt, log_);
  if (!restart) outputs_->write_due(*simulation_);
}

Simulation& ScriptedRun::whole() const {
  if (!simulation_) throw std::runtime_error(why_over_);
  if (is_in_body_force_)
    throw std::runtime_error(
        "a body force may look at the grains, a wall's motion at the time, and neither can do anything else with the "
        "run");
  return *simulation_;
}
const Simulation& ScriptedRun::simulation() const {
  if (!simulation_) throw std::runtime_error(why_over_);
  return *simulation_;
}

void ScriptedRun::step(std::uint64_t n) { advance_to(simulation().step_number() + n); }

void ScriptedRun::run(std::optional<double> until) {
  const std::uint64_t end = simulation().plan().n_steps;
  advance_to(until ? steps_until(*until, simulation().time_step()) : end);
  if (!outputs_) return;
  const py::gil_scoped_release free;
  if (simulation().step_number() >= end) {
    outputs_->write_snapshot_now(*simulation_);
    outputs_->write_open_fields(*simulation_);
  }
  outputs_->write_checkpoint_now(*simulation_);
  outputs_->write_open_records(*simulation_);
}

void ScriptedRun::advance_to(std::uint64_t last) {
  if (is_advancing_) throw std::runtime_error("a body force or a callback cannot step the run that asks for it");
  if (!why_over_.empty()) throw RunError(why_over_);
  const Raised advancing(is_advancing_);
  is_stopping_ = false;
  next_look_ = std::chrono::steady_clock::now() + between_looks;
  while (simulation().step_number() < last && !is_stopping_) {
    {
      const py::gil_scoped_release free;
      step_until(std::min(last, next_callback()));
    }
    call_back();
  }
}

void ScriptedRun::step_until(std::uint64_t last) {
  while (simulation_->step_number() < last) {
    step_once();
    if (outputs_) outputs_->write_due(*simulation_);
    look_for_signals();
  }
}

void ScriptedRun::step_once() {
  try {
    simulation_->step();
  } catch (const RecordedRunError& error) {
    const std::string said = error.what() + (outputs_ ? outputs_->keep(error.record) : "");
    why_over_ = fmt::format("the run has ended at step {} by an error: {}", simulation_->step_number(), said);
    throw RunError(said);
  } catch (const std::exception& error) {  // the step is half done
    why_over_ = fmt::format("the run has ended at step {} by an error: {}", simulation_->step_number(), error.what());
    throw;
  }
}

/// Alone an interrupt holds after this step. Several ranks agree on the step to stop at, and then all raise it.
void ScriptedRun::look_for_signals() {
  const bool is_alone = simulation_->world().is_alone();
  if (!is_alone && simulation_->is_stop_agreed()) {
    simulation_->forget_stop();
    const py::gil_scoped_acquire lock;
    raise_interrupt();
  }
  const auto now = std::chrono::steady_clock::now();
  if (now < next_look_) return;
  next_look_ = now + between_looks;
  const py::gil_scoped_acquire lock;
  if (PyErr_CheckSignals() == 0) return;
  if (is_alone || PyErr_ExceptionMatches(PyExc_KeyboardInterrupt) == 0) throw py::error_already_set();
  PyErr_Clear();
  simulation_->ask_to_stop();
}

std::uint64_t ScriptedRun::next_callback() const {
  std::uint64_t next = std::numeric_limits<std::uint64_t>::max();
  for (const Callback& callback : callbacks_)
    next = std::min(next, (simulation_->step_number() / callback.interval + 1) * callback.interval);
  return next;
}

void ScriptedRun::call_back() {
  const std::vector<Callback> now = callbacks_;  // a callback may add and remove some
  for (const Callback& callback : now)
    if (simulation_->step_number() % callback.interval == 0) callback.function(py::cast(this));
}

void ScriptedRun::add_callback(std::uint64_t interval, py::function function) {
  if (interval == 0) throw std::invalid_argument("a callback needs an interval of at least 1 step");
  callbacks_.push_back({interval, std::move(function)});
}

void ScriptedRun::remove_callback(const py::function& function) {
  std::erase_if(callbacks_, [&](const Callback& callback) { return callback.function.equal(function); });
}

void ScriptedRun::set_body_force(const py::object& function) {
  if (function.is_none()) {
    whole().set_body_force({});
    return;
  }
  whole().set_body_force([this, function](std::span<double> acceleration) {
    const py::gil_scoped_acquire lock;
    const Raised asked(is_in_body_force_);
    const std::vector<py::ssize_t> shape = {static_cast<py::ssize_t>(acceleration.size() / 3), 3};
    const py::array_t<double> target(shape, acceleration.data(), py::none());
    py::module_::import("numpy").attr("copyto")(target, function(py::cast(this)));
  });
}

void ScriptedRun::set_wall_motion(const std::string& wall, py::function function, std::uint64_t every) {
  whole().set_wall_motion(
      wall,
      // Held where it can be let go of: the engine may drop it without Python's lock.
      [this, held = std::make_shared<Held>(std::move(function))](double time) {
        const py::gil_scoped_acquire lock;
        const Raised asked(is_in_body_force_);
        return rates_of(held->function(time));
      },
      every);
}

FieldView ScriptedRun::view(const std::string& name) {
  if (!simulation_) throw std::runtime_error(why_over_);
  Simulation& run = *simulation_;
  const std::optional<Field> field = field_by_name(name);
  if (!field)
    throw py::key_error(fmt::format("there is no field \"{}\"; this run has {}", name,
                                    py::str(py::str(", ").attr("join")(fields())).cast<std::string>()));
  if (!is_in_body_force_) run.remove_left();
  if (const auto found = run.view(*field)) return *found;
  const bool is_for_output = info(*field).need == Need::requested;
  throw py::key_error(fmt::format("this scene has no need of the field \"{}\"{}", name,
                                  is_for_output ? "; name it in output.fields" : ""));
}

py::array ScriptedRun::array(const std::string& name) { return array_of(view(name), false); }

py::array ScriptedRun::writable(const std::string& name) {
  whole();
  const FieldView field = view(name);
  if (field.info->travel != Travel::every_step)
    throw std::invalid_argument(
        fmt::format("field \"{}\" cannot be changed; position, velocity and angular_velocity can", name));
  return array_of(field, true);
}

void ScriptedRun::grains_changed() {
  const bool was_spoiled = is_spoiled_;
  try {
    whole().grains_changed();
  } catch (const std::invalid_argument& error) {
    is_spoiled_ = true;
    why_over_ = std::string(error.what()) + "; edit() it to a place in the domain before the run goes on";
    throw;
  }
  is_spoiled_ = false;
  if (was_spoiled) why_over_.clear();
}

py::dict ScriptedRun::fields() const {
  py::dict all;
  simulation();  // is there
  for (const FieldInfo& row : field_table) {
    const auto view = simulation_->view(row.field);
    if (!view) continue;
    const auto shape =
        row.components == 1 ? py::tuple(py::make_tuple(view->n)) : py::tuple(py::make_tuple(view->n, row.components));
    all[std::string(row.name).c_str()] = py::make_tuple(std::string(row.unit), shape);
  }
  return all;
}

py::dict ScriptedRun::snapshot(const std::vector<std::string>& names) const {
  for (const std::string& name : names)
    if (!field_by_name(name)) throw py::key_error(fmt::format("there is no field \"{}\"", name));
  Image image;
  {
    const py::gil_scoped_release free;
    image = whole().snapshot(names);
  }
  return dict_of(std::move(image));
}

py::object ScriptedRun::gather(const std::string& name) const {
  const std::optional<Field> field = field_by_name(name);
  if (!field) throw py::key_error(fmt::format("there is no field \"{}\"", name));
  const World& world = simulation().world();
  Image image = whole().snapshot({name});
  const auto pack = [&](auto& values) {
    const std::string mine(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0]));
    values.clear();
    for (const std::string& part : world.gather_at_root(mine)) {
      const std::size_t before = values.size();
      values.resize(before + part.size() / sizeof(values[0]));
      std::memcpy(values.data() + before, part.data(), part.size());
    }
  };
  for (FieldArray& array : image.fields) {
    if (array.field != *field) continue;
    switch (info(*field).type) {
      case FieldType::real: pack(array.reals); break;
      case FieldType::gid: pack(array.gids); break;
      case FieldType::index: pack(array.indices); break;
    }
    if (!world.is_root()) return py::none();
    return dict_of(std::move(image))["fields"][name.c_str()];
  }
  throw py::key_error(fmt::format("this scene has no need of the field \"{}\"", name));
}

std::size_t ScriptedRun::probe_number(const std::string& name) const {
  const std::vector<Probe>& probes = simulation().scene().output.probes;
  std::string names;
  for (std::size_t k = 0; k < probes.size(); ++k) {
    if (probes[k].name == name) return k;
    names += (k == 0 ? "" : ", ") + probes[k].name;
  }
  throw py::key_error(fmt::format("the scene has no probe \"{}\"; it has {}", name, names.empty() ? "none" : names));
}

py::dict ScriptedRun::probe(const std::string& name) {
  const std::size_t number = probe_number(name);
  const std::vector<std::string> columns = simulation().probe_columns(number);
  std::vector<double> row;
  {
    const py::gil_scoped_release free;
    row = whole().probe_row(number);
  }
  py::dict values;
  for (std::size_t k = 0; k < row.size(); ++k) values[columns[k].c_str()] = row[k];
  return values;
}

py::dict ScriptedRun::energy() const {
  EnergyLedger e;
  {
    const py::gil_scoped_release free;
    e = whole().energy();
  }
  py::dict values;
  const auto put = [&](const char* name, double value) { values[name] = value; };
  put("kinetic", e.kinetic);
  put("rotational", e.rotational);
  put("elastic_normal", e.elastic_normal);
  put("elastic_tangential", e.elastic_tangential);
  put("potential", e.potential);
  put("lost_normal", e.lost_normal);
  put("lost_tangential", e.lost_tangential);
  put("lost_friction", e.lost_friction);
  put("lost_drag", e.lost_drag);
  put("wall_work", e.wall_work);
  put("left", e.left);
  put("total", e.total());
  put("error", e.error());
  return values;
}

void ScriptedRun::write_snapshot(const fs::path& path) const {
  const py::gil_scoped_release free;
  const World& world = simulation().world();
  if (world.is_root() && path.has_parent_path()) make_directory(path.parent_path());
  world.wait_for_all();
  moraine::write_snapshot(path, whole().snapshot(), world, simulation().scene().output.distributed);
}

void ScriptedRun::write_checkpoint(const fs::path& path) const {
  const py::gil_scoped_release free;
  const World& world = simulation().world();
  if (world.is_root() && path.has_parent_path()) make_directory(path.parent_path());
  world.wait_for_all();
  moraine::write_checkpoint(path, whole().checkpoint(), record_, world, simulation().scene().output.distributed);
}

}  // namespace moraine
