// A network as a small TOML file: name, latency [s], bandwidth [bytes/s].
#pragma once

#include <filesystem>

#include "engine/run/projection.hpp"

namespace moraine {

/// InfiniBand QDR, as in examples/networks/infiniband_qdr_40gbps.toml.
Network default_network();

/// Throws SceneFileError where the file is not TOML, UsageError where a key is missing, unknown or out of range, StorageError where the
/// file cannot be read.
Network read_network(const std::filesystem::path& file);

}  // namespace moraine
