#include "io/cli/scale_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <cstring>
#include <limits>
#include <map>
#include <set>

#include "engine/particles/fill.hpp"
#include "engine/run/plan.hpp"
#include "io/checkpoint/durable_file.hpp"
#include "io/cli/child.hpp"
#include "io/cli/interrupt.hpp"
#include "io/cli/launch.hpp"
#include "io/cli/network_file.hpp"
#include "io/cli/programs.hpp"
#include "io/cli/progress.hpp"
#include "io/cli/run_command.hpp"
#include "io/cli/run_directory.hpp"
#include "io/cli/scale_projection.hpp"
#include "io/cli/scale_report.hpp"
#include "io/cli/schedule.hpp"
#include "io/cli/text.hpp"
#include "io/cli/version.hpp"
#include "io/scene_toml/scene_toml.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

/// The overrides by which the scene is run on so many cores.
std::vector<std::string> overrides_on(const ScaleRequest& request, long long n_cores) {
  std::vector<std::string> all = request.overrides;
  if (request.kind == ScaleKind::strong) return all;
  for (std::string& growth : growth_overrides(request.scene_file, request.overrides, static_cast<int>(n_cores)))
    all.push_back(std::move(growth));
  return all;
}

constexpr std::uint64_t usual_steps = 300, usual_warm_up = 100;  // several rebuilds each

/// Fills in the numbers of steps that were not asked for: the usual ones, or fewer where the scene ends after
/// `n_steps`.
void choose_steps(ScaleRequest& request, std::uint64_t n_steps) {
  if (!request.steps) request.steps = std::clamp<std::uint64_t>(3 * n_steps / 4, 1, usual_steps);
  if (!request.warm_up)
    request.warm_up = std::min(usual_warm_up, n_steps > *request.steps ? n_steps - *request.steps : 0);
  if (*request.warm_up + *request.steps > n_steps)
    throw UsageError(fmt::format(
        "{}: the scene ends after {}, before the {} of --warm-up and --steps; use fewer, or a later time.end",
        request.scene_file.string(), counted(n_steps, "step"), *request.warm_up + *request.steps));
}

/// Looks at all that can be wrong before anything is run, and fills in the steps.
void check(ScaleRequest& request, const std::vector<Layout>& layouts) {
  if (World::is_launched())
    throw UsageError("moraine scale starts the ranks of its runs itself: start it without mpirun or srun");
  for (const int n : request.projected)
    if (n < 1) throw UsageError(fmt::format("--project: expected numbers of ranks from 1, found {}", n));
  for (const Layout& layout : layouts)
    if (layout.ranks > 1) find_mpirun(layout);
  std::set<long long> sizes;  // of the scene
  for (const Layout& layout : layouts) sizes.insert(request.kind == ScaleKind::weak ? layout.total() : 1);
  std::uint64_t n_steps = std::numeric_limits<std::uint64_t>::max();
  for (const long long n_cores : sizes) {
    const Scene scene = read_scene(request.scene_file, overrides_on(request, n_cores));
    refuse_scripted_walls(scene);
    if (count_grains(scene) == 0)
      throw UsageError(request.scene_file.string() + ": the scene has no grains to share out");
    n_steps = std::min(n_steps, steps_until(scene.time.end, choose_time_step(scene).step));
  }
  choose_steps(request, n_steps);
}

/// What is wrong with it should not come up after the runs.
void check_network(const ScaleRequest& request) {
  try {
    if (request.network) read_network(*request.network);
  } catch (const StorageError& error) {
    throw UsageError(error.what());
  }
}

fs::path directory_of(const ScaleRequest& request) {
  if (request.out) return request.out->has_filename() ? *request.out : request.out->parent_path();
  const std::string name = "scale-" + run_name(request.scene_file);
  return fs::path("runs") / (request.kind == ScaleKind::weak ? name + "-weak" : name);
}

SweepIdentity identity_of(const ScaleRequest& request) {
  return {word_for(request.kind),
          scene_as_run(request.scene_file, request.overrides),
          state_of_files(files_of_scene(request.scene_file, request.overrides)),
          hash_of_program(),
          this_machine(),
          *request.steps,
          *request.warm_up};
}

std::string command_text(const ScaleRequest& request) {
  std::string text = "moraine scale " + shell_quoted(request.scene_file.string()) + " --" + word_for(request.kind);
  for (const std::string& change : request.overrides) text += " --set " + shell_quoted(change);
  if (request.layouts) text += " --layouts " + *request.layouts;
  return text + fmt::format(" --steps {} --warm-up {} --repeats {}", *request.steps, *request.warm_up, request.repeats);
}

/// A run of the sweep that did not come to its end.
struct SweepError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The runs of a sweep, one after the other; those that are done already are not run again.
class Sweep {
 public:
  Sweep(const ScaleRequest& request, const std::vector<Layout>& layouts, const SweepDirectory& directory, Log& log)
      : request_(request),
        layouts_(layouts),
        directory_(directory),
        runs_(runs_by_turns(layouts, request.repeats)),
        clock_(request.kind),
        log_(log) {
    for (const SweepRun& run : runs_)
      if (const auto done = directory.find(run))
        add(run, *done);
      else
        missing_.push_back(run);
  }

  std::size_t n_runs() const { return runs_.size(); }
  std::size_t n_missing() const { return missing_.size(); }

  /// Runs what is missing. Returns the signal that has ended it early, or 0. Throws SweepError where a run fails.
  int run() {
    const InterruptGuard guard;
    while (!missing_.empty() && InterruptGuard::signal() == 0) {
      const SweepRun run = missing_.front();
      directory_.clear(run.name());
      if (!carry_out(run)) break;
      missing_.erase(missing_.begin());
    }
    return missing_.empty() ? 0 : InterruptGuard::signal();
  }

  std::vector<LayoutResult> results() const {
    std::vector<LayoutResult> all;
    for (const Layout& layout : layouts_) all.push_back(result_of(layout, done_.at(layout.text())));
    compare_layouts(all);
    return all;
  }
  const RunSummary& any_run() const { return done_.begin()->second.front(); }

 private:
  void add(const SweepRun& run, const RunSummary& summary) {
    done_[run.layout.text()].push_back(summary);
    clock_.add(run.layout, summary);
  }

  /// False where a signal has ended it.
  bool carry_out(const SweepRun& run) {
    const WallClock clock;
    say_progress(run, 0.0);
    const ChildEnd end = run_child(words_of(run), ".", directory_.talk_file(run.name()), [&] {
      if (log_.is_terminal()) say_progress(run, clock.seconds());
    });
    if (InterruptGuard::signal() != 0) return false;
    const std::optional<RunSummary> summary = end.is_good() ? directory_.find(run) : std::nullopt;
    if (!summary) throw SweepError(failure_text(run, end));
    add(run, *summary);
    return true;
  }

  std::vector<std::string> words_of(const SweepRun& run) const {
    std::vector<std::string> words = {request_.program,
                                      "run",
                                      request_.scene_file.string(),
                                      "--layout",
                                      run.layout.text(),
                                      "--out",
                                      directory_.run_directory(run.name()).string(),
                                      "--steps",
                                      std::to_string(*request_.steps),
                                      "--warm-up",
                                      std::to_string(*request_.warm_up),
                                      "--no-output"};
    for (const std::string& assignment : overrides_on(request_, run.layout.total()))
      words.insert(words.end(), {"--set", assignment});
    return words;
  }

  std::string failure_text(const SweepRun& run, const ChildEnd& end) const {
    const std::string how = end.killed != 0
                                ? fmt::format("was ended by signal {} ({})", end.killed, strsignal(end.killed))
                            : end.code != 0 ? fmt::format("ended with exit code {}", end.code)
                                            : "ended without the summary of so many steps";
    return fmt::format("run {} {}; the last that it said, in {}:\n{}", run.name(), how,
                       directory_.talk_file(run.name()).string(), last_words(directory_.talk_file(run.name()), 8));
  }

  /// `since`: [s] that the run has taken so far.
  void say_progress(const SweepRun& run, double since) {
    const std::size_t n_done = runs_.size() - missing_.size();
    std::string text = fmt::format("run {} of {}: layout {}, repeat {} of {}", n_done + 1, runs_.size(),
                                   run.layout.text(), run.repeat, request_.repeats);
    if (const std::optional<double> left = seconds_left(since)) text += ", " + duration_text(*left) + " left";
    log_.progress(text);
  }

  std::optional<double> seconds_left(double since) const {
    double left = 0.0;
    for (std::size_t i = 0; i < missing_.size(); ++i) {
      const std::optional<double> expected = clock_.expected(missing_[i].layout);
      if (!expected) return std::nullopt;
      left += i == 0 ? std::max(0.0, *expected - since) : *expected;
    }
    return left;
  }

  const ScaleRequest& request_;
  const std::vector<Layout>& layouts_;
  const SweepDirectory& directory_;
  std::vector<SweepRun> runs_, missing_;
  std::map<std::string, std::vector<RunSummary>> done_;  // by layout
  SweepClock clock_;
  Log& log_;
};

int end_interrupted(const ScaleRequest& request, const Sweep& sweep, int signal, Log& log) {
  log.say(fmt::format("ended by signal {}: {} of {} done, and kept in {}; the same command goes on from there", signal,
                      sweep.n_runs() - sweep.n_missing(), counted(sweep.n_runs(), "run"),
                      directory_of(request).string()));
  return exit_code::signal + signal;
}

/// What was measured is worth its table also where the projection cannot be made.
void add_projection(const ScaleRequest& request, ScaleResults& results, Log& log) {
  if (request.projected.empty()) return;
  std::vector<int> ranks = request.projected;
  std::sort(ranks.begin(), ranks.end());
  ranks.erase(std::unique(ranks.begin(), ranks.end()), ranks.end());
  const auto scene_on = [&](int n_cores) { return read_scene(request.scene_file, overrides_on(request, n_cores)); };
  log.progress("projecting");
  std::vector<std::string> remarks;
  try {
    const Network network = request.network ? read_network(*request.network) : default_network();
    results.projected = project_scaling(scene_on, ranks, network, remarks);
    if (scene_on(1).gas) remarks.emplace_back("projected are the grains only, without the gas");
  } catch (const std::exception& error) {
    remarks.push_back(std::string("there is no projection: ") + error.what());
  }
  for (const std::string& remark : remarks) log.warn(remark);
}

int report(const ScaleRequest& request, const Sweep& sweep, const fs::path& directory, Log& log) {
  const RunSummary& any = sweep.any_run();
  ScaleResults results{request.kind,
                       request.scene_file.string(),
                       any.title,
                       any.version,
                       any.commit,
                       this_machine(),
                       *request.steps,
                       *request.warm_up,
                       sweep.results(),
                       {},
                       command_text(request)};
  add_projection(request, results, log);
  log.say(scale_table(results) + write_scale_report(results, directory));
  const std::string fault = hash_fault(results);
  if (!fault.empty()) {
    log.error(fault);
    return exit_code::failed;
  }
  const std::string& hash = results.layouts.front().hashes.front();
  log.say(request.kind == ScaleKind::strong
              ? fmt::format("all {} ended in the same state: {}", counted(sweep.n_runs(), "run"), hash)
              : "runs on as many cores ended in the same state");
  return exit_code::good;
}

}  // namespace

int scale_scene(const ScaleRequest& asked, Log& log) {
  ScaleRequest request = asked;
  const std::vector<Layout> layouts =
      request.layouts ? parse_layouts(*request.layouts) : layouts_up_to(available_cores());
  check(request, layouts);
  check_network(request);
  for (const Layout& layout : layouts)
    if (layout.total() > available_cores())
      log.warn(fmt::format("layout {} has more threads than there are cores ({})", layout.text(), available_cores()));
  const SweepDirectory directory(directory_of(request), identity_of(request));
  if (!directory.remark().empty()) log.say(directory.remark());
  Sweep sweep(request, layouts, directory, log);
  if (const std::size_t n_done = sweep.n_runs() - sweep.n_missing(); n_done > 0)
    log.say(fmt::format("{} of {} are done already, in {}", n_done, counted(sweep.n_runs(), "run"),
                        directory.path().string()));
  try {
    if (const int signal = sweep.run(); signal != 0) return end_interrupted(request, sweep, signal, log);
  } catch (const SweepError& error) {
    log.error(error.what());
    log.say("what is done stays in " + directory.path().string() + "; the same command goes on from there");
    return exit_code::failed;
  }
  return report(request, sweep, directory.path(), log);
}

}  // namespace moraine
