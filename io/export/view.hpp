// moraine view: a run in one HTML page that plays in a browser, from a file, without a server or anything from elsewhere.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/export/frames.hpp"

namespace moraine {

struct ViewRequest {
  std::filesystem::path run;                 // run directory, or one snapshot
  std::string field = "speed";               // what the grains are coloured by; see grain_values()
  std::vector<double> range;                 // least and greatest value of the colours; empty: those of most grains
  std::uint64_t most_grains = 30000;         // in a frame: of more, an even share is shown
  std::uint64_t most_frames = 200;           // of more, an even share, with the first and the last
  std::optional<std::filesystem::path> out;  // the page; none: RUN/view.html
};

/// Writes the page and returns what to tell the user. Throws StorageError, ExportError.
std::string view_run(const ViewRequest& request);

}  // namespace moraine
