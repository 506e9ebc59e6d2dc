// The snapshots of a run as one time series that ParaView opens: RUN/snapshots.xdmf beside the folder RUN/snapshots.
#pragma once

#include <cstdint>
#include <filesystem>

#include "comm/world.hpp"
#include "engine/run/image.hpp"
#include "io/snapshot/xdmf.hpp"

namespace moraine {

class SnapshotSeries {
 public:
  /// Takes up what the run directory holds: the entries of its snapshots.xdmf whose files are there, and snapshots that it misses
  /// (a crash may come between the two). Throws StorageError.
  explicit SnapshotSeries(const std::filesystem::path& run_directory);

  /// Writes the snapshot, as write_snapshot() does, and then at the root the series file, each whole or not at all. All
  /// ranks call it; throws StorageError, the same on all.
  void add(const Image& image, const World& world = {}, bool distributed = false);

  /// Removes the snapshots from that step on, with the files of their ranks, and their entries: what a run that goes on
  /// from there will write anew. Returns how many. Throws StorageError.
  int drop_from(std::uint64_t step);

  std::size_t size() const { return entries_.size(); }
  bool contains(std::uint64_t step) const { return entries_.count(step) != 0; }
  std::filesystem::path file() const { return run_directory_ / "snapshots.xdmf"; }

 private:
  void write() const;

  std::filesystem::path run_directory_;
  xdmf::Entries entries_;
};

}  // namespace moraine
