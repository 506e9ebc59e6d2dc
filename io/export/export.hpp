// moraine export: the snapshots of a run in files for other tools.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "io/export/frames.hpp"

namespace moraine {

enum class ExportKind { vtk, csv, povray, tecplot };

struct ExportRequest {
  std::filesystem::path run;  // run directory, or one snapshot
  ExportKind kind = ExportKind::vtk;
  std::optional<int> frame;                  // none: all
  std::string field = "speed";               // POV-Ray: what the grains are coloured by
  std::optional<std::filesystem::path> out;  // directory; none: RUN/vtk, RUN/csv, RUN/povray, RUN/tecplot
};

/// Writes the files and returns what to tell the user. Throws StorageError, ExportError.
std::string export_run(const ExportRequest& request);

}  // namespace moraine
