// How many ranks and threads a run uses.
#pragma once

#include <stdexcept>
#include <string>

namespace moraine {

/// A command line or a request that cannot be carried out; nothing has been done. Exit code 2.
struct UsageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct Layout {
  int ranks = 1;
  int threads = 1;
  std::string text() const { return std::to_string(ranks) + 'x' + std::to_string(threads); }
};

/// Cores that this process may use (its CPU set, so that Slurm's and a user's binding count).
int available_cores();

/// "auto" or "RxT", such as "1x8". Throws UsageError that says what was expected.
Layout parse_layout(const std::string& text);

}  // namespace moraine
