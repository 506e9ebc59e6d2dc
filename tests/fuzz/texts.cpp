// Texts that people write: scenes, meshes, tables, networks, and what surrounds a run.
#include <algorithm>
#include <array>

#include "engine/run/plan.hpp"
#include "engine/run/simulation.hpp"
#include "engine/walls/walls.hpp"
#include "io/cli/check_command.hpp"
#include "io/cli/job_script.hpp"
#include "io/cli/launch.hpp"
#include "io/cli/layout.hpp"
#include "io/cli/network_file.hpp"
#include "io/cli/terminal.hpp"
#include "io/files/files.hpp"
#include "io/scene_toml/scene_toml.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace moraine::fuzz {

namespace {

/// A few grains and cells: the scene is worth two steps.
bool is_small(const Scene& scene) {
  const Plan plan = make_plan(scene, 1);
  double cells = 1.0;
  if (scene.gas)
    for (const int n : scene.gas->cells) cells *= n;
  return plan.n_grains <= 400 && cells <= 4000.0;
}

void take_steps(const Scene& scene) {
  Simulation simulation(scene, 1);
  for (int i = 0; i < 2; ++i) simulation.step();
  static_cast<void>(simulation.state_hash());
}

/// Lines after the first zero byte.
std::vector<std::string> overrides_in(std::string_view text) {
  std::vector<std::string> lines;
  const std::size_t zero = text.find('\0');
  if (zero == std::string_view::npos) return lines;
  for (std::size_t at = zero + 1; at < text.size() && lines.size() < 8;) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    lines.emplace_back(text.substr(at, end - at));
    at = end + 1;
  }
  return lines;
}

}  // namespace

void fuzz_scene(Bytes bytes) {
  const std::string_view text = Source(bytes).rest();
  static const std::filesystem::path tetrahedron =
      put("some.obj", "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n");
  static const std::filesystem::path grains = put("some.csv", "x,y,z,d\n0.05,0.05,0.05,0.01\n0.07,0.05,0.05,0.01\n");
  const std::filesystem::path path = put("scene.toml", text.substr(0, text.find('\0')));
  const std::vector<std::string> overrides = overrides_in(text);
  try {
    static_cast<void>(check_text(path, overrides, std::nullopt));
    static_cast<void>(scene_as_run(path, overrides));
    const Scene scene = read_scene(path, overrides);
    if (is_small(scene)) take_steps(scene);
  } catch (const SceneFileError&) {
  } catch (const SceneError&) {
  } catch (const RunError&) {
  } catch (const UsageError&) {}
}

void fuzz_mesh(Bytes bytes) {
  Source source(bytes);
  const std::filesystem::path path = put(source.byte() % 2 == 0 ? "a.stl" : "a.obj", source.rest());
  try {
    WallDefinition wall;
    wall.name = "wall";
    wall.shape = MeshShape{path.string(), load_mesh(path)};
    static_cast<void>(inspect(std::get<MeshShape>(wall.shape).mesh));
    Scene scene;
    scene.domain.high = {1.0, 1.0, 1.0};
    scene.walls.push_back(std::move(wall));
    const Walls walls(scene);
    static_cast<void>(walls.area(0, scene.domain.box()));
  } catch (const FileError&) {
  } catch (const SceneError&) {}
}

void fuzz_grains(Bytes bytes) {
  constexpr std::array<const char*, 4> names = {"a.csv", "a.txt", "a.csv.gz", "a.h5"};
  Source source(bytes);
  const std::filesystem::path path = put(names[source.below(3)], source.rest());
  GrainFileContext context;
  context.materials = {"glass", "steel"};
  try {
    static_cast<void>(load_grains(path, context));
  } catch (const FileError&) {}
}

void fuzz_network(Bytes bytes) {
  try {
    static_cast<void>(read_network(put("network.toml", Source(bytes).rest())));
  } catch (const UsageError&) {
  } catch (const SceneFileError&) {}
}

void fuzz_environment(Bytes bytes) {
  constexpr std::array<const char*, 5> variables = {"SLURM_STEP_NUM_TASKS", "SLURM_PROCID", "SLURM_JOB_NUM_NODES",
                                                    "MORAINE_TERMINAL", "SLURM_NTASKS"};
  std::string text(Source(bytes).rest());
  std::replace(text.begin(), text.end(), '\0', ' ');
  std::array<std::string, 5> lines;
  for (std::size_t i = 0, at = 0; i < lines.size() && at < text.size(); ++i) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    lines[i] = text.substr(at, end - at);
    at = end + 1;
  }
  for (std::size_t i = 0; i < lines.size(); ++i) setenv(variables[i], lines[i].c_str(), 1);
  static_cast<void>(stray_tasks());
  static_cast<void>(this_place());
  static_cast<void>(terminal_width());
  for (const char* variable : variables) unsetenv(variable);
  const auto try_all = [&](auto&& parse) {
    for (const std::string& line : lines) try {
        parse(line);
      } catch (const UsageError&) {}
  };
  try_all([](const std::string& line) { static_cast<void>(parse_layout(line).text()); });
  try_all([](const std::string& line) { static_cast<void>(parse_time_limit(line)); });
  try_all([](const std::string& line) { static_cast<void>(parse_memory(line)); });
}

}  // namespace moraine::fuzz
