#include "io/cli/run_directory.hpp"

#include <charconv>

#include "io/checkpoint/checkpoint.hpp"
#include "io/cli/layout.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

bool is_empty_or_missing(const fs::path& directory) {
  std::error_code error;
  if (!fs::exists(directory, error)) return true;
  return fs::is_directory(directory, error) && fs::is_empty(directory, error) && !error;
}

/// What a job finds in its directory before it runs.
bool holds_only_job(const fs::path& directory) {
  std::error_code error;
  for (fs::directory_iterator entry(directory, error), end; !error && entry != end; entry.increment(error))
    if (entry->path() != job_folder(directory)) return false;
  return !error;
}

fs::path base_directory(const fs::path& scene_file, const Scene& scene) {
  if (scene.output.directory.empty()) return fs::path("runs") / run_name(scene_file);
  fs::path base = fs::path(scene.output.directory).lexically_normal();
  return base.has_filename() ? base : base.parent_path();
}

fs::path numbered(const fs::path& base, int number) {
  if (number == 1) return base;
  fs::path path = base;
  path += '-' + std::to_string(number);
  return path;
}

/// The number in NAME-NUMBER, 1 for NAME itself, 0 for other names.
int number_of(const std::string& name, const std::string& base) {
  if (name == base) return 1;
  if (!name.starts_with(base + '-')) return 0;
  int number = 0;
  const char* last = name.data() + name.size();
  const auto [end, error] = std::from_chars(name.data() + base.size() + 1, last, number);
  return error == std::errc() && end == last && number >= 2 ? number : 0;
}

}  // namespace

std::string run_name(const fs::path& scene_file) {
  const fs::path full = fs::absolute(scene_file).lexically_normal();
  const std::string stem = full.stem().string();
  if (stem != "scene") return stem;
  const std::string folder = full.parent_path().filename().string();
  return folder.empty() ? stem : folder;
}

bool holds_run(const fs::path& directory) {
  return fs::exists(directory / "scene.toml") || fs::exists(directory / "checkpoints") ||
         fs::exists(directory / "snapshots");
}

fs::path job_folder(const fs::path& directory) { return directory / "job"; }

fs::path new_run_directory(const fs::path& scene_file, const Scene& scene, const std::optional<fs::path>& out) {
  if (out) {
    if (is_empty_or_missing(*out) || holds_only_job(*out)) return *out;
    throw UsageError(out->string() +
                     (!fs::is_directory(*out) ? " is a file; --out expects a directory"
                      : holds_run(*out)
                          ? " holds a run already; choose another --out, or go on with it by --restart auto"
                          : " is not empty; choose another --out"));
  }
  const fs::path base = base_directory(scene_file, scene);
  for (int number = 1;; ++number)
    if (is_empty_or_missing(numbered(base, number))) return numbered(base, number);
}

std::optional<fs::path> newest_run_directory(const fs::path& scene_file, const Scene& scene) {
  const fs::path base = base_directory(scene_file, scene);
  const fs::path parent = base.has_parent_path() ? base.parent_path() : fs::path(".");
  int newest = 0;
  std::error_code error;
  for (fs::directory_iterator entry(parent, error), end; !error && entry != end; entry.increment(error)) {
    const int number = number_of(entry->path().filename().string(), base.filename().string());
    if (number > newest && holds_run(entry->path())) newest = number;
  }
  return newest == 0 ? std::nullopt : std::optional(numbered(base, newest));
}

std::optional<fs::path> run_directory_of(const fs::path& checkpoint) {
  const fs::path full = fs::absolute(checkpoint).lexically_normal();
  if (full.parent_path().filename() != "checkpoints") return std::nullopt;
  // Kept as it was given where that is possible, so that messages are short.
  const fs::path given = checkpoint.lexically_normal().parent_path();
  if (given.filename() == "checkpoints" && given.has_parent_path()) return given.parent_path();
  return full.parent_path().parent_path();
}

}  // namespace moraine
