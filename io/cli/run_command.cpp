#include "io/cli/run_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <functional>
#include <new>
#include <span>
#include <sstream>

#include "engine/run/flight_record.hpp"
#include "engine/run/simulation.hpp"
#include "io/checkpoint/checkpoint.hpp"
#include "io/cli/failure.hpp"
#include "io/cli/interrupt.hpp"
#include "io/cli/launch.hpp"
#include "io/cli/layout.hpp"
#include "io/cli/memory.hpp"
#include "io/cli/outputs.hpp"
#include "io/cli/programs.hpp"
#include "io/cli/progress.hpp"
#include "io/cli/run_directory.hpp"
#include "io/cli/summary.hpp"
#include "io/cli/text.hpp"
#include "io/cli/version.hpp"
#include "io/scene_toml/scene_toml.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

/// Where a run starts and where its results go.
struct Start {
  fs::path directory;
  std::optional<Checkpoint> checkpoint;
  fs::path checkpoint_path;
  bool goes_on_in_directory = false;  // false: a new directory
};

std::optional<std::uint64_t> kept_until(const Start& start) {
  if (!start.goes_on_in_directory || !start.checkpoint) return std::nullopt;
  return start.checkpoint->image.step;
}

/// What the root finds in the file system, at all ranks: it may change while they look, and one that looks is enough.
fs::path found_by_root(const World& world, const std::function<fs::path()>& find) {
  std::string path = world.is_root() ? find().string() : std::string();
  world.broadcast(path);
  return path;
}

/// A run that ended before its first checkpoint: the same scene starts anew in its place, as it will write the same files
/// again; another scene's are not touched.
fs::path restarted_from_nothing(const RunRequest& request, const Scene& scene, const fs::path& found, Log& log) {
  const fs::path old_scene = found / "scene.toml";
  if (fs::exists(old_scene) && read_file(old_scene) == scene_as_run(request.scene_file, request.overrides)) {
    log.say(found.string() + " has no checkpoint yet: starting from the beginning");
    return found;
  }
  log.say(found.string() + " holds a run of another scene, without checkpoints");
  return new_run_directory(request.scene_file, scene, request.out);
}

/// Where the run is that `--restart auto` goes on with; empty where there is none.
fs::path run_to_go_on_with(const RunRequest& request, const Scene& scene) {
  const std::optional<fs::path> found = request.out ? request.out : newest_run_directory(request.scene_file, scene);
  return found && holds_run(*found) ? *found : fs::path();
}

Start start_auto(const RunRequest& request, const Scene& scene, const World& world, Log& log) {
  Start start;
  const fs::path found = found_by_root(world, [&] { return run_to_go_on_with(request, scene); });
  if (found.empty()) {
    log.say("nothing to go on from yet: starting from the beginning");
    start.directory = found_by_root(world, [&] { return new_run_directory(request.scene_file, scene, request.out); });
    return start;
  }
  std::optional<LatestCheckpoint> latest = find_latest_checkpoint(found, world);
  if (!latest) {
    start.directory = found_by_root(world, [&] { return restarted_from_nothing(request, scene, found, log); });
    return start;
  }
  start.directory = found;
  for (const std::string& warning : latest->warnings) log.warn(warning + "; taking the one before it");
  start.checkpoint = std::move(latest->checkpoint);
  start.checkpoint_path = latest->path;
  start.goes_on_in_directory = true;
  return start;
}

/// The run directory that a checkpoint lies in, where the run is to go on there; empty where it is to go on elsewhere.
fs::path own_directory(const RunRequest& request, const fs::path& checkpoint) {
  const std::optional<fs::path> own = run_directory_of(checkpoint);
  const bool is_own = own && (!request.out || (fs::exists(*request.out) && fs::equivalent(*own, *request.out)));
  return is_own ? *own : fs::path();
}

Start find_checkpoint_and_place(const RunRequest& request, const Scene& scene, const World& world, Log& log) {
  if (request.restart == "auto") return start_auto(request, scene, world, log);
  Start start;
  if (request.restart) {
    start.checkpoint_path = *request.restart;
    start.checkpoint = read_checkpoint(start.checkpoint_path, world);
    start.directory = found_by_root(world, [&] { return own_directory(request, start.checkpoint_path); });
    start.goes_on_in_directory = !start.directory.empty();
  }
  if (start.directory.empty())
    start.directory = found_by_root(world, [&] { return new_run_directory(request.scene_file, scene, request.out); });
  return start;
}

/// A checkpoint that cannot be read is a bad request: nothing has been done yet.
Start find_start(const RunRequest& request, const Scene& scene, const World& world, Log& log) {
  try {
    return find_checkpoint_and_place(request, scene, world, log);
  } catch (const StorageError& error) {
    throw UsageError(error.what());
  }
}

/// A directory and those of its parents that were not there before.
class MadeDirectories {
 public:
  explicit MadeDirectories(const fs::path& directory) {
    for (fs::path path = fs::absolute(directory).lexically_normal(); !path.empty() && !fs::exists(path);
         path = path.parent_path())
      made_.push_back(path);
    make_directory(directory);
  }
  /// Takes back those that hold nothing.
  void remove_empty() const {
    std::error_code ignored;
    for (const fs::path& path : made_) fs::remove(path, ignored);
  }

 private:
  std::vector<fs::path> made_;
};

/// The lines in which two scene texts differ, a few of them.
std::string scene_differences(const std::string& before, const std::string& now) {
  const auto lines = [](const std::string& text) {
    std::vector<std::string> all;
    std::istringstream stream(text);
    for (std::string line; std::getline(stream, line);) all.push_back(line);
    return all;
  };
  const std::vector<std::string> a = lines(before), b = lines(now);
  std::string text;
  int n_shown = 0;
  const auto show = [&](const std::vector<std::string>& from, const std::vector<std::string>& in, const char* mark) {
    for (const std::string& line : from)
      if (std::find(in.begin(), in.end(), line) == in.end() && n_shown++ < 10)
        text += fmt::format("\n  {} {}", mark, line);
  };
  show(a, b, "-");
  show(b, a, "+");
  return text + (n_shown > 10 ? "\n  ..." : "");
}

/// Puts the files into the directory by which the run can be repeated.
void write_record(const Start& start, const RunRecord& record, const Layout& layout, Log& log) {
  const fs::path scene_file = start.directory / "scene.toml";
  if (start.checkpoint && start.checkpoint->record.scene != record.scene) {
    log.warn("the scene has changed since the checkpoint:" +
             scene_differences(start.checkpoint->record.scene, record.scene));
    if (start.goes_on_in_directory && fs::exists(scene_file))
      write_file(start.directory / fmt::format("scene.until-step-{}.toml", start.checkpoint->image.step),
                 read_file(scene_file));
  }
  write_file(scene_file, record.scene);
  write_file(start.directory / "version.txt", program_identity() + "\nlayout " + layout.text() + '\n');
}

Simulation make_simulation(const Scene& scene, const Layout& layout, const Start& start, const World& world) {
  if (!start.checkpoint) return Simulation(scene, layout.threads, world);
  Simulation simulation(scene, layout.threads, start.checkpoint->image, world);
  const Hash128 restored = simulation.state_hash();
  if (!(restored == start.checkpoint->image.hash))
    throw StorageError(start.checkpoint_path, "cannot be gone on from: the state restored has the hash " +
                                                  restored.text() + ", the one stored " +
                                                  start.checkpoint->image.hash.text() +
                                                  "; this program and the one that wrote it differ");
  return simulation;
}

/// The last step of a run that is to take so many.
std::uint64_t last_of_so_many(const RunRequest& request, const Simulation& simulation, Log& log) {
  const std::uint64_t first = simulation.step_number(), n_steps = simulation.plan().n_steps;
  const std::uint64_t n_left = n_steps > first ? n_steps - first : 0;
  const std::uint64_t wanted = request.warm_up + *request.steps;
  if (wanted > n_left)
    log.warn(fmt::format("the scene ends after {}, before the {} of --warm-up and --steps (a later time.end goes on)",
                         counted(n_left, "step"), wanted));
  return first + std::min(wanted, n_left);
}

/// The last step of this process.
std::uint64_t last_step(const RunRequest& request, const Simulation& simulation, Log& log) {
  const std::uint64_t n_steps = simulation.plan().n_steps;
  if (request.steps) return last_of_so_many(request, simulation, log);
  if (!request.until) return n_steps;
  const std::uint64_t wanted = steps_until(*request.until, simulation.time_step());
  if (wanted > n_steps)
    log.warn(fmt::format(
        "--until {} s lies behind the end of the scene, {} s, where the run will end (--set time.end={} goes on)",
        *request.until, simulation.scene().time.end, *request.until));
  return std::min(wanted, n_steps);
}

/// The command that goes on with this run.
std::string go_on_command(const RunRequest& request, const fs::path& directory) {
  std::string command = "moraine run " + shell_quoted(request.scene_file.string());
  if (request.layout) command += " --layout " + *request.layout;
  for (const std::string& override_ : request.overrides) command += " --set " + shell_quoted(override_);
  return command + " --restart auto --out " + shell_quoted(directory.string());
}

std::string how_to_go_on(const RunRequest& request, const fs::path& directory,
                         const std::optional<fs::path>& checkpoint) {
  if (!checkpoint) return "there is no checkpoint to go on from yet";
  return fmt::format("the last checkpoint is {}\nto go on from it: {}", checkpoint->string(),
                     go_on_command(request, directory));
}

/// One run from its first to its last step; all ranks do the same, and what is said is the root's.
class RunLoop {
 public:
  RunLoop(const RunRequest& request, const Start& start, const Layout& layout, Simulation& simulation, RunRecord record,
          double start_seconds, Log& log)
      : request_(request),
        directory_(start.directory),
        layout_(layout),
        simulation_(simulation),
        world_(simulation.world()),
        log_(log),
        last_step_(last_step(request, simulation, log)) {
    if (request.has_outputs) outputs_.emplace(start.directory, simulation, std::move(record), kept_until(start), log);
    times_.start = start_seconds;
    is_new_ = !start.checkpoint;
    if (start.checkpoint) resume_from_ = start.checkpoint_path;
  }

  int run() {
    const InterruptGuard guard;
    try {
      return go();
    } catch (const RecordedRunError& error) {
      fail("", error.what() + (outputs_ ? outputs_->keep(error.record) : ""));
    } catch (const RunError& error) {
      fail("", error.what());  // which says at which step
    } catch (const StorageError& error) {
      fail(step_text(), error.what());
    } catch (const std::bad_alloc&) {
      if (world_.is_alone()) throw;
      fail(step_text(), "there is not enough memory");
    } catch (const std::exception& error) {
      if (world_.is_alone()) throw;
      fail(step_text(), error.what());  // here, where nothing has been taken apart yet that the other ranks wait for
    }
    return exit_code::failed;
  }

 private:
  int go() {
    if (is_new_ && outputs_) outputs_->write_due(simulation_);
    Progress progress(log_, simulation_.step_number(), last_step_, simulation_.time_step());
    mark_.cpus = cpus_of_threads(layout_.threads);
    while (simulation_.step_number() < last_step_ && !is_to_stop()) {
      step();
      progress.update(simulation_.step_number(), simulation_.n_grains());
    }
    times_.cpus = cpus_of_threads(layout_.threads);
    const bool is_interrupted = simulation_.step_number() < last_step_;
    // The last state is worth a look; an interrupted run will come by the snapshots that it owes.
    if (outputs_ && !is_interrupted) {
      outputs_->write_snapshot_now(simulation_);
      outputs_->write_open_fields(simulation_);
    }
    if (outputs_) {
      outputs_->write_checkpoint_now(simulation_);
      outputs_->write_open_records(simulation_);
    }
    return is_interrupted ? end_interrupted() : end_well();
  }

  void step() {
    const WallClock clock;
    const WorldTimes before = world_.times();
    simulation_.step();
    times_.stepping += clock.seconds();
    times_.world.reductions += world_.times().reductions - before.reductions;
    times_.world.parcels += world_.times().parcels - before.parcels;
    times_.particle_steps += static_cast<double>(simulation_.n_grains());
    ++times_.n_steps;
    say_news();
    if (outputs_) outputs_->write_due(simulation_);
    if (times_.n_warm_up < request_.warm_up && times_.n_steps == request_.warm_up) end_warm_up();
  }

  /// What the run has to say, as it comes up: warnings, and what the balance did.
  void say_news() {
    for (const std::string& note : simulation_.take_notes()) log_.warn(note);
    if (simulation_.n_known_warnings() > n_said_) {
      const std::vector<std::string> warnings = simulation_.known_warnings();
      while (n_said_ < warnings.size()) log_.warn(warnings[n_said_++]);
    }
    if (!world_.is_root()) return;
    for (const std::string& note : simulation_.take_balance_notes()) log_.say(note);
    const std::vector<BalanceRow> rows = simulation_.take_balance_rows();
    if (outputs_) outputs_->add_balance(rows);
  }

  /// From here on it counts.
  void end_warm_up() {
    world_.wait_for_all();  // all begin together
    RunTimes counted_from_here;
    counted_from_here.start = times_.start;
    counted_from_here.n_warm_up = times_.n_steps;
    times_ = counted_from_here;
    outputs_before_ = outputs_ ? outputs_->seconds() : 0.0;
    mark_ = mark_of(simulation_, layout_.threads);
  }

  bool is_to_stop() {
    if (InterruptGuard::signal() != 0) simulation_.ask_to_stop();
    return simulation_.is_stop_agreed();
  }

  /// `signal`: that has ended the run, or 0.
  void finish(int signal) {
    if (outputs_) times_.outputs = outputs_->seconds() - outputs_before_;
    RunSummary run = summarize(simulation_, times_, mark_);
    if (!world_.is_root()) return;
    run.scene_file = request_.scene_file.string();
    run.layout = layout_.text();
    run.directory = directory_.string();
    run.signal = signal;
    const std::string text = summary_text(run);
    write_file(directory_ / "summary.txt", text + '\n');
    write_file(directory_ / "summary.json", summary_json(run));
    log_.say(text);
  }

  int end_well() {
    if (world_.is_root() && outputs_ && outputs_->n_snapshots() > 0)
      log_.say(fmt::format("{} in {}", counted(outputs_->n_snapshots(), "snapshot"),
                           (directory_ / "snapshots.xdmf").string()));
    finish(0);
    if (outputs_ && last_step_ < simulation_.plan().n_steps)
      log_.say("to go on: " + go_on_command(request_, directory_));
    return exit_code::good;
  }

  int end_interrupted() {
    auto noted = static_cast<std::uint64_t>(InterruptGuard::signal());
    world_.max(std::span(&noted, 1));  // not all ranks need have been told
    const int signal = static_cast<int>(noted);
    finish(signal);
    if (outputs_)
      log_.say(fmt::format("ended by signal {} at {:.6g} s, checkpoint {}\nto go on: {}", signal, simulation_.time(),
                           outputs_->last_checkpoint()->string(), go_on_command(request_, directory_)));
    else
      log_.say(fmt::format("ended by signal {} at {:.6g} s, without a checkpoint (--no-output)", signal,
                           simulation_.time()));
    return exit_code::signal + signal;
  }

  std::string step_text() const { return fmt::format("step {}: ", simulation_.step_number()); }

  /// Says what happened, where it is not known by itself also when. Of several ranks only this one may know: it speaks
  /// for all, and ends them.
  void fail(const std::string& when, const std::string& cause) {
    if (world_.is_alone()) {
      report(log_, cause);
      return;
    }
    end_job(world_, exit_code::failed, [&] {
      const std::string text = fmt::format("rank {}: {}{}", world_.rank(), when, cause);
      if (world_.is_root()) {
        report(log_, text);
        return;
      }
      Log log;
      try {
        log.open(directory_ / "log.txt");
      } catch (const StorageError&) { /* the terminal will do */
      }
      report(log, text);
    });
  }

  /// The log may lie on the disk that is full; what it says is on the terminal by then.
  void report(Log& log, const std::string& text) {
    try {
      log.error(text);
    } catch (const StorageError&) {}
    const bool has_own = outputs_ && outputs_->last_checkpoint();
    const std::optional<fs::path> checkpoint = has_own ? outputs_->last_checkpoint() : resume_from_;
    try {
      log.say(how_to_go_on(request_, directory_, checkpoint));
    } catch (const StorageError&) {}
  }

  const RunRequest& request_;
  fs::path directory_;
  Layout layout_;
  Simulation& simulation_;
  World world_;
  Log& log_;
  std::uint64_t last_step_;
  std::optional<Outputs> outputs_;  // none: the run is for its timing only
  RunTimes times_;
  RunMark mark_;
  double outputs_before_ = 0.0;  // [s] of output in the warm-up
  std::size_t n_said_ = 0;       // of the run's warnings
  bool is_new_ = true;
  std::optional<fs::path> resume_from_;
};

void say_what_runs(const Scene& scene, const Simulation& simulation, const Start& start, const Layout& layout,
                   Log& log) {
  if (!scene.title.empty()) log.say(scene.title);
  const Plan& plan = simulation.plan();
  log.say(fmt::format("{}, {} of {:.6g} s, layout {}", counted(simulation.n_grains(), "grain"),
                      counted(plan.n_steps, "step"), simulation.time_step(), layout.text()));
  for (const std::string& warning : plan.warnings) log.warn(warning);
  if (start.checkpoint)
    log.say(fmt::format("going on from {}: step {}, {:.6g} s", start.checkpoint_path.string(),
                        start.checkpoint->image.step, start.checkpoint->image.time));
}

/// Puts the results where they belong, from the first to the last of them.
int run_in_place(const RunRequest& request, Scene& scene, const Start& start, const Layout& layout, const World& world,
                 const WallClock& clock, Log& log) {
  const std::optional<FreeMemory> free = free_memory();
  Simulation simulation = make_simulation(scene, layout, start, world);
  keep_within_memory(simulation, free, world);
  scene.particles.clear();  // lists of start positions weigh as much as the grains
  const RunRecord record{scene_as_run(request.scene_file, request.overrides), program_version(), program_commit()};
  if (world.is_root()) {
    log.open(start.directory / "log.txt");
    log.note(program_identity());
    write_record(start, record, layout, log);
  }
  log.say("results: " + start.directory.string());
  say_what_runs(scene, simulation, start, layout, log);
  for (const std::string& line : simulation.keep_to_cores()) log.say(line);
  return RunLoop(request, start, layout, simulation, record, clock.seconds(), log).run();
}

/// What mpirun's job has left of the run, after a rank was ended by a signal.
std::string how_to_go_on_after(const RunRequest& request, const Scene& scene, const fs::path& newest_before) {
  const fs::path newest = newest_run_directory(request.scene_file, scene).value_or(fs::path());
  const bool is_of_this_run = request.restart || newest != newest_before;
  const fs::path directory = request.out ? *request.out : is_of_this_run ? newest : fs::path();
  const std::vector<fs::path> checkpoints = directory.empty() ? std::vector<fs::path>() : list_checkpoints(directory);
  return how_to_go_on(request, directory,
                      checkpoints.empty() ? std::nullopt : std::optional<fs::path>(checkpoints.front()));
}

/// Who was ended by which signal; empty where nobody was.
std::string killed_text(const JobEnd& end) {
  const int signal = end.killed ? end.killed->signal : end.mpirun_killed;
  if (signal == 0) return {};
  const std::string who = end.killed ? fmt::format("rank {} on {}", end.killed->rank, end.killed->node) : "mpirun";
  return fmt::format("{} was ended by signal {} ({}){}", who, signal, strsignal(signal),
                     signal == SIGKILL ? ", as the system does where memory runs out" : "");
}

std::string given_up_text(const JobEnd& end, const Layout& layout) {
  return fmt::format("{}, and was ended: see what it said above, and whether \"mpirun -n {} hostname\" works here{}",
                     end.given_up == GivenUp::no_ranks
                         ? "mpirun has no ranks and does not end"
                         : fmt::format("mpirun has not brought the {} ranks together in time", layout.ranks),
                     layout.ranks,
                     end.given_up == GivenUp::no_ranks ? "" : "; MORAINE_START_PATIENCE=SECONDS waits longer");
}

/// Starts the ranks of a layout, after everything has been looked at that can be wrong with the request.
int run_on_ranks(const RunRequest& request, Scene& scene, const Layout& layout, Log& log) {
  scene.particles.clear();  // it is the ranks who need them
  if (!request.restart) new_run_directory(request.scene_file, scene, request.out);
  const fs::path newest_before = newest_run_directory(request.scene_file, scene).value_or(fs::path());
  const JobEnd end = run_as_ranks(layout, request.command_line);
  if (end.given_up != GivenUp::no) {
    log.error(given_up_text(end, layout));
    log.say(how_to_go_on_after(request, scene, newest_before));
    return exit_code::failed;
  }
  const std::string cause = killed_text(end);
  if (cause.empty()) return end.code;
  if (end.signal != 0) {
    log.say(fmt::format("ended by signal {} before the first step or after the last", end.signal));
    return exit_code::signal + end.signal;
  }
  log.error(cause + "; the run has ended with it");
  log.say(how_to_go_on_after(request, scene, newest_before));
  return exit_code::failed;
}

}  // namespace

int run_scene(const RunRequest& request, Log& log, const World& world) {
  const WallClock clock;
  if (const auto stray = stray_tasks()) {
    if (!stray->is_first) return exit_code::bad_input;
    throw UsageError(
        fmt::format("srun has started {} tasks that do not find each other, so that each would do the whole run: give "
                    "srun --mpi=pmix (srun --mpi=list shows what there is)",
                    stray->n_tasks));
  }
  std::vector<SceneMessage> warnings;
  Scene scene = read_scene(request.scene_file, request.overrides, &warnings, world);
  refuse_scripted_walls(scene);
  GivenLayout given;
  if (World::is_launched()) {
    given = layout_of_given_ranks(request.layout, scene.run.layout, world);
    if (const auto share = share_of_node(world); share && world.is_root())
      expect_to_fit(make_plan(scene, given.layout.threads), given.layout, *share);
  } else {
    const LayoutChoice choice = layout_for(scene, request.layout);
    given.layout = choice.layout;
    given.why = choice.why;
    given.is_crowded = given.layout.threads > available_cores();
    if (!this_place().is_one_of_many)
      if (const auto doubt = expect_to_fit(make_plan(scene, given.layout.threads), given.layout)) log.warn(*doubt);
    if (!given.why.empty()) log.say(fmt::format("layout {}: {}", given.layout.text(), given.why));
    if (given.layout.ranks > 1) return run_on_ranks(request, scene, given.layout, log);
  }
  for (const SceneMessage& warning : warnings) log.warn(warning.text());
  if (given.is_crowded)
    log.warn(fmt::format("layout {} asks for more threads than the {} cores that this process may use",
                         given.layout.text(), available_cores()));
  const Start start = find_start(request, scene, world, log);
  if (!request.has_outputs && start.goes_on_in_directory)
    throw UsageError("--no-output would leave gaps in the results of " + start.directory.string() +
                     ", where the run goes on; give it a directory of its own by --out");

  if (!world.is_root()) return run_in_place(request, scene, start, given.layout, world, clock, log);
  const MadeDirectories made(
      start.directory);  // before the scene is filled: a place that cannot be written is found at once
  try {
    return run_in_place(request, scene, start, given.layout, world, clock, log);
  } catch (...) {
    made.remove_empty();
    throw;
  }
}

}  // namespace moraine
