// What a scene says about sweeps of speed against error: its table [pareto]. A run has no use for it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace moraine {

/// Another way to run the scene, such as with another contact law.
struct ParetoVariant {
  std::string name;
  std::vector<std::string> set;  // "key=value", as for --set
};

struct ParetoTable {
  std::optional<double> end;            // [s] to which each run goes; none: time.end
  double from = 0.0;                    // [s] averages of statistics begin here
  std::vector<std::string> statistics;  // "probe.column": averages over time are compared
  std::vector<std::string> values;      // "probe.column": rows are compared one by one
  std::vector<double> steps_per_contact = {10.0, 20.0, 50.0, 100.0};
  std::optional<double> reference;     // steps in the shortest contact of the reference; none: twice the most of those
  std::vector<double> skins;           // [m]; none: 0.05 and 0.2 of the mean diameter
  std::vector<double> gas_steps;       // [s]; none: half and twice that of the scene
  std::vector<double> gas_tolerances;  // [-]; none: 100 and 10 000 times that of the scene
  double accept = 0.01;                // [-] an error that a recommended setting may have
  std::vector<ParetoVariant> variants;
};

/// The table of a scene that read_scene() accepts; defaults where it has none. Throws SceneFileError.
ParetoTable read_pareto(const std::filesystem::path& file, const std::vector<std::string>& overrides = {});

/// The scene with its overrides, without comments and without what is only for commands that look at it from outside
/// ([pareto], [scale]): equal for scenes that run alike. Throws SceneFileError.
std::string scene_without_studies(const std::filesystem::path& file, const std::vector<std::string>& overrides = {});

}  // namespace moraine
