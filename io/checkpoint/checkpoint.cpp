#include "io/checkpoint/checkpoint.hpp"

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <string_view>
#include <utility>

#include "io/checkpoint/agreement.hpp"
#include "io/checkpoint/rank_files.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view prefix = "checkpoint_";
constexpr std::string_view suffix = ".h5";
const std::vector<std::string> kinds = {"checkpoint"};

/// What the root sees, at all ranks.
std::vector<fs::path> agreed_checkpoints(const fs::path& run_directory, const World& world) {
  if (world.is_alone()) return list_checkpoints(run_directory);
  std::string names;
  if (world.is_root())
    for (const fs::path& path : list_checkpoints(run_directory)) names += path.filename().string() + '/';
  world.broadcast(names);
  std::vector<fs::path> paths;
  for (std::size_t at = 0, end; at < names.size(); at = end + 1) {
    end = names.find('/', at);
    paths.push_back(checkpoint_directory(run_directory) / names.substr(at, end - at));
  }
  return paths;
}

}  // namespace

void write_checkpoint(const fs::path& path, const Image& image, const RunRecord& record, const World& world,
                      bool distributed) {
  write_image(path, image, &record, world, distributed);
}

Checkpoint read_checkpoint(const fs::path& path, const World& world) {
  const Hdf5Reader file(path, kinds, true, world);
  Checkpoint checkpoint;
  agree(world, path, [&] {
    checkpoint.record = read_record(file);
    checkpoint.image = read_grains(file, world);
    read_history(file, checkpoint.image, world);
  });
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

std::optional<LatestCheckpoint> find_latest_checkpoint(const fs::path& run_directory, const World& world) {
  LatestCheckpoint latest;
  for (const fs::path& path : agreed_checkpoints(run_directory, world)) {
    try {
      latest.checkpoint = read_checkpoint(path, world);
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
  for (std::size_t i = static_cast<std::size_t>(std::max(n_kept, 1)); i < found.size(); ++i)
    remove_with_rank_files(found[i]);
  remove_all_stale_rank_files(checkpoint_directory(run_directory));
  std::vector<fs::path> left_over;
  std::error_code error;
  for (fs::directory_iterator entry(checkpoint_directory(run_directory), error), end; !error && entry != end;
       entry.increment(error))
    if (entry->path().extension() == ".tmp") left_over.push_back(entry->path());
  for (const fs::path& path : left_over) fs::remove(path, error);
}

}  // namespace moraine
