#include "io/snapshot/snapshot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <string_view>

#include "io/checkpoint/image_file.hpp"

namespace moraine {

namespace fs = std::filesystem;

void write_snapshot(const fs::path& path, const Image& image, const World& world, bool distributed) {
  write_image(path, image, nullptr, world, distributed);
}

Image read_snapshot(const fs::path& path, std::vector<std::string>* unknown) {
  const Hdf5Reader file(path, {"snapshot"}, false);
  std::vector<std::string> left_out;
  return read_grains(file, {}, unknown != nullptr ? unknown : &left_out);
}

ImageFile read_image_file(const fs::path& path) {
  const Hdf5Reader file(path, {"checkpoint", "snapshot"}, false);
  ImageFile found;
  found.kind = file.kind();
  found.n_rank_files = file.rank_files().size();
  found.image = read_grains(file, {}, &found.unknown);
  if (found.kind == "checkpoint") {
    read_history(file, found.image);
    found.record = read_record(file);
  }
  return found;
}

std::vector<std::uint64_t> grains_of_rank_files(const fs::path& path) {
  const ColumnForm gids{"particles/gid", FieldType::gid, 1, {}};
  std::vector<std::uint64_t> counts;
  const Hdf5Reader front(path, {"checkpoint", "snapshot"}, false);
  for (const std::string& name : front.rank_files())
    counts.push_back(Hdf5Reader(path.parent_path() / name, {rank_file_kind}, false).n_rows(gids));
  return counts;
}

std::string snapshot_name(std::uint64_t step) { return fmt::format("snapshot_{:012}.h5", step); }

std::optional<std::uint64_t> snapshot_step(const fs::path& path) {
  constexpr std::string_view prefix = "snapshot_", suffix = ".h5";
  const std::string name = path.filename().string();
  if (!name.starts_with(prefix) || !name.ends_with(suffix) || name.size() <= prefix.size() + suffix.size())
    return std::nullopt;
  const char* last = name.data() + name.size() - suffix.size();
  std::uint64_t step = 0;
  const auto [end, error] = std::from_chars(name.data() + prefix.size(), last, step);
  return error == std::errc() && end == last ? std::optional(step) : std::nullopt;
}

fs::path snapshot_directory(const fs::path& run_directory) { return run_directory / "snapshots"; }

std::vector<fs::path> list_snapshots(const fs::path& run_directory) {
  std::vector<fs::path> found;
  std::error_code error;
  for (fs::directory_iterator entry(snapshot_directory(run_directory), error), end; !error && entry != end;
       entry.increment(error))
    if (snapshot_step(entry->path())) found.push_back(entry->path());
  std::sort(found.begin(), found.end(),
            [](const fs::path& a, const fs::path& b) { return snapshot_step(a) < snapshot_step(b); });
  return found;
}

}  // namespace moraine
