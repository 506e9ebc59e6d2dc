// Files that consist of one file per rank and one in front, NAME.h5, that names them and shows their rows as its own:
//   NAME.h5    NAME.rank-0000.5bd1aa03.h5    NAME.rank-0001.90c37e11.h5    ...
// The last word of a rank's file is the beginning of its seal, so that a file written anew with other content never
// touches those that the old NAME.h5 still needs, and one with the same content replaces them by the same bits.
#pragma once

#include <cstddef>
#include <filesystem>

#include "io/checkpoint/seal.hpp"

namespace moraine {

/// Where a rank writes before its seal is known: NAME.rank-0003.h5 (and .tmp behind it, see temporary_name()).
std::filesystem::path rank_file_draft(const std::filesystem::path& path, int rank);

/// The name that it takes then: NAME.rank-0003.5bd1aa03.h5.
std::filesystem::path rank_file_name(const std::filesystem::path& path, int rank, Hash128 seal);

/// Removes the files of ranks that no file in front needs (`path`, or `path`.old, which has been set aside): what an
/// interrupted write or a replaced file has left. Those of a file in front that is damaged stay. One process calls it.
void remove_stale_rank_files(const std::filesystem::path& path);

/// The same for all files in a directory.
void remove_all_stale_rank_files(const std::filesystem::path& directory);

/// Removes a file and, where it consists of several, those of its ranks. Throws StorageError where it is there and
/// cannot be removed.
void remove_with_rank_files(const std::filesystem::path& path);

}  // namespace moraine
