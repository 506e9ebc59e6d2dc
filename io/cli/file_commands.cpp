#include "io/cli/file_commands.hpp"

#include <fmt/format.h>

#include "io/checkpoint/checkpoint.hpp"
#include "io/cli/text.hpp"
#include "io/snapshot/compare.hpp"
#include "io/snapshot/describe.hpp"
#include "io/snapshot/snapshot.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

/// The file that stands for a path: itself, or what a run directory holds last.
fs::path last_image(const fs::path& path) {
  if (!fs::is_directory(path)) return path;
  if (const auto checkpoints = list_checkpoints(path); !checkpoints.empty()) return checkpoints.front();
  if (const auto snapshots = list_snapshots(path); !snapshots.empty()) return snapshots.back();
  throw StorageError(path, "holds neither checkpoints nor snapshots");
}

std::string header_line(const char* name, const fs::path& path, const ImageFile& file) {
  return fmt::format("{}: {}\n   {}, step {}, {} s, {}, state hash {}\n", name, path.string(), file.kind,
                     file.image.step, file.image.time, counted(file.image.n_grains, "grain"), file.image.hash.text());
}

}  // namespace

std::string info_text(const fs::path& path) {
  if (!fs::is_directory(path)) return describe(path);
  const auto checkpoints = list_checkpoints(path);
  const auto snapshots = list_snapshots(path);
  std::string text = fmt::format("{}: {}, {}; the latest:\n\n", path.string(), counted(snapshots.size(), "snapshot"),
                                 counted(checkpoints.size(), "checkpoint"));
  return text + describe(last_image(path));
}

ComparisonText compare_files(const fs::path& a, const fs::path& b) {
  const fs::path path_a = last_image(a), path_b = last_image(b);
  const ImageFile file_a = read_image_file(path_a), file_b = read_image_file(path_b);
  const Comparison comparison = compare(file_a.image, file_b.image);
  std::string text = header_line("A", path_a, file_a) + header_line("B", path_b, file_b);
  for (const auto& [name, file] : {std::pair("A", &file_a), std::pair("B", &file_b)})
    for (const std::string& unknown : file->unknown)
      text += fmt::format("field {} of {} is not known to this program and not compared\n", unknown, name);
  return {comparison.is_equal, text + comparison_text(comparison)};
}

}  // namespace moraine
