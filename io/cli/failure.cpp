#include "io/cli/failure.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>

namespace moraine {

namespace {

using std::chrono::milliseconds;

/// The ranks of a node share a name that only one process can hold: an abstract socket, which goes with the process and
/// leaves no file behind.
bool is_first_of_node() {
  const char* job = std::getenv("PMIX_NAMESPACE");
  const std::string name = "moraine-end-of-" + (job != nullptr ? std::string(job) : std::to_string(getppid()));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  name.copy(address.sun_path + 1, sizeof address.sun_path - 1);    // a name in no directory starts with a zero
  const int held = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);  // until the process ends
  return held < 0 || bind(held, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
}

}  // namespace

void end_job(const World& world, int code, const std::function<void()>& say) {
  // What is wrong for all of them is found by all of them at about the same time; those of other nodes find out in this
  // way.
  std::this_thread::sleep_for(milliseconds(std::min(30 * world.rank(), 1000)));
  if (is_first_of_node()) {
    say();
    std::fflush(nullptr);
    std::this_thread::sleep_for(milliseconds(100));  // the launcher passes the words on before it hears of the end
  } else {
    std::this_thread::sleep_for(milliseconds(5000));  // the one who speaks ends the job
  }
  world.abort(code);
}

}  // namespace moraine
