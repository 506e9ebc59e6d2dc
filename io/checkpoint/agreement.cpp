#include "io/checkpoint/agreement.hpp"

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "io/checkpoint/durable_file.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

std::optional<StorageError> failure_of(const fs::path& path, const std::function<void()>& stage) {
  try {
    stage();
  } catch (const StorageError& error) {
    return error;
  } catch (const std::exception& error) {
    return StorageError(path, error.what());
  }
  return std::nullopt;
}

}  // namespace

void agree(const World& world, const fs::path& path, const std::function<void()>& stage) {
  if (world.is_alone()) return stage();
  const std::optional<StorageError> failure = failure_of(path, stage);
  const auto size = static_cast<std::uint64_t>(world.size());
  // Larger for earlier ranks, so that the largest names the first that failed.
  std::uint64_t first[] = {failure ? size - static_cast<std::uint64_t>(world.rank()) : 0};
  world.max(std::span<std::uint64_t>(first));
  if (first[0] == 0) return;
  const int rank = static_cast<int>(size - first[0]);
  std::string name = failure ? failure->path.string() : std::string();
  std::string problem = failure ? failure->problem : std::string();
  world.broadcast(name, rank);
  world.broadcast(problem, rank);
  throw StorageError(name, problem);
}

void agree_on_root(const World& world, const fs::path& path, const std::function<void()>& stage) {
  agree(world, path, [&] {
    if (world.is_root()) stage();
  });
}

}  // namespace moraine
