// From the grains of the ranks, in order of memory, to the rows of an image, in order of gid, and back.
#pragma once

#include "comm/world.hpp"
#include "engine/contacts/contacts.hpp"
#include "engine/particles/particles.hpp"
#include "engine/run/image.hpp"

namespace moraine {

/// Appends the given fields of the grains that are here, in order of gid.
void gather_fields(const Particles& particles, const std::vector<Field>& fields, Image& image);
/// Appends what contacts remember, in order, each once over all ranks.
void gather_memory(const Particles& particles, const Contacts& contacts, Image& image);

/// What gather_memory has gathered, by the present places of the grains; alone only.
PairCarry carry_by_place(const Particles& particles, const Image& image);

/// Brings rows that lie on any ranks into the order of an image: consecutive over the ranks, about as many on each. `n_gids`: gids ever
/// given. Sets n_grains. All ranks call it.
void share_out_rows(const World& world, std::uint64_t n_gids, Image& image);

/// Puts the rows that this rank holds into storage, and sorts what their contacts remember by place. With several ranks a pair stands at
/// both its grains, wherever their rows lie. Throws SceneError where the image does not hold what the scene needs. All ranks call it.
void put_rows(const World& world, const Image& image, Particles& particles, PairCarry& pairs, WallCarry& walls);

}  // namespace moraine
