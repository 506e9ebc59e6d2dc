// Migration: grains go to the ranks whose boxes they lie in, with all that they are and all that their contacts remember.
#pragma once

#include "comm/subdomains.hpp"
#include "comm/world.hpp"
#include "engine/contacts/pair_list.hpp"
#include "engine/contacts/wall_contacts.hpp"
#include "engine/particles/particles.hpp"

namespace moraine {

/// Marks the grains that lie in other ranks' boxes; empty where there are none, or where the world is alone.
std::vector<std::uint8_t> leaving_grains(const World& world, const Subdomains& subdomains, const Particles& particles);

/// Hands the marked grains over. `pairs` and `walls` are by present places, before and after; pairs of marked grains must stand at both
/// their grains. Grains that have left the scene are dropped. All ranks call it; returns the number of grains that this one gave away.
/// `has_further`: pairs remember more than their springs, on every rank.
std::size_t migrate(const World& world, const Subdomains& subdomains, std::span<const std::uint8_t> is_leaving,
                    bool has_further, Particles& particles, PairCarry& pairs, WallCarry& walls, int n_threads);

}  // namespace moraine
