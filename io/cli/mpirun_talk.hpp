// What mpirun says beside the program's own words.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace moraine {

/// In the environment of ranks that this program has started: their root tells so on stderr once they have found each other.
inline constexpr const char* start_sign_variable = "MORAINE_START_SIGN";
/// In the root, after MPI has started.
void give_start_sign();

/// A rank that was ended by a signal.
struct KilledRank {
  int rank = 0;
  std::string node;
  int signal = 0;
};

/// Lets through what comes from mpirun's stderr, but for its notices about the end of a job, between lines of dashes:
/// the program says in one line what they say in twenty. What mpirun has to say for itself (it cannot start the ranks)
/// passes.
class MpirunTalk {
 public:
  /// What of the text so far can be shown; unfinished lines too, so that a line of progress is not held up.
  std::string pass(std::string_view text);
  /// What was held back until now.
  std::string rest();
  /// The first rank of which mpirun said that a signal had ended it.
  const std::optional<KilledRank>& killed() const { return killed_; }
  /// True once the root's sign has passed; it is not shown.
  bool are_ranks_up() const { return are_ranks_up_; }

 private:
  std::string end_of_notice();

  std::string waiting_;  // the unfinished line
  std::string notice_;
  bool is_in_notice_ = false;
  bool are_ranks_up_ = false;
  bool is_in_line_ = false;  // the beginning of the unfinished line has been shown
  std::optional<KilledRank> killed_;
};

}  // namespace moraine
