// The CPUs that this process was started with, noted before anything can change them.
#pragma once

#include <sched.h>

#include <cstddef>

namespace moraine {

inline constexpr std::size_t most_cpus = 1 << 14;
inline constexpr std::size_t cpu_set_bytes = most_cpus / 8;

/// `cpu_set_bytes` of them; all zero where they could not be read.
const cpu_set_t* cpus_at_start();

}  // namespace moraine
