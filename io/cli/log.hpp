// What a run says: to the terminal, and with the time of day to RUN/log.txt.
#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "io/checkpoint/durable_file.hpp"

namespace moraine {

class Log {
 public:
  /// To the terminal only, until open(). A quiet one says nothing there.
  explicit Log(bool is_quiet = false) : is_quiet_(is_quiet) {}
  /// One that says nothing and writes nothing: for all ranks but the root.
  static Log mute();
  /// From here on also to a file, appended to what it holds; what was said so far goes there first. Throws StorageError.
  void open(const std::filesystem::path& path);

  void say(const std::string& text);    // stdout
  void warn(const std::string& text);   // stderr, "warning: "
  void error(const std::string& text);  // stderr, "error: "
  void note(const std::string& text);   // file only
  /// A line that is rewritten by the next one, where stderr is a terminal; else a line like any other. Not in the file.
  void progress(const std::string& line);
  bool is_terminal() const;

 private:
  void clear_progress();
  void print(std::FILE* stream, const std::string& text) const;
  void record(const std::string& text);

  std::unique_ptr<FileHandle> file_;
  std::uint64_t end_ = 0;  // [bytes]
  std::string waiting_;    // said before open()
  bool has_progress_ = false;
  bool is_quiet_ = false;
  bool is_mute_ = false;
};

}  // namespace moraine
