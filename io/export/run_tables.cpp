#include "io/export/run_tables.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "io/checkpoint/durable_file.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells(1);
  for (const char c : line)
    if (c == ',')
      cells.emplace_back();
    else if (c != '\r')
      cells.back() += c;
  return cells;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    if (end > at) lines.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return lines;
}

std::optional<double> number_of(const std::string& cell) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (error != std::errc() || end != cell.data() + cell.size()) return std::nullopt;
  return value;
}

/// "QUANTITY at AXIS PLACE m [UNIT]", "QUANTITY [UNIT]" or "QUANTITY".
TableColumn column_of(const std::string& header) {
  TableColumn column;
  const std::size_t bracket = header.rfind(" [");
  const bool has_unit = bracket != std::string::npos && header.back() == ']';
  column.name = has_unit ? header.substr(0, bracket) : header;
  if (has_unit) column.unit = header.substr(bracket + 2, header.size() - bracket - 3);
  if (!has_unit && (column.name.find(" / ") != std::string::npos || column.name == "work over mean"))
    column.unit = "-";  // a ratio, beside counts
  column.quantity = column.name;
  const std::size_t at = column.name.rfind(" at ");
  if (at == std::string::npos || column.name.size() < at + 8 || !column.name.ends_with(" m")) return column;
  const char axis = column.name[at + 4];
  const auto place = number_of(column.name.substr(at + 6, column.name.size() - at - 8));
  if (axis < 'x' || axis > 'z' || column.name[at + 5] != ' ' || !place) return column;
  column.quantity = column.name.substr(0, at);
  column.axis = std::string(1, axis);
  column.place = place;
  return column;
}

/// Of a table with a row for each rank at a time, one with a row a time: mean and largest of the ranks. Which rank a row is of, and
/// its node, are no quantities.
RunTable over_ranks(const RunTable& table) {
  RunTable merged;
  merged.name = table.name;
  std::vector<std::size_t> starts;  // rows at which another time begins
  for (std::size_t row = 0; row < table.time.size(); ++row)
    if (row == 0 || table.time[row] != table.time[row - 1]) starts.push_back(row);
  for (const std::size_t row : starts) merged.time.push_back(table.time[row]);
  const bool has_several = starts.size() < table.time.size();
  starts.push_back(table.time.size());
  for (const TableColumn& column : table.columns) {
    if (column.name == "rank" || column.name == "node") continue;
    TableColumn mean = column, largest = column;
    mean.values.clear(), largest.values.clear();
    for (std::size_t k = 0; k + 1 < starts.size(); ++k) {
      const auto begin = column.values.begin() + static_cast<std::ptrdiff_t>(starts[k]);
      const auto end = column.values.begin() + static_cast<std::ptrdiff_t>(starts[k + 1]);
      mean.values.push_back(std::accumulate(begin, end, 0.0) / static_cast<double>(end - begin));
      largest.values.push_back(*std::max_element(begin, end));
    }
    if (has_several) mean.name += ", mean", largest.name += ", largest";
    merged.columns.push_back(std::move(mean));
    if (has_several) merged.columns.push_back(std::move(largest));
  }
  return merged;
}

RunTable read_table(const fs::path& file) {
  RunTable table;
  table.name = file.stem().string();
  const std::vector<std::string> lines = lines_of(read_file(file));
  if (lines.empty()) return table;
  const std::vector<std::string> header = cells_of(lines[0]);
  const auto time = std::find(header.begin(), header.end(), "time [s]");
  if (time == header.end()) return table;
  const auto time_at = static_cast<std::size_t>(time - header.begin());
  std::vector<std::size_t> places;
  for (std::size_t k = 0; k < header.size(); ++k) {
    if (k == time_at || header[k] == "step") continue;
    places.push_back(k);
    table.columns.push_back(column_of(header[k]));
  }
  for (std::size_t row = 1; row < lines.size(); ++row) {
    const std::vector<std::string> cells = cells_of(lines[row]);
    if (cells.size() != header.size()) continue;  // the last one of a run that is being written
    table.time.push_back(number_of(cells[time_at]).value_or(std::numeric_limits<double>::quiet_NaN()));
    for (std::size_t k = 0; k < places.size(); ++k)
      table.columns[k].values.push_back(number_of(cells[places[k]]).value_or(std::numeric_limits<double>::quiet_NaN()));
  }
  std::erase_if(table.columns, [](const TableColumn& column) {
    return std::none_of(column.values.begin(), column.values.end(), [](double v) { return std::isfinite(v); });
  });
  const bool has_ranks = std::any_of(table.columns.begin(), table.columns.end(),
                                     [](const TableColumn& column) { return column.name == "rank"; });
  return has_ranks ? over_ranks(table) : table;
}

}  // namespace

std::vector<RunTable> read_run_tables(const fs::path& directory) {
  std::vector<fs::path> files;
  if (fs::is_directory(directory))
    for (const fs::directory_entry& entry : fs::directory_iterator(directory))
      if (entry.is_regular_file() && entry.path().extension() == ".csv") files.push_back(entry.path());
  const auto order = [](const fs::path& file) { return std::pair(file.stem() == "balance", file); };
  std::sort(files.begin(), files.end(), [&](const fs::path& a, const fs::path& b) { return order(a) < order(b); });
  std::vector<RunTable> tables;
  for (const fs::path& file : files) {
    RunTable table = read_table(file);
    if (!table.columns.empty() && !table.time.empty()) tables.push_back(std::move(table));
  }
  return tables;
}

std::vector<ColumnGroup> column_groups(const RunTable& table) {
  std::vector<ColumnGroup> groups;
  for (std::size_t k = 0; k < table.columns.size(); ++k) {
    const TableColumn& column = table.columns[k];
    const std::string quantity = column.place ? column.quantity : std::string();
    auto group = std::find_if(groups.begin(), groups.end(),
                              [&](const ColumnGroup& g) { return g.quantity == quantity && g.unit == column.unit; });
    if (group == groups.end()) group = groups.insert(groups.end(), {quantity, column.unit, {}});
    group->columns.push_back(k);
  }
  return groups;
}

}  // namespace moraine
