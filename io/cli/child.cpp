#include "io/cli/child.hpp"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include "io/cli/interrupt.hpp"
#include "io/cli/layout.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

constexpr useconds_t between_looks = 50'000;  // [us]
constexpr int looks_a_tick = 5;
constexpr int cannot_start = 127;

[[noreturn]] void become(std::vector<std::string> words, const fs::path& directory, const fs::path& talk,
                         pid_t parent) {
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(cannot_start);  // gone already
  signal(SIGPIPE, SIG_DFL);
  take_back_cpus();
  if (const int nothing = open("/dev/null", O_RDONLY); nothing >= 0) dup2(nothing, STDIN_FILENO);
  const int file = open(talk.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
  if (file < 0 || dup2(file, STDOUT_FILENO) < 0 || dup2(file, STDERR_FILENO) < 0) _exit(cannot_start);
  if (chdir(directory.c_str()) != 0) std::perror(directory.c_str()), _exit(cannot_start);
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  execv(pointers[0], pointers.data());
  std::perror(pointers[0]);
  _exit(cannot_start);
}

}  // namespace

ChildEnd run_child(const std::vector<std::string>& words, const fs::path& directory, const fs::path& talk,
                   const std::function<void()>& tick) {
  const pid_t self = getpid();
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error(words[0] + " cannot be started: " + std::strerror(errno));
  if (child == 0) become(words, directory, talk, self);
  int status = 0, passed_on = 0;
  for (int n = 0; waitpid(child, &status, WNOHANG) != child; ++n) {
    usleep(between_looks);
    if (const int signal = InterruptGuard::signal(); signal != passed_on) {
      kill(child, signal);
      passed_on = signal;
    }
    if (tick && n % looks_a_tick == 0) tick();
  }
  ChildEnd end;
  if (WIFSIGNALED(status)) end.killed = WTERMSIG(status);
  if (WIFEXITED(status)) end.code = WEXITSTATUS(status);
  return end;
}

}  // namespace moraine
