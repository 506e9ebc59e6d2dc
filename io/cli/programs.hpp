// Other programs: where they are, and what they say.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace moraine {

/// The first of these names that is an executable file in PATH; nothing where none is.
std::optional<std::filesystem::path> find_program(const std::vector<std::string>& names);

/// A word as a POSIX shell reads it back: itself where it is plain, else in quotes.
std::string shell_quoted(const std::string& word);

struct ProgramEnd {
  int code = 0;        // exit code; 128 + n where signal n has ended it
  std::string output;  // stdout and stderr, without blanks at the end
};
/// Runs a program without input and waits for its end. Throws std::runtime_error where no process can be started.
ProgramEnd hear_program(const std::vector<std::string>& words);

}  // namespace moraine
