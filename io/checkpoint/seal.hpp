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
//   rank-file 5bd1... snapshot_000000001000.rank-0000.5bd1aa03.h5   where each rank has written a file: its seal, its name
//   ...
//   seal 77de...                  XXH3-128 of the lines above
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
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

/// A run of one dataset's bytes as one rank wrote it.
struct Slice {
  std::uint64_t bytes = 0;
  Hash128 hash;  // taken from memory
};

/// One dataset as it was written: slices that follow each other in the file.
struct WrittenPart {
  std::string name;
  std::uint64_t offset = 0;  // [bytes] from the start of the file
  std::vector<Slice> slices;
};

/// A file that holds the rows of one rank, beside the one that it belongs to.
struct RankFile {
  std::string name;  // without directory
  Hash128 seal;      // its own last line
};

/// What a file says that it is.
struct SealHeader {
  std::string kind;  // "checkpoint", "snapshot"
  int format = 0;
  std::uint64_t header_bytes = 0;
  std::uint64_t file_bytes = 0;
  Hash128 content;
  std::vector<FilePart> parts;
  std::vector<RankFile> rank_files;
  Hash128 seal;
};

/// The newest format that this program reads: files of their own for each rank. Whole files are still written in the
/// one before.
inline constexpr int file_format = 2;
inline constexpr int whole_file_format = 1;

/// The kind of a file that holds the rows of one rank.
inline constexpr const char* rank_file_kind = "part";
/// Of coarse-grained fields.
inline constexpr const char* field_file_kind = "fields";

/// XXH3, 128 bits (Collet 2020).
Hash128 hash_bytes(const void* bytes, std::size_t n);

/// The same, of bytes that come piece by piece.
class HashStream {
 public:
  HashStream();
  ~HashStream();
  HashStream(const HashStream&) = delete;
  HashStream& operator=(const HashStream&) = delete;
  void reset();
  void add(const void* bytes, std::size_t n);
  Hash128 value() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Size of the user block that holds the seal of so many parts whose names have so many characters together [bytes].
std::uint64_t seal_size(std::size_t n_parts, std::size_t n_name_characters);

/// Reads back what lies in `written` behind the first `header_bytes` bytes, compares each slice with its hash, and
/// writes and syncs the seal. Returns the seal's own hash, which stands for the whole file. Throws StorageError in the
/// name of `path`.
Hash128 seal_file(const std::filesystem::path& written, const std::filesystem::path& path, const std::string& kind,
                  std::uint64_t header_bytes, const std::vector<WrittenPart>& parts,
                  const std::vector<RankFile>& rank_files = {});

/// Checks a file against its seal. Throws StorageError: not of this kind, a newer format, cut short, damaged and where.
/// `kinds`: those that are accepted. Returns nothing for a plain HDF5 file without a seal. The files of the ranks,
/// where there are any, are not looked at.
std::optional<SealHeader> check_seal(const std::filesystem::path& path, const std::vector<std::string>& kinds);

/// Checks a file of one rank that `path` lists: that it is there, sound, and the one that is meant. Throws StorageError
/// in the name of `path` that names the rank's file.
void check_rank_file(const std::filesystem::path& path, const RankFile& file);

/// The files of ranks that `path` lists; none for a whole file. Nothing where its header cannot be read. The content is
/// not checked.
std::optional<std::vector<RankFile>> listed_rank_files(const std::filesystem::path& path);

}  // namespace moraine
