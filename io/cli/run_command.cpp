#include "io/cli/run_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <sstream>
#include <string_view>

#include "engine/run/simulation.hpp"
#include "io/checkpoint/checkpoint.hpp"
#include "io/cli/interrupt.hpp"
#include "io/cli/layout.hpp"
#include "io/cli/outputs.hpp"
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

Start start_auto(const RunRequest& request, const Scene& scene, Log& log) {
  Start start;
  const std::optional<fs::path> found = request.out ? request.out : newest_run_directory(request.scene_file, scene);
  if (!found || !holds_run(*found)) {
    log.say("nothing to go on from yet: starting from the beginning");
    start.directory = new_run_directory(request.scene_file, scene, request.out);
    return start;
  }
  std::optional<LatestCheckpoint> latest = find_latest_checkpoint(*found);
  if (!latest) {
    start.directory = restarted_from_nothing(request, scene, *found, log);
    return start;
  }
  start.directory = *found;
  for (const std::string& warning : latest->warnings) log.warn(warning + "; taking the one before it");
  start.checkpoint = std::move(latest->checkpoint);
  start.checkpoint_path = latest->path;
  start.goes_on_in_directory = true;
  return start;
}

Start find_checkpoint_and_place(const RunRequest& request, const Scene& scene, Log& log) {
  if (request.restart == "auto") return start_auto(request, scene, log);
  Start start;
  if (!request.restart) {
    start.directory = new_run_directory(request.scene_file, scene, request.out);
    return start;
  }
  start.checkpoint_path = *request.restart;
  start.checkpoint = read_checkpoint(start.checkpoint_path);
  const std::optional<fs::path> own = run_directory_of(start.checkpoint_path);
  const bool is_own = own && (!request.out || (fs::exists(*request.out) && fs::equivalent(*own, *request.out)));
  start.goes_on_in_directory = is_own;
  start.directory = is_own ? *own : new_run_directory(request.scene_file, scene, request.out);
  return start;
}

/// A checkpoint that cannot be read is a bad request: nothing has been done yet.
Start find_start(const RunRequest& request, const Scene& scene, Log& log) {
  try {
    return find_checkpoint_and_place(request, scene, log);
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

Simulation make_simulation(const Scene& scene, const Layout& layout, const Start& start) {
  if (!start.checkpoint) return Simulation(scene, layout.threads);
  Simulation simulation(scene, layout.threads, start.checkpoint->image);
  const Hash128 restored = simulation.state_hash();
  if (!(restored == start.checkpoint->image.hash))
    throw StorageError(start.checkpoint_path, "cannot be gone on from: the state restored has the hash " +
                                                  restored.text() + ", the one stored " +
                                                  start.checkpoint->image.hash.text() +
                                                  "; this program and the one that wrote it differ");
  return simulation;
}

/// The last step of this process.
std::uint64_t last_step(const RunRequest& request, const Simulation& simulation, Log& log) {
  const std::uint64_t n_steps = simulation.plan().n_steps;
  if (!request.until) return n_steps;
  const std::uint64_t wanted = steps_until(*request.until, simulation.time_step());
  if (wanted > n_steps)
    log.warn(fmt::format(
        "--until {} s lies behind the end of the scene, {} s, where the run will end (--set time.end={} goes on)",
        *request.until, simulation.scene().time.end, *request.until));
  return std::min(wanted, n_steps);
}

std::string shell_quoted(const std::string& word) {
  const auto is_plain = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 ||
           std::string_view("_-./=,:+@").find(c) != std::string_view::npos;
  };
  if (!word.empty() && std::all_of(word.begin(), word.end(), is_plain)) return word;
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted + '\'';
}

/// The command that goes on with this run.
std::string go_on_command(const RunRequest& request, const fs::path& directory) {
  std::string command = "moraine run " + shell_quoted(request.scene_file.string());
  if (request.layout) command += " --layout " + *request.layout;
  for (const std::string& override_ : request.overrides) command += " --set " + shell_quoted(override_);
  return command + " --restart auto --out " + shell_quoted(directory.string());
}

/// One run from its first to its last step.
class RunLoop {
 public:
  RunLoop(const RunRequest& request, const Start& start, const Layout& layout, Simulation& simulation, RunRecord record,
          double start_seconds, Log& log)
      : request_(request),
        directory_(start.directory),
        layout_(layout),
        simulation_(simulation),
        log_(log),
        last_step_(last_step(request, simulation, log)),
        outputs_(start.directory, simulation, std::move(record), kept_until(start), log) {
    times_.start = start_seconds;
    is_new_ = !start.checkpoint;
    if (start.checkpoint) resume_from_ = start.checkpoint_path;
  }

  int run() {
    const InterruptGuard guard;
    try {
      return go();
    } catch (const RunError& error) {
      log_.error(error.what());
    } catch (const StorageError& error) {
      report_without_disk(error.what());
    }
    say_how_to_go_on();
    return exit_code::failed;
  }

 private:
  int go() {
    if (is_new_) outputs_.write_due(simulation_);
    Progress progress(log_, simulation_.step_number(), last_step_, simulation_.time_step());
    while (simulation_.step_number() < last_step_ && InterruptGuard::signal() == 0) {
      const WallClock clock;
      simulation_.step();
      times_.stepping += clock.seconds();
      times_.particle_steps += static_cast<double>(simulation_.n_grains());
      ++times_.n_steps;
      outputs_.write_due(simulation_);
      progress.update(simulation_.step_number(), simulation_.n_grains());
    }
    const bool is_interrupted = simulation_.step_number() < last_step_;
    // The last state is worth a look; an interrupted run will come by the snapshots that it owes.
    if (!is_interrupted) outputs_.write_snapshot_now(simulation_);
    outputs_.write_checkpoint_now(simulation_);
    return is_interrupted ? end_interrupted() : end_well();
  }

  void finish() {
    times_.outputs = outputs_.seconds();
    const std::string text = summary(simulation_, times_, directory_.string(), layout_.text());
    write_file(directory_ / "summary.txt", text + '\n');
    log_.say(text);
  }

  int end_well() {
    if (outputs_.n_snapshots() > 0)
      log_.say(fmt::format("{} in {}", counted(outputs_.n_snapshots(), "snapshot"),
                           (directory_ / "snapshots.xdmf").string()));
    finish();
    if (last_step_ < simulation_.plan().n_steps) log_.say("to go on: " + go_on_command(request_, directory_));
    return exit_code::good;
  }

  int end_interrupted() {
    const int signal = InterruptGuard::signal();
    finish();
    log_.say(fmt::format("ended by signal {} at {:.6g} s, checkpoint {}\nto go on: {}", signal, simulation_.time(),
                         outputs_.last_checkpoint()->string(), go_on_command(request_, directory_)));
    return exit_code::signal + signal;
  }

  /// The log may lie on the disk that is full.
  void report_without_disk(const std::string& text) {
    try {
      log_.error(text);
    } catch (const StorageError&) {
      std::fprintf(stderr, "error: %s\n", text.c_str());
    }
  }

  void say_how_to_go_on() {
    const std::optional<fs::path> checkpoint = outputs_.last_checkpoint() ? outputs_.last_checkpoint() : resume_from_;
    const std::string text = checkpoint ? fmt::format("the last checkpoint is {}\nto go on from it: {}",
                                                      checkpoint->string(), go_on_command(request_, directory_))
                                        : "there is no checkpoint to go on from yet";
    try {
      log_.say(text);
    } catch (const StorageError&) { /* said on the terminal all the same */
    }
  }

  const RunRequest& request_;
  fs::path directory_;
  Layout layout_;
  Simulation& simulation_;
  Log& log_;
  std::uint64_t last_step_;
  Outputs outputs_;
  RunTimes times_;
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

}  // namespace

int run_scene(const RunRequest& request, Log& log) {
  const WallClock clock;
  std::vector<SceneMessage> warnings;
  Scene scene = read_scene(request.scene_file, request.overrides, &warnings);
  const RunRecord record{scene_as_run(request.scene_file, request.overrides), program_version(), program_commit()};
  const Layout layout = parse_layout(request.layout.value_or(scene.run.layout));
  for (const SceneMessage& warning : warnings) log.warn(warning.text());
  if (layout.threads > available_cores())
    log.warn(fmt::format("layout {} asks for more threads than the {} cores that this process may use", layout.text(),
                         available_cores()));
  const Start start = find_start(request, scene, log);

  const MadeDirectories made(
      start.directory);  // before the scene is filled: a place that cannot be written is found at once
  try {
    Simulation simulation = make_simulation(scene, layout, start);
    scene.particles.clear();  // lists of start positions weigh as much as the grains
    log.open(start.directory / "log.txt");
    log.note(program_identity());
    write_record(start, record, layout, log);
    log.say("results: " + start.directory.string());
    say_what_runs(scene, simulation, start, layout, log);
    return RunLoop(request, start, layout, simulation, record, clock.seconds(), log).run();
  } catch (...) {
    made.remove_empty();
    throw;
  }
}

}  // namespace moraine
