// Where the energy is and where it went.
//
// Leapfrog keeps velocities half a step before positions. The ledger is taken at the positions: kinetic energy with the
// velocities advanced by half a kick, elastic energy at the present overlaps, losses summed over the steps up to
// the present positions, so that what it leaves open falls with the time step
// (measured: in proportion to it, for dense beds).
#pragma once

#include "comm/world.hpp"
#include "engine/contacts/contacts.hpp"
#include "engine/particles/particles.hpp"

namespace moraine {

/// Energies [J]; `error` is what the ledger does not explain.
struct EnergyLedger {
  double kinetic = 0.0;
  double rotational = 0.0;
  double elastic_normal = 0.0;
  double elastic_tangential = 0.0;
  double potential = 0.0;
  double lost_normal = 0.0;      // to normal dashpots
  double lost_tangential = 0.0;  // to tangential dashpots
  double lost_friction = 0.0;
  double lost_drag = 0.0;  // to bulk viscosity and the gas; less than nothing where it drives the grains
  double left = 0.0;       // carried out through outlets
  double wall_work = 0.0;  // done by moving walls
  double initial = 0.0;    // total at the start of the run
  double total() const { return kinetic + rotational + elastic_normal + elastic_tangential + potential; }
  double lost() const { return lost_normal + lost_tangential + lost_friction + lost_drag + left; }
  double error() const { return total() + lost() - initial - wall_work; }
};

/// The energies at the present positions, given the velocities there; `initial`, `left` and `wall_work` stay zero. `damping` is the bulk
/// viscosity [1/s]. The same on every layout: all sums are exact. All ranks call it.
EnergyLedger take_ledger(const World& world, const Particles& particles, const Contacts& contacts,
                         const Contacts::Velocities& now, Vec3 gravity, double damping, double dt);

}  // namespace moraine
