// The terminal behind this process.
#pragma once

#include <cstddef>
#include <optional>

namespace moraine {

/// The environment variable by which a program tells its ranks the width of the terminal behind mpirun.
inline constexpr const char* terminal_variable = "MORAINE_TERMINAL";

/// Width of the terminal that stderr goes to, also through mpirun; nothing where it is none.
std::optional<std::size_t> terminal_width();

}  // namespace moraine
