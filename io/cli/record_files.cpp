#include "io/cli/record_files.hpp"

#include <fmt/format.h>

#include "io/checkpoint/durable_file.hpp"

namespace moraine {

namespace fs = std::filesystem;

std::string record_stem(const std::string& subject) {
  return subject.empty() ? "flight_record" : "flight_record_" + subject;
}

std::vector<fs::path> write_record(const fs::path& directory, const FlightRecord& record, const World& world) {
  std::vector<fs::path> written;
  const std::string rank = world.is_alone() ? "" : fmt::format(".rank-{:04}", world.rank());
  const auto write = [&](const char* part, const std::string& text) {
    if (text.empty()) return;
    const fs::path path = directory / (record_stem(record.subject) + part + rank + ".csv");
    try {
      write_file(path, text);
      written.push_back(path);
    } catch (const StorageError&) {}
  };
  write("", record.grains);
  write("_cells", record.gas_cells);
  write("_gas", record.gas_steps);
  return written;
}

}  // namespace moraine
