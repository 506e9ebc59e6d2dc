// All that a run writes while it goes: probes, energies, snapshots, hashes, checkpoints, each when it is due.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/run/simulation.hpp"
#include "io/checkpoint/checkpoint.hpp"
#include "io/cli/log.hpp"
#include "io/cli/schedule.hpp"
#include "io/cli/table_file.hpp"
#include "io/cli/watch.hpp"
#include "io/snapshot/field_series.hpp"
#include "io/snapshot/series.hpp"

namespace moraine {

/// All ranks of the simulation make the same calls at the same steps. Tables, the series and the removal of what is old
/// are the root's.
class Outputs {
 public:
  /// Opens the files of a run directory that exists. With `restart`, what lies behind that step is
  /// dropped; without it, all of an earlier attempt. Throws StorageError.
  Outputs(const std::filesystem::path& directory, const Simulation& simulation, RunRecord record,
          std::optional<std::uint64_t> restart, Log& log);

  /// Called after every step: writes what is due at it, and warns of what the gas or the energies have come to. Checkpoints come last: a
  /// run that goes on from one finds all other outputs of that step written. Throws StorageError; RunError where grains are missing,
  /// or the record of a warning of run.stop_on is complete.
  void write_due(Simulation& simulation);

  /// Appends lines to balance.csv; only the root has any.
  void add_balance(const std::vector<BalanceRow>& rows);

  /// True where any output is due at that step.
  bool is_due(std::uint64_t step) const;

  /// Makes sure that the present step has a snapshot. Throws StorageError.
  void write_snapshot_now(Simulation& simulation);
  /// At the end of a run: averages of fields that are not over are written as they are, and go on where the run does. Throws StorageError.
  void write_open_fields(const Simulation& simulation);
  /// Makes sure that the present step has a checkpoint, and removes old ones. Throws StorageError.
  void write_checkpoint_now(const Simulation& simulation);
  /// Writes what is to be kept of a run that has ended so; where that is, in words for the end of its message. What cannot be written is left.
  std::string keep(const FlightRecord& record) const;
  /// Flight records of warnings as far as they have come, at the end of a run. What cannot be written is left. Throws RunError where a warning
  /// of run.stop_on is among them.
  void write_open_records(Simulation& simulation) { write_records(simulation, true); }

  std::optional<std::filesystem::path> last_checkpoint() const { return last_checkpoint_; }
  /// At the root.
  std::size_t n_snapshots() const { return series_->size(); }
  /// Wall-clock time spent on writing [s].
  double seconds() const { return seconds_; }

 private:
  struct ProbeTable {
    std::size_t probe;
    Schedule schedule;
    bool has_time;                   // the probe's own first column is the time
    std::optional<TableFile> table;  // of the root
  };

  /// Files of a probe of kind fields.
  struct FieldOutput {
    std::size_t probe;
    std::optional<Schedule> averages;  // when one is over; nothing: with each sample
    bool has_table;
    FieldSeries series;
  };

  void open_fields(const Simulation& simulation, std::optional<std::uint64_t> restart);
  void write_fields(Simulation& simulation);
  void open_series(std::optional<std::uint64_t> restart);
  void drop_later_outputs(std::uint64_t restart);
  std::uint64_t first_open_snapshot(std::uint64_t restart) const;
  void set_later_checkpoints_aside(std::uint64_t restart);
  void open_tables(const Simulation& simulation, std::optional<std::uint64_t> restart);
  void sync_tables();
  void write_probes(Simulation& simulation);
  void write_energy(Simulation& simulation);
  void write_records(Simulation& simulation, bool is_end);
  void watch_gas(Simulation& simulation);
  void warn(Simulation& simulation, const std::vector<Warning>& warnings);
  void check_grains(const Simulation& simulation, const Image& image) const;

  std::filesystem::path directory_;
  World world_;
  RunRecord record_;
  Log* log_;
  std::vector<std::string> fields_;
  int checkpoints_kept_;
  bool is_distributed_, keeps_energy_;
  Schedule snapshots_, checkpoints_;
  std::optional<SnapshotSeries> series_;  // of the root, and of the others once it has dropped what is old
  std::vector<ProbeTable> probes_;
  std::vector<FieldOutput> fields_of_probes_;
  std::optional<TableFile> energy_;   // of the root
  std::optional<TableFile> hashes_;   // of the root
  std::optional<TableFile> balance_;  // of the root
  std::optional<std::filesystem::path> last_checkpoint_;
  std::optional<std::uint64_t> last_checkpoint_step_;
  double seconds_ = 0.0;
  Watch watch_;
  std::vector<Warning> reasons_to_stop_;  // by run.stop_on, whose records are not complete yet
};

}  // namespace moraine
