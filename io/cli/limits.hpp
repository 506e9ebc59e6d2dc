// Limits of this process (ulimit) under which mpirun does not start ranks, and waits for ever: how much it takes, told before.
#pragma once

#include <cstdint>

namespace moraine {

/// Lifts the soft limit towards the hard one, as far as any run needs; children inherit it.
void allow_many_files();

/// What mpirun needs for so many ranks on this machine, beside what it is handed down: below that it does not start them and does not end.
std::uint64_t files_of_mpirun(int n_ranks);
/// What a rank needs to find the others and to write.
inline constexpr std::uint64_t files_of_rank = 32;

/// Throws UsageError that names limit, need and cure where mpirun may not open enough files for so many ranks.
void expect_files_for_mpirun(int n_ranks);
/// The same, where files may not be as large as the memory that ranks of one machine share (ulimit -f).
void expect_shared_memory();
/// The same for this process as a rank.
void expect_files_for_rank();

}  // namespace moraine
