#include "io/checkpoint/checkpoint.hpp"

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <string_view>
#include <utility>

#include "io/checkpoint/image_file.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view prefix = "checkpoint_";
constexpr std::string_view suffix = ".h5";
const std::vector<std::string> kinds = {"checkpoint"};

}  // namespace

void write_checkpoint(const fs::path& path, const Image& image, const RunRecord& record) {
  Hdf5Writer file(path, kinds[0], header_size(image, 1));
  file.attribute("version", record.version);
  file.attribute("commit", record.commit);
  file.text("scene", record.scene);
  write_grains(file, image);
  write_history(file, image);
  file.close();
}

Checkpoint read_checkpoint(const fs::path& path) {
  const Hdf5Reader file(path, kinds, true);
  Checkpoint checkpoint;
  checkpoint.record = {file.text("scene"), file.text_attribute("version"), file.text_attribute("commit")};
  checkpoint.image = read_grains(file);
  read_history(file, checkpoint.image);
  return checkpoint;
}

std::string checkpoint_name(std::uint64_t step) {
  char name[64];
  std::snprintf(name, sizeof name, "checkpoint_%012llu.h5", static_cast<unsigned long long>(step));
  return name;
}

std::optional<std::uint64_t> checkpoint_step(const fs::path& path) {
  const std::string name = path.filename().string();
  if (!name.starts_with(prefix) || !name.ends_with(suffix) || name.size() <= prefix.size() + suffix.size())
    return std::nullopt;
  const char* first = name.data() + prefix.size();
  const char* last = name.data() + name.size() - suffix.size();
  std::uint64_t step = 0;
  const auto [end, error] = std::from_chars(first, last, step);
  return error == std::errc() && end == last ? std::optional(step) : std::nullopt;
}

fs::path checkpoint_directory(const fs::path& run_directory) { return run_directory / "checkpoints"; }

std::vector<fs::path> list_checkpoints(const fs::path& run_directory) {
  std::vector<fs::path> found;
  std::error_code error;
  for (fs::directory_iterator entry(checkpoint_directory(run_directory), error), end; !error && entry != end;
       entry.increment(error))
    if (checkpoint_step(entry->path())) found.push_back(entry->path());
  std::sort(found.begin(), found.end(),
            [](const fs::path& a, const fs::path& b) { return checkpoint_step(a) > checkpoint_step(b); });
  return found;
}

std::optional<LatestCheckpoint> find_latest_checkpoint(const fs::path& run_directory) {
  LatestCheckpoint latest;
  for (const fs::path& path : list_checkpoints(run_directory)) {
    try {
      latest.checkpoint = read_checkpoint(path);
      latest.path = path;
      return latest;
    } catch (const StorageError& error) {
      latest.warnings.emplace_back(error.what());
    }
  }
  if (latest.warnings.empty()) return std::nullopt;
  std::string all = "holds no sound checkpoint:";
  for (const std::string& warning : latest.warnings) all += "\n  " + warning;
  throw StorageError(checkpoint_directory(run_directory), all);
}

void remove_old_checkpoints(const fs::path& run_directory, int n_kept) {
  const std::vector<fs::path> found = list_checkpoints(run_directory);
  std::error_code error;
  for (std::size_t i = static_cast<std::size_t>(std::max(n_kept, 1)); i < found.size(); ++i)
    if (!fs::remove(found[i], error) && error)
      throw StorageError(found[i], "cannot be removed: " + explain_errno(error.value()));
  std::vector<fs::path> left_over;
  for (fs::directory_iterator entry(checkpoint_directory(run_directory), error), end; !error && entry != end;
       entry.increment(error))
    if (entry->path().extension() == ".tmp") left_over.push_back(entry->path());
  for (const fs::path& path : left_over) fs::remove(path, error);
}

}  // namespace moraine
