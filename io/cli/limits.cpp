#include "io/cli/limits.hpp"

#include <dirent.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <cstdlib>
#include <string>

#include "io/cli/layout.hpp"

namespace moraine {

namespace {

/// More than the ranks and probes of any run; not the hard limit itself, which may be a thousand million: programs that
/// close all files that they might have would take minutes.
constexpr rlim_t plenty = 65536;

rlimit file_limit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) limit.rlim_cur = limit.rlim_max = RLIM_INFINITY;
  return limit;
}

/// Open files that a program started from here has from its beginning, beside stdin, stdout and stderr.
std::uint64_t files_handed_down() {
  DIR* const all = opendir("/proc/self/fd");
  if (all == nullptr) return 0;
  std::uint64_t n = 0;
  while (const dirent* entry = readdir(all)) {
    const int file = std::atoi(entry->d_name);  // "." and ".." are 0
    if (file > 2 && (fcntl(file, F_GETFD) & FD_CLOEXEC) == 0) ++n;
  }
  closedir(all);
  return n;
}

void expect_files(std::uint64_t n, const std::string& who) {
  const rlimit limit = file_limit();
  if (limit.rlim_cur == RLIM_INFINITY || limit.rlim_cur >= n) return;
  throw UsageError(fmt::format(
      "only {} open files are allowed here, {} needs {}: raise the file limit (ulimit -n {}; where the hard "
      "limit forbids it, nofile in /etc/security/limits.conf or the batch system's settings)",
      limit.rlim_cur, who, n, n));
}

}  // namespace

void allow_many_files() {
  rlimit limit = file_limit();
  const rlim_t wanted = std::min(plenty, limit.rlim_max);
  if (limit.rlim_cur == RLIM_INFINITY || limit.rlim_cur >= wanted) return;
  limit.rlim_cur = wanted;
  setrlimit(RLIMIT_NOFILE, &limit);
}

std::uint64_t files_of_mpirun(int n_ranks) {
  // Open MPI 4.1: 26 and 4 for each rank, found by bisection for 1 to 32 ranks (README). Fewer and it says "limit on number of
  // pipes" and waits for ever. A few more, for other versions.
  return 30 + 4 * static_cast<std::uint64_t>(n_ranks);
}

void expect_files_for_mpirun(int n_ranks) {
  expect_files(files_of_mpirun(n_ranks) + files_handed_down(), fmt::format("mpirun for {} ranks", n_ranks));
}

void expect_shared_memory() {
  constexpr rlim_t least =
      rlim_t{8} << 20;  // Open MPI 4.1 takes files of 4 MB; shorter ones and its ranks wait for ever
  rlimit limit{};
  if (getrlimit(RLIMIT_FSIZE, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY || limit.rlim_cur >= least) return;
  throw UsageError(fmt::format(
      "files larger than a limit of {} kB are not allowed here, ranks share memory by files of {} kB: raise the limit "
      "(ulimit -f; the shell counts in blocks of 512 or 1024 bytes), or use one rank",
      limit.rlim_cur >> 10, least >> 10));
}

void expect_files_for_rank() { expect_files(files_of_rank, "a rank"); }

}  // namespace moraine
