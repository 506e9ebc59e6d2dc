// HDF5 files of ours, written and read through few words; every call of the library is checked.
//
// Nothing of HDF5's own headers is seen outside hdf5_file.cpp. Files are deterministic: the same content gives the same bytes
// (no time stamps). Groups are made as dataset names need them.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "io/checkpoint/seal.hpp"

namespace moraine {

/// Writes PATH.tmp and puts it in the place of PATH when it is whole: close() seals, syncs and renames. A writer that goes
/// without close() removes PATH.tmp. All members throw StorageError.
class Hdf5Writer {
 public:
  /// `header_bytes`: user block for the seal, see seal_size().
  Hdf5Writer(const std::filesystem::path& path, std::string kind, std::uint64_t header_bytes);
  ~Hdf5Writer();
  Hdf5Writer(const Hdf5Writer&) = delete;
  Hdf5Writer& operator=(const Hdf5Writer&) = delete;

  /// Shape (n), or (n, components) with components > 1. `unit` becomes an attribute unless empty.
  void dataset(const std::string& name, std::span<const double> values, int components = 1,
               const std::string& unit = {});
  void dataset(const std::string& name, std::span<const std::uint64_t> values);
  void dataset(const std::string& name, std::span<const std::uint16_t> values);
  void text(const std::string& name, const std::string& value);  // UTF-8, one string

  /// Attributes of the file's root.
  void attribute(const std::string& name, const std::string& value);
  void attribute(const std::string& name, double value);
  void attribute(const std::string& name, std::uint64_t value);
  void attribute(const std::string& name, const std::array<double, 3>& value);

  void close();

 private:
  struct File;
  std::unique_ptr<File> file_;
};

/// Reads a file. The constructor checks its seal first; members throw StorageError where something is missing or of another form.
class Hdf5Reader {
 public:
  /// `kinds`: those that are accepted. `needs_seal`: false accepts a plain HDF5 file, such as another tool has rewritten.
  Hdf5Reader(const std::filesystem::path& path, const std::vector<std::string>& kinds, bool needs_seal);
  ~Hdf5Reader();
  Hdf5Reader(const Hdf5Reader&) = delete;
  Hdf5Reader& operator=(const Hdf5Reader&) = delete;

  const std::filesystem::path& path() const;
  /// "checkpoint" or "snapshot", from the attribute "kind".
  std::string kind() const;
  bool exists(const std::string& name) const;
  /// Names of what a group holds, in order of name; empty where there is no such group.
  std::vector<std::string> children(const std::string& group) const;

  /// Shape (n) gives n values, (n, components) n * components; `components` must agree.
  std::vector<double> reals(const std::string& name, int components = 1) const;
  std::vector<std::uint64_t> gids(const std::string& name) const;
  std::vector<std::uint16_t> indices(const std::string& name) const;
  std::string text(const std::string& name) const;

  std::string text_attribute(const std::string& name) const;
  double real_attribute(const std::string& name) const;
  std::uint64_t integer_attribute(const std::string& name) const;
  std::array<double, 3> vector_attribute(const std::string& name) const;

 private:
  struct File;
  std::unique_ptr<File> file_;
};

}  // namespace moraine
