// What a run shows of itself on its way, bit by bit, to be compared with another.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "engine/run/simulation.hpp"

namespace moraine::trace {

/// Doubles compared by their bits, printed by their values.
struct Bits {
  std::vector<double> values;
  bool operator==(const Bits& other) const {
    return values.size() == other.values.size() &&
           (values.empty() || std::memcmp(values.data(), other.values.data(), values.size() * sizeof(double)) == 0);
  }
};

inline Bits ledger_bits(const EnergyLedger& e) {
  return {{e.kinetic, e.rotational, e.elastic_normal, e.elastic_tangential, e.potential, e.lost_normal,
           e.lost_tangential, e.lost_friction, e.lost_drag, e.left, e.wall_work, e.initial}};
}

struct Moment {
  std::uint64_t step = 0;
  std::string hash;
  std::uint64_t n_born = 0, n_left = 0, n_inside = 0;
  std::vector<Bits> probes;
  Bits ledger;
};

/// The values of all ranks, one rank after the other, on all ranks.
inline std::vector<double> whole(const World& world, const std::vector<double>& own) {
  if (world.is_alone()) return own;
  std::string bytes(reinterpret_cast<const char*>(own.data()), own.size() * sizeof(double)), all;
  for (const std::string& of_rank : world.gather_at_root(bytes)) all += of_rank;
  world.broadcast(all);
  std::vector<double> values(all.size() / sizeof(double));
  if (!all.empty()) std::memcpy(values.data(), all.data(), all.size());
  return values;
}

/// What the run shows on grids and triangles: coarse-grained fields, then force maps. They begin anew now and then, as in a run that writes them.
inline void look_at_fields(Simulation& simulation, const Image& snapshot, Moment& moment) {
  const std::vector<Probe>& probes = simulation.scene().output.probes;
  const bool begins = simulation.step_number() % 750 == 0;
  for (std::size_t k = 0; k < probes.size(); ++k) {
    if (probes[k].kind != Probe::Kind::fields) continue;
    for (const GridArray& array : simulation.fields(k).arrays)
      moment.probes.push_back({whole(simulation.world(), array.values)});
    if (begins) simulation.begin_fields(k);
  }
  for (const WallMap& map : snapshot.maps)
    for (const std::vector<double>& values : {map.corners, map.force, map.pressure, map.shear})
      moment.probes.push_back({values});
  if (begins) simulation.begin_force_maps();
}

inline Moment look(Simulation& simulation) {
  Moment moment;
  moment.step = simulation.step_number();
  moment.hash = simulation.state_hash().text();
  const Image snapshot = simulation.snapshot();
  moment.n_inside = snapshot.n_grains;  // several ranks count here
  moment.n_born = simulation.n_born();
  moment.n_left = simulation.n_left();
  for (std::size_t k = 0; k < simulation.scene().output.probes.size(); ++k)
    moment.probes.push_back({simulation.probe_row(k)});
  look_at_fields(simulation, snapshot, moment);
  if (simulation.scene().output.energy) moment.ledger = ledger_bits(simulation.energy());
  return moment;
}

/// Moves the walls of scenes::driven(): the lid up and down, asked in each step; the blade about a moving point and tilting, asked every 7 steps.
inline void drive(Simulation& simulation) {
  simulation.set_wall_motion("lid", [](double t) {
    return WallRates{{0.0, 0.0, -0.2 * std::sin(60.0 * t)}, {0.0, 0.0, 2.0}};
  });
  simulation.set_wall_motion(
      "blade",
      [](double t) {
        return WallRates{{0.1 * std::cos(25.0 * t), 0.1 * std::sin(25.0 * t), 0.0},
                         {std::sin(40.0 * t), 0.0, 10.0 * std::cos(9.0 * t)}};
      },
      7);
}

/// Moments of a run of n steps, every so many.
inline std::vector<Moment> record(Simulation& simulation, int n_steps, int every) {
  std::vector<Moment> moments{look(simulation)};
  for (int i = 1; i <= n_steps; ++i) {
    simulation.step();
    if (i % every == 0) moments.push_back(look(simulation));
  }
  return moments;
}
inline std::vector<Moment> record(const Scene& scene, int n_threads, int n_steps, int every) {
  Simulation simulation(scene, n_threads);
  return record(simulation, n_steps, every);
}

/// The first difference between two runs, in words; empty where there is none.
inline std::string difference(const std::vector<Moment>& x, const std::vector<Moment>& y) {
  if (x.size() != y.size()) return "different numbers of moments";
  for (std::size_t k = 0; k < x.size(); ++k) {
    const std::string at = "step " + std::to_string(x[k].step) + ": ";
    if (x[k].step != y[k].step) return at + "the other is at step " + std::to_string(y[k].step);
    if (x[k].hash != y[k].hash) return at + "hash " + x[k].hash + " and " + y[k].hash;
    if (x[k].n_left != y[k].n_left || x[k].n_inside != y[k].n_inside) return at + "numbers of grains";
    if (x[k].probes.size() != y[k].probes.size()) return at + "numbers of probes";
    for (std::size_t p = 0; p < x[k].probes.size(); ++p)
      if (!(x[k].probes[p] == y[k].probes[p])) return at + "probe " + std::to_string(p);
    if (!(x[k].ledger == y[k].ledger)) {
      for (std::size_t v = 0; v < x[k].ledger.values.size(); ++v)
        if (x[k].ledger.values[v] != y[k].ledger.values[v]) return at + "ledger entry " + std::to_string(v);
      return at + "ledger";
    }
  }
  return "";
}

/// The first difference between two images, in words.
inline std::string difference(const Image& x, const Image& y) {
  if (x.step != y.step || x.time != y.time || x.time_step != y.time_step) return "clock";
  if (x.n_grains != y.n_grains) return "number of grains";
  if (x.fields.size() != y.fields.size()) return "number of fields";
  for (std::size_t k = 0; k < x.fields.size(); ++k) {
    const std::string name(info(x.fields[k].field).name);
    if (x.fields[k].field != y.fields[k].field || x.fields[k].gids != y.fields[k].gids ||
        x.fields[k].indices != y.fields[k].indices || !(Bits{x.fields[k].reals} == Bits{y.fields[k].reals}))
      return "field " + name;
  }
  if (x.pairs != y.pairs)
    return "pair history (" + std::to_string(x.pairs.size()) + " and " + std::to_string(y.pairs.size()) + ")";
  if (x.further != y.further) return "rolling and bonds of pairs";
  if (x.walls != y.walls)
    return "wall history (" + std::to_string(x.walls.size()) + " and " + std::to_string(y.walls.size()) + ")";
  for (std::size_t k = 0; k < x.grids.size(); ++k)
    if (x.grids.size() != y.grids.size() || x.grids[k].name != y.grids[k].name || x.grids[k].n != y.grids[k].n ||
        !(Bits{x.grids[k].values} == Bits{y.grids[k].values}))
      return "gas " + x.grids[k].name;
  for (std::size_t k = 0; k < std::max(x.sums.size(), y.sums.size()); ++k)
    if (x.sums.size() != y.sums.size() || x.sums[k].name != y.sums[k].name || x.sums[k].n != y.sums[k].n ||
        !(Bits{x.sums[k].values} == Bits{y.sums[k].values}))
      return "sums of fields";
  if (x.maps != y.maps) return "force maps";
  if (x.accumulators != y.accumulators) return "accumulators";
  if (!(x.hash == y.hash)) return "hash";
  return "";
}

}  // namespace moraine::trace
