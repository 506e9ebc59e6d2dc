#include "io/cli/pareto_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>

#include "engine/particles/fill.hpp"
#include "engine/run/plan.hpp"
#include "io/checkpoint/durable_file.hpp"
#include "io/cli/child.hpp"
#include "io/cli/interrupt.hpp"
#include "io/cli/launch.hpp"
#include "io/cli/pareto_report.hpp"
#include "io/cli/programs.hpp"
#include "io/cli/progress.hpp"
#include "io/cli/run_command.hpp"
#include "io/cli/run_directory.hpp"
#include "io/cli/sweep.hpp"
#include "io/cli/text.hpp"
#include "io/cli/version.hpp"
#include "io/scene_toml/scene_toml.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

constexpr int usual_repeats = 3;  // of scenes that are compared by statistics

fs::path directory_of(const ParetoRequest& request) {
  if (request.out) return request.out->has_filename() ? *request.out : request.out->parent_path();
  return fs::path("runs") / ("pareto-" + run_name(request.scene_file));
}

SweepIdentity identity_of(const ParetoRequest& request, const Layout& layout) {
  return {"pareto on " + layout.text(),
          scene_without_studies(request.scene_file, request.overrides),
          state_of_files(files_of_scene(request.scene_file, request.overrides)),
          hash_of_program(),
          this_machine(),
          0,
          0};
}

std::string command_text(const ParetoRequest& request) {
  std::string text = "moraine pareto " + shell_quoted(request.scene_file.string());
  for (const std::string& change : request.overrides) text += " --set " + shell_quoted(change);
  if (request.layout) text += " --layout " + *request.layout;
  if (request.repeats) text += fmt::format(" --repeats {}", *request.repeats);
  if (request.is_product) text += " --product";
  return text;
}

std::vector<ProbeColumn> columns_of(const ParetoPlan& plan) {
  std::vector<ProbeColumn> columns;
  const bool by_statistics = plan.measure == ParetoMeasure::statistics;
  for (const std::string& text : by_statistics ? plan.table.statistics : plan.table.values)
    columns.push_back(find_column(plan.scene, text, by_statistics ? "statistics" : "values"));
  return columns;
}

/// The changes that a run is concerned by: not those of the table of the sweep itself, so that more settings do not make other runs.
std::vector<std::string> changes_of_scene(const std::vector<std::string>& overrides) {
  std::vector<std::string> changes = overrides;
  std::erase_if(changes, [](const std::string& change) {
    return change.starts_with("pareto.") || change.starts_with("pareto=") || change.starts_with("scale.");
  });
  return changes;
}

/// What all runs of the sweep change of the scene, besides their setting.
std::vector<std::string> common_overrides(const ParetoPlan& plan, const std::vector<ProbeColumn>& columns) {
  std::vector<std::string> changes = {fmt::format("time.end={}", plan.end), "output.checkpoints=0",
                                      fmt::format("output.snapshots={}", plan.sample), "output.fields=[\"position\"]",
                                      "output.distributed=false"};
  if (plan.measure == ParetoMeasure::statistics) return changes;
  for (std::size_t i = 0; i < plan.scene.output.probes.size(); ++i)
    if (std::any_of(columns.begin(), columns.end(),
                    [&](const ProbeColumn& column) { return column.probe == plan.scene.output.probes[i].name; }))
      changes.push_back(fmt::format("probe[{}].interval={}", i, plan.sample));
  return changes;
}

/// One run: a setting with one of its seeds.
struct ParetoRun {
  std::size_t setting = 0;
  int repeat = 1;
};

/// A sweep that cannot go on: its reference does not come to its end, or a run is ended from outside.
struct ParetoFault : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class ParetoSweep {
 public:
  ParetoSweep(const ParetoRequest& request, const ParetoPlan& plan, const Layout& layout, int repeats,
              const SweepDirectory& directory, Log& log)
      : request_(request),
        plan_(plan),
        layout_(layout),
        directory_(directory),
        columns_(columns_of(plan)),
        common_(common_overrides(plan, columns_)),
        records_(plan.settings.size()),
        failures_(plan.settings.size()),
        log_(log) {
    for (int repeat = 1; repeat <= repeats; ++repeat)
      for (std::size_t i = 0; i < plan.settings.size(); ++i)
        if (repeat <= repeats_of(plan.settings[i])) runs_.push_back({i, repeat});
    n_done_before_ = static_cast<std::size_t>(
        std::count_if(runs_.begin(), runs_.end(), [&](const ParetoRun& run) { return is_done(run); }));
  }

  std::size_t n_runs() const { return runs_.size(); }
  std::size_t n_done_before() const { return n_done_before_; }
  std::size_t n_done() const { return n_done_; }

  /// Returns the signal that has ended it early, or 0.
  int run() {
    const InterruptGuard guard;
    for (const ParetoRun& one : runs_) {
      if (InterruptGuard::signal() != 0) break;
      if (failures_[one.setting].empty() && !is_done(one) && !carry_out(one)) break;
      take(one);
      ++n_done_;
    }
    return n_done_ == runs_.size() ? 0 : InterruptGuard::signal();
  }

  std::vector<ParetoResult> results() const {
    std::vector<ParetoResult> all;
    for (std::size_t i = 0; i < plan_.settings.size(); ++i) all.push_back(result_of(i));
    // A skin changes no bit; where the states agree, so do the errors, of which the scene has more repeats.
    const auto scene =
        std::find_if(all.begin(), all.end(), [](const ParetoResult& r) { return r.setting.kind == ParetoKind::scene; });
    for (ParetoResult& result : all)
      if (result.is_good() && scene->is_good() && result.setting.kind == ParetoKind::skin &&
          is_same_state(result, *scene))
        result.errors = scene->errors;
    return all;
  }

 private:
  /// Skins are tried for their speed only, which a few repeats tell.
  static int repeats_of(const ParetoSetting& setting) { return setting.kind == ParetoKind::skin ? 5 : 1 << 30; }

  std::string name_of(const ParetoRun& run) const {
    return plan_.settings[run.setting].id + '-' + std::to_string(run.repeat);
  }
  fs::path failure_file(const ParetoRun& run) const { return directory_.path() / "runs" / (name_of(run) + ".failed"); }

  std::vector<std::string> changes_of(const ParetoRun& run) const {
    std::vector<std::string> changes = changes_of_scene(request_.overrides);
    for (const auto& more : {common_, plan_.settings[run.setting].overrides, repeat_overrides(plan_.scene, run.repeat)})
      changes.insert(changes.end(), more.begin(), more.end());
    return changes;
  }

  std::string request_text(const ParetoRun& run) const {
    std::string text;
    for (const std::string& change : changes_of(run)) text += change + '\n';
    return text;
  }

  /// A run counts only where it was asked for the very same.
  bool is_done(const ParetoRun& run) const {
    const fs::path file = directory_.request_file(name_of(run));
    if (!fs::exists(file) || read_file(file) != request_text(run)) return false;
    return fs::exists(failure_file(run)) || directory_.find(name_of(run));
  }

  void take(const ParetoRun& run) {
    if (!failures_[run.setting].empty()) return;  // one of its repeats has stopped: it is of no use
    if (fs::exists(failure_file(run))) {
      failures_[run.setting] = read_file(failure_file(run));
      if (plan_.settings[run.setting].kind == ParetoKind::reference)
        throw ParetoFault("the reference cannot be run: " + failures_[run.setting]);
      return;
    }
    records_[run.setting].push_back(read_record(plan_, columns_, directory_.run_directory(name_of(run))));
    if (is_timed_) seconds_.push_back({run.setting, clock_.seconds()});
    is_timed_ = false;
  }

  /// False where a signal has ended it.
  bool carry_out(const ParetoRun& run) {
    const std::string name = name_of(run);
    directory_.clear(name);
    std::error_code ignored;
    fs::remove(failure_file(run), ignored);
    fs::remove(directory_.request_file(name), ignored);
    clock_ = WallClock();
    is_timed_ = true;
    say_progress(run);
    const ChildEnd end = run_child(words_of(run), ".", directory_.talk_file(name), [&] {
      if (log_.is_terminal()) say_progress(run);
    });
    if (InterruptGuard::signal() != 0) return false;
    if (end.killed != 0 || end.code == exit_code::bad_input)
      throw ParetoFault(fmt::format("run {} {}; the last that it said, in {}:\n{}", name,
                                    end.killed != 0
                                        ? fmt::format("was ended by signal {} ({})", end.killed, strsignal(end.killed))
                                        : "was refused",
                                    directory_.talk_file(name).string(), last_words(directory_.talk_file(name), 8)));
    if (end.code != 0) write_file(failure_file(run), cause_of_failure(name));
    tidy(name);
    write_file(directory_.request_file(name), request_text(run));  // from now on it is done
    return true;
  }

  /// The line of its talk that says what was wrong.
  std::string cause_of_failure(const std::string& name) const {
    const std::string words = last_words(directory_.talk_file(name), 20);
    const std::size_t at = words.find("error: ");
    if (at == std::string::npos) return last_words(directory_.talk_file(name), 1);
    return words.substr(at + 7, words.find('\n', at) - at - 7);
  }

  /// Takes away what nobody will look at: the sweep may have many runs.
  void tidy(const std::string& name) const {
    std::error_code ignored;
    fs::remove_all(directory_.run_directory(name) / "checkpoints", ignored);
    if (plan_.measure == ParetoMeasure::statistics)
      fs::remove_all(directory_.run_directory(name) / "snapshots", ignored);
  }

  std::vector<std::string> words_of(const ParetoRun& run) const {
    std::vector<std::string> words = {request_.program,
                                      "run",
                                      request_.scene_file.string(),
                                      "--layout",
                                      layout_.text(),
                                      "--out",
                                      directory_.run_directory(name_of(run)).string()};
    for (const std::string& change : changes_of(run)) words.insert(words.end(), {"--set", change});
    return words;
  }

  ParetoResult result_of(std::size_t i) const {
    ParetoResult result;
    result.setting = plan_.settings[i];
    result.failure = failures_[i];
    const std::vector<ParetoRecord>& runs = records_[i];
    result.n_runs = static_cast<int>(runs.size());
    if (!result.is_good()) return result;
    std::vector<const RunSummary*> by_time;
    for (const ParetoRecord& record : runs) {
      by_time.push_back(&record.summary);
      result.hashes.push_back(record.summary.hash);
      result.times.push_back(record.summary.seconds());
    }
    std::sort(by_time.begin(), by_time.end(),
              [](const RunSummary* a, const RunSummary* b) { return a->seconds() < b->seconds(); });
    const RunSummary& median = *by_time[(by_time.size() - 1) / 2];
    result.seconds = median.seconds() * plan_.scene.time.end / plan_.end;
    result.speed = median.speed();
    if (result.setting.kind != ParetoKind::reference)
      result.errors = errors_between(plan_, columns_, runs, records_.front());
    return result;
  }

  void say_progress(const ParetoRun& run) {
    std::string text = fmt::format("run {} of {}: {}", n_done_ + 1, runs_.size(), plan_.settings[run.setting].name);
    if (run.repeat > 1) text += fmt::format(", repeat {}", run.repeat);
    if (const std::optional<double> left = seconds_left(run)) text += ", " + duration_text(*left) + " left";
    log_.progress(text);
  }

  /// Runs take as long as they have steps.
  std::optional<double> seconds_left(const ParetoRun& now) const {
    double seconds = 0.0, steps = 0.0, left = 0.0;
    for (const auto& [setting, time] : seconds_) {
      seconds += time;
      steps += 1.0 / plan_.settings[setting].time_step;
    }
    if (steps == 0.0) return std::nullopt;
    for (std::size_t i = n_done_; i < runs_.size(); ++i)
      if (!is_done(runs_[i])) left += seconds / steps / plan_.settings[runs_[i].setting].time_step;
    const double since = clock_.seconds(), expected = seconds / steps / plan_.settings[now.setting].time_step;
    return left - std::min(since, expected);
  }

  const ParetoRequest& request_;
  const ParetoPlan& plan_;
  const Layout layout_;
  const SweepDirectory& directory_;
  const std::vector<ProbeColumn> columns_;
  const std::vector<std::string> common_;
  std::vector<ParetoRun> runs_;
  std::vector<std::vector<ParetoRecord>> records_;       // of each setting, by repeat
  std::vector<std::string> failures_;                    // of each setting
  std::vector<std::pair<std::size_t, double>> seconds_;  // that runs of this process have taken [s], by setting
  WallClock clock_;
  bool is_timed_ = false;
  std::size_t n_done_before_ = 0, n_done_ = 0;
  Log& log_;
};

int report(const ParetoRequest& request, const ParetoPlan& plan, const ParetoSweep& sweep, const Layout& layout,
           int repeats, const fs::path& directory, Log& log) {
  ParetoResults results{request.scene_file.string(),
                        plan.scene.title,
                        program_version(),
                        program_commit(),
                        this_machine(),
                        layout.text(),
                        command_text(request),
                        plan.measure,
                        plan.end,
                        plan.table.from,
                        plan.scene.time.end,
                        repeats,
                        plan.table.accept,
                        sweep.results(),
                        {},
                        {},
                        false,
                        plan.remarks};
  judge(results);
  log.say(pareto_table(results) + write_pareto_report(results, directory));
  return results.recommended ? exit_code::good : exit_code::failed;
}

}  // namespace

int pareto_scene(const ParetoRequest& request, Log& log) {
  if (World::is_launched())
    throw UsageError("moraine pareto starts the ranks of its runs itself: start it without mpirun or srun");
  const ParetoPlan plan = plan_pareto(request.scene_file, request.overrides, request.is_product);
  if (count_grains(plan.scene) == 0)
    throw UsageError(request.scene_file.string() + ": the scene has no grains, so there is no time step to choose");
  const Layout layout = parse_layout(request.layout.value_or(plan.scene.run.layout));
  if (layout.ranks > 1) find_mpirun(layout);
  const int repeats = request.repeats.value_or(plan.measure == ParetoMeasure::statistics ? usual_repeats : 1);
  const SweepDirectory directory(directory_of(request), identity_of(request, layout));
  if (!directory.remark().empty()) log.say(directory.remark());
  ParetoSweep sweep(request, plan, layout, repeats, directory, log);
  if (sweep.n_done_before() > 0)
    log.say(fmt::format("{} of {} are done already, in {}", sweep.n_done_before(), counted(sweep.n_runs(), "run"),
                        directory.path().string()));
  try {
    if (const int signal = sweep.run(); signal != 0) {
      log.say(fmt::format("ended by signal {}: {} of {} done, and kept in {}; the same command goes on from there",
                          signal, sweep.n_done(), counted(sweep.n_runs(), "run"), directory.path().string()));
      return exit_code::signal + signal;
    }
  } catch (const ParetoFault& error) {
    log.error(error.what());
    log.say("what is done stays in " + directory.path().string() + "; the same command goes on from there");
    return exit_code::failed;
  }
  return report(request, plan, sweep, layout, repeats, directory.path(), log);
}

}  // namespace moraine
