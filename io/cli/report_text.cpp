#include "io/cli/report_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "io/cli/child.hpp"
#include "io/cli/programs.hpp"

namespace moraine {

namespace fs = std::filesystem;

std::string aligned_table(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths(rows[0].size());
  for (const auto& row : rows)
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  std::string text;
  for (const auto& row : rows) {
    std::string line = fmt::format("{:<{}}", row[0], widths[0]);
    for (std::size_t i = 1; i < row.size(); ++i) line += fmt::format("  {:>{}}", row[i], widths[i]);
    text += line.substr(0, line.find_last_not_of(' ') + 1) + '\n';
  }
  return text;
}

std::string csv_line(const std::vector<std::string>& values) {
  std::string line;
  for (const std::string& value : values) {
    if (&value != &values.front()) line += ',';
    if (value.find_first_of(",\"\n") == std::string::npos) {
      line += value;
      continue;
    }
    line += '"';
    for (const char c : value) line += c == '"' ? std::string("\"\"") : std::string(1, c == '\n' ? ' ' : c);
    line += '"';
  }
  return line + '\n';
}

std::string percent_text(double share) { return fmt::format("{:.1f} %", 100.0 * share); }

std::string quoted_gnuplot(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("''") : std::string(1, c == '\n' ? ' ' : c);
  return quoted + '\'';
}

std::string draw_plot(const fs::path& directory, const std::string& name) {
  const std::optional<fs::path> gnuplot = find_program({"gnuplot"});
  if (!gnuplot) return "for the plot: apt-get install gnuplot-nox, then the same command again";
  const fs::path talk = directory / "gnuplot.txt";
  const ChildEnd end = run_child({fs::absolute(*gnuplot).string(), name + ".gnuplot"}, directory, talk);
  if (!end.is_good()) return "gnuplot failed, and says why in " + talk.string();
  std::error_code ignored;
  fs::remove(talk, ignored);
  return fmt::format("plot: {0}.svg, {0}.png", name);
}

}  // namespace moraine
