#include "io/python/script_scene.hpp"

#include "io/scene_toml/scene_toml.hpp"

namespace moraine {

namespace {

std::vector<std::string> texts_of(const std::vector<SceneMessage>& messages) {
  std::vector<std::string> texts;
  for (const SceneMessage& message : messages) texts.push_back(message.text());
  return texts;
}

void forget_lines(std::vector<SceneMessage>& messages) {
  for (SceneMessage& message : messages) message.line = message.column = 0;
}

}  // namespace

ScriptScene scene_from_file(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                            const World& world) {
  std::vector<SceneMessage> warnings;
  ScriptScene scene;
  scene.content = std::make_shared<const Scene>(read_scene(file, overrides, &warnings, world));
  scene.text = scene_as_run(file, overrides);
  scene.warnings = texts_of(warnings);
  return scene;
}

ScriptScene scene_from_text(const std::string& text, const std::string& name, const std::vector<std::string>& overrides,
                            const std::filesystem::path& base, bool has_lines, const World& world) {
  try {
    std::vector<SceneMessage> warnings;
    ScriptScene scene;
    scene.content = std::make_shared<const Scene>(
        read_scene_text(text, name, overrides, std::filesystem::absolute(base), &warnings, world));
    scene.text = scene_text_as_run(text, name, overrides, base);
    if (!has_lines) forget_lines(warnings);
    scene.warnings = texts_of(warnings);
    return scene;
  } catch (SceneFileError& error) {
    if (has_lines) throw;
    forget_lines(error.problems);
    throw SceneFileError(error.problems);
  }
}

}  // namespace moraine
