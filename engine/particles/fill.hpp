// Grains at birth: the groups of a scene as a list of seeds, in the order in which gids are given.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "comm/world.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

struct FillReport {
  std::string text;  // one line a group: how many grains, solid fraction reached
};

/// All grains of the scene in order of birth. Depends on the scene only (never on threads). Throws SceneError, for
/// example where a solid fraction cannot be reached or a grain of a file lies outside the domain.
///
/// - Random fills and lattices overlap nothing: no grain of this or an earlier group, no wall that stands at the start, no
///   face of their region (but they lie across the faces of a periodic direction that the region spans). Lattice sites that
///   earlier grains take are left out. Consecutive random fills of one region are packed together, as a mixture.
/// - A solid fraction is met as closely as whole grains can. Two-dimensional grains lie in the middle of the domain's depth.
/// - Velocity deviations are normal and sum up to no momentum: each group has its mass times its velocity, to round-off.
/// - Listed grains keep their places (brought into the domain where it is periodic). They take the group's material unless
///   that is empty, and the group's velocities unless the list has them. Where the lists are scattered over the
///   ranks of `world`, all ranks call it, and each gets the grains of its share.
std::vector<GrainSeed> make_grains(const Scene& scene, int n_threads, FillReport* report = nullptr,
                                   const World& world = {});

/// The gids of the grains that make_grains gives for a scene of nothing but lists: their numbers over all lists.
std::vector<std::uint64_t> listed_gids(const Scene& scene);

/// How many grains make_grains will give, without placing them. Exact, but that a lattice without a count may lose sites to
/// earlier groups. Throws SceneError.
std::int64_t count_grains(const Scene& scene);

}  // namespace moraine
