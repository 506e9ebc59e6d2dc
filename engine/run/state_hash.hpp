// One number for the whole state, the same on every layout.
#pragma once

#include <cstdint>
#include <span>

#include "comm/world.hpp"
#include "engine/contacts/contacts.hpp"
#include "engine/particles/particles.hpp"
#include "engine/run/gas_phase.hpp"
#include "engine/run/image.hpp"

namespace moraine {

/// Hash of the mechanical state: step, all grains (fields that travel, but for what was dissipated), and what contacts remember, what
/// the run remembers besides (`remembered`, the same on all ranks), and what the gas remembers (gas: nullptr without).
/// Each grain, contact and line of gas cells is hashed by itself, keyed by gid or place (XXH3, 128 bits), and the hashes are added, so that neither
/// order nor share of the grains matters. All ranks call it.
Hash128 state_hash(const World& world, const Particles& particles, const Contacts& contacts, std::uint64_t step,
                   std::span<const double> remembered, GasPhase* gas);

}  // namespace moraine
