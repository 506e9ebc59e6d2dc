#include "io/cli/table_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>

namespace moraine {

namespace fs = std::filesystem;

namespace {

/// Length of the header and of the rows before that step; a row without its newline was cut off by a crash and does not count.
std::size_t kept_length(const std::string& text, std::uint64_t keep_before) {
  std::size_t kept = text.find('\n') + 1;
  for (std::size_t end; (end = text.find('\n', kept)) != std::string::npos; kept = end + 1) {
    std::uint64_t step = 0;
    const auto [after, error] = std::from_chars(text.data() + kept, text.data() + end, step);
    if (error != std::errc() || step >= keep_before) break;
  }
  return kept;
}

}  // namespace

std::string number_text(double value) { return fmt::format("{}", value); }

std::string csv_cell(const std::string& text) {
  std::string cell = text;
  std::replace_if(
      cell.begin(), cell.end(), [](char c) { return c == ',' || c == '\n' || c == '"'; }, ' ');
  return cell;
}

TableFile::TableFile(const fs::path& path, const std::vector<std::string>& columns,
                     std::optional<std::uint64_t> keep_before) {
  std::string header = "step";
  for (const std::string& column : columns) header += ',' + csv_cell(column);
  header += '\n';
  const std::string old = keep_before && fs::exists(path) ? read_file(path) : std::string();
  const bool goes_on = old.find('\n') != std::string::npos;
  if (goes_on && !old.starts_with(header))
    throw StorageError(path,
                       "has other columns than this run would write; use --out with a new directory to go on there");
  file_ = std::make_unique<FileHandle>(path, O_RDWR | O_CREAT);
  if (goes_on) {
    end_ = kept_length(old, *keep_before);
    file_->resize(end_);
  } else {
    file_->resize(0);
    append(header);
  }
}

void TableFile::append(const std::string& line) {
  file_->write(line.data(), line.size(), end_);
  end_ += line.size();
}

void TableFile::add(std::uint64_t step, const std::vector<double>& values) {
  std::string line = std::to_string(step);
  for (const double value : values) line += ',' + number_text(value);
  append(line + '\n');
}

void TableFile::add_text(std::uint64_t step, const std::vector<std::string>& cells) {
  std::string line = std::to_string(step);
  for (const std::string& cell : cells) line += ',' + csv_cell(cell);
  append(line + '\n');
}

void TableFile::sync() { file_->sync(); }

}  // namespace moraine
