// What a file from a stranger may do: be read, or be refused by name. Each target takes any bytes; an error that is not
// one of ours leaves it as an exception, and ends the program that drives it (libFuzzer's, or replay.cpp).
#pragma once

#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <string_view>

namespace moraine::fuzz {

using Bytes = std::span<const std::uint8_t>;

struct Target {
  const char* name;
  void (*run)(Bytes);
};

void fuzz_scene(Bytes bytes);        // a scene file; lines after a zero byte are --set
void fuzz_mesh(Bytes bytes);         // the first byte chooses: STL or OBJ
void fuzz_grains(Bytes bytes);       // a table of grains; the first byte chooses its ending
void fuzz_sealed(Bytes bytes);       // a checkpoint or snapshot, byte by byte
void fuzz_content(Bytes bytes);      // a well-formed HDF5 file, rightly sealed, of unexpected content
void fuzz_restart(Bytes bytes);      // a sound checkpoint of a run, its numbers altered
void fuzz_network(Bytes bytes);      // a description of a network
void fuzz_environment(Bytes bytes);  // Slurm's variables, layouts, time limits, amounts of memory

inline constexpr Target targets[] = {
    {"scene", fuzz_scene},     {"mesh", fuzz_mesh},       {"grains", fuzz_grains},   {"sealed", fuzz_sealed},
    {"content", fuzz_content}, {"restart", fuzz_restart}, {"network", fuzz_network}, {"environment", fuzz_environment},
};

/// Takes bytes apart; zeros when there are no more.
class Source {
 public:
  explicit Source(Bytes bytes) : bytes_(bytes) {}
  bool is_empty() const { return bytes_.empty(); }
  std::uint8_t byte() {
    if (bytes_.empty()) return 0;
    const std::uint8_t value = bytes_.front();
    bytes_ = bytes_.subspan(1);
    return value;
  }
  std::uint64_t word() {
    std::uint64_t value = 0;
    const std::size_t n = std::min<std::size_t>(sizeof value, bytes_.size());
    std::memcpy(&value, bytes_.data(), n);
    bytes_ = bytes_.subspan(n);
    return value;
  }
  std::size_t below(std::size_t n) { return n == 0 ? 0 : byte() % n; }
  std::string_view rest() const { return {reinterpret_cast<const char*>(bytes_.data()), bytes_.size()}; }

 private:
  Bytes bytes_;
};

/// A folder in memory, of this process, removed when it ends.
inline const std::filesystem::path& scratch() {
  struct Folder {
    std::filesystem::path path;
    Folder() {
      std::error_code error;
      const std::filesystem::path memory = "/dev/shm";
      const bool has_memory = std::filesystem::is_directory(memory, error);
      path = (has_memory ? memory : std::filesystem::temp_directory_path()) /
             ("moraine-fuzz-" + std::to_string(::getpid()));
      std::filesystem::create_directories(path);
    }
    ~Folder() {
      std::error_code ignored;
      std::filesystem::remove_all(path, ignored);
    }
  };
  static const Folder folder;
  return folder.path;
}

inline std::filesystem::path put(const std::string& name, std::string_view text) {
  const std::filesystem::path path = scratch() / name;
  std::ofstream(path, std::ios::binary | std::ios::trunc).write(text.data(), static_cast<std::streamsize>(text.size()));
  return path;
}

}  // namespace moraine::fuzz
