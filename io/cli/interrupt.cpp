#include "io/cli/interrupt.hpp"

#include <csignal>
#include <iterator>

namespace moraine {

namespace {

volatile std::sig_atomic_t noted = 0;

constexpr int heeded[] = {SIGINT, SIGTERM, SIGHUP};
struct sigaction previous[std::size(heeded)];
struct sigaction previous_pipe;

void note(int signal) { noted = signal; }

}  // namespace

InterruptGuard::InterruptGuard() {
  noted = 0;
  struct sigaction action {};
  action.sa_handler = note;
  sigemptyset(&action.sa_mask);
  action.sa_flags = static_cast<int>(SA_RESETHAND | SA_RESTART);
  for (std::size_t i = 0; i < std::size(heeded); ++i) {
    sigaction(heeded[i], nullptr, &previous[i]);
    // What the surroundings ignore stays ignored: nohup and background jobs count on it.
    if (previous[i].sa_handler != SIG_IGN) sigaction(heeded[i], &action, nullptr);
  }
  struct sigaction ignore {};
  ignore.sa_handler = SIG_IGN;
  sigaction(SIGPIPE, &ignore, &previous_pipe);
}

InterruptGuard::~InterruptGuard() {
  for (std::size_t i = 0; i < std::size(heeded); ++i) sigaction(heeded[i], &previous[i], nullptr);
  sigaction(SIGPIPE, &previous_pipe, nullptr);
}

int InterruptGuard::signal() { return noted; }

}  // namespace moraine
