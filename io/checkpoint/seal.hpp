// The seal: what the first bytes of each of our HDF5 files say about the rest, so that a damaged file is found, and the
// damaged part named, before the HDF5 library reads a byte of it (the library may crash on damaged structures).
//
// It lies in the file's user block, a stretch in front that HDF5 sets aside for applications, so that every HDF5 tool opens
// the file as it is. It is plain text, `head -c 300 FILE` shows it:
//
//   Moraine checkpoint 1          what it is, format version
//   header 2048                   size of the user block [bytes]
//   bytes 481204                  size of the file
//   content 31c5...               XXH3-128 of everything behind the user block
//   part 4096 240000 90ab... particles/position     offset, bytes, XXH3-128 of one dataset
//   ...
//   seal 77de...                  XXH3-128 of the lines above
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "engine/run/image.hpp"

namespace moraine {

/// One dataset's place in a file.
struct FilePart {
  std::string name;
  std::uint64_t offset = 0;  // [bytes] from the start of the file
  std::uint64_t bytes = 0;
  Hash128 hash;
};

/// What a file says that it is.
struct SealHeader {
  std::string kind;  // "checkpoint", "snapshot"
  int format = 0;
  std::uint64_t header_bytes = 0;
  std::uint64_t file_bytes = 0;
  Hash128 content;
  std::vector<FilePart> parts;
};

/// The newest format that this program reads and writes.
inline constexpr int file_format = 1;

/// XXH3, 128 bits (Collet 2020).
Hash128 hash_bytes(const void* bytes, std::size_t n);

/// Size of the user block that holds the seal of so many parts whose names have so many characters together [bytes].
std::uint64_t seal_size(std::size_t n_parts, std::size_t n_name_characters);

/// Reads back what lies in `written` behind the first `header_bytes` bytes, compares each part with its hash (taken from
/// memory before it was written), and writes and syncs the seal. Throws StorageError in the name of `path`.
void seal_file(const std::filesystem::path& written, const std::filesystem::path& path, const std::string& kind,
               std::uint64_t header_bytes, std::vector<FilePart> parts);

/// Checks a file against its seal. Throws StorageError: not of this kind, a newer format, cut short, damaged and where.
/// `kinds`: those that are accepted. Returns nothing for a plain HDF5 file without a seal.
std::optional<SealHeader> check_seal(const std::filesystem::path& path, const std::vector<std::string>& kinds);

}  // namespace moraine
