#include "io/cli/pareto_results.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <numeric>
#include <sstream>

#include "engine/run/plan.hpp"
#include "io/checkpoint/durable_file.hpp"
#include "io/snapshot/snapshot.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// A time series as the run wrote it.
struct Table {
  std::vector<std::string> columns;
  std::vector<std::vector<double>> rows;
};

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
  return cells;
}

double number_of(const std::string& cell) {
  double value = nan;
  std::from_chars(cell.data(), cell.data() + cell.size(), value);
  return value;
}

Table read_table(const fs::path& file) {
  std::istringstream in(read_file(file));
  Table table;
  std::string line;
  if (std::getline(in, line)) table.columns = cells_of(line);
  while (std::getline(in, line)) {
    std::vector<double> row;
    for (const std::string& cell : cells_of(line)) row.push_back(number_of(cell));
    if (row.size() == table.columns.size()) table.rows.push_back(std::move(row));
  }
  return table;
}

/// A column with its times.
struct Series {
  std::vector<double> times, values;
};

Series series_of(const fs::path& run_directory, const ProbeColumn& column) {
  const fs::path file = run_directory / (column.probe + ".csv");
  const Table table = read_table(file);
  const auto index_of = [&](const std::string& name) {
    const auto found = std::find(table.columns.begin(), table.columns.end(), name);
    if (found == table.columns.end()) throw StorageError(file, "has no column \"" + name + "\"");
    return static_cast<std::size_t>(found - table.columns.begin());
  };
  const std::size_t time = index_of("time [s]"), value = index_of(column.file_column);
  Series series;
  for (const std::vector<double>& row : table.rows) {
    series.times.push_back(row[time]);
    series.values.push_back(row[value]);
  }
  return series;
}

/// A row is written at the step nearest to its time, so the one that is due at `from` may come half a step before it; without
/// it averages of different steps would be over different times.
void add_average(const Series& series, double due, const fs::path& directory, const ProbeColumn& column,
                 ParetoRecord& record) {
  const double from = due - 0.5001 * record.summary.time_step;
  double sum = 0.0, squares = 0.0, n = 0.0;
  for (std::size_t i = 0; i < series.values.size(); ++i) {
    if (series.times[i] < from || !std::isfinite(series.values[i])) continue;
    sum += series.values[i];
    squares += series.values[i] * series.values[i];
    n += 1.0;
  }
  if (n < 1.0)
    throw StorageError(directory / (column.probe + ".csv"),
                       fmt::format("has no rows from {:g} s on to average \"{}\"", due, column.text));
  record.means.push_back(sum / n);
  record.deviations.push_back(std::sqrt(std::max(0.0, squares / n - sum * sum / (n * n))));
}

/// Positions by gid.
std::vector<double> positions_of(const fs::path& file) {
  const Image image = read_snapshot(file);
  const FieldArray* const gids = image.find(Field::gid);
  const FieldArray* const positions = image.find(Field::position);
  if (!gids || !positions) throw StorageError(file, "does not hold gid and position");
  std::vector<double> places;
  for (std::size_t i = 0; i < gids->gids.size(); ++i) {
    const std::size_t at = 3 * static_cast<std::size_t>(gids->gids[i]);
    if (places.size() < at + 3) places.resize(at + 3, nan);
    std::copy_n(positions->reals.begin() + static_cast<std::ptrdiff_t>(3 * i), 3,
                places.begin() + static_cast<std::ptrdiff_t>(at));
  }
  return places;
}

double root_mean_square(double sum, double n) { return n > 0.0 ? std::sqrt(sum / n) : 0.0; }

/// Root mean square distance of the grains that both have, over all looks, in mean diameters.
ParetoError path_error(const ParetoPlan& plan, const ParetoRecord& run, const ParetoRecord& reference) {
  const Domain& domain = plan.scene.domain;
  const Vec3 size = domain.box().size();
  double sum = 0.0, n = 0.0;
  for (std::size_t look = 0; look < std::min(run.paths.size(), reference.paths.size()); ++look) {
    const std::vector<double>&a = run.paths[look], &b = reference.paths[look];
    for (std::size_t k = 0; k + 2 < std::min(a.size(), b.size()); k += 3) {
      double square = 0.0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        double apart = a[k + axis] - b[k + axis];
        const double period = size[static_cast<int>(axis)];
        if (domain.periodic[axis]) apart -= period * std::round(apart / period);
        square += apart * apart;
      }
      if (!std::isfinite(square)) continue;  // one of them has left
      sum += square;
      n += 1.0;
    }
  }
  const double diameter = mean_diameter(plan.scene);
  return {"paths of grains", root_mean_square(sum, n) / diameter, {}, diameter};
}

/// Root mean square difference of the rows over the root mean square of the reference's.
ParetoError value_error(const ProbeColumn& column, const std::vector<double>& run,
                        const std::vector<double>& reference) {
  double sum = 0.0, scale = 0.0, n = 0.0;
  for (std::size_t i = 0; i < std::min(run.size(), reference.size()); ++i) {
    const double apart = run[i] - reference[i];
    if (!std::isfinite(apart)) continue;
    sum += apart * apart;
    scale += reference[i] * reference[i];
    n += 1.0;
  }
  const double size = root_mean_square(scale, n);
  return {column.text, size > 0.0 ? root_mean_square(sum, n) / size : root_mean_square(sum, n), {}, size};
}

/// Differences of the averages, repeat by repeat: what two runs share by their start then cancels.
ParetoError statistic_error(const ProbeColumn& column, std::size_t which, const std::vector<ParetoRecord>& runs,
                            const std::vector<ParetoRecord>& reference) {
  const std::size_t n = std::min(runs.size(), reference.size());
  double mean = 0.0, spread = 0.0;
  for (const ParetoRecord& record : reference) {
    mean += record.means[which] / static_cast<double>(reference.size());
    spread += record.deviations[which] / static_cast<double>(reference.size());
  }
  double scale = std::max(std::abs(mean), spread);  // a mean of zero is no measure
  if (!(scale > 0.0)) scale = 1.0;
  std::vector<double> differences;
  for (std::size_t i = 0; i < n; ++i) differences.push_back((runs[i].means[which] - reference[i].means[which]) / scale);
  const double sum = std::accumulate(differences.begin(), differences.end(), 0.0);
  return {column.text, sum / static_cast<double>(n), half_width_of_mean(differences), scale};
}

bool is_candidate(const ParetoResult& result) {
  return result.is_good() && result.setting.kind != ParetoKind::reference && !result.errors.empty();
}

/// One setting beside another, as far as it is known.
enum class Comparison { better, same, worse, unknown };

/// The times of `one` beside those of `other`. Without repeats there is no interval, and the times are taken as they are.
Comparison compare_times(const ParetoResult& one, const ParetoResult& other) {
  std::vector<double> logs;
  for (std::size_t i = 0; i < std::min(one.times.size(), other.times.size()); ++i)
    logs.push_back(std::log(one.times[i] / other.times[i]));
  const double mean = std::accumulate(logs.begin(), logs.end(), 0.0) / static_cast<double>(logs.size());
  const std::optional<double> half_width = half_width_of_mean(logs);
  if (mean + half_width.value_or(0.0) < 0.0) return Comparison::better;
  if (mean - half_width.value_or(0.0) > 0.0) return Comparison::worse;
  return half_width ? Comparison::unknown : Comparison::same;
}

Comparison compare_errors(const ParetoResult& one, const ParetoResult& other) {
  if (is_same_state(one, other)) return Comparison::same;
  if (one.worst().bound() < other.least_error()) return Comparison::better;
  if (one.least_error() > other.worst().bound()) return Comparison::worse;
  const bool is_exact = !one.worst().half_width && !other.worst().half_width;
  return is_exact ? Comparison::same : Comparison::unknown;
}

/// With few repeats the mean of a setting is small by chance: what intervals leave open is said to be open.
ParetoStanding standing_of(const ParetoResult& one, const std::vector<ParetoResult>& results) {
  ParetoStanding standing = ParetoStanding::front;
  for (const ParetoResult& other : results) {
    if (&other == &one || !is_candidate(other)) continue;
    const Comparison time = compare_times(one, other), error = compare_errors(one, other);
    if (time == Comparison::better || error == Comparison::better) continue;
    if (time == Comparison::same && error == Comparison::same) continue;
    if (time != Comparison::unknown && error != Comparison::unknown) return ParetoStanding::beaten;
    standing = ParetoStanding::open;
  }
  return standing;
}

void mark_front(std::vector<ParetoResult>& results) {
  for (ParetoResult& one : results)
    one.standing = is_candidate(one) ? standing_of(one, results) : ParetoStanding::beaten;
}

/// Where halving the step again and again does not bring the paths together, they are not what can be compared.
bool do_paths_part(const ParetoResults& results) {
  constexpr double far = 0.05;  // [mean diameters]
  const ParetoResult* coarsest = nullptr;
  const ParetoResult* finest = nullptr;
  for (const ParetoResult& result : results.results) {
    if (!is_candidate(result) || result.setting.kind != ParetoKind::time_step) continue;
    if (!coarsest || result.setting.time_step > coarsest->setting.time_step) coarsest = &result;
    if (!finest || result.setting.time_step < finest->setting.time_step) finest = &result;
  }
  if (!finest || finest == coarsest) return false;
  const double error = finest->errors.front().value;
  return error > far && error > 0.3 * coarsest->errors.front().value;
}

std::string error_text(const ParetoError& error) {
  const std::string size = fmt::format("{:.2g} %", 100.0 * std::abs(error.value));
  return error.half_width ? fmt::format("{} +- {:.2g} %", size, 100.0 * *error.half_width) : size;
}

/// One that nothing is known to beat.
void recommend(ParetoResults& results) {
  std::optional<std::size_t> best, surest;
  for (std::size_t i = 0; i < results.results.size(); ++i) {
    const ParetoResult& result = results.results[i];
    if (result.standing == ParetoStanding::beaten) continue;
    const double bound = result.worst().bound();
    if (bound <= results.accept && (!best || result.seconds < results.results[*best].seconds)) best = i;
    if (!surest || bound < results.results[*surest].worst().bound()) surest = i;
  }
  results.recommended = best ? best : surest;
  if (!results.recommended) {
    results.advice = "no setting has come to its end but the reference";
    return;
  }
  const ParetoResult& chosen = results.results[*results.recommended];
  const ParetoError& error = chosen.worst();
  results.advice =
      fmt::format("{}: step {:.4g} s, {:.1f} steps a contact; error {} in {}", chosen.setting.name,
                  chosen.setting.time_step, chosen.setting.steps_per_contact, error_text(error), error.quantity);
  results.advice +=
      best ? fmt::format("; the fastest that is known to be within {:g} %", 100.0 * results.accept)
           : fmt::format("; none is known to be within {:g} %, this is the surest: {}", 100.0 * results.accept,
                         results.measure == ParetoMeasure::statistics
                             ? "more --repeats or a later pareto.end narrow the intervals"
                             : "try more steps in pareto.steps_per_contact");
}

}  // namespace

const char* word_for(ParetoStanding standing) {
  static constexpr const char* words[] = {"beaten", "open", "front"};
  return words[static_cast<std::size_t>(standing)];
}

bool is_same_state(const ParetoResult& one, const ParetoResult& other) {
  const std::size_t n = std::min(one.hashes.size(), other.hashes.size());
  return n > 0 &&
         std::equal(one.hashes.begin(), one.hashes.begin() + static_cast<std::ptrdiff_t>(n), other.hashes.begin());
}

double ParetoResult::least_error() const {
  double least = 0.0;
  for (const ParetoError& error : errors) least = std::max(least, error.least());
  return least;
}

const ParetoError& ParetoResult::worst() const {
  return *std::max_element(errors.begin(), errors.end(),
                           [](const ParetoError& a, const ParetoError& b) { return a.bound() < b.bound(); });
}

ParetoRecord read_record(const ParetoPlan& plan, const std::vector<ProbeColumn>& columns,
                         const fs::path& run_directory) {
  ParetoRecord record;
  record.summary = read_summary(run_directory / "summary.json");
  for (const ProbeColumn& column : columns) {
    Series series = series_of(run_directory, column);
    if (plan.measure == ParetoMeasure::statistics)
      add_average(series, plan.table.from, run_directory, column, record);
    else
      record.rows.push_back(std::move(series.values));
  }
  if (plan.measure == ParetoMeasure::paths)
    for (const fs::path& file : list_snapshots(run_directory)) record.paths.push_back(positions_of(file));
  return record;
}

std::optional<double> half_width_of_mean(const std::vector<double>& samples) {
  // Student's t for a probability of 0.975, by degrees of freedom from 1.
  static constexpr double quantiles[] = {12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228};
  const std::size_t n = samples.size();
  if (n < 2) return std::nullopt;
  const auto count = static_cast<double>(n);
  const double mean = std::accumulate(samples.begin(), samples.end(), 0.0) / count;
  double squares = 0.0;
  for (const double sample : samples) squares += (sample - mean) * (sample - mean);
  const double t = n - 2 < std::size(quantiles) ? quantiles[n - 2] : 1.96 + 2.5 / (count - 1.0);
  return t * std::sqrt(squares / (count - 1.0) / count);
}

std::vector<ParetoError> errors_between(const ParetoPlan& plan, const std::vector<ProbeColumn>& columns,
                                        const std::vector<ParetoRecord>& runs,
                                        const std::vector<ParetoRecord>& reference) {
  std::vector<ParetoError> errors;
  if (plan.measure == ParetoMeasure::paths) errors.push_back(path_error(plan, runs.front(), reference.front()));
  for (std::size_t i = 0; i < columns.size(); ++i)
    errors.push_back(plan.measure == ParetoMeasure::statistics
                         ? statistic_error(columns[i], i, runs, reference)
                         : value_error(columns[i], runs.front().rows[i], reference.front().rows[i]));
  return errors;
}

void judge(ParetoResults& results) {
  mark_front(results.results);
  results.is_chaotic = results.measure == ParetoMeasure::paths && do_paths_part(results);
  results.recommended.reset();
  if (!results.is_chaotic) {
    recommend(results);
    return;
  }
  results.advice =
      "none: the paths of the grains do not come together as the step shrinks, so the scene is chaotic and its errors "
      "cannot be read off paths. Name what counts, such as\n[pareto]\nstatistics = [\"PROBE.COLUMN\"]\nfrom = ...\n"
      "and give --repeats, or compare a shorter part by pareto.end";
}

}  // namespace moraine
