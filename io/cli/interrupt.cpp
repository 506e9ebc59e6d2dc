#include "io/cli/interrupt.hpp"

#include <csignal>
#include <iterator>

#include "comm/world.hpp"

namespace moraine {

namespace {

volatile std::sig_atomic_t noted = 0;

struct Heeded {
  int signal;
  int stand_in;  // under a launcher
};
constexpr Heeded heeded[] = {{SIGINT, SIGUSR1}, {SIGTERM, SIGUSR2}, {SIGHUP, SIGALRM}};
struct sigaction previous[std::size(heeded)];
struct sigaction previous_stand_in[std::size(heeded)];
struct sigaction previous_pipe;

void note(int signal) {
  for (const Heeded& one : heeded)
    if (signal == one.stand_in) signal = one.signal;
  noted = signal;
}

}  // namespace

InterruptGuard::InterruptGuard() {
  noted = 0;
  struct sigaction action {};
  action.sa_handler = note;
  sigemptyset(&action.sa_mask);
  action.sa_flags = static_cast<int>(SA_RESETHAND | SA_RESTART);
  for (std::size_t i = 0; i < std::size(heeded); ++i) {
    sigaction(heeded[i].signal, nullptr, &previous[i]);
    sigaction(heeded[i].stand_in, nullptr, &previous_stand_in[i]);
    // What the surroundings ignore stays ignored: nohup and background jobs count on it.
    if (previous[i].sa_handler != SIG_IGN) sigaction(heeded[i].signal, &action, nullptr);
    if (World::is_launched()) sigaction(heeded[i].stand_in, &action, nullptr);
  }
  struct sigaction ignore {};
  ignore.sa_handler = SIG_IGN;
  sigaction(SIGPIPE, &ignore, &previous_pipe);
}

InterruptGuard::~InterruptGuard() {
  for (std::size_t i = 0; i < std::size(heeded); ++i) {
    sigaction(heeded[i].signal, &previous[i], nullptr);
    sigaction(heeded[i].stand_in, &previous_stand_in[i], nullptr);
  }
  sigaction(SIGPIPE, &previous_pipe, nullptr);
}

int InterruptGuard::signal() { return noted; }

int InterruptGuard::stand_in_for(int signal) {
  for (const Heeded& one : heeded)
    if (signal == one.signal) return one.stand_in;
  return signal;
}

}  // namespace moraine
