// Speed against error: the ways to run a scene that a sweep tries.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "engine/scene/scene.hpp"
#include "io/scene_toml/pareto.hpp"

namespace moraine {

/// What a setting changes of the scene.
enum class ParetoKind { reference, scene, time_step, skin, precision, gas_step, gas_tolerance, variant, product };
const char* word_for(ParetoKind kind);

/// One way to run the scene.
struct ParetoSetting {
  ParetoKind kind = ParetoKind::scene;
  std::string id;    // names its runs
  std::string name;  // in tables: "20 steps a contact"
  std::vector<std::string> overrides;
  double time_step = 0.0;          // [s]
  double steps_per_contact = 0.0;  // [-]
};

/// How runs are compared.
enum class ParetoMeasure { paths, statistics };

/// What a sweep needs to know before anything is run.
struct ParetoPlan {
  Scene scene;  // as it is
  ParetoTable table;
  ParetoMeasure measure = ParetoMeasure::paths;
  double end = 0.0;                     // [s] of each run
  double sample = 0.0;                  // [s] between two looks at the paths; 0: none
  std::vector<ParetoSetting> settings;  // the reference first
  std::vector<std::string> remarks;     // what is not tried, and why
};

/// `is_product`: every time step with every precision and variant, not only one change at a time. Throws SceneFileError,
/// UsageError.
ParetoPlan plan_pareto(const std::filesystem::path& scene_file, const std::vector<std::string>& overrides,
                       bool is_product);

/// The changes by which the scene is repeated with other random numbers; `repeat` 1 is the scene itself. Groups without any
/// random velocity get a very small one, so that repeats part.
std::vector<std::string> repeat_overrides(const Scene& scene, int repeat);

/// A column of a probe that the scene names.
struct ProbeColumn {
  std::string text;  // as the scene has it
  std::string probe, column;
  std::string file_column;  // as in the head of the file
};
/// Finds "probe.column"; the unit may be left out. Throws UsageError that lists what there is.
ProbeColumn find_column(const Scene& scene, const std::string& text, const std::string& key);

}  // namespace moraine
