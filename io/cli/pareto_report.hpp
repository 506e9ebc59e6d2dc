// The results of a sweep of speed against error as table, CSV, JSON and plot.
#pragma once

#include <filesystem>
#include <string>

#include "io/cli/pareto_results.hpp"

namespace moraine {

/// For the terminal: each setting with its cost and its error, the front marked, and the setting to recommend.
std::string pareto_table(const ParetoResults& results);
std::string pareto_csv(const ParetoResults& results);
std::string pareto_json(const ParetoResults& results);
/// A script for gnuplot, data included, that writes pareto.svg and pareto.png: error over time to the end, the front a line.
std::string pareto_gnuplot(const ParetoResults& results);

/// Writes pareto.csv, pareto.json and pareto.gnuplot, and by gnuplot pareto.svg and pareto.png. Says what was written.
/// Throws StorageError.
std::string write_pareto_report(const ParetoResults& results, const std::filesystem::path& directory);

}  // namespace moraine
