// moraine render: pictures of snapshots, made by POV-Ray, and movies of them, by ffmpeg.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "io/export/frames.hpp"
#include "io/export/povray.hpp"

namespace moraine {

struct RenderRequest {
  std::filesystem::path run;         // run directory, or one snapshot
  std::optional<std::string> frame;  // number, from the last if negative (none: -1); or "all" (with a movie always)
  std::string size = "1280x960";     // WIDTHxHEIGHT [pixels]
  PictureStyle style;
  std::optional<std::filesystem::path> out;    // the file (with "all": the directory); none: RUN/pictures/STEP.png
  std::optional<std::filesystem::path> movie;  // .mp4, .webm or .gif: all frames as this file, and no pictures
  double rate = 10.0;                          // [1/s] frames of the movie
  int preview = 0;  // > 0: the picture as text of so many columns for a terminal, and no file
  std::function<void(const std::string&)> progress = [](const std::string&) {};
};

/// Makes the pictures and returns what to tell the user. Throws StorageError; ExportError where POV-Ray or ffmpeg is missing or fails, a
/// frame or field does not exist, or the size cannot be read.
std::string render_run(const RenderRequest& request);

}  // namespace moraine
