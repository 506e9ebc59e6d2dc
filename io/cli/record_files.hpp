// Where flight records lie in a run's directory.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "comm/world.hpp"
#include "engine/run/simulation.hpp"

namespace moraine {

/// With what the names of a record's files begin. `subject`: of a warning; empty for that of a stop.
std::string record_stem(const std::string& subject);

/// Writes what a record holds: STEM.csv (grains), STEM_cells.csv and STEM_gas.csv, of several ranks with their number. Returns the files
/// written; what cannot be is left.
std::vector<std::filesystem::path> write_record(const std::filesystem::path& directory, const FlightRecord& record,
                                                const World& world);

}  // namespace moraine
