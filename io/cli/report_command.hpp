// moraine report: a sweep or a run as one page that holds all of it, for a browser or a paper's supplement.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace moraine {

struct ReportRequest {
  std::filesystem::path directory;           // of a run, a scaling sweep, or a sweep of speed against error
  std::optional<std::filesystem::path> out;  // none: report.html in it
};

/// Writes the page and says where. Plots are drawn by gnuplot; without it the page has its tables, and says so. Throws UsageError
/// where the directory holds none of the three, StorageError where what it holds cannot be read.
std::string write_report(const ReportRequest& request);

}  // namespace moraine
