// The coarse-grained fields of a probe as one time series that ParaView opens: RUN/NAME.xdmf beside the folder RUN/fields.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "comm/world.hpp"
#include "engine/run/image.hpp"
#include "io/snapshot/xdmf.hpp"

namespace moraine {

class FieldSeries {
 public:
  /// Takes up what the run directory holds, as SnapshotSeries does. Throws StorageError.
  FieldSeries(const std::filesystem::path& run_directory, const std::string& name);

  /// Writes RUN/fields/NAME_STEP.h5, and with a table NAME_STEP.csv, one row a cell; then at the root the series file. Each whole or not at
  /// all. All ranks call it; throws StorageError, the same on all.
  void add(const FieldImage& fields, const World& world, bool has_table);

  /// Removes the files from that step on, and their entries. Throws StorageError.
  void drop_from(std::uint64_t step);

  bool contains(std::uint64_t step) const { return entries_.count(step) != 0; }
  std::filesystem::path file() const { return run_directory_ / (name_ + ".xdmf"); }

 private:
  void write() const;

  std::filesystem::path run_directory_;
  std::string name_;
  xdmf::Entries entries_;
};

/// The files of fields of a run directory, of all probes, in order of name and step. Nothing is opened.
std::vector<std::filesystem::path> list_field_files(const std::filesystem::path& run_directory);

/// Centres of cells [m] and what is there, one row a cell.
std::string csv_of_fields(const FieldImage& fields);

}  // namespace moraine
