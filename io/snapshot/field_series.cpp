#include "io/snapshot/field_series.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <iterator>
#include <optional>

#include "io/checkpoint/agreement.hpp"
#include "io/checkpoint/durable_file.hpp"
#include "io/checkpoint/image_file.hpp"
#include "io/checkpoint/subdirectory.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

fs::path field_directory(const fs::path& run_directory) { return run_directory / "fields"; }

std::string file_name(const std::string& name, std::uint64_t step) { return fmt::format("{}_{:012}.h5", name, step); }

/// The step of a file of that probe, where it is one.
std::optional<std::uint64_t> step_of(const fs::path& path, const std::string& name) {
  const std::string stem = path.stem().string();
  if (path.extension() != ".h5" || !stem.starts_with(name + "_")) return std::nullopt;
  const char* const last = stem.data() + stem.size();
  std::uint64_t step = 0;
  const auto [end, error] = std::from_chars(stem.data() + name.size() + 1, last, step);
  return error == std::errc() && end == last ? std::optional(step) : std::nullopt;
}

std::string entry_of(const FieldImage& fields) {
  std::string text = xdmf::cells(fields.n, fields.box);
  for (const GridArray& array : fields.arrays)
    text += xdmf::on_cells(array.name, fields.n, "fields/" + file_name(fields.name, fields.step), field_dataset(array));
  return xdmf::entry(fields.step, fields.time, text);
}

/// All values at the root, nothing elsewhere. All ranks call it.
FieldImage at_root(const FieldImage& fields, const World& world) {
  FieldImage all = fields;
  for (GridArray& array : all.arrays) {
    if (world.is_alone()) break;
    const std::string own(reinterpret_cast<const char*>(array.values.data()), array.values.size() * sizeof(double));
    std::string bytes;
    for (const std::string& of_rank : world.gather_at_root(own)) bytes += of_rank;
    array.values.resize(bytes.size() / sizeof(double));
    if (!bytes.empty()) std::memcpy(array.values.data(), bytes.data(), bytes.size());
  }
  return all;
}

}  // namespace

std::string csv_of_fields(const FieldImage& fields) {
  std::string text = "x [m],y [m],z [m]";
  for (const GridArray& array : fields.arrays)
    text += ',' + array.name + (array.unit.empty() ? "" : " [" + array.unit + "]");
  text += '\n';
  const Vec3 size = fields.box.size();
  const Vec3 spacing = {size.x / fields.n[0], size.y / fields.n[1], size.z / fields.n[2]};
  auto out = std::back_inserter(text);
  std::size_t cell = 0;
  for (int k = 0; k < fields.n[2]; ++k)
    for (int j = 0; j < fields.n[1]; ++j)
      for (int i = 0; i < fields.n[0]; ++i, ++cell) {
        fmt::format_to(out, "{},{},{}", fields.box.low.x + (i + 0.5) * spacing.x,
                       fields.box.low.y + (j + 0.5) * spacing.y, fields.box.low.z + (k + 0.5) * spacing.z);
        for (const GridArray& array : fields.arrays) fmt::format_to(out, ",{}", array.values[cell]);
        text += '\n';
      }
  return text;
}

FieldSeries::FieldSeries(const fs::path& run_directory, const std::string& name)
    : run_directory_(run_directory), name_(name) {
  xdmf::Entries listed;
  if (fs::exists(file())) listed = xdmf::parse(read_file(file()));
  for (const fs::path& path : list_field_files(run_directory_)) {
    const auto step = step_of(path, name_);
    if (!step) continue;
    const auto known = listed.find(*step);
    entries_[*step] = known != listed.end() ? known->second : entry_of(read_field_image(path));
  }
}

void FieldSeries::write() const { write_file(file(), xdmf::series(name_, entries_)); }

void FieldSeries::add(const FieldImage& fields, const World& world, bool has_table) {
  const fs::path directory = field_directory(run_directory_);
  agree_on_root(world, directory, [&] { make_subdirectory(directory); });
  const fs::path path = directory / file_name(name_, fields.step);
  write_field_image(path, fields, world);
  if (has_table) {
    const FieldImage all = at_root(fields, world);
    fs::path table = path;
    table.replace_extension(".csv");
    agree_on_root(world, table, [&] { write_file(table, csv_of_fields(all)); });
  }
  entries_[fields.step] = entry_of(fields);
  agree_on_root(world, file(), [&] { write(); });
}

void FieldSeries::drop_from(std::uint64_t step) {
  // The series first, so that it never lists a file that is gone.
  if (std::erase_if(entries_, [&](const auto& entry) { return entry.first >= step; }) > 0) write();
  for (const fs::path& path : list_field_files(run_directory_)) {
    const auto found = step_of(path, name_);
    if (!found || *found < step) continue;
    fs::path table = path;
    table.replace_extension(".csv");
    for (const fs::path& old : {path, table}) {
      std::error_code error;
      fs::remove(old, error);
      if (error) throw StorageError(old, "cannot be removed: " + explain_errno(error.value()));
    }
  }
}

std::vector<fs::path> list_field_files(const fs::path& run_directory) {
  std::vector<fs::path> found;
  std::error_code error;
  for (fs::directory_iterator entry(field_directory(run_directory), error), end; !error && entry != end;
       entry.increment(error))
    if (entry->path().extension() == ".h5") found.push_back(entry->path());
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace moraine
