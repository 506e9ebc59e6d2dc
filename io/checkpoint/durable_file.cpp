#include "io/checkpoint/durable_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "io/checkpoint/subdirectory.hpp"

namespace moraine {

namespace fs = std::filesystem;

std::string explain_errno(int error) {
  switch (error) {
    case ENOSPC: return "no space left on the disk";
    case EDQUOT: return "the disk quota is used up";
    case EACCES: return "permission denied";
    case EROFS: return "the file system is read-only";
    case ENOENT: return "no such file or directory";
    case EFBIG: return "the file would be larger than a limit allows (ulimit -f)";
    case EMFILE: return "too many open files (ulimit -n)";
    case EIO: return "the disk reports an input/output error";
    default: return std::strerror(error);
  }
}

FileHandle::FileHandle(const fs::path& opened, int flags, const fs::path& named_in_messages)
    : path_(named_in_messages.empty() ? opened : named_in_messages) {
  do descriptor_ = ::open(opened.c_str(), flags | O_CLOEXEC, 0666);
  while (descriptor_ < 0 && errno == EINTR);
  const bool writes = (flags & (O_WRONLY | O_RDWR)) != 0;
  if (descriptor_ < 0)
    throw StorageError(path_, (writes ? "cannot be written: " : "cannot be read: ") + explain_errno(errno));
  struct stat status {};
  if (::fstat(descriptor_, &status) == 0 && S_ISDIR(status.st_mode)) {
    ::close(std::exchange(descriptor_, -1));
    throw StorageError(path_, "is a directory, expected a file");
  }
}

FileHandle::~FileHandle() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

std::uint64_t FileHandle::size() const {
  struct stat status {};
  if (::fstat(descriptor_, &status) != 0) throw StorageError(path_, "cannot be examined: " + explain_errno(errno));
  return static_cast<std::uint64_t>(status.st_size);
}

std::size_t FileHandle::read(void* to, std::size_t n, std::uint64_t offset) const {
  std::size_t done = 0;
  while (done < n) {
    const ssize_t got =
        ::pread(descriptor_, static_cast<char*>(to) + done, n - done, static_cast<off_t>(offset + done));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw StorageError(path_, "cannot be read: " + explain_errno(errno));
    if (got == 0) break;
    done += static_cast<std::size_t>(got);
  }
  return done;
}

void FileHandle::write(const void* from, std::size_t n, std::uint64_t offset) {
  std::size_t done = 0;
  while (done < n) {
    const ssize_t put =
        ::pwrite(descriptor_, static_cast<const char*>(from) + done, n - done, static_cast<off_t>(offset + done));
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0) throw StorageError(path_, "cannot be written: " + explain_errno(put < 0 ? errno : ENOSPC));
    done += static_cast<std::size_t>(put);
  }
}

void FileHandle::resize(std::uint64_t size) {
  if (::ftruncate(descriptor_, static_cast<off_t>(size)) != 0)
    throw StorageError(path_, "cannot be cut to its length: " + explain_errno(errno));
}

void FileHandle::reserve(std::uint64_t size) {
  int result = 0;
  do result = ::fallocate(descriptor_, 0, 0, static_cast<off_t>(size));
  while (result != 0 && errno == EINTR);
  // Some file systems cannot promise room: there the writes themselves will tell.
  if (result != 0 && errno != EOPNOTSUPP && errno != ENOSYS)
    throw StorageError(path_, "cannot be written: " + explain_errno(errno));
}

void FileHandle::sync() {
  if (::fsync(descriptor_) != 0) throw StorageError(path_, "cannot be written to the disk: " + explain_errno(errno));
}

void FileHandle::close() {
  if (::close(std::exchange(descriptor_, -1)) != 0)
    throw StorageError(path_, "cannot be closed: " + explain_errno(errno));
}

fs::path temporary_name(const fs::path& path) {
  fs::path name = path;
  name += ".tmp";
  return name;
}

void sync_directory(const fs::path& directory) {
  const fs::path place = directory.empty() ? fs::path(".") : directory;
  const int descriptor = ::open(place.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) throw StorageError(place, "cannot be opened: " + explain_errno(errno));
  const int result = ::fsync(descriptor);
  const int error = errno;
  ::close(descriptor);
  // Some file systems cannot sync a directory and say EINVAL; a rename there is as durable as it gets.
  if (result != 0 && error != EINVAL)
    throw StorageError(place, "cannot be written to the disk: " + explain_errno(error));
}

void move_to(const fs::path& written, const fs::path& path) {
  if (std::rename(written.c_str(), path.c_str()) != 0)
    throw StorageError(path, "cannot be replaced: " + explain_errno(errno));
  sync_directory(path.parent_path());
}

void take_place(const fs::path& path) { move_to(temporary_name(path), path); }

void write_file(const fs::path& path, std::string_view text) {
  const fs::path temporary = temporary_name(path);
  try {
    FileHandle file(temporary, O_WRONLY | O_CREAT | O_TRUNC, path);
    file.write(text.data(), text.size(), 0);
    file.sync();
    file.close();
    take_place(path);
  } catch (...) {
    std::error_code ignored;
    fs::remove(temporary, ignored);
    throw;
  }
}

std::string read_file(const fs::path& path) {
  const FileHandle file(path, O_RDONLY);
  std::string text(file.size(), '\0');
  text.resize(file.read(text.data(), text.size(), 0));
  return text;
}

namespace {

void expect_directory(const fs::path& path, const std::error_code& error) {
  if (error) throw StorageError(path, "the directory cannot be made: " + explain_errno(error.value()));
  std::error_code ignored;
  if (!fs::is_directory(path, ignored)) throw StorageError(path, "is a file, expected a directory");
}

}  // namespace

void make_directory(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  expect_directory(path, error);
}

void make_subdirectory(const fs::path& path) {
  std::error_code error;
  fs::create_directory(path, error);
  expect_directory(path, error);
}

}  // namespace moraine
