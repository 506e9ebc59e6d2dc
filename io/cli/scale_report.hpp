// The results of a scaling sweep as table, CSV, JSON and plot.
#pragma once

#include <filesystem>
#include <string>

#include "io/cli/scale_results.hpp"

namespace moraine {

/// For the terminal: times, efficiency and messages of each layout, share of each phase, where the threads were, the
/// best.
std::string scale_table(const ScaleResults& results);
std::string scale_csv(const ScaleResults& results);
std::string scale_json(const ScaleResults& results);
/// A script for gnuplot, data included, that writes scale.svg and scale.png: speed-up, efficiency, shares of phases.
std::string scale_gnuplot(const ScaleResults& results);

/// Writes scale.csv, scale.json and scale.gnuplot, and by gnuplot scale.svg and scale.png. Says what was written; also
/// where there is no gnuplot, and which package it takes. Throws StorageError.
std::string write_scale_report(const ScaleResults& results, const std::filesystem::path& directory);

}  // namespace moraine
