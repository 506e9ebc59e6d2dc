#include "io/checkpoint/rank_files.hpp"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <system_error>
#include <vector>

#include "io/checkpoint/durable_file.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view mark = ".rank-";

fs::path beside(const fs::path& path, const std::string& word) {
  return path.parent_path() / (path.stem().string() + word + path.extension().string());
}

std::string rank_word(int rank) {
  char word[32];
  std::snprintf(word, sizeof word, ".rank-%04d", rank);
  return word;
}

/// The file in front of a rank's file, by name: the words from ".rank-" to the ending go. Nothing for other files.
std::optional<fs::path> front_of(const fs::path& path) {
  const bool is_draft = path.extension() == ".tmp";
  const fs::path name = is_draft ? path.stem() : path.filename();
  const std::string stem = name.stem().string();
  const std::size_t at = stem.rfind(mark);
  if (at == std::string::npos) return std::nullopt;
  const std::string words = stem.substr(at + mark.size());
  const std::size_t n_digits = std::min(words.find('.'), words.size());
  const bool is_number =
      n_digits > 0 && std::all_of(words.begin(), words.begin() + static_cast<std::ptrdiff_t>(n_digits),
                                  [](unsigned char c) { return std::isdigit(c) != 0; });
  const std::size_t expected = is_draft ? n_digits : n_digits + 9;  // the seal's first eight digits and a dot
  if (!is_number || words.size() != expected) return std::nullopt;
  return path.parent_path() / (stem.substr(0, at) + name.extension().string());
}

/// The names of all files of ranks that a file in front, or one set aside, still needs; nothing where this cannot be
/// told.
std::optional<std::set<std::string>> needed_by(const fs::path& front) {
  std::set<std::string> names;
  for (const char* ending : {"", ".old"}) {
    const fs::path path = front.string() + ending;
    std::error_code error;
    if (!fs::exists(path, error)) continue;
    const auto listed = listed_rank_files(path);
    if (!listed) return std::nullopt;
    for (const RankFile& file : *listed) names.insert(file.name);
  }
  return names;
}

void remove_stale(const fs::path& directory, const std::optional<fs::path>& only) {
  std::vector<std::pair<fs::path, fs::path>> found;  // file, file in front
  std::error_code error;
  const fs::path place = directory.empty() ? fs::path(".") : directory;
  for (fs::directory_iterator entry(place, error), end; !error && entry != end; entry.increment(error)) {
    const std::optional<fs::path> front = front_of(entry->path());
    if (front && (!only || front->filename() == only->filename())) found.emplace_back(entry->path(), *front);
  }
  std::map<fs::path, std::optional<std::set<std::string>>> needed;
  for (const auto& [path, front] : found) {
    const auto known = needed.try_emplace(front).first;
    if (!known->second) known->second = needed_by(front);
    const bool is_draft = path.extension() == ".tmp";
    if (is_draft || (known->second && known->second->count(path.filename().string()) == 0)) fs::remove(path, error);
  }
}

}  // namespace

fs::path rank_file_draft(const fs::path& path, int rank) { return beside(path, rank_word(rank)); }

fs::path rank_file_name(const fs::path& path, int rank, Hash128 seal) {
  return beside(path, rank_word(rank) + '.' + seal.text().substr(0, 8));
}

void remove_stale_rank_files(const fs::path& path) { remove_stale(path.parent_path(), path); }

void remove_all_stale_rank_files(const fs::path& directory) { remove_stale(directory, std::nullopt); }

void remove_with_rank_files(const fs::path& path) {
  std::error_code error;
  // The one in front goes first, so that none is left whose rows are gone.
  if (!fs::remove(path, error) && error) throw StorageError(path, "cannot be removed: " + explain_errno(error.value()));
  remove_stale_rank_files(path);
}

}  // namespace moraine
