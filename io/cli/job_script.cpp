#include "io/cli/job_script.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <string_view>

#include "io/cli/programs.hpp"

namespace moraine {

namespace {

constexpr double mebi = 1048576.0;
/// What a rank takes without grains [MiB]: the program, and the buffers of the MPI library.
constexpr double memory_of_rank = 250.0;
/// Times the estimate of the grains: the largest share over the mean, ghosts, and buffers of a checkpoint.
constexpr double memory_margin = 2.0;

/// A line of the script must not become two.
void refuse_control_characters(const std::string& text) {
  if (std::any_of(text.begin(), text.end(), [](char c) { return std::iscntrl(static_cast<unsigned char>(c)) != 0; }))
    throw UsageError("\"" + text + "\" has control characters in it, which a job script cannot hold");
}

/// A word in a directive: in double quotes where a batch system's reader would break it.
std::string directive_word(const std::string& text) {
  if (text.find_first_of(" '\"\\#;") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' || c == '\\' ? std::string("\\") + c : std::string(1, c);
  return quoted + '"';
}

/// A file name in which Slurm replaces %j and its like.
std::string slurm_pattern(const std::filesystem::path& folder, const std::string& pattern) {
  std::string text;
  for (const char c : (folder / "").string()) text += c == '%' ? "%%" : std::string(1, c);
  return directive_word(text + pattern);
}

int ranks_of_node(const Job& job, const Layout& layout) { return layout.ranks / job.nodes; }

/// CPUs that the ranks of a node use; of a sweep, in the layout that uses most.
int cpus_of_node(const Job& job) {
  int most = 1;
  for (const Layout& layout : job.layouts) most = std::max(most, ranks_of_node(job, layout) * layout.threads);
  return most;
}

void check(const Job& job) {
  for (const std::string& text : {job.partition, job.account, job.mpi, job.script.string()})
    refuse_control_characters(text);
  for (const std::string& directive : job.directives) refuse_control_characters(directive);
  for (const Layout& layout : job.layouts) {
    if (layout.ranks % job.nodes == 0) continue;
    const int fewer = layout.ranks / job.nodes * job.nodes;
    throw UsageError(fmt::format(
        "layout {}: {} ranks do not divide evenly over {} nodes; take {}{} ranks, or another --nodes", layout.text(),
        layout.ranks, job.nodes, fewer == 0 ? "" : std::to_string(fewer) + " or ", fewer + job.nodes));
  }
  if (job.time_limit && *job.time_limit <= job.margin)
    throw UsageError(fmt::format(
        "--time {} ends before there is anything to do: the run is asked to end {} s before its time limit; give it "
        "more --time, or less --margin (as long as it takes to write a checkpoint, and Slurm may ask a minute earlier)",
        time_limit_text(*job.time_limit), job.margin));
  if (job.system == BatchSystem::slurm) return;
  if (job.is_sweep) throw UsageError("--sweep is for Slurm; for PBS and LSF, take one job for each layout");
  if (!job.time_limit) throw UsageError("--system pbs and lsf need --time: the script counts the seconds itself");
}

std::string slurm_directives(const Job& job) {
  std::string text;
  const auto say = [&](const std::string& line) { text += "#SBATCH --" + line + '\n'; };
  const auto remark = [&](const std::string& line) { text += "# " + line + '\n'; };
  say("job-name=" + job.name);
  if (!job.partition.empty()) say("partition=" + directive_word(job.partition));
  if (!job.account.empty()) say("account=" + directive_word(job.account));
  if (job.time_limit) say("time=" + time_limit_text(*job.time_limit));
  say(fmt::format("nodes={}", job.nodes));
  if (job.is_sweep) {
    remark("One job for each layout, with nodes of its own; the CPUs are those of the layout that uses most.");
    say(fmt::format("array=0-{}", job.layouts.size() - 1));
    say("exclusive");
    say("ntasks-per-node=1");
    say(fmt::format("cpus-per-task={}", cpus_of_node(job)));
  } else {
    const Layout& layout = job.layouts.front();
    say(fmt::format("ntasks={}", layout.ranks));
    say(fmt::format("ntasks-per-node={}", ranks_of_node(job, layout)));
    say(fmt::format("cpus-per-task={}", layout.threads));
  }
  remark("A core for each thread: two hardware threads of one core would share its arithmetic.");
  say("threads-per-core=1");
  remark("Of each node, as `moraine check` estimates it, with a margin; 0 is all of it.");
  say(job.memory == 0 ? "mem=0" : fmt::format("mem={}M", job.memory));
  say("output=" + slurm_pattern(job.script.parent_path(), job.is_sweep ? "%A_%a.out" : "%j.out"));
  remark("So many seconds before the time limit all ranks get SIGUSR2: they write a checkpoint and end.");
  say(fmt::format("signal=USR2@{}", job.margin));
  remark("It goes on by submitting itself again (see the end); Slurm is not to start it over.");
  say("no-requeue");
  for (const std::string& directive : job.directives) {
    const std::string bare = directive.substr(std::min(directive.find_first_not_of('-'), directive.size()));
    const bool is_short = directive.starts_with('-') && !directive.starts_with("--");
    text += "#SBATCH " + std::string(is_short ? "-" : "--") + bare + '\n';
  }
  return text;
}

std::string pbs_directives(const Job& job) {
  const Layout& layout = job.layouts.front();
  std::string text;
  const auto say = [&](const std::string& line) { text += "#PBS " + line + '\n'; };
  say("-N " + job.name);
  if (!job.partition.empty()) say("-q " + directive_word(job.partition));
  if (!job.account.empty()) say("-A " + directive_word(job.account));
  const std::int64_t limit = *job.time_limit;
  say(fmt::format("-l walltime={:02}:{:02}:{:02}", limit / 3600, limit / 60 % 60, limit % 60));
  say(fmt::format("-l select={}:ncpus={}:mpiprocs={}:ompthreads={}{}", job.nodes, cpus_of_node(job),
                  ranks_of_node(job, layout), layout.threads,
                  job.memory == 0 ? "" : fmt::format(":mem={}mb", job.memory)));
  say("-l place=scatter");
  say("-j oe");
  say("-o " + directive_word((job.script.parent_path() / "").string()));
  say("-r n");
  say("-V");  // the environment of whoever submits, as the other two do it by themselves
  for (const std::string& directive : job.directives) say(directive);
  return text;
}

std::string lsf_directives(const Job& job) {
  const Layout& layout = job.layouts.front();
  std::string text;
  const auto say = [&](const std::string& line) { text += "#BSUB " + line + '\n'; };
  say("-J " + job.name);
  if (!job.partition.empty()) say("-q " + directive_word(job.partition));
  if (!job.account.empty()) say("-P " + directive_word(job.account));
  const std::int64_t minutes = (*job.time_limit + 59) / 60;
  say(fmt::format("-W {}:{:02}", minutes / 60, minutes % 60));
  say(fmt::format("-n {}", layout.ranks));
  say(fmt::format("-R \"span[ptile={}] affinity[core({})]\"", ranks_of_node(job, layout), layout.threads));
  if (job.memory != 0) say(fmt::format("-M {}MB", job.memory));
  say("-o " + directive_word((job.script.parent_path() / "%J.out").string()));
  say("-rn");
  for (const std::string& directive : job.directives) say(directive);
  return text;
}

std::string settings(const Job& job) {
  std::string text = "script=" + shell_quoted(job.script.string()) + '\n';
  text += "program=" + shell_quoted(job.program.string()) + '\n';
  text += "scene=" + shell_quoted(job.scene.string()) + '\n';
  if (job.is_sweep) {
    text += "layouts=(";
    for (const Layout& layout : job.layouts) {
      if (text.back() != '(') text += ' ';
      text += layout.text();
    }
    text += ")\nlayout=${layouts[SLURM_ARRAY_TASK_ID]}\n";
  } else {
    text += "layout=" + job.layouts.front().text() + '\n';
  }
  text += fmt::format("nodes={}\nranks=${{layout%x*}} threads=${{layout#*x}}\n", job.nodes);
  return text + "out=" + shell_quoted(job.out.string()) + (job.is_sweep ? "/$layout" : "") + '\n';
}

std::string run_words(const Job& job) {
  std::string text = "  \"$program\" run \"$scene\" --layout \"$layout\" --restart auto --out \"$out\"";
  for (const std::string& setting : job.overrides) text += " \\\n  --set " + shell_quoted(setting);
  return text + '\n';
}

std::string slurm_launch(const Job& job) {
  return fmt::format(
             R"(# --cpus-per-task: since Slurm 22.05 srun does not take it from the job. --kill-on-bad-exit: ranks would
# wait for ever for one that has died. block:block: ranks of near numbers own near regions of space. `srun --mpi=list` shows
# what may stand after --mpi.
srun --mpi={} --nodes="$nodes" --ntasks="$ranks" --ntasks-per-node=$((ranks / nodes)) --cpus-per-task="$threads" \
  --cpu-bind=cores --distribution=block:block --kill-on-bad-exit=1 \
)",
             shell_quoted(job.mpi)) +
         run_words(job);
}

std::string mpirun_launch(const Job& job) {
  const char* hosts = job.system == BatchSystem::pbs ? "PBS_NODEFILE" : "LSB_DJOB_HOSTFILE";
  return fmt::format(
             R"(# {} s before the time limit mpirun gets SIGUSR2 and hands it on to the ranks.
timeout --preserve-status --signal=USR2 {} \
  mpirun -n "$ranks" --hostfile "${}" --map-by "ppr:$((ranks / nodes)):node:PE=$threads" --bind-to core \
)",
             job.margin, *job.time_limit - job.margin, hosts) +
         run_words(job);
}

/// The command that hands the script in again, as a word of the shell.
std::string submission(const Job& job) {
  const std::string script = shell_quoted(job.script.string());
  if (job.system == BatchSystem::pbs) return shell_quoted("qsub " + script);
  if (job.system == BatchSystem::lsf) return shell_quoted("bsub <" + script);
  if (!job.is_sweep) return shell_quoted("sbatch " + script);
  return "\"sbatch --array=$SLURM_ARRAY_TASK_ID \"" +
         shell_quoted(shell_quoted(job.script.string()));  // quoted twice: eval reads it again
}

constexpr const char* before_run = R"(
# The step of the last checkpoint; -1 where there is none yet.
last_step() {
  local file step last=-1
  for file in "$out"/checkpoints/checkpoint_*.h5; do
    step=${file##*_}
    step=${step%.h5}
    [[ $step =~ ^[0-9]+$ ]] && ((10#$step > last)) && last=$((10#$step))
  done
  echo "$last"
}

# Whoever cancels the job ends it for good: the ranks are told as well and write a checkpoint, and it goes no further.
trap 'echo "job: cancelled, or over its time limit, at step $(last_step); to go on from there: $submit"; exit 143' TERM

before=$(last_step)
)";

constexpr const char* after_run = R"(code=$?
after=$(last_step)

case $code in
  0)
    echo "job: the scene is done"
    ;;
  140 | 143)  # SIGUSR2 came, before the first step or after some
    if ((after <= before)); then
      echo "error: the time limit came before a step beyond step $before was taken: the job is not submitted again;" \
        "give it more time in $script, then: $submit" >&2
      exit 1
    fi
    echo "job: time is up at step $after; the next job goes on"
    if ! eval "$submit"; then
      echo "error: the next job could not be submitted (see above); to go on by hand: $submit" >&2
      exit 1
    fi
    ;;
  *)
    echo "error: the run has ended with exit code $code (see above): the job is not submitted again;" \
      "to go on from step $after: $submit" >&2
    exit "$code"
    ;;
esac
)";

}  // namespace

std::string job_script(const Job& job) {
  check(job);
  std::string text = fmt::format("#!/bin/bash\n# Job \"{}\", written by {}.\n# Its place is {}\n", job.name, job.origin,
                                 directive_word(job.script.string()));
  switch (job.system) {
    case BatchSystem::slurm: text += slurm_directives(job); break;
    case BatchSystem::pbs: text += pbs_directives(job); break;
    case BatchSystem::lsf: text += lsf_directives(job); break;
  }
  text += '\n' + settings(job);
  text += "# How the job is handed in again.\nsubmit=" + submission(job) + '\n';
  text += before_run;
  return text + (job.system == BatchSystem::slurm ? slurm_launch(job) : mpirun_launch(job)) + after_run;
}

std::string job_name(const std::string& name) {
  std::string text;
  for (const char c : name) {
    const bool is_good =
        std::isalnum(static_cast<unsigned char>(c)) != 0 || std::string_view("._-").find(c) != std::string_view::npos;
    text += is_good ? c : '_';
  }
  return text.empty() ? "moraine" : text;
}

std::int64_t parse_time_limit(const std::string& text) {
  const auto refuse = [&](const std::string& why) {
    return UsageError("--time \"" + text + "\": " + why +
                      "expected MINUTES, MINUTES:SECONDS, HOURS:MINUTES:SECONDS, DAYS-HOURS, DAYS-HOURS:MINUTES or "
                      "DAYS-HOURS:MINUTES:SECONDS, such as 90, 2:00:00 or 1-12");
  };
  const std::size_t dash = text.find('-');
  const bool has_days = dash != std::string::npos;
  std::vector<std::int64_t> numbers;
  const auto read = [&](std::string_view part) {
    std::int64_t number = 0;
    const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), number);
    if (part.empty() || error != std::errc() || end != part.data() + part.size() || number < 0 || number > 10'000'000)
      throw refuse("");
    numbers.push_back(number);
  };
  if (has_days) read(std::string_view(text).substr(0, dash));
  for (std::size_t at = has_days ? dash + 1 : 0; at <= text.size();) {
    const std::size_t end = std::min(text.find(':', at), text.size());
    read(std::string_view(text).substr(at, end - at));
    at = end + 1;
  }
  const std::size_t n = numbers.size() - (has_days ? 1 : 0);
  if (n > 3) throw refuse("");
  // Days, hours, minutes, seconds: after days come hours; without them the last are seconds, or minutes if alone.
  std::array<std::int64_t, 4> given{};
  const std::size_t first = has_days ? 0 : n == 1 ? 2 : 4 - n;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    given[first + i] = numbers[i];
    constexpr std::array<std::int64_t, 4> most = {10'000'000, 23, 59, 59};
    if (i > 0 && numbers[i] > most[first + i])
      throw refuse("there is no " + std::to_string(numbers[i]) + " after a \":\" or \"-\"; ");
  }
  const std::int64_t seconds = ((given[0] * 24 + given[1]) * 60 + given[2]) * 60 + given[3];
  if (seconds == 0) throw refuse("no time at all; ");
  return seconds;
}

std::string time_limit_text(std::int64_t seconds) {
  const std::string clock = fmt::format("{:02}:{:02}:{:02}", seconds / 3600 % 24, seconds / 60 % 60, seconds % 60);
  return seconds < 86400 ? clock : fmt::format("{}-{}", seconds / 86400, clock);
}

int default_margin(std::optional<std::int64_t> time_limit) {
  constexpr std::int64_t most = 120;
  return static_cast<int>(std::clamp<std::int64_t>(time_limit.value_or(4 * most) / 4, 1, most));
}

std::int64_t parse_memory(const std::string& text) {
  std::int64_t number = 0;
  const char* last = text.data() + text.size();
  const auto [end, error] = std::from_chars(text.data(), last, number);
  const std::string_view unit(end, static_cast<std::size_t>(last - end));
  const bool is_good = error == std::errc() && number >= 0 && number < 1'000'000'000 && unit.size() <= 1;
  const std::size_t power = unit.empty() ? 1 : std::string_view("KMGT").find(static_cast<char>(std::toupper(unit[0])));
  if (!is_good || power == std::string_view::npos)
    throw UsageError("--mem \"" + text +
                     "\": expected a number with K, M, G or T, such as 16G, or 0 for all of a node");
  if (power == 0) return (number + 1023) / 1024;
  for (std::size_t i = 1; i < power; ++i) number *= 1024;
  return number;
}

std::int64_t memory_of_node(double of_scene, const Layout& layout, int nodes) {
  const double grains = memory_margin * of_scene / mebi / nodes;
  const double ranks = memory_of_rank * layout.ranks / nodes;
  return 100 * static_cast<std::int64_t>(std::ceil((grains + ranks) / 100.0));
}

}  // namespace moraine
