// Directories inside one that must be there.
#pragma once

#include <filesystem>

namespace moraine {

/// Makes a directory in one that must be there: what has been moved away must not be made anew, empty. Throws
/// StorageError.
void make_subdirectory(const std::filesystem::path& path);

}  // namespace moraine
