#include "io/cli/log.hpp"

#include <fcntl.h>

#include <algorithm>
#include <cstdio>
#include <ctime>

#include "io/cli/terminal.hpp"

namespace moraine {

namespace {

std::string time_of_day() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%d %H:%M:%S", &local);
  return text;
}

}  // namespace

void Log::print(std::FILE* stream, const std::string& text) const {
  if (is_quiet_) return;
  std::fwrite(text.data(), 1, text.size(), stream);
  std::fflush(stream);
}

Log Log::mute() {
  Log log(true);
  log.is_mute_ = true;
  return log;
}

bool Log::is_terminal() const { return terminal_width().has_value(); }

void Log::open(const std::filesystem::path& path) {
  file_ = std::make_unique<FileHandle>(path, O_WRONLY | O_CREAT);
  end_ = file_->size();
  file_->write(waiting_.data(), waiting_.size(), end_);
  end_ += waiting_.size();
  waiting_.clear();
}

void Log::record(const std::string& text) {
  if (is_mute_) return;
  const std::string now = time_of_day();
  std::string lines;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    lines += now + "  " + text.substr(at, end - at) + '\n';
    at = end + 1;
  }
  if (!file_) {
    waiting_ += lines;
    return;
  }
  file_->write(lines.data(), lines.size(), end_);
  end_ += lines.size();
}

void Log::clear_progress() {
  if (has_progress_) print(stderr, "\r\x1b[K");
  has_progress_ = false;
}

void Log::say(const std::string& text) {
  clear_progress();
  print(stdout, text + '\n');
  record(text);
}

void Log::warn(const std::string& text) {
  clear_progress();
  print(stderr, "warning: " + text + '\n');
  record("warning: " + text);
}

void Log::error(const std::string& text) {
  clear_progress();
  print(stderr, "error: " + text + '\n');
  record("error: " + text);
}

void Log::note(const std::string& text) { record(text); }

void Log::progress(const std::string& line) {
  const std::optional<std::size_t> width = terminal_width();
  if (!width) {
    print(stderr, line + '\n');
    return;
  }
  print(stderr, "\r\x1b[K" + line.substr(0, *width - 1));
  has_progress_ = true;
}

}  // namespace moraine
