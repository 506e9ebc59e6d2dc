// The time series of a run directory, read back.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace moraine {

/// One column of a table: "velocity z at x 0.05 m [m/s]" has the quantity "velocity z", the place 0.05 along x, and the unit "m/s".
struct TableColumn {
  std::string name;      // as in the file, without unit
  std::string quantity;  // without place
  std::string unit;
  std::string axis;             // "x", "y", "z" where it belongs to a place, else empty
  std::optional<double> place;  // [m]
  std::vector<double> values;   // one a row; not a number where the file has none
};

struct RunTable {
  std::string name;          // of the probe
  std::vector<double> time;  // [s] of each row
  std::vector<TableColumn> columns;
};

/// The tables of a run directory (NAME.csv with a column "time [s]" and numbers), in order of name, but what is about the
/// machine (balance) last; of tables with a row a rank, mean and largest of the ranks. Columns that are not numbers are left out, and tables of nothing else. Throws StorageError.
std::vector<RunTable> read_run_tables(const std::filesystem::path& directory);

/// Columns that belong in one picture: of one unit, and either all of one quantity at several places or none with a place.
struct ColumnGroup {
  std::string quantity;  // of those with places, else empty
  std::string unit;
  std::vector<std::size_t> columns;  // of the table
  bool is_profile() const { return !quantity.empty(); }
};
std::vector<ColumnGroup> column_groups(const RunTable& table);

}  // namespace moraine
