// What the grains of a run have in common, those that inlets are still to give among them.
#pragma once

#include "comm/world.hpp"
#include "engine/contacts/contacts.hpp"
#include "engine/particles/particles.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

/// Of the grains of all ranks, which call it together, and of those to come. Each rank gives its own; where there are none at all, nothing is
/// said of any (GrainKind as it is made). The run calls it once, before it makes its contacts.
GrainKind kind_of(const World& world, const Scene& scene, const Particles& particles);

}  // namespace moraine
