#include "io/cli/summary.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <numeric>

#include "io/cli/text.hpp"

namespace moraine {

namespace {

constexpr double worth_a_row = 0.0005;  // of the whole

/// Time of a phase over the ranks [s].
struct RankTimes {
  std::string name;
  double mean = 0.0;
  double largest = 0.0;
};

/// Where the time of this rank went.
std::vector<PhaseTime> times_of_rank(const Simulation& simulation, const RunTimes& times) {
  std::vector<PhaseTime> rows = simulation.phases();
  // What the simulation sees as the time between its steps is ours to share out: start and output.
  std::erase_if(rows, [](const PhaseTime& row) { return row.name == "outside the step"; });
  double in_phases = 0.0;
  for (const PhaseTime& row : rows) in_phases += row.seconds;
  // Phases are those of the steps; what the steps took beyond them is shown, not hidden.
  rows.push_back({"other", std::max(times.stepping - in_phases, 0.0)});
  rows.push_back({"output", times.outputs});
  rows.push_back({"start", times.start});
  return rows;
}

std::string phase_table(const Simulation& simulation, const RunTimes& times) {
  const World& world = simulation.world();
  std::vector<RankTimes> rows;
  RankTimes whole{"total"};
  for (const PhaseTime& row : times_of_rank(simulation, times)) {
    const std::vector<double> seconds = world.gather(row.seconds);
    const double mean = std::accumulate(seconds.begin(), seconds.end(), 0.0) / static_cast<double>(seconds.size());
    rows.push_back({row.name, mean, *std::max_element(seconds.begin(), seconds.end())});
    whole.mean += mean;
  }
  const auto line = [&](const RankTimes& row) {
    std::string text = fmt::format("{:<28}{:>12.3f}{:>10.1f}", row.name, row.mean, 100.0 * row.mean / whole.mean);
    if (row.largest > 0.0 && !world.is_alone()) text += fmt::format("{:>12.3f}", row.largest);
    return text + '\n';
  };
  std::string text = fmt::format("{:<28}{:>12}{:>10}", "phase", "seconds", "percent");
  text += world.is_alone() ? "\n" : fmt::format("{:>12}\n", "largest");
  for (const RankTimes& row : rows)
    if (row.largest > worth_a_row * whole.mean) text += line(row);
  return text + line(whole);
}

double sum_over_ranks(const World& world, double bytes) {
  const std::vector<double> all = world.gather(bytes);
  return std::accumulate(all.begin(), all.end(), 0.0);
}

}  // namespace

double peak_memory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

std::string summary(const Simulation& simulation, const RunTimes& times, const std::string& directory,
                    const std::string& layout) {
  std::string text = phase_table(simulation, times);
  text += fmt::format("{} of {:.6g} s to {:.6g} s simulated, layout {}, {}\n", counted(times.n_steps, "step"),
                      simulation.time_step(), simulation.time(), layout, counted(simulation.n_rebuilds(), "rebuild"));
  if (times.stepping > 0.0)
    text += fmt::format("speed: {:.2f} M particle-steps/s\n", 1e-6 * times.particle_steps / times.stepping);
  text += fmt::format("grains: {} born, {} inside, {} left\n", simulation.n_born(), simulation.n_grains(),
                      simulation.n_left());
  if (const std::optional<GasTotals> gas = simulation.gas_totals(); gas && gas->n_steps > 0) {
    const auto per_step = [&](std::uint64_t n) { return static_cast<double>(n) / static_cast<double>(gas->n_steps); };
    text += fmt::format(
        "gas: {} in {:.3g} parts each, {:.3g} iterations a part, largest mass imbalance {:.1e} of a cell's gas, "
        "momentum to and from "
        "grains equal to {:.1e}\n",
        counted(gas->n_steps, "step"), per_step(gas->n_parts),
        static_cast<double>(gas->n_iterations) / static_cast<double>(std::max<std::uint64_t>(gas->n_parts, 1)),
        gas->imbalance, gas->momentum_error);
    text += fmt::format("void fraction: at least {:.3f}", gas->least_void_fraction);
    if (gas->n_floored > 0)
      text += fmt::format("; taken as gas.least_void_fraction in {:.3g} cells a step", per_step(gas->n_floored));
    text += '\n';
  }
  const std::string hash =
      simulation.state_hash().text();  // first: it wants the pair list, which a checkpoint sets aside
  const double bytes = sum_over_ranks(simulation.world(), peak_memory());
  const double held = sum_over_ranks(simulation.world(), simulation.memory());
  const auto n_grains = static_cast<double>(std::max<std::uint64_t>(simulation.n_born(), 1));
  text += fmt::format("memory: {} in grains, pairs and contacts; peak memory: {} ({:.0f} bytes a grain)\n",
                      bytes_text(held), bytes_text(bytes), bytes / n_grains);
  text += fmt::format("results: {}\n", directory);
  return text + "state hash: " + hash;
}

}  // namespace moraine
