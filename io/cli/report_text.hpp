// What tables and plots of sweeps have in common.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace moraine {

/// Right-aligned columns as wide as their widest entry, two spaces apart; the first is left-aligned. All rows have as
/// many entries as the first.
std::string aligned_table(const std::vector<std::vector<std::string>>& rows);
/// One line of a CSV file; values with commas or quotes in quotes.
std::string csv_line(const std::vector<std::string>& values);
/// "12.3 %"
std::string percent_text(double share);
/// A text as gnuplot reads it back, on one line.
std::string quoted_gnuplot(const std::string& text);

/// Runs `NAME.gnuplot` in `directory`, which writes NAME.svg and NAME.png. Says what was written, or why not: also where
/// there is no gnuplot, and which package it takes.
std::string draw_plot(const std::filesystem::path& directory, const std::string& name);

}  // namespace moraine
