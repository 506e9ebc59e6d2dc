// Probes: time series of what happens in a part of the scene.
#pragma once

#include <string>
#include <vector>

#include "comm/world.hpp"
#include "engine/openings/inlets.hpp"
#include "engine/run/census.hpp"
#include "engine/run/gas_probes.hpp"
#include "engine/run/ledger.hpp"
#include "engine/scene/scene.hpp"
#include "engine/walls/walls.hpp"

namespace moraine {

/// What a probe may look at.
struct ProbeView {
  const World& world;
  const Scene& scene;
  const Walls& walls;
  const Particles& particles;
  const Contacts& contacts;
  double dt = 0.0;             // [s]
  const EnergyLedger* energy;  // nullptr where the scene keeps none
  Census census;
  const Inlets* inlets;
  double time = 0.0;             // [s]
  const GasView* gas = nullptr;  // nullptr where the scene has none
};

/// Column names with units, the time not among them.
std::vector<std::string> probe_columns(const Scene& scene, const Probe& probe);
/// Values of the columns, the same on all ranks, which call it together. `last` is the probe's own memory from row to row (time and mass left), kept through restarts.
std::vector<double> probe_row(const ProbeView& view, const Probe& probe, std::vector<double>& last);

}  // namespace moraine
