// Scene files: TOML to the plain structs of engine/scene, with every error collected and located.
#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "comm/world.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

/// Something wrong, or doubtful, with a scene file, and where.
struct SceneMessage {
  std::string origin;   // name of the file as given, or "--set 3" for the third override
  int line = 0;         // from 1; 0: no line
  int column = 0;       // from 1; 0: no column
  std::string key;      // path such as "particles[0].diameter"; empty for errors of the file as a whole
  std::string value;    // as written in the file, shortened; empty: not there, or told by the message
  std::string message;  // what is wrong, what was expected, the cure
  bool is_warning = false;
  /// One line: FILE:LINE: key "KEY" = VALUE: MESSAGE
  std::string text() const;
};

/// A scene file that cannot be run. what() lists every problem, one a line.
struct SceneFileError : std::runtime_error {
  explicit SceneFileError(std::vector<SceneMessage> found);
  std::vector<SceneMessage> problems;
};

/// Reads a scene file, changed by `overrides` ("key=value", see README), loads the files it names (relative to its own
/// directory), and validates it. Throws SceneFileError with all problems. Warnings are appended to `warnings`.
/// All ranks of `world` call it, and find the same problems. Only the first opens the scene and its meshes; lists of
/// grains they share, so that none holds a list whole where the scene has nothing but lists (else the first has them
/// whole). A Simulation of such a scene must be made with the same `world`.
Scene read_scene(const std::filesystem::path& file, const std::vector<std::string>& overrides = {},
                 std::vector<SceneMessage>* warnings = nullptr, const World& world = {});

/// The same for a text; `name` stands in messages, `base_directory` is where relative file names start.
Scene read_scene_text(const std::string& text, const std::string& name, const std::vector<std::string>& overrides = {},
                      const std::filesystem::path& base_directory = {}, std::vector<SceneMessage>* warnings = nullptr,
                      const World& world = {});

/// The text of a scene with its overrides applied and its file names made absolute, comments kept. It reads back to the
/// same scene from anywhere. Stored in the run directory and in checkpoints. Throws SceneFileError where the text
/// cannot be parsed or an override does not fit; does not check anything else.
std::string scene_as_run(const std::filesystem::path& file, const std::vector<std::string>& overrides = {});
std::string scene_text_as_run(const std::string& text, const std::string& name,
                              const std::vector<std::string>& overrides = {},
                              const std::filesystem::path& base_directory = {});

/// The overrides by which a scene becomes `factor` times as large, by its own rule (scale.weak); none for 1. Throws
/// SceneFileError where it has no rule, and says what to add; or where an override does not fit.
std::vector<std::string> growth_overrides(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                                          int factor);

/// The files that a scene names, absolute. Throws SceneFileError as scene_as_run() does.
std::vector<std::filesystem::path> files_of_scene(const std::filesystem::path& file,
                                                  const std::vector<std::string>& overrides = {});

/// Every key of a scene file, as markdown tables: name, type, unit, default, meaning.
std::string scene_key_reference();

}  // namespace moraine
