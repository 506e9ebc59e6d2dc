#include "io/export/export.hpp"

#include <fmt/format.h>

#include "io/checkpoint/durable_file.hpp"
#include "io/export/csv.hpp"
#include "io/export/povray.hpp"
#include "io/export/tecplot.hpp"
#include "io/export/vtk.hpp"
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

/// One snapshot as a file of that kind: grains, and gas where the kind has a file for it.
struct FrameText {
  std::string grains, gas, gas_ending;
};
FrameText text_of(const Image& image, ExportKind kind, const Scene* scene, const PictureStyle& style) {
  switch (kind) {
    case ExportKind::vtk: return {vtp_text(image), vti_text(image), ".vti"};
    case ExportKind::csv: return {csv_text(image), {}, {}};
    case ExportKind::povray: return {povray_text(image, scene, style), {}, {}};
    case ExportKind::tecplot: return {tecplot_grains(image), tecplot_gas(image), ".dat"};
  }
  return {};
}

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

  std::vector<std::pair<double, std::string>> written, gas;
  for (const fs::path& file : frames.files) {
    const Image image = read_image_file(file).image;
    const FrameText text = text_of(image, request.kind, scene ? &*scene : nullptr, style);
    written.emplace_back(image.time, "grains_" + frame_label(file) + words_of(request.kind).ending);
    write_file(out / written.back().second, text.grains);
    if (text.gas.empty()) continue;
    gas.emplace_back(image.time, "gas_" + frame_label(file) + text.gas_ending);
    write_file(out / gas.back().second, text.gas);
  }
  std::string text = fmt::format("{} {} in {}", written.size() + gas.size(),
                                 written.size() + gas.size() == 1 ? "file" : "files", out.string());
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
