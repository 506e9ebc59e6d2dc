#include "io/export/export.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "io/checkpoint/durable_file.hpp"
#include "io/checkpoint/image_file.hpp"
#include "io/export/csv.hpp"
#include "io/export/povray.hpp"
#include "io/export/tecplot.hpp"
#include "io/export/vtk.hpp"
#include "io/snapshot/field_series.hpp"
#include "io/snapshot/snapshot.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

struct KindWords {
  const char* folder;
  const char* ending;
};
KindWords words_of(ExportKind kind) {
  switch (kind) {
    case ExportKind::vtk: return {"vtk", ".vtp"};
    case ExportKind::csv: return {"csv", ".csv"};
    case ExportKind::povray: return {"povray", ".pov"};
    case ExportKind::tecplot: return {"tecplot", ".dat"};
  }
  return {};
}

std::string times_table(const std::vector<std::pair<double, std::string>>& frames) {
  std::string text = "time [s],file\n";
  for (const auto& [time, file] : frames) text += fmt::format("{},{}\n", time, file);
  return text;
}

/// The grains of a snapshot as one .vtp file, or, where each rank has written its own, as a piece for each of them. Returns the
/// name of the file to open, and counts those written.
std::string write_vtk_grains(const fs::path& snapshot, const Image& image, const fs::path& out, std::size_t& n_files) {
  const std::string stem = "grains_" + frame_label(snapshot);
  const std::vector<std::uint64_t> counts = grains_of_rank_files(snapshot);
  if (counts.empty()) {
    write_file(out / (stem + ".vtp"), vtp_text(image));
    ++n_files;
    return stem + ".vtp";
  }
  std::vector<std::string> pieces;
  GrainRows rows;
  for (const std::uint64_t count : counts) {
    rows = {rows.end, rows.end + count};
    pieces.push_back(fmt::format("{}_{}.vtp", stem, pieces.size()));
    write_file(out / pieces.back(), vtp_text(image, rows));
  }
  if (rows.end != image.n_grains) throw StorageError(snapshot, "does not hold the grains of the files that it names");
  write_file(out / (stem + ".pvtp"), pvtp_text(image, pieces));
  n_files += pieces.size() + 1;
  return stem + ".pvtp";
}

/// One snapshot as a file of that kind: grains, and gas where the kind has a file for it.
struct FrameText {
  std::string grains, gas, gas_ending;
};
FrameText text_of(const Image& image, ExportKind kind, const Scene* scene, const PictureStyle& style) {
  switch (kind) {
    case ExportKind::vtk: return {{}, vti_text(image), ".vti"};  // grains: write_vtk_grains()
    case ExportKind::csv: return {csv_text(image), {}, {}};
    case ExportKind::povray: return {povray_text(image, scene, style), {}, {}};
    case ExportKind::tecplot: return {tecplot_grains(image), tecplot_gas(image), ".dat"};
  }
  return {};
}

using FramesInTime = std::vector<std::pair<double, std::string>>;

/// A name as a part of the name of a file.
std::string in_file_name(std::string name) {
  std::replace_if(
      name.begin(), name.end(), [](char c) { return c == '/' || c == '\\' || c == '\n'; }, '_');
  return name;
}

/// Files of one kind of things, and the .pvd that strings them together.
class VtkSeries {
 public:
  explicit VtkSeries(fs::path out) : out_(std::move(out)) {}
  void add(const std::string& name, const std::string& label, const char* ending, double time,
           const std::string& text) {
    FramesInTime& frames = all_[name];
    frames.emplace_back(time, name + "_" + label + ending);
    write_file(out_ / frames.back().second, text);
    ++n_files_;
  }
  /// Returns what there is to open besides the grains.
  std::string finish() const {
    std::string text;
    for (const auto& [name, frames] : all_) {
      write_file(out_ / (name + ".pvd"), pvd_text(frames));
      text += fmt::format(" and {}", (out_ / (name + ".pvd")).string());
    }
    return text;
  }
  std::size_t n_files() const { return n_files_; }

 private:
  fs::path out_;
  std::map<std::string, FramesInTime> all_;
  std::size_t n_files_ = 0;
};

}  // namespace

std::string export_run(const ExportRequest& request) {
  Frames frames = find_frames(request.run);
  if (request.frame) frames.files = {frames.at(*request.frame)};
  const fs::path out = request.out ? *request.out : frames.directory / words_of(request.kind).folder;
  std::string why_no_scene;
  const std::optional<Scene> scene = request.kind == ExportKind::povray ? scene_of(frames, why_no_scene) : std::nullopt;
  PictureStyle style;
  style.field = request.field;
  make_directory(out);

  std::size_t n_files = 0;
  FramesInTime written, gas;
  VtkSeries more(out);
  for (const fs::path& file : frames.files) {
    const Image image = read_image_file(file).image;
    const FrameText text = text_of(image, request.kind, scene ? &*scene : nullptr, style);
    if (request.kind == ExportKind::vtk) {
      written.emplace_back(image.time, write_vtk_grains(file, image, out, n_files));
    } else {
      written.emplace_back(image.time, "grains_" + frame_label(file) + words_of(request.kind).ending);
      write_file(out / written.back().second, text.grains);
      ++n_files;
    }
    if (request.kind == ExportKind::vtk)
      for (const WallMap& map : image.maps)
        more.add("wall_" + in_file_name(map.name), frame_label(file), ".vtp", image.time, vtp_text(map, image.time));
    if (text.gas.empty()) continue;
    gas.emplace_back(image.time, "gas_" + frame_label(file) + text.gas_ending);
    write_file(out / gas.back().second, text.gas);
  }
  if (request.kind == ExportKind::vtk && frames.is_run && !request.frame)
    for (const fs::path& file : list_field_files(frames.directory)) {
      const FieldImage fields = read_field_image(file);
      more.add("fields_" + in_file_name(fields.name), frame_label(file), ".vti", fields.time, vti_text(fields));
    }
  n_files += gas.size() + more.n_files();
  std::string text = fmt::format("{} {} in {}", n_files, n_files == 1 ? "file" : "files", out.string());
  if (request.kind == ExportKind::vtk) {
    write_file(out / "grains.pvd", pvd_text(written));
    text += fmt::format("; ParaView opens {}", (out / "grains.pvd").string());
    if (!gas.empty()) {
      write_file(out / "gas.pvd", pvd_text(gas));
      text += fmt::format(" and {}", (out / "gas.pvd").string());
    }
    text += more.finish();
  }
  if (request.kind == ExportKind::csv) write_file(out / "times.csv", times_table(written));
  if (request.kind == ExportKind::povray) {
    text += "; for a picture: povray +W1280 +H960 +A " + (out / written.back().second).string();
    if (!scene) text += "\nwithout walls: " + why_no_scene;
  }
  return text;
}

}  // namespace moraine
