// Which program this is.
#pragma once

#include <string>

namespace moraine {

std::string program_version();  // "0.1.0"
std::string program_commit();   // of the source; "unknown" outside a repository
/// Version, commit, compiler and build type, one line.
std::string program_identity();

}  // namespace moraine
