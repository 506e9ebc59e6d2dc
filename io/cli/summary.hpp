// What a run says at its end.
#pragma once

#include <string>
#include <vector>

#include "engine/run/simulation.hpp"

namespace moraine {

/// Where the time of this process went.
struct RunTimes {
  double start = 0.0;     // [s] filling the scene, or reading the checkpoint
  double stepping = 0.0;  // [s]
  double outputs = 0.0;   // [s]
  double particle_steps = 0.0;
  std::uint64_t n_steps = 0;  // of this process
};

/// Table of phases, speed, grains, memory; ends in "state hash: ...". With several ranks the phases are means, with the
/// largest beside them, and memory is that of all. All ranks of the simulation call it; the text is the root's.
std::string summary(const Simulation& simulation, const RunTimes& times, const std::string& directory,
                    const std::string& layout);

/// Most memory that this process has held so far [bytes].
double peak_memory();

}  // namespace moraine
