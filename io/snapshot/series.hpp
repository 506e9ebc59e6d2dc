// The snapshots of a run as one time series that ParaView opens: RUN/snapshots.xdmf beside the folder RUN/snapshots.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>

#include "engine/run/image.hpp"

namespace moraine {

class SnapshotSeries {
 public:
  /// Takes up what the run directory holds: the entries of its snapshots.xdmf whose files are there, and snapshots that it misses
  /// (a crash may come between the two). Throws StorageError.
  explicit SnapshotSeries(const std::filesystem::path& run_directory);

  /// Writes the snapshot and then the series file, each whole or not at all. Throws StorageError.
  void add(const Image& image);

  /// Removes the snapshots from that step on, and their entries: what a run that goes on from there will write anew.
  /// Returns how many. Throws StorageError.
  int drop_from(std::uint64_t step);

  std::size_t size() const { return entries_.size(); }
  bool contains(std::uint64_t step) const { return entries_.count(step) != 0; }
  std::filesystem::path file() const { return run_directory_ / "snapshots.xdmf"; }

 private:
  void write() const;

  std::filesystem::path run_directory_;
  std::map<std::uint64_t, std::string> entries_;  // by step: the XDMF grid of one snapshot
};

}  // namespace moraine
