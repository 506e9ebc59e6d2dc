#include "io/cli/project_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "engine/particles/fill.hpp"
#include "engine/run/gas_projection.hpp"
#include "engine/run/projection.hpp"
#include "io/checkpoint/durable_file.hpp"
#include "io/cli/layout.hpp"
#include "io/cli/network_file.hpp"
#include "io/cli/text.hpp"
#include "io/scene_toml/scene_toml.hpp"

namespace moraine {

namespace {

/// Fewer parts than this have next to no inner ones, and cannot stand for many.
constexpr int fewest_parts = 8;
/// What the program itself takes [bytes].
constexpr double base_memory = 4e7;

std::string row(const std::string& name, const std::string& text) { return fmt::format("{:<13}{}\n", name, text); }

std::string whole(double value) { return count_text(static_cast<std::uint64_t>(std::llround(value))); }

std::string seconds_text(double seconds) {
  if (seconds < 1e-6) return fmt::format("{:.3g} ns", seconds * 1e9);
  if (seconds < 1e-3) return fmt::format("{:.3g} us", seconds * 1e6);
  return seconds < 1.0 ? fmt::format("{:.3g} ms", seconds * 1e3) : fmt::format("{:.3g} s", seconds);
}

/// A number of a rank that is shown as mean and largest.
struct Quantity {
  const char* name;
  const char* column;  // in the CSV file
  std::function<double(const RankCounts&)> value;
  bool is_bytes = false;
};

std::vector<Quantity> quantities(const Rates& rates) {
  const auto real = [](std::int64_t n) { return static_cast<double>(n); };
  return {
      {"grains", "grains", [=](const RankCounts& r) { return real(r.n_grains); }},
      {"pairs", "pairs", [=](const RankCounts& r) { return real(r.n_pairs); }},
      {"of these, with a ghost", "border_pairs", [=](const RankCounts& r) { return real(r.n_border_pairs); }},
      {"of these, touching", "contacts", [=](const RankCounts& r) { return real(r.n_contacts); }},
      {"ghosts received", "ghosts", [=](const RankCounts& r) { return real(r.n_ghosts); }},
      {"grains sent", "sent", [=](const RankCounts& r) { return real(r.n_sent); }},
      {"neighbours", "neighbours", [](const RankCounts& r) { return r.n_neighbours; }},
      {"messages sent a step", "messages", [](const RankCounts& r) { return r.n_messages; }},
      {"bytes sent a step", "bytes", [=](const RankCounts& r) { return real(r.bytes); }, true},
      {"memory", "memory",
       [=](const RankCounts& r) { return base_memory + rates.bytes_per_grain * real(r.n_grains + r.n_ghosts); }, true},
  };
}

struct Spread {
  double mean = 0.0, largest = 0.0;
};

Spread spread_of(const std::vector<RankCounts>& ranks, const Quantity& quantity) {
  Spread spread;
  for (const RankCounts& rank : ranks) {
    spread.mean += quantity.value(rank) / static_cast<double>(ranks.size());
    spread.largest = std::max(spread.largest, quantity.value(rank));
  }
  return spread;
}

/// One number of ranks.
struct Case {
  int n_ranks = 0;
  int n_parts = 0;  // that were cut, and stand for the ranks
  std::vector<RankCounts> ranks;
  Prediction prediction;
  std::optional<GasLayout> gas;
  GasPrediction gas_prediction;
};

std::string title(const Case& c, double n_wanted, std::int64_t n_grains) {
  std::string text = counted(static_cast<std::uint64_t>(c.n_ranks), "rank");
  if (c.n_parts == c.n_ranks) return text;
  text += fmt::format(" with {} grains, as the {} that hold as many each of {}", whole(n_wanted), c.n_parts,
                      count_text(static_cast<std::uint64_t>(n_grains)));
  return text;
}

std::string case_text(const Case& c, const std::string& heading, const Rates& rates) {
  std::string text = fmt::format("\n{}\n  {:<24}{:>14}{:>14}\n", heading, "", "mean", "largest");
  for (const Quantity& quantity : quantities(rates)) {
    const Spread spread = spread_of(c.ranks, quantity);
    const auto shown = [&](double value) {
      if (quantity.is_bytes) return bytes_text(value);
      return value < 100.0 ? fmt::format("{:.1f}", value) : whole(value);
    };
    text += fmt::format("  {:<24}{:>14}{:>14}\n", quantity.name, shown(spread.mean), shown(spread.largest));
  }
  const auto n_empty = static_cast<std::uint64_t>(
      std::count_if(c.ranks.begin(), c.ranks.end(), [](const RankCounts& r) { return r.n_grains == 0; }));
  if (n_empty > 0) text += fmt::format("  {} without grains\n", counted(n_empty, "rank"));
  return text;
}

std::string summary_text(const std::vector<Case>& cases) {
  std::string text =
      fmt::format("\n{:>10} {:>14} {:>10} {:>10} {:>11} {:>9} {:>9} {:>9} {:>9}\n", "ranks", "grains a rank",
                  "imbalance", "step", "efficiency", "work", "messages", "waiting", "fixed");
  for (const Case& c : cases) {
    const Prediction& p = c.prediction;
    double grains = 0.0;
    for (const RankCounts& rank : c.ranks) grains += static_cast<double>(rank.n_grains);
    const auto percent = [](double share) { return fmt::format("{:.1f} %", 100.0 * share); };
    text += fmt::format("{:>10} {:>14} {:>10.3f} {:>10} {:>11} {:>9} {:>9} {:>9} {:>9}\n", c.n_ranks,
                        whole(grains / c.n_parts), p.imbalance, seconds_text(p.step), percent(p.efficiency),
                        percent(p.work), percent(p.messages), percent(p.waiting),
                        percent(1.0 - p.work - p.messages - p.waiting));
  }
  return text;
}

/// The gas steps, where the cases have them.
std::string gas_summary_text(const std::vector<Case>& cases) {
  if (cases.empty() || !cases.front().gas) return "";
  std::string text =
      fmt::format("\na gas step and the {} grain steps to the next\n", cases.front().gas_prediction.grain_steps);
  text += fmt::format("{:>10} {:>10} {:>13} {:>12} {:>10} {:>10} {:>11} {:>10} {:>10} {:>11}\n", "ranks", "with cells",
                      "cells of each", "grain steps", "drag", "cells", "first rank", "messages", "all", "efficiency");
  for (const Case& c : cases) {
    const GasPrediction& p = c.gas_prediction;
    std::int64_t most = 0;
    for (const GasRank& rank : c.gas->ranks) most = std::max(most, rank.n_cells);
    text += fmt::format("{:>10} {:>10} {:>13} {:>12} {:>10} {:>10} {:>11} {:>10} {:>10} {:>11}\n", c.n_ranks,
                        c.gas->n_gas_ranks, count_text(static_cast<std::uint64_t>(most)),
                        seconds_text(p.grain_steps * c.prediction.step), seconds_text(p.grains), seconds_text(p.cells),
                        seconds_text(p.root), seconds_text(p.messages), seconds_text(p.whole),
                        fmt::format("{:.1f} %", 100.0 * p.efficiency));
  }
  return text;
}

std::string assumptions_text(const ProjectRequest& request, std::int64_t bytes_per_ghost, bool scene_has_gas) {
  std::string text = "\nassumptions\n";
  const auto say = [&](const std::string& line) { text += "  - " + line + "\n"; };
  say("grains as they lie at the start, cut as the run will cut them then: every grain costs the same, pairs are not "
      "known yet. "
      "Cuts that follow the measured work even it out better");
  say(fmt::format(
      "each rank computes as fast as this process did, alone on this machine with {}: no rank takes memory bandwidth "
      "from another, and a rank with few grains gains nothing from its caches",
      counted(static_cast<std::uint64_t>(request.threads), "thread")));
  say("work is pairs + 4 a grain; the rates are of the first steps, with the rebuilds that fell into them; messages of "
      "rebuilds, "
      "migration and output are not counted");
  say(fmt::format(
      "{} bytes a ghost and step; one message a neighbour and step, each way; both ways at once; a rank has the "
      "network's bandwidth for itself, and pays the latency once for each neighbour",
      bytes_per_ghost));
  say("messages are hidden by interior work: a step takes packing + max(interior, messages) + border + fixed; all wait "
      "for the "
      "slowest rank. Shares are means over the ranks");
  if (scene_has_gas && request.grains) say("the gas is left out: how it grows with --grains is not known");
  if (scene_has_gas && !request.grains)
    say("the gas: iterations and parts as measured here, from when the inlets have reached their speed; at least some "
        "8000 cells a rank, and coarse grids by the first rank alone; messages are not hidden; a reduction takes two "
        "latencies for each doubling of the ranks; windows as grains lie at the start; smoothing is not counted");
  if (request.grains)
    say("a larger bed is like this one, with more of it: where few ranks are cut, more of them than in the larger one "
        "lie at the "
        "outside, with fewer neighbours and ghosts");
  return text;
}

std::string csv_text(const std::vector<Case>& cases, const Rates& rates) {
  std::string text = "ranks,parts";
  for (const Quantity& quantity : quantities(rates)) text += fmt::format(",{0}_mean,{0}_largest", quantity.column);
  text += ",imbalance,step [s],one_rank_step [s],efficiency,work_share,message_share,waiting_share";
  const bool has_gas = !cases.empty() && cases.front().gas;
  if (has_gas)
    text += ",gas_ranks,gas_drag [s],gas_cells [s],gas_root [s],gas_messages [s],with_gas [s],with_gas_efficiency";
  text += '\n';
  for (const Case& c : cases) {
    text += fmt::format("{},{}", c.n_ranks, c.n_parts);
    for (const Quantity& quantity : quantities(rates)) {
      const Spread spread = spread_of(c.ranks, quantity);
      text += fmt::format(",{},{}", spread.mean, spread.largest);
    }
    const Prediction& p = c.prediction;
    text += fmt::format(",{},{},{},{},{},{},{}", p.imbalance, p.step, p.one_rank, p.efficiency, p.work, p.messages,
                        p.waiting);
    if (has_gas) {
      const GasPrediction& g = c.gas_prediction;
      text += fmt::format(",{},{},{},{},{},{},{}", c.gas->n_gas_ranks, g.grains, g.cells, g.root, g.messages, g.whole,
                          g.efficiency);
    }
    text += '\n';
  }
  return text;
}

void check(const ProjectRequest& request) {
  if (request.ranks.empty()) throw UsageError("--ranks: expected at least one number of ranks, such as 256,4096");
  for (const int n : request.ranks)
    if (n < 1) throw UsageError(fmt::format("--ranks: expected numbers of at least 1, found {}", n));
  if (request.threads < 1 || request.threads > available_cores())
    throw UsageError(
        fmt::format("--layout-threads {}: rates are measured here, so it must be 1 to the cores of this machine ({})",
                    request.threads, available_cores()));
}

int parts_for(int n_ranks, const std::optional<double>& n_wanted, std::int64_t n_grains) {
  if (!n_wanted) return n_ranks;
  const double parts = n_ranks * static_cast<double>(n_grains) / *n_wanted;
  if (parts < fewest_parts)
    throw UsageError(
        fmt::format("{} ranks with {} grains hold {} each: the scene's {} are too few to show that (it takes {} times "
                    "as many as a rank holds); use more ranks or a larger scene",
                    n_ranks, whole(*n_wanted), whole(*n_wanted / n_ranks),
                    count_text(static_cast<std::uint64_t>(n_grains)), fewest_parts));
  return static_cast<int>(std::lround(parts));
}

}  // namespace

std::string project_text(const ProjectRequest& request) {
  check(request);
  const Network network = request.network ? read_network(*request.network) : default_network();
  const Scene scene = read_scene(request.scene_file, request.overrides);
  const int n_cores = available_cores();
  const std::vector<GrainSeed> grains = make_grains(scene, n_cores);
  const auto n_grains = static_cast<std::int64_t>(grains.size());
  if (n_grains == 0) throw UsageError(request.scene_file.string() + ": the scene has no grains to share out");
  if (request.grains && *request.grains < static_cast<double>(n_grains))
    throw UsageError(fmt::format("--grains {:g}: fewer than the scene has ({})", *request.grains,
                                 count_text(static_cast<std::uint64_t>(n_grains))));
  std::vector<Case> cases;
  for (const int n : request.ranks) cases.push_back({n, parts_for(n, request.grains, n_grains), {}, {}, {}, {}});
  const Projection projection(scene, grains, n_cores);
  const Rates rates = measure_rates(scene, grains, request.threads);

  std::string text = row("scene", request.scene_file.string() + (scene.title.empty() ? "" : ": " + scene.title));
  text += row("grains",
              fmt::format("{}; skin {:.4g} m", count_text(static_cast<std::uint64_t>(n_grains)), projection.skin()));
  text += row("measured", fmt::format("{} grains on {} for {}: {} a grain and step, {:.0f} bytes a grain",
                                      whole(static_cast<double>(rates.n_grains)),
                                      counted(static_cast<std::uint64_t>(request.threads), "thread"),
                                      counted(static_cast<std::uint64_t>(rates.n_steps), "step"),
                                      seconds_text(rates.per_grain), rates.bytes_per_grain));
  text += row("", fmt::format("{} a pair, {} a grain, {} a step, {:.2g} GB/s into messages", seconds_text(rates.unit),
                              seconds_text(4.0 * rates.unit), seconds_text(rates.fixed), 1e-9 / rates.copy));
  text += row("network", fmt::format("{}: latency {}, {:.3g} GB/s", network.name, seconds_text(network.latency),
                                     1e-9 * network.bandwidth));
  const bool has_gas = scene.gas && !request.grains;  // a larger bed has a gas of its own, which nobody has described
  const GasRates gas_rates = has_gas ? measure_gas_rates(scene, grains, request.threads) : GasRates{};
  if (has_gas)
    text += row("gas", fmt::format("{}: {} a cell, {} a grain, {} a cell of coarse grids and iteration; {:.3g} "
                                   "iterations in {:.3g} parts",
                                   counted(static_cast<std::uint64_t>(gas_rates.n_steps), "step"),
                                   seconds_text(gas_rates.cell), seconds_text(gas_rates.grain),
                                   seconds_text(gas_rates.root_cell), gas_rates.n_iterations, gas_rates.n_parts));
  const double one_rank_work = work_of(projection.count(1)[0]);
  for (Case& c : cases) {
    const Projection::Division division = projection.divide(c.n_parts);
    c.ranks = projection.count(division);
    c.prediction = predict(c.ranks, one_rank_work, projection.bytes_per_ghost(), rates, network);
    if (has_gas) {
      c.gas = lay_out_gas(scene, projection.positions(), division.owners, c.n_ranks);
      c.gas_prediction = predict_gas(scene, *c.gas, gas_rates, rates, network, c.prediction);
    }
    text += case_text(c, title(c, request.grains.value_or(0.0), n_grains), rates);
  }
  text += summary_text(cases) + gas_summary_text(cases) +
          assumptions_text(request, projection.bytes_per_ghost(), scene.gas.has_value());
  if (request.csv) write_file(*request.csv, csv_text(cases, rates));
  return text;
}

}  // namespace moraine
