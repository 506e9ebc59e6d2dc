// Commands on the files of finished or running runs.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace moraine {

/// moraine info: describes a checkpoint, a snapshot, or what a run directory holds. Throws StorageError.
std::string info_text(const std::filesystem::path& path);

struct ComparisonText {
  bool is_equal = false;
  std::string text;
};
/// moraine compare: two files, or the latest checkpoints (else snapshots) of two run directories. Throws StorageError.
ComparisonText compare_files(const std::filesystem::path& a, const std::filesystem::path& b);

}  // namespace moraine
