#include "io/cli/outputs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "io/checkpoint/agreement.hpp"
#include "io/checkpoint/subdirectory.hpp"
#include "io/cli/progress.hpp"
#include "io/cli/record_files.hpp"
#include "io/cli/text.hpp"
#include "io/snapshot/snapshot.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

const std::vector<std::string> energy_columns = {
    "time [s]",      "kinetic [J]",     "rotational [J]",      "elastic_normal [J]", "elastic_tangential [J]",
    "potential [J]", "lost_normal [J]", "lost_tangential [J]", "lost_friction [J]",  "lost_drag [J]",
    "left [J]",      "wall_work [J]",   "total [J]",           "error [J]"};

const std::vector<std::string> balance_columns = {"time [s]", "rank",           "node",       "grains",
                                                  "pairs",    "work over mean", "threads",    "grain phases [s]",
                                                  "gas [s]",  "waited [s]",     "worked [s]", "held [s]"};

std::vector<double> balance_values(const BalanceRow& row) {
  return {row.time,
          static_cast<double>(row.rank),
          static_cast<double>(row.node),
          row.n_grains,
          row.n_pairs,
          row.work,
          static_cast<double>(row.n_threads),
          row.grains,
          row.gas,
          row.waited,
          row.worked,
          row.held};
}

std::vector<double> energy_values(double time, const EnergyLedger& e) {
  return {time,        e.kinetic,     e.rotational,      e.elastic_normal, e.elastic_tangential,
          e.potential, e.lost_normal, e.lost_tangential, e.lost_friction,  e.lost_drag,
          e.left,      e.wall_work,   e.total(),         e.error()};
}

std::string energy_line(double time, const EnergyLedger& e) {
  const double scale = std::max({std::abs(e.initial), std::abs(e.total()), std::abs(e.lost()), std::abs(e.wall_work)});
  return fmt::format(
      "energy at {:.6g} s: kinetic {:.6g} J, rotational {:.6g} J, elastic {:.6g} J, potential {:.6g} J, lost {:.6g} J, "
      "{}error {:.3g} J ({:.2g} of the largest)",
      time, e.kinetic, e.rotational, e.elastic_normal + e.elastic_tangential, e.potential, e.lost(),
      e.wall_work != 0.0 ? fmt::format("from walls {:.6g} J, ", e.wall_work) : "", e.error(),
      scale > 0.0 ? std::abs(e.error()) / scale : 0.0);
}

/// What the scene asks for, and what no snapshot can do without.
std::vector<std::string> snapshot_fields(std::vector<std::string> wanted) {
  if (wanted.empty()) return wanted;
  for (const char* name : {"position", "radius", "gid"})
    if (std::find(wanted.begin(), wanted.end(), name) == wanted.end()) wanted.emplace_back(name);
  return wanted;
}

bool is_taken(const std::vector<Probe>& probes, const std::string& name) {
  return std::any_of(probes.begin(), probes.end(), [&](const Probe& probe) { return probe.name == name; });
}

}  // namespace

Outputs::Outputs(const fs::path& directory, const Simulation& simulation, RunRecord record,
                 std::optional<std::uint64_t> restart, Log& log)
    : directory_(directory),
      world_(simulation.world()),
      record_(std::move(record)),
      log_(&log),
      fields_(snapshot_fields(simulation.scene().output.fields)),
      checkpoints_kept_(simulation.scene().output.checkpoints_kept),
      is_distributed_(simulation.scene().output.distributed),
      keeps_energy_(simulation.scene().output.energy),
      snapshots_(simulation.scene().output.snapshot_interval, simulation.time_step()),
      checkpoints_(simulation.scene().output.checkpoint_interval, simulation.time_step()),
      watch_(simulation.scene()) {
  if (world_.is_root()) open_series(restart);
  world_.wait_for_all();  // nobody looks at files that are being removed
  if (!world_.is_root()) series_.emplace(directory_);
  open_tables(simulation, restart);
  open_fields(simulation, restart);
}

void Outputs::open_series(std::optional<std::uint64_t> restart) {
  series_.emplace(directory_);
  if (restart)
    drop_later_outputs(*restart);
  else if (series_->size() > 0)
    series_->drop_from(0);
}

void Outputs::drop_later_outputs(std::uint64_t restart) {
  const int n_dropped = series_->drop_from(first_open_snapshot(restart));
  if (n_dropped > 0)
    log_->say(
        fmt::format("{} later than the restart dropped", counted(static_cast<std::uint64_t>(n_dropped), "snapshot")));
  set_later_checkpoints_aside(restart);
}

std::uint64_t Outputs::first_open_snapshot(std::uint64_t restart) const {
  // What was written at the restart itself stays if an unbroken run would have written it too.
  return snapshots_.is_due(restart) ? restart + 1 : restart;
}

void Outputs::set_later_checkpoints_aside(std::uint64_t restart) {
  for (const fs::path& path : list_checkpoints(directory_)) {
    if (*checkpoint_step(path) == restart) last_checkpoint_ = path;
    if (*checkpoint_step(path) <= restart) continue;
    fs::path aside = path;
    aside += ".old";
    std::error_code error;
    fs::rename(path, aside, error);
    if (error) throw StorageError(path, "cannot be renamed: " + explain_errno(error.value()));
    log_->say(fmt::format("{} is later than the restart: renamed to {}", path.string(), aside.filename().string()));
  }
}

void Outputs::open_tables(const Simulation& simulation, std::optional<std::uint64_t> restart) {
  const Output& output = simulation.scene().output;
  const auto probe_rows = restart ? std::optional(*restart + 1) : std::nullopt;
  const auto snapshot_rows = restart ? std::optional(first_open_snapshot(*restart)) : std::nullopt;
  for (std::size_t i = 0; i < output.probes.size(); ++i) {
    std::vector<std::string> columns = simulation.probe_columns(i);
    const bool has_time = !columns.empty() && columns[0].starts_with("time");
    if (!has_time) columns.insert(columns.begin(), "time [s]");
    probes_.push_back({i, Schedule(output.probes[i].interval, simulation.time_step()), has_time, {}});
    if (world_.is_root())
      probes_.back().table.emplace(directory_ / (output.probes[i].name + ".csv"), columns, probe_rows);
  }
  if (!world_.is_root()) return;
  const auto free_name = [&](const char* name, const char* other) {
    return directory_ / (std::string(is_taken(output.probes, name) ? other : name) + ".csv");
  };
  if (keeps_energy_) energy_.emplace(free_name("energy", "energy_ledger"), energy_columns, snapshot_rows);
  hashes_.emplace(free_name("hashes", "state_hashes"), std::vector<std::string>{"time [s]", "state_hash"},
                  snapshot_rows);
  balance_.emplace(free_name("balance", "balance_of_ranks"), balance_columns, probe_rows);
}

/// Files later than the restart go; one at the restart itself stays if an unbroken run would have written it too.
void Outputs::open_fields(const Simulation& simulation, std::optional<std::uint64_t> restart) {
  const std::vector<Probe>& probes = simulation.scene().output.probes;
  for (std::size_t k = 0; k < probes.size(); ++k) {
    const Probe& probe = probes[k];
    if (probe.kind != Probe::Kind::fields) continue;
    std::optional<Schedule> averages;
    if (probe.average > 0.0)
      averages.emplace(std::isfinite(probe.average) ? probe.average : 0.0, simulation.time_step());
    const Schedule& due = averages ? *averages : probes_[k].schedule;
    const std::uint64_t first_open = !restart ? 0 : due.is_due(*restart) ? *restart + 1 : *restart;
    agree_on_root(world_, directory_, [&] { FieldSeries(directory_, probe.name).drop_from(first_open); });
    fields_of_probes_.push_back({k, averages, probe.has_table, FieldSeries(directory_, probe.name)});
  }
}

/// Those whose average is over now; there may have been no sample yet.
void Outputs::write_fields(Simulation& simulation) {
  const std::uint64_t step = simulation.step_number();
  for (FieldOutput& output : fields_of_probes_) {
    const bool is_over =
        output.averages ? step > 0 && output.averages->is_due(step) : probes_[output.probe].schedule.is_due(step);
    if (!is_over) continue;
    const FieldImage fields = simulation.fields(output.probe);
    if (fields.n_samples == 0) continue;
    output.series.add(fields, world_, output.has_table);
    simulation.begin_fields(output.probe);
  }
}

void Outputs::write_open_fields(const Simulation& simulation) {
  for (FieldOutput& output : fields_of_probes_)
    if (const FieldImage fields = simulation.fields(output.probe); fields.n_samples > 0)
      output.series.add(fields, world_, output.has_table);
}

void Outputs::add_balance(const std::vector<BalanceRow>& rows) {
  if (!balance_) return;
  for (const BalanceRow& row : rows) balance_->add(row.step, balance_values(row));
}

bool Outputs::is_due(std::uint64_t step) const {
  return snapshots_.is_due(step) || checkpoints_.is_due(step) ||
         std::any_of(probes_.begin(), probes_.end(),
                     [&](const ProbeTable& probe) { return probe.schedule.is_due(step); }) ||
         std::any_of(fields_of_probes_.begin(), fields_of_probes_.end(),
                     [&](const FieldOutput& output) { return output.averages && output.averages->is_due(step); });
}

void Outputs::write_due(Simulation& simulation) {
  watch_gas(simulation);
  write_records(simulation, false);
  const std::uint64_t step = simulation.step_number();
  if (!is_due(step)) return;
  {
    const WallClock clock;
    write_probes(simulation);
    write_fields(simulation);
    seconds_ += clock.seconds();
  }
  if (snapshots_.is_due(step)) {
    write_snapshot_now(simulation);
    simulation.begin_force_maps();
  }
  if (checkpoints_.is_due(step) && step > 0) write_checkpoint_now(simulation);
}

void Outputs::check_grains(const Simulation& simulation, const Image& image) const {
  if (image.n_grains + simulation.n_left() == simulation.n_born()) return;
  throw RunError(fmt::format("grains are missing at {} s: {} were born, but {} are inside and {} left through outlets",
                             simulation.time(), simulation.n_born(), image.n_grains, simulation.n_left()));
}

void Outputs::write_probes(Simulation& simulation) {
  const std::uint64_t step = simulation.step_number();
  for (ProbeTable& probe : probes_) {
    if (!probe.schedule.is_due(step)) continue;
    std::vector<double> values = simulation.probe_row(probe.probe);
    if (!probe.has_time) values.insert(values.begin(), simulation.time());
    if (probe.table) probe.table->add(step, values);
  }
}

void Outputs::write_energy(Simulation& simulation) {
  if (!keeps_energy_) return;
  const EnergyLedger ledger = simulation.energy();
  if (energy_) energy_->add(simulation.step_number(), energy_values(simulation.time(), ledger));
  log_->note(energy_line(simulation.time(), ledger));
  warn(simulation, watch_.look(ledger, simulation.time()));
}

void Outputs::warn(Simulation& simulation, const std::vector<Warning>& warnings) {
  const std::vector<std::string>& fatal = simulation.scene().run.stop_on;
  for (const Warning& warning : warnings) {
    simulation.begin_record(warning.concern);
    const bool is_fatal = std::find(fatal.begin(), fatal.end(), name_of(warning.concern)) != fatal.end();
    if (is_fatal) reasons_to_stop_.push_back(warning);
    log_->warn(fmt::format("{}\n  a record of the grains and cells concerned: {}*{}", warning.text,
                           (directory_ / record_stem(name_of(warning.concern))).string(),
                           is_fatal ? "; once it is complete the run ends (run.stop_on)" : ""));
  }
}

std::string Outputs::keep(const FlightRecord& record) const {
  std::string said;
  for (const fs::path& path : write_record(directory_, record, world_))
    said += (said.empty() ? "\n  the last steps of the grains concerned: " : ", ") + path.string();
  return said;
}

void Outputs::write_records(Simulation& simulation, bool is_end) {
  std::string reasons;
  for (const FlightRecord& record : simulation.take_records(is_end)) {
    write_record(directory_, record, world_);
    for (const Warning& warning : reasons_to_stop_)
      if (record.subject == name_of(warning.concern)) reasons += (reasons.empty() ? "" : "\n  ") + warning.text;
  }
  if (reasons.empty()) return;
  reasons_to_stop_.clear();
  world_.wait_for_all();  // for the records of the others: whoever speaks first ends all
  throw RunError("ended as run.stop_on asks: " + reasons);
}

void Outputs::watch_gas(Simulation& simulation) {
  if (const auto gas = simulation.gas_totals()) warn(simulation, watch_.look(*gas, simulation.time()));
}

void Outputs::write_snapshot_now(Simulation& simulation) {
  const std::uint64_t step = simulation.step_number();
  std::uint64_t is_there = world_.is_root() && series_->contains(step) ? 1 : 0;
  world_.max(std::span(&is_there, 1));
  if (is_there != 0) return;
  const WallClock clock;
  const Image image = simulation.snapshot(fields_);
  check_grains(simulation, image);
  series_->add(image, world_, is_distributed_);
  if (hashes_) hashes_->add_text(step, {number_text(simulation.time()), image.hash.text()});
  write_energy(simulation);
  seconds_ += clock.seconds();
}

void Outputs::sync_tables() {
  for (ProbeTable& probe : probes_) probe.table->sync();
  if (energy_) energy_->sync();
  hashes_->sync();
  balance_->sync();
}

void Outputs::write_checkpoint_now(const Simulation& simulation) {
  const std::uint64_t step = simulation.step_number();
  if (last_checkpoint_step_ == step) return;
  const WallClock clock;
  // The series first: a restart counts on the rows up to its step.
  if (world_.is_root()) {
    sync_tables();
    make_subdirectory(checkpoint_directory(directory_));
  }
  world_.wait_for_all();  // for the directory
  const fs::path path = checkpoint_directory(directory_) / checkpoint_name(step);
  write_checkpoint(path, simulation.checkpoint(), record_, world_, is_distributed_);
  last_checkpoint_ = path;
  last_checkpoint_step_ = step;
  if (world_.is_root()) remove_old_checkpoints(directory_, checkpoints_kept_);
  log_->note(fmt::format("checkpoint at {:.6g} s, step {}: {}", simulation.time(), step, path.string()));
  seconds_ += clock.seconds();
}

}  // namespace moraine
