// A scene as a script holds it: checked, with the text that repeats it.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "comm/world.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

struct ScriptScene {
  std::string text;                      // as run: with changes and absolute file names
  std::vector<std::string> warnings;     // doubts of the scene's check
  std::shared_ptr<const Scene> content;  // never changed; shared by the runs made from it
};

/// Throw SceneFileError. All ranks.
ScriptScene scene_from_file(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                            const World& world);
/// `has_lines`: the text is one that the user knows, so that messages name its lines.
ScriptScene scene_from_text(const std::string& text, const std::string& name, const std::vector<std::string>& overrides,
                            const std::filesystem::path& base, bool has_lines, const World& world);

}  // namespace moraine
