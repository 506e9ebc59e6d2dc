// moraine plot: the time series, profiles and phases of a run as pictures, by gnuplot.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/export/run_tables.hpp"

namespace moraine {

struct PlotRequest {
  std::filesystem::path run;                 // run directory
  std::vector<std::string> formats;          // "svg", "png"; empty: both
  std::optional<std::filesystem::path> out;  // none: RUN/plots
};

/// Share of the time of the steps that each phase took, and its name.
struct PhaseShareRow {
  std::string name;
  double percent = 0.0;
};

/// One picture: its file name without ending, and the script that draws it, data included.
struct Plot {
  std::string name;
  std::string script;
};
/// A picture for each group of columns of each table: lines over time, or a profile at several times and its mean over the second half.
std::vector<Plot> plots_of(const std::vector<RunTable>& tables);
/// The phases as bars; nothing where there are none.
std::optional<Plot> plot_of_phases(const std::vector<PhaseShareRow>& phases, const std::string& heading);

/// Writes plots.gnuplot and, by gnuplot, the pictures, and returns what to tell the user. Throws StorageError; UsageError where the
/// directory holds nothing to plot or gnuplot is missing or fails.
std::string plot_run(const PlotRequest& request);

}  // namespace moraine
