// Files that are either whole or not there: written beside their place, synced, renamed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>

namespace moraine {

/// A file cannot be read or written. `what()` starts with the file's name and says what is wrong with it.
struct StorageError : std::runtime_error {
  StorageError(const std::filesystem::path& file, const std::string& what_is_wrong)
      : std::runtime_error(file.string() + ": " + what_is_wrong), path(file), problem(what_is_wrong) {}
  std::filesystem::path path;
  std::string problem;
};

/// The meaning of an errno, with the cure where there is a usual one ("no space left on the disk").
std::string explain_errno(int error);

/// An open file descriptor that closes itself. All members throw StorageError in the name of `path`.
class FileHandle {
 public:
  /// `flags` as for open(2).
  FileHandle(const std::filesystem::path& opened, int flags, const std::filesystem::path& named_in_messages = {});
  ~FileHandle();
  FileHandle(const FileHandle&) = delete;
  FileHandle& operator=(const FileHandle&) = delete;

  std::uint64_t size() const;  // [bytes]
  /// Reads up to n bytes from `offset`; fewer only at the end of the file.
  std::size_t read(void* to, std::size_t n, std::uint64_t offset) const;
  /// Writes all n bytes, or throws.
  void write(const void* from, std::size_t n, std::uint64_t offset);
  void resize(std::uint64_t size);
  /// Makes sure of the disk's room for the first `size` bytes, where the file system can promise it.
  void reserve(std::uint64_t size);
  void sync();
  /// Closes and reports what the system held back until now.
  void close();

 private:
  int descriptor_ = -1;
  std::filesystem::path path_;
};

/// The name under which a file is written before it takes its place: PATH.tmp, in the same directory.
std::filesystem::path temporary_name(const std::filesystem::path& path);

/// Makes the entry of a directory durable. Throws StorageError.
void sync_directory(const std::filesystem::path& directory);

/// Gives a written and synced file its name and syncs the directory. Throws StorageError in the name of `path`, which
/// is then as it was.
void move_to(const std::filesystem::path& written, const std::filesystem::path& path);

/// Moves a written and synced PATH.tmp to PATH and syncs the directory. Throws StorageError; PATH is then as it was.
void take_place(const std::filesystem::path& path);

/// Replaces a file by `text` at once: after a crash it holds the old text or the new one. Throws StorageError.
void write_file(const std::filesystem::path& path, std::string_view text);

/// The whole file. Throws StorageError.
std::string read_file(const std::filesystem::path& path);

/// Makes a directory and its parents. Throws StorageError.
void make_directory(const std::filesystem::path& path);

}  // namespace moraine
