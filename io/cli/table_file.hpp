// A time series in a CSV file: a header, then one row a line.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/checkpoint/durable_file.hpp"

namespace moraine {

class TableFile {
 public:
  /// Columns are "step" and then `columns`. With `keep_before`, rows of an existing file before that step stay and the others
  /// are cut off, so that a run that goes on from there leaves the file of an unbroken one; without it the file starts anew.
  /// Throws StorageError, also where the existing file has other columns.
  TableFile(const std::filesystem::path& path, const std::vector<std::string>& columns,
            std::optional<std::uint64_t> keep_before);

  /// Appends a row and hands it to the system at once. Throws StorageError.
  void add(std::uint64_t step, const std::vector<double>& values);
  void add_text(std::uint64_t step, const std::vector<std::string>& cells);

  /// Makes all rows durable. Throws StorageError.
  void sync();

 private:
  void append(const std::string& line);

  std::unique_ptr<FileHandle> file_;
  std::uint64_t end_ = 0;  // [bytes]
};

/// The text that reads back to the same double, as short as possible.
std::string number_text(double value);

/// Removes what cannot stand in a CSV cell without quotes.
std::string csv_cell(const std::string& text);

}  // namespace moraine
