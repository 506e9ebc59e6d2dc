#include "io/export/export.hpp"

#include <fmt/format.h>

#include "io/checkpoint/durable_file.hpp"
#include "io/export/csv.hpp"
#include "io/export/povray.hpp"
#include "io/export/vtk.hpp"
#include "io/snapshot/snapshot.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

const char* kind_name(ExportKind kind) {
  return kind == ExportKind::vtk ? "vtk" : kind == ExportKind::csv ? "csv" : "povray";
}

std::string times_table(const std::vector<std::pair<double, std::string>>& frames) {
  std::string text = "time [s],file\n";
  for (const auto& [time, file] : frames) text += fmt::format("{},{}\n", time, file);
  return text;
}

}  // namespace

std::string export_run(const ExportRequest& request) {
  Frames frames = find_frames(request.run);
  if (request.frame) frames.files = {frames.at(*request.frame)};
  const fs::path out = request.out ? *request.out : frames.directory / kind_name(request.kind);
  std::string why_no_scene;
  const std::optional<Scene> scene = request.kind == ExportKind::povray ? scene_of(frames, why_no_scene) : std::nullopt;
  PictureStyle style;
  style.field = request.field;
  make_directory(out);

  std::vector<std::pair<double, std::string>> written, gas;
  for (const fs::path& file : frames.files) {
    const Image image = read_image_file(file).image;
    const std::string stem = "grains_" + frame_label(file);
    switch (request.kind) {
      case ExportKind::vtk: written.emplace_back(image.time, stem + ".vtp"); break;
      case ExportKind::csv: written.emplace_back(image.time, stem + ".csv"); break;
      case ExportKind::povray: written.emplace_back(image.time, stem + ".pov"); break;
    }
    write_file(out / written.back().second, request.kind == ExportKind::vtk ? vtp_text(image)
                                            : request.kind == ExportKind::csv
                                                ? csv_text(image)
                                                : povray_text(image, scene ? &*scene : nullptr, style));
    if (request.kind != ExportKind::vtk || image.grids.empty()) continue;
    gas.emplace_back(image.time, "gas_" + frame_label(file) + ".vti");
    write_file(out / gas.back().second, vti_text(image));
  }
  std::string text = fmt::format("{} {} in {}", written.size(), written.size() == 1 ? "file" : "files", out.string());
  if (request.kind == ExportKind::vtk) {
    write_file(out / "grains.pvd", pvd_text(written));
    text += fmt::format("; ParaView opens {}", (out / "grains.pvd").string());
    if (!gas.empty()) {
      write_file(out / "gas.pvd", pvd_text(gas));
      text += fmt::format(" and {}", (out / "gas.pvd").string());
    }
  }
  if (request.kind == ExportKind::csv) write_file(out / "times.csv", times_table(written));
  if (request.kind == ExportKind::povray) {
    text += "; for a picture: povray +W1280 +H960 +A " + (out / written.back().second).string();
    if (!scene) text += "\nwithout walls: " + why_no_scene;
  }
  return text;
}

}  // namespace moraine
