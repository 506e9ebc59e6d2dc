// Work on files that all ranks do together: it succeeds on all of them or fails on all of them, with the same words.
#pragma once

#include <filesystem>
#include <functional>

#include "comm/world.hpp"

namespace moraine {

/// Does one stage of such work on every rank, and then tells whether it has succeeded on all. Where it has failed on
/// any, all ranks throw the StorageError of the first that failed (of other exceptions the text, in the name of
/// `path`). The stage must not wait for other ranks, unless it does so whether it fails or not. All ranks call it;
/// alone it is just the stage.
void agree(const World& world, const std::filesystem::path& path, const std::function<void()>& stage);

/// The same for a stage that only the root does.
void agree_on_root(const World& world, const std::filesystem::path& path, const std::function<void()>& stage);

}  // namespace moraine
