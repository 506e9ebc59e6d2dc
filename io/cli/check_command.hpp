// moraine check: what a scene will be run with, without running it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace moraine {

/// Title, grains, sizes, domain, materials, time step and what limits it, memory, time, kernels, walls, as text.
/// `refusal`, where wanted: why it cannot be run here, for it takes more memory than there is; else left as it is.
/// Throws SceneFileError or SceneError with every problem, UsageError for the layout.
std::string check_text(const std::filesystem::path& scene_file, const std::vector<std::string>& overrides,
                       const std::optional<std::string>& layout, std::string* refusal = nullptr);

}  // namespace moraine
