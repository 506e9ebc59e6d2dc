// What a checkpoint or snapshot holds, for a person at a terminal.
#pragma once

#include <filesystem>
#include <string>

namespace moraine {

/// Kind, step, time, domain, grains, fields with least and greatest values, contacts, state hash. Throws StorageError.
std::string describe(const std::filesystem::path& path);

}  // namespace moraine
