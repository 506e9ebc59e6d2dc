#include "io/cli/submit_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "engine/run/plan.hpp"
#include "io/checkpoint/durable_file.hpp"
#include "io/cli/job_script.hpp"
#include "io/cli/launch.hpp"
#include "io/cli/programs.hpp"
#include "io/cli/run_directory.hpp"
#include "io/cli/text.hpp"
#include "io/cli/version.hpp"
#include "io/scene_toml/scene_toml.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

BatchSystem parse_system(const std::string& text) {
  if (text == "slurm") return BatchSystem::slurm;
  if (text == "pbs") return BatchSystem::pbs;
  if (text == "lsf") return BatchSystem::lsf;
  throw UsageError("--system \"" + text + "\": expected slurm, pbs or lsf");
}

/// Ranks and threads are asked for before anybody knows the machine.
Layout fixed_layout(const std::string& text) {
  if (text == "auto")
    throw UsageError(
        "a job needs a layout of so many ranks and threads, and \"auto\" depends on the machine: give "
        "--layout RANKSxTHREADS, such as --layout 8x4 for 8 ranks of 4 threads on all nodes together");
  return parse_layout(text);
}

std::vector<Layout> layouts_of(const SubmitRequest& request, const Scene& scene) {
  if (!request.is_sweep) {
    if (!request.layouts.empty()) throw UsageError("--layouts is for --sweep; for one job give --layout");
    return {fixed_layout(request.layout.value_or(scene.run.layout))};
  }
  if (request.layout) throw UsageError("--sweep takes several layouts: --layouts 1x4,2x2,4x1 instead of --layout");
  if (request.layouts.empty()) throw UsageError("--sweep needs the layouts: --layouts 1x4,2x2,4x1");
  std::vector<Layout> layouts;
  for (const std::string& text : request.layouts) {
    layouts.push_back(fixed_layout(text));
    if (std::count_if(layouts.begin(), layouts.end(),
                      [&](const Layout& one) { return one.text() == layouts.back().text(); }) > 1)
      throw UsageError("--layouts names " + layouts.back().text() + " twice");
  }
  return layouts;
}

/// Where the results of the job go. A job that was handed in before owns its directory, even while it still waits.
fs::path directory_of(const SubmitRequest& request, const Scene& scene) {
  Scene named = scene;
  if (request.is_sweep && scene.output.directory.empty())
    named.output.directory = (fs::path("runs") / (run_name(request.scene_file) + "-sweep")).string();
  if (request.restart) {
    const std::optional<fs::path> found = request.out ? request.out : newest_run_directory(request.scene_file, named);
    if (found && (holds_run(*found) || fs::exists(job_folder(*found)))) return *found;
  }
  fs::path directory = new_run_directory(request.scene_file, named, request.out);
  if (fs::exists(job_folder(directory)))
    throw UsageError(directory.string() +
                     " belongs to a job that was submitted before; choose another --out, or submit it again by "
                     "--restart auto");
  return directory;
}

std::int64_t memory_of(const SubmitRequest& request, const Job& job, const Plan& plan) {
  if (request.memory) return parse_memory(*request.memory);
  std::int64_t most = 0;
  for (const Layout& layout : job.layouts) most = std::max(most, memory_of_node(plan.memory, layout, job.nodes));
  return most;
}

Job job_of(const SubmitRequest& request, const Scene& scene, const std::vector<Layout>& layouts, const Plan& plan) {
  Job job;
  job.system = parse_system(request.system);
  job.name = job_name(request.name.value_or(run_name(request.scene_file)));
  job.nodes = request.nodes;
  job.layouts = layouts;
  job.is_sweep = request.is_sweep;
  if (request.time) job.time_limit = parse_time_limit(*request.time);
  job.margin = request.margin.value_or(default_margin(job.time_limit));
  job.memory = memory_of(request, job, plan);
  job.partition = request.partition;
  job.account = request.account;
  job.mpi = request.mpi;
  job.directives = request.directives;
  job.origin = "moraine " + program_version() + " (commit " + program_commit() + ")";
  job.program = request.program;
  job.scene = fs::absolute(request.scene_file).lexically_normal();
  job.out = fs::absolute(directory_of(request, scene)).lexically_normal();
  if (!job.out.has_filename()) job.out = job.out.parent_path();
  job.script = job_folder(job.out) / "submit.sh";
  job.overrides = request.overrides;
  return job;
}

/// Two jobs in one directory would write over each other.
void check_queue(const Job& job) {
  const ProgramEnd queue = hear_program({"squeue", "--me", "--noheader", "--format=%i %T %o"});
  std::istringstream lines(queue.code == 0 ? queue.output : "");
  for (std::string line; std::getline(lines, line);)
    if (line.find(' ' + job.script.string()) != std::string::npos) {
      const std::string id = line.substr(0, line.find(' '));
      throw UsageError(fmt::format("{} belongs to job {}, which has not ended yet; wait for it, or: scancel {}",
                                   job.out.string(), id, id));
    }
}

/// The number that sbatch --parsable prints, alone on a line (with ";CLUSTER" where there are several); empty where
/// there is none.
std::string job_id(const std::string& output) {
  std::istringstream lines(output);
  std::string id;
  for (std::string line; std::getline(lines, line);) {
    const std::string number = line.substr(0, line.find(';'));
    if (!number.empty() && number.find_first_not_of("0123456789") == std::string::npos) id = number;
  }
  return id;
}

/// Files that are taken back unless they are to stay.
class WrittenScript {
 public:
  WrittenScript(const fs::path& path, const std::string& text) : path_(path) {
    for (fs::path folder = path.parent_path(); !fs::exists(folder); folder = folder.parent_path())
      made_.push_back(folder);
    if (fs::exists(path)) before_ = read_file(path);
    make_directory(path.parent_path());
    write_file(path, text);
  }
  WrittenScript(const WrittenScript&) = delete;
  WrittenScript& operator=(const WrittenScript&) = delete;
  ~WrittenScript() {
    if (is_kept_) return;
    std::error_code ignored;
    fs::remove(path_, ignored);
    for (const fs::path& folder : made_) fs::remove(folder, ignored);  // where nothing else has come into it
    try {
      if (before_) write_file(path_, *before_);
    } catch (const StorageError&) { /* the error that brings us here is told */
    }
  }
  void keep() { is_kept_ = true; }

 private:
  fs::path path_;
  std::vector<fs::path> made_;
  std::optional<std::string> before_;
  bool is_kept_ = false;
};

fs::path find_sbatch() {
  if (const std::optional<fs::path> sbatch = find_program({"sbatch"})) return *sbatch;
  throw UsageError(
      "sbatch is not in PATH: submit jobs on a machine of a Slurm cluster (Debian: apt-get install "
      "slurm-client), or take --dry-run to see the script");
}

/// Slurm takes the memory of nodes whose memory it was not told (RealMemory) for 1 MB.
bool knows_memory_of_nodes() {
  const ProgramEnd nodes = hear_program({"sinfo", "--noheader", "--format=%m"});
  std::istringstream lines(nodes.output);
  bool is_told = nodes.code != 0 || nodes.output.empty();  // then sbatch will tell
  for (std::string line; std::getline(lines, line);) is_told = is_told || (line != "1" && line != "1+");
  return is_told;
}

/// What sbatch has said, and what can be done about it.
std::string refusal(const Job& job, const ProgramEnd& end) {
  std::string text = fmt::format("sbatch has refused the job (exit code {}), nothing was submitted:\n{}", end.code,
                                 end.output.empty() ? "it gave no reason" : end.output);
  if (end.output.find("Memory specification") != std::string::npos)
    text += fmt::format("\n{} MiB of each node were asked for; --mem SIZE asks for another size, --mem 0 for all of it",
                        job.memory);
  return text;
}

/// Hands the script in, and returns what sbatch has said.
std::string hand_in(const Job& job) {
  const fs::path sbatch = find_sbatch();
  check_queue(job);
  WrittenScript file(job.script, job_script(job));
  const ProgramEnd end = hear_program({sbatch.string(), "--parsable", job.script.string()});
  if (end.code != 0) throw UsageError(refusal(job, end));
  file.keep();
  return end.output;
}

/// Slurm takes jobs that no machine of the partition can run, and lets them wait for ever.
void warn_of_waiting(const std::string& id, Log& log) {
  const ProgramEnd queue = hear_program({"squeue", "--noheader", "--job=" + id, "--format=%r"});
  const std::string reason = queue.output.substr(0, queue.output.find('\n'));
  if (queue.code == 0 && (reason.starts_with("Partition") || reason.starts_with("Bad") || reason.ends_with("Limit")))
    log.warn(
        fmt::format("job {} waits by reason of {}: it may never start, unless it is changed (see man squeue; to "
                    "take it back: scancel {})",
                    id, reason, id));
}

std::string report(const Job& job, const Plan& plan, const std::string& output) {
  const std::string id = job_id(output);
  if (id.empty()) return "sbatch says: " + output;
  const fs::path folder = job.script.parent_path();
  const auto row = [](const char* name, const std::string& text) { return fmt::format("{:<9}{}\n", name, text); };
  std::string text = fmt::format("job {} submitted: \"{}\" on {}, ", id, job.name,
                                 counted(static_cast<std::uint64_t>(job.nodes), "node"));
  if (job.is_sweep) {
    text += fmt::format("an array of {}\n", counted(job.layouts.size(), "layout"));
    text += row("results", (job.out / "RANKSxTHREADS").string());
  } else {
    text +=
        fmt::format("layout {}; the run will take about {}\n", job.layouts.front().text(), duration_text(plan.seconds));
    text += row("results", job.out.string());
  }
  text += row("script", job.script.string());
  const std::string log = job.is_sweep ? shell_quoted((folder / (id + "_")).string()) + "*.out"
                                       : shell_quoted((folder / (id + ".out")).string());
  text += row("watch", fmt::format("squeue --me --name={}; tail -f {}", job.name, log));
  text += row("cancel", "scancel --me --name=" + job.name);
  return text + row("", "by its name, as a job that goes on has a new number; the run writes a checkpoint then");
}

}  // namespace

void submit(const SubmitRequest& request, Log& log) {
  std::vector<SceneMessage> warnings;
  const Scene scene = read_scene(request.scene_file, request.overrides, &warnings);
  refuse_scripted_walls(scene);
  const std::vector<Layout> layouts = layouts_of(request, scene);
  if (request.nodes < 1) throw UsageError(fmt::format("--nodes {}: expected at least 1", request.nodes));
  if (request.restart && *request.restart != "auto")
    throw UsageError("--restart " + *request.restart + ": a job goes on from the last checkpoint: --restart auto");
  const Plan plan = make_plan(scene, static_cast<int>(layouts.front().total()));
  for (const SceneMessage& warning : warnings) log.warn(warning.text());
  for (const std::string& warning : plan.warnings) log.warn(warning);
  Job job = job_of(request, scene, layouts, plan);
  const std::string script = job_script(job);
  if (request.is_dry_run) {
    log.say(script.substr(0, script.find_last_not_of('\n') + 1));  // say() ends the line
    return;
  }
  if (job.system != BatchSystem::slurm)
    throw UsageError("--system " + request.system +
                     " is a template that is not tried out: take --dry-run, look it "
                     "through, save it as " +
                     job.script.string() + ", and hand it in by " + (job.system == BatchSystem::pbs ? "qsub" : "bsub"));
  find_sbatch();
  if (!request.memory && !knows_memory_of_nodes()) {
    log.warn("this Slurm does not know the memory of its nodes, so the job asks for all of it (--mem SIZE for less)");
    job.memory = 0;
  }
  const std::string answer = hand_in(job);
  const std::string text = report(job, plan, answer);
  log.say(text.substr(0, text.find_last_not_of('\n') + 1));
  if (const std::string id = job_id(answer); !id.empty()) warn_of_waiting(id, log);
}

}  // namespace moraine
