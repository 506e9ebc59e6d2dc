#include "io/cli/summary.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>

#include "io/cli/text.hpp"

namespace moraine {

namespace {

constexpr double worth_a_row = 0.0005;  // of the whole

std::string phase_table(const Simulation& simulation, const RunTimes& times) {
  std::vector<PhaseTime> rows = simulation.phases();
  // What the simulation sees as the time between its steps is ours to share out: start and output.
  std::erase_if(rows, [](const PhaseTime& row) { return row.name == "outside the step"; });
  const auto sum = [&] {
    double seconds = 0.0;
    for (const PhaseTime& row : rows) seconds += row.seconds;
    return seconds;
  };
  // Phases are those of the steps; what the steps took beyond them is shown, not hidden.
  if (times.stepping > sum()) rows.push_back({"other", times.stepping - sum()});
  rows.push_back({"output", times.outputs});
  rows.push_back({"start", times.start});
  const double whole = sum();
  std::string text = fmt::format("{:<28}{:>12}{:>10}\n", "phase", "seconds", "percent");
  for (const PhaseTime& row : rows)
    if (row.seconds > worth_a_row * whole)
      text += fmt::format("{:<28}{:>12.3f}{:>10.1f}\n", row.name, row.seconds, 100.0 * row.seconds / whole);
  return text + fmt::format("{:<28}{:>12.3f}{:>10.1f}\n", "total", whole, 100.0);
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
  const double bytes = peak_memory();
  const auto n_grains = static_cast<double>(std::max<std::uint64_t>(simulation.n_born(), 1));
  text += fmt::format("memory: {} in grains, pairs and contacts; peak memory: {} ({:.0f} bytes a grain)\n",
                      bytes_text(simulation.memory()), bytes_text(bytes), bytes / n_grains);
  text += fmt::format("results: {}\n", directory);
  return text + fmt::format("state hash: {}", simulation.state_hash().text());
}

}  // namespace moraine
