// moraine render: pictures of snapshots, made by POV-Ray.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "io/export/frames.hpp"
#include "io/export/povray.hpp"

namespace moraine {

struct RenderRequest {
  std::filesystem::path run;      // run directory, or one snapshot
  std::string frame = "-1";       // number, from the last if negative; or "all"
  std::string size = "1280x960";  // WIDTHxHEIGHT [pixels]
  PictureStyle style;
  std::optional<std::filesystem::path> out;  // the file (with "all": the directory); none: RUN/pictures/STEP.png
};

/// Makes the pictures and returns what to tell the user. Throws StorageError; ExportError where POV-Ray is missing or fails, a
/// frame or field does not exist, or the size cannot be read.
std::string render_run(const RenderRequest& request);

}  // namespace moraine
