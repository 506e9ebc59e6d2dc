#include "io/cli/mpirun_talk.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <regex>
#include <utility>

namespace moraine {

namespace {

const std::string dashes(74, '-');
const std::string start_sign = "moraine: the ranks have found each other";

bool is_about_the_end(const std::string& notice) {
  constexpr std::array<std::string_view, 5> ends = {"terminated normally, but", "noticed that process rank",
                                                    "detected that one or more processes exited",
                                                    "MPI_ABORT was invoked", "has exited due to process rank"};
  return std::any_of(ends.begin(), ends.end(),
                     [&](std::string_view words) { return notice.find(words) != std::string::npos; });
}

/// "[node:pid] 3 more processes have sent help message ..." and the line after it; "mpirun: Forwarding signal 12 to
/// job"; a notice that mpirun could not read to its end, as the rank that sent it was ended meanwhile; "Read -1,
/// expected 4080, errno = 3" of a rank whose neighbour is gone.
bool is_aside(const std::string& line) {
  return (line.starts_with("mpirun") && line.find(": Forwarding signal") != std::string::npos) ||
         line.find("sent help message help-mpi-api.txt") != std::string::npos ||
         line.find("] Read -1, expected ") != std::string::npos ||
         (line.find("ORTE_ERROR_LOG: ") != std::string::npos &&
          line.find("/util/show_help.c at line") != std::string::npos) ||
         line.find("\"orte_base_help_aggregate\" to 0") != std::string::npos;
}

std::optional<KilledRank> killed_in(const std::string& notice) {
  static const std::regex words(R"(process rank (\d+) with PID \d+ on node (\S+) exited on signal (\d+))");
  std::smatch match;
  if (!std::regex_search(notice, match, words)) return std::nullopt;
  return KilledRank{std::stoi(match[1]), match[2], std::stoi(match[3])};
}

}  // namespace

void give_start_sign() {
  if (std::getenv(start_sign_variable) == nullptr) return;
  unsetenv(start_sign_variable);  // of this job alone, not of those that it may start
  std::fputs((start_sign + '\n').c_str(), stderr);
}

std::string MpirunTalk::end_of_notice() {
  is_in_notice_ = false;
  const std::string notice = std::exchange(notice_, {});
  if (!killed_) killed_ = killed_in(notice);
  return is_about_the_end(notice) ? std::string() : dashes + '\n' + notice + dashes + '\n';
}

std::string MpirunTalk::pass(std::string_view text) {
  waiting_ += text;
  std::string shown;
  std::size_t at = 0;
  for (std::size_t end; (end = waiting_.find('\n', at)) != std::string::npos; at = end + 1) {
    const std::string line = waiting_.substr(at, end - at);
    if (line == dashes) {  // also after a line of progress, which has no end
      if (is_in_notice_)
        shown += end_of_notice();
      else
        is_in_notice_ = true;
      is_in_line_ = false;
    } else if (line == start_sign) {
      are_ranks_up_ = true;
    } else if (is_in_notice_) {
      notice_ += line + '\n';
    } else if (is_in_line_ || !is_aside(line)) {
      shown += line + '\n';
      is_in_line_ = false;
    }
  }
  waiting_.erase(0, at);
  if (!is_in_notice_ && !waiting_.empty() && waiting_[0] != '-' && waiting_[0] != '[' && waiting_[0] != 'm') {
    shown += std::exchange(waiting_, {});
    is_in_line_ = true;
  }
  return shown;
}

std::string MpirunTalk::rest() {
  const std::string last = std::exchange(waiting_, {});
  if (!is_in_notice_) return last;
  const std::string notice = notice_ + last;
  return is_about_the_end(notice) ? std::string() : dashes + '\n' + notice;
}

}  // namespace moraine
