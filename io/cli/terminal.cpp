#include "io/cli/terminal.hpp"

#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdlib>

namespace moraine {

std::optional<std::size_t> terminal_width() {
  if (const char* given = std::getenv(terminal_variable)) return std::strtoul(given, nullptr, 10);
  if (isatty(STDERR_FILENO) == 0) return std::nullopt;
  winsize size{};
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80u;
}

}  // namespace moraine
