// The text of a scene as it is run. Private to io/scene_toml.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "io/scene_toml/document.hpp"

namespace moraine::scene_toml {

/// The text with overrides (which must apply) and absolute file names written into it, everything else left as it
/// stands.
std::string write_as_run(const std::string& text, const std::vector<std::string>& overrides,
                         const std::filesystem::path& base);

/// Where a document names files.
std::vector<Path> file_keys(const Node& root);

}  // namespace moraine::scene_toml
