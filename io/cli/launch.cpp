#include "io/cli/launch.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <set>

#include "engine/run/plan.hpp"
#include "io/cli/child.hpp"
#include "io/cli/interrupt.hpp"
#include "io/cli/limits.hpp"
#include "io/cli/programs.hpp"
#include "io/cli/terminal.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

/// Hardware threads of one core name each other in the same words.
int count_cores(const std::vector<int>& cpus) {
  std::set<std::string> cores;
  for (const int cpu : cpus) {
    std::ifstream file("/sys/devices/system/cpu/cpu" + std::to_string(cpu) + "/topology/thread_siblings_list");
    std::string siblings;
    if (!std::getline(file, siblings)) return static_cast<int>(cpus.size());
    cores.insert(siblings);
  }
  return static_cast<int>(cores.size());
}

bool has_several_nodes() {
  const char* n = std::getenv("SLURM_JOB_NUM_NODES");
  return n != nullptr && std::atoi(n) > 1;
}

void write_all(int to, const std::string& text) {
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t n = write(to, text.data() + done, text.size() - done);
    if (n < 0 && errno != EINTR) return;  // nobody reads any more
    if (n > 0) done += static_cast<std::size_t>(n);
  }
}

/// For mpirun and for the ranks; what the user has set stays.
void set_environment(bool crowded) {
  if (geteuid() == 0) {
    // Open MPI refuses to start as root unless told twice; where root is the only user (a container) that is wanted.
    setenv("OMPI_ALLOW_RUN_AS_ROOT", "1", 0);
    setenv("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1", 0);
  }
  if (const auto width = terminal_width()) setenv(terminal_variable, std::to_string(*width).c_str(), 1);
  // Whoever waits must not take the CPU that is waited for.
  if (std::getenv("GOMP_SPINCOUNT") || std::getenv("OMP_WAIT_POLICY")) return;
  if (crowded) {
    setenv("OMP_WAIT_POLICY", "passive", 0);
  } else {
    // Threads without work go to sleep soon, as their core may be another rank's by then.
    setenv("GOMP_SPINCOUNT", "20000", 0);
  }
}

/// In the child: mpirun in a group of its own, so that Control-C comes to this program alone, which asks the ranks in a
/// way that leaves them the time for a checkpoint; and gone when this program goes, however that may be.
[[noreturn]] void become_mpirun(std::vector<std::string> words, int talk, pid_t parent) {
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(127);  // gone already
  signal(SIGPIPE, SIG_DFL);
  take_back_cpus();
  if (const int nothing = open("/dev/null", O_RDONLY); nothing >= 0) dup2(nothing, STDIN_FILENO);
  dup2(talk, STDERR_FILENO);
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  execv(pointers[0], pointers.data());
  const std::string text = "error: " + words[0] + " cannot be started: " + std::strerror(errno) + "\n";
  write_all(STDERR_FILENO, text);
  _exit(1);
}

/// How long ranks may take to find each other [s]; where the environment has MORAINE_START_PATIENCE, that. Throws UsageError.
double start_patience() {
  constexpr double usual = 600.0;
  const char* const given = std::getenv("MORAINE_START_PATIENCE");
  if (given == nullptr) return usual;
  char* end = nullptr;
  const double seconds = std::strtod(given, &end);
  if (end == given || *end != '\0' || !(seconds > 0.0))
    throw UsageError(fmt::format("MORAINE_START_PATIENCE=\"{}\" is not a number of seconds, such as 600", given));
  return seconds;
}

/// True where the system does not tell, too.
bool has_children(pid_t process) {
  std::error_code error;
  for (const fs::directory_entry& thread : fs::directory_iterator(fmt::format("/proc/{}/task", process), error)) {
    std::ifstream file(thread.path() / "children");
    std::string first;
    if (!file || file >> first) return true;
  }
  return error.value() != 0;
}

/// mpirun while it runs.
class Job {
 public:
  Job(const std::vector<std::string>& words, double patience) : patience_(patience) {
    if (pipe2(talk_.data(), O_CLOEXEC) != 0) throw std::runtime_error(std::string("pipe: ") + std::strerror(errno));
    const pid_t self = getpid();
    mpirun_ = fork();
    if (mpirun_ < 0) throw std::runtime_error(std::string("mpirun cannot be started: ") + std::strerror(errno));
    if (mpirun_ == 0) become_mpirun(words, talk_[1], self);
    close(talk_[1]);
  }
  Job(const Job&) = delete;
  Job& operator=(const Job&) = delete;
  ~Job() { close(talk_[0]); }

  JobEnd wait() {
    const InterruptGuard guard;
    JobEnd end;
    int status = 0;
    while (waitpid(mpirun_, &status, WNOHANG) != mpirun_) {
      if (!pass_on_talk(look_interval)) look_after_mpirun();
      if (const int signal = InterruptGuard::signal(); signal != end.signal) {
        kill(mpirun_, InterruptGuard::stand_in_for(signal));
        end.signal = signal;
      }
    }
    while (pass_on_talk(0)) continue;
    write_all(STDERR_FILENO, filter_.rest());
    if (WIFSIGNALED(status)) end.mpirun_killed = WTERMSIG(status);
    end.given_up = given_up_;
    end.code = WEXITSTATUS(status);
    end.killed = filter_.killed();
    return end;
  }

 private:
  static constexpr int look_interval = 100;  // [ms]

  /// mpirun waits for ever where it could not start all ranks, or has lost sight of those that ended. Told, and then ended: ranks that
  /// have not found each other, and no ranks at all. Counted in looks, as clocks leap and processes are stopped.
  void look_after_mpirun() {
    constexpr double share_until_told = 0.05, share_without_ranks = 0.1, grace = 5.0;  // [s]
    constexpr int looks_between = 20;
    const double n_looks = ++n_looks_;
    if (n_looks_ % looks_between == 0) n_without_ranks_ = has_children(mpirun_) ? 0 : n_without_ranks_ + looks_between;
    const auto seconds = [](double looks) { return 1e-3 * look_interval * looks; };
    const double waited = filter_.are_ranks_up() ? 0.0 : seconds(n_looks);
    if (!is_told_ && waited >= share_until_told * patience_) {
      is_told_ = true;
      write_all(
          STDERR_FILENO,
          fmt::format("the ranks have not found each other after {:.3g} s; still waiting for mpirun (process {})\n",
                      waited, mpirun_));
    }
    if (given_up_ == GivenUp::no) {
      if (waited >= patience_) given_up_ = GivenUp::not_started;
      if (seconds(n_without_ranks_) >= share_without_ranks * patience_) given_up_ = GivenUp::no_ranks;
      if (given_up_ != GivenUp::no) kill(mpirun_, SIGTERM);
    } else if (seconds(++n_looks_since_) >= grace) {
      kill(mpirun_, SIGKILL);
    }
  }

  /// Waits for talk, not longer than that [ms]; false where there is none.
  bool pass_on_talk(int patience) {
    pollfd waiting{talk_[0], POLLIN, 0};
    std::array<char, 4096> text;
    if (poll(&waiting, 1, patience) <= 0) return false;
    const ssize_t n = read(talk_[0], text.data(), text.size());
    if (n > 0) {
      write_all(STDERR_FILENO, filter_.pass({text.data(), static_cast<std::size_t>(n)}));
    } else if (patience > 0) {
      usleep(static_cast<useconds_t>(1000 * patience));  // closed, but not ended yet
    }
    return n > 0;
  }

  std::array<int, 2> talk_{};
  pid_t mpirun_ = -1;
  double patience_;                                            // [s]
  int n_looks_ = 0, n_without_ranks_ = 0, n_looks_since_ = 0;  // since it was given up
  GivenUp given_up_ = GivenUp::no;
  bool is_told_ = false;
  MpirunTalk filter_;
};

}  // namespace

Place this_place() {
  const std::vector<int> cpus = available_cpus();
  const auto n_cpus = static_cast<int>(cpus.size());
  return {n_cpus, count_cores(cpus), n_cpus == sysconf(_SC_NPROCESSORS_ONLN), has_several_nodes()};
}

void refuse_scripted_walls(const Scene& scene) {
  for (std::size_t w = 0; w < scene.walls.size(); ++w)
    if (scene.walls[w].has(WallMotion::Kind::script))
      throw SceneError(
          {{fmt::format("wall[{}].motion", w),
            fmt::format("wall \"{}\" is moved by a script; run this scene from Python, also where a run goes on "
                        "(moraine python SCRIPT, with set_wall_motion; see io/python/README.md)",
                        scene.walls[w].name),
            false}});
}

bool is_crowded(const Layout& layout, const Place& place) {
  return !place.is_one_of_many && layout.total() > place.n_cpus;
}

std::vector<std::string> mpirun_options(const Layout& layout, const Place& place) {
  std::vector<std::string> words = {"-n", std::to_string(layout.ranks)};
  const auto add = [&](std::initializer_list<const char*> more) {
    words.insert(words.end(), more.begin(), more.end());
  };
  const std::string share = "slot:PE=" + std::to_string(layout.threads);
  if (place.is_one_of_many || (place.is_whole && layout.total() <= place.n_cores))
    add({"--map-by", share.c_str(), "--bind-to", "core"});
  else if (place.is_whole && layout.total() <= place.n_cpus)
    add({"--use-hwthread-cpus", "--map-by", share.c_str(), "--bind-to", "hwthread"});
  else
    add({"--oversubscribe", "--bind-to", "none"});  // they stay within the CPUs of this process
  if (is_crowded(layout, place)) add({"--mca", "mpi_yield_when_idle", "1"});
  return words;
}

fs::path find_mpirun(const Layout& layout) {
  // the first is Debian's name where several kinds of MPI are installed
  if (const auto file = find_program({"mpirun.openmpi", "mpirun"})) return *file;
  throw UsageError("layout " + layout.text() +
                   " needs mpirun, and there is none in PATH: install Open MPI (Debian: apt-get install openmpi-bin), "
                   "or use one rank: --layout 1x" +
                   std::to_string(layout.total()));
}

LayoutChoice layout_for(const Scene& scene, const std::optional<std::string>& asked) {
  const std::string text = asked.value_or(scene.run.layout);
  if (text != "auto") return {parse_layout(text), ""};
  std::uint64_t n_cells = 0;
  if (scene.gas)
    n_cells = static_cast<std::uint64_t>(scene.gas->cells[0]) * static_cast<std::uint64_t>(scene.gas->cells[1]) *
              static_cast<std::uint64_t>(scene.gas->cells[2]);
  return choose_layout(make_plan(scene, 1).n_grains, n_cells, cores_of(available_cpus()),
                       find_program({"mpirun.openmpi", "mpirun"}).has_value() && !has_several_nodes());
}

std::optional<StrayTasks> stray_tasks() {
  const char* n = std::getenv("SLURM_STEP_NUM_TASKS");
  if (World::is_launched() || n == nullptr || std::atoi(n) < 2) return std::nullopt;
  const char* number = std::getenv("SLURM_PROCID");
  return StrayTasks{std::atoi(n), number == nullptr || std::atoi(number) == 0};
}

JobEnd run_as_ranks(const Layout& layout, const std::vector<std::string>& words) {
  const Place place = this_place();
  std::vector<std::string> command = {find_mpirun(layout).string()};
  const double patience = start_patience();
  if (!place.is_one_of_many) expect_files_for_mpirun(layout.ranks);
  expect_shared_memory();
  setenv(start_sign_variable, "1", 1);
  set_environment(is_crowded(layout, place));
  for (const std::string& option : mpirun_options(layout, place)) command.push_back(option);
  for (const char* name : {terminal_variable, start_sign_variable, "OMP_WAIT_POLICY", "GOMP_SPINCOUNT"})
    if (std::getenv(name) != nullptr) command.insert(command.end(), {"-x", name});  // to other nodes, too
  command.insert(command.end(), words.begin(), words.end());
  return Job(command, patience).wait();
}

}  // namespace moraine
