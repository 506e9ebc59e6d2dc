#include "io/checkpoint/seal.hpp"

#include <fcntl.h>
#include <xxhash.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstring>
#include <memory>
#include <string_view>

#include "io/checkpoint/durable_file.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t block_bytes = 1u << 20;
constexpr std::uint64_t smallest_header = 512;  // HDF5: a user block is 0 or a power of two from 512 on
constexpr std::uint64_t largest_header = 1u << 28;
constexpr std::string_view hdf5_signature = "\x89HDF\r\n\x1a\n";

Hash128 from_xxhash(XXH128_hash_t hash) { return {hash.high64, hash.low64}; }

/// Hash of bytes [begin, end) of a file, through a buffer.
Hash128 hash_range(const FileHandle& file, std::uint64_t begin, std::uint64_t end, std::vector<char>& buffer) {
  HashStream stream;
  buffer.resize(std::max<std::size_t>(
      buffer.size(), static_cast<std::size_t>(std::min<std::uint64_t>(block_bytes, end - std::min(begin, end)))));
  for (std::uint64_t at = begin; at < end;) {
    const std::size_t n = static_cast<std::size_t>(std::min<std::uint64_t>(block_bytes, end - at));
    const std::size_t got = file.read(buffer.data(), n, at);
    stream.add(buffer.data(), got);
    if (got < n) break;
    at += n;
  }
  return stream.value();
}

/// Reads what was written from front to back once, as it may be large: the hash of all content, and of each part on the
/// way.
class ReadBack {
 public:
  ReadBack(const FileHandle& file, const fs::path& path, std::uint64_t from) : file_(file), path_(path), at_(from) {}

  /// Up to byte `end`.
  void pass(std::uint64_t end, HashStream* part = nullptr, HashStream* slice = nullptr) {
    while (at_ < end) {
      const std::size_t n =
          file_.read(buffer_.data(), static_cast<std::size_t>(std::min<std::uint64_t>(block_bytes, end - at_)), at_);
      if (n == 0) throw StorageError(path_, "became shorter while it was written");
      content_.add(buffer_.data(), n);
      if (part != nullptr) part->add(buffer_.data(), n);
      if (slice != nullptr) slice->add(buffer_.data(), n);
      at_ += n;
    }
  }

  /// A part, which must hold what its writers had in memory. Returns its hash.
  FilePart pass_part(const WrittenPart& written) {
    pass(written.offset);
    const bool is_one = written.slices.size() == 1;
    HashStream whole, inside;
    for (const Slice& slice : written.slices) {
      inside.reset();
      pass(at_ + slice.bytes, is_one ? nullptr : &whole, &inside);
      if (inside.value() != slice.hash)
        throw StorageError(path_, "what was read back of " + written.name +
                                      " is not what was written: the disk or memory is at fault");
    }
    return {written.name, written.offset, at_ - written.offset, is_one ? inside.value() : whole.value()};
  }

  Hash128 content() const { return content_.value(); }

 private:
  const FileHandle& file_;
  const fs::path& path_;
  std::uint64_t at_;
  HashStream content_;
  std::vector<char> buffer_ = std::vector<char>(block_bytes);
};

/// Fills in the hashes of a header.
void hash_content(const FileHandle& file, const fs::path& path, std::vector<WrittenPart> parts, SealHeader& header) {
  std::sort(parts.begin(), parts.end(), [](const WrittenPart& a, const WrittenPart& b) { return a.offset < b.offset; });
  ReadBack back(file, path, header.header_bytes);
  for (const WrittenPart& part : parts) header.parts.push_back(back.pass_part(part));
  back.pass(header.file_bytes);
  header.content = back.content();
}

std::string seal_text(const SealHeader& header) {
  std::string text = "Moraine " + header.kind + ' ' + std::to_string(header.format) + '\n';
  text += "header " + std::to_string(header.header_bytes) + '\n';
  text += "bytes " + std::to_string(header.file_bytes) + '\n';
  text += "content " + header.content.text() + '\n';
  for (const FilePart& part : header.parts)
    text += "part " + std::to_string(part.offset) + ' ' + std::to_string(part.bytes) + ' ' + part.hash.text() + ' ' +
            part.name + '\n';
  for (const RankFile& file : header.rank_files) text += "rank-file " + file.seal.text() + ' ' + file.name + '\n';
  return text;
}

/// Takes text apart, word by word; every reader returns false at the first thing out of place.
class Scanner {
 public:
  explicit Scanner(std::string_view text) : text_(text) {}
  std::size_t position() const { return at_; }

  bool literal(std::string_view expected) {
    if (text_.substr(at_, expected.size()) != expected) return false;
    at_ += expected.size();
    return true;
  }
  bool number(std::uint64_t& value) {
    const char* first = text_.data() + at_;
    const auto [end, error] = std::from_chars(first, text_.data() + text_.size(), value);
    if (error != std::errc() || (end - first > 1 && *first == '0')) return false;
    at_ += static_cast<std::size_t>(end - first);
    return true;
  }
  bool until(char stop, std::string& word) {
    const std::size_t end = text_.find(stop, at_);
    if (end == std::string_view::npos) return false;
    word = text_.substr(at_, end - at_);
    at_ = end;
    return true;
  }
  bool hash(Hash128& value) {
    if (text_.size() < at_ + 32) return false;
    const std::string word(text_.substr(at_, 32));
    if (!std::all_of(word.begin(), word.end(), [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); }))
      return false;
    value = Hash128::from_text(word);
    at_ += 32;
    return true;
  }

 private:
  std::string_view text_;
  std::size_t at_ = 0;
};

bool parse_first_line(Scanner& scan, SealHeader& header) {
  std::uint64_t format = 0;
  if (!scan.literal("Moraine ") || !scan.until(' ', header.kind) || !scan.literal(" ") || !scan.number(format))
    return false;
  header.format = static_cast<int>(std::min<std::uint64_t>(format, 1'000'000));
  return scan.literal("\n");
}

bool parse_rest(Scanner& scan, std::string_view block, SealHeader& header) {
  if (!scan.literal("header ") || !scan.number(header.header_bytes) || !scan.literal("\nbytes ") ||
      !scan.number(header.file_bytes) || !scan.literal("\ncontent ") || !scan.hash(header.content) ||
      !scan.literal("\n"))
    return false;
  while (scan.literal("part ")) {
    FilePart part;
    if (!scan.number(part.offset) || !scan.literal(" ") || !scan.number(part.bytes) || !scan.literal(" ") ||
        !scan.hash(part.hash) || !scan.literal(" ") || !scan.until('\n', part.name) || !scan.literal("\n"))
      return false;
    header.parts.push_back(std::move(part));
  }
  while (scan.literal("rank-file ")) {
    RankFile file;
    if (!scan.hash(file.seal) || !scan.literal(" ") || !scan.until('\n', file.name) || !scan.literal("\n"))
      return false;
    header.rank_files.push_back(std::move(file));
  }
  const std::size_t sealed = scan.position();
  if (!scan.literal("seal ") || !scan.hash(header.seal) || !scan.literal("\n")) return false;
  if (header.seal != hash_bytes(block.data(), sealed)) return false;
  const std::string_view padding = block.substr(scan.position());
  return std::all_of(padding.begin(), padding.end(), [](char c) { return c == '\0'; });
}

/// The size of the user block, read from the second line; 0 where there is none.
std::uint64_t announced_header(std::string_view start) {
  const std::size_t line = start.find("\nheader ");
  if (line == std::string_view::npos) return 0;
  Scanner scan(start.substr(line + 8));
  std::uint64_t bytes = 0;
  if (!scan.number(bytes) || bytes < smallest_header || bytes > largest_header || (bytes & (bytes - 1)) != 0) return 0;
  return bytes;
}

std::string joined(const std::vector<std::string>& words, const char* between) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : between) + word;
  return text;
}

/// Which parts do not agree with their hashes, in words.
std::string damaged_parts(const FileHandle& file, const SealHeader& header) {
  std::vector<std::string> names;
  std::vector<char> buffer;
  for (const FilePart& part : header.parts)
    if (hash_range(file, part.offset, part.offset + part.bytes, buffer) != part.hash) names.push_back(part.name);
  if (names.empty()) return "is damaged: its HDF5 structure does not agree with its checksum";
  return "is damaged: " + joined(names, ", ") + (names.size() == 1 ? " does" : " do") + " not agree with the checksum";
}

/// The header of a sealed file, checked against its own hash and the file's size; no `kinds` accept any. Nothing for a
/// plain HDF5 file.
std::optional<SealHeader> read_header(const FileHandle& file, const fs::path& path,
                                      const std::vector<std::string>& kinds) {
  const std::string expected = "expected a Moraine " + joined(kinds, " or ");
  std::string block(smallest_header, '\0');
  block.resize(file.read(block.data(), block.size(), 0));
  if (block.empty()) throw StorageError(path, "is empty, " + expected);
  if (block.starts_with(hdf5_signature)) return std::nullopt;

  SealHeader header;
  Scanner first(block);
  if (!parse_first_line(first, header))
    throw StorageError(path, std::string(block.size() < 40 ? "is cut short or " : "") +
                                 "is not a Moraine file, or its first line is damaged; " + expected);
  if (header.format > file_format)
    throw StorageError(path, "is written in format " + std::to_string(header.format) + ", newer than format " +
                                 std::to_string(file_format) + " of this program: use a newer Moraine");
  if (!kinds.empty() && std::find(kinds.begin(), kinds.end(), header.kind) == kinds.end())
    throw StorageError(path, "is a Moraine " + header.kind + ", " + expected);

  const std::uint64_t header_bytes = announced_header(block);
  const std::uint64_t size = file.size();
  if (header_bytes == 0)
    throw StorageError(path, size < smallest_header ? "is cut short" : "is damaged: its header cannot be read");
  if (size < header_bytes)
    throw StorageError(path, "is cut short: " + std::to_string(size) + " bytes are less than its header");
  block.resize(header_bytes);
  file.read(block.data(), block.size(), 0);
  Scanner scan(block);
  parse_first_line(scan, header);
  if (header.format < 1 || !parse_rest(scan, block, header) || header.header_bytes != header_bytes)
    throw StorageError(path, "is damaged: its header does not agree with its checksum");
  if (size != header.file_bytes)
    throw StorageError(path, (size < header.file_bytes ? "is cut short: " : "is too long: ") + std::to_string(size) +
                                 " of " + std::to_string(header.file_bytes) + " bytes");
  return header;
}

}  // namespace

struct HashStream::State {
  XXH3_state_t* xxhash = XXH3_createState();
  State() = default;
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() { XXH3_freeState(xxhash); }
};

HashStream::HashStream() : state_(std::make_unique<State>()) { reset(); }
HashStream::~HashStream() = default;
void HashStream::reset() { XXH3_128bits_reset(state_->xxhash); }
void HashStream::add(const void* bytes, std::size_t n) { XXH3_128bits_update(state_->xxhash, bytes, n); }
Hash128 HashStream::value() const { return from_xxhash(XXH3_128bits_digest(state_->xxhash)); }

Hash128 hash_bytes(const void* bytes, std::size_t n) { return from_xxhash(XXH3_128bits(bytes, n)); }

std::uint64_t seal_size(std::size_t n_parts, std::size_t n_name_characters) {
  const std::size_t longest_part = 5 + 21 + 21 + 33 + 1;  // "part ", two numbers, hash, newline
  const std::size_t needed = 256 + n_parts * longest_part + n_name_characters;
  std::uint64_t size = smallest_header;
  while (size < needed) size *= 2;
  return size;
}

Hash128 seal_file(const fs::path& written, const fs::path& path, const std::string& kind, std::uint64_t header_bytes,
                  const std::vector<WrittenPart>& parts, const std::vector<RankFile>& rank_files) {
  FileHandle file(written, O_RDWR, path);
  const int format = rank_files.empty() ? whole_file_format : file_format;
  SealHeader header{kind, format, header_bytes, file.size(), {}, {}, rank_files, {}};
  hash_content(file, path, parts, header);
  std::string text = seal_text(header);
  header.seal = hash_bytes(text.data(), text.size());
  text += "seal " + header.seal.text() + '\n';
  if (text.size() > header_bytes) throw std::logic_error("the seal does not fit into its user block");
  text.resize(header_bytes, '\0');
  file.write(text.data(), text.size(), 0);
  file.sync();
  file.close();
  return header.seal;
}

std::optional<SealHeader> check_seal(const fs::path& path, const std::vector<std::string>& kinds) {
  const FileHandle file(path, O_RDONLY);
  const std::optional<SealHeader> header = read_header(file, path, kinds);
  if (!header) return std::nullopt;
  std::vector<char> buffer;
  if (hash_range(file, header->header_bytes, header->file_bytes, buffer) != header->content)
    throw StorageError(path, damaged_parts(file, *header));
  return header;
}

void check_rank_file(const fs::path& path, const RankFile& file) {
  const std::string begin = "cannot be used: its part " + file.name + ' ';
  const fs::path place = path.parent_path() / file.name;
  std::error_code error;
  if (!fs::exists(place, error)) throw StorageError(path, begin + "is missing");
  try {
    const std::optional<SealHeader> header = check_seal(place, {rank_file_kind});
    if (!header || header->seal != file.seal) throw StorageError(place, "belongs to another file");
  } catch (const StorageError& failure) {
    throw StorageError(path, begin + failure.problem);
  }
}

std::optional<std::vector<RankFile>> listed_rank_files(const fs::path& path) {
  try {
    const FileHandle file(path, O_RDONLY);
    const std::optional<SealHeader> header = read_header(file, path, {});
    return header ? header->rank_files : std::vector<RankFile>();
  } catch (const StorageError&) {
    return std::nullopt;
  }
}

}  // namespace moraine
