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
///   that is empty, and the group's velocities unless the list has them.
std::vector<GrainSeed> make_grains(const Scene& scene, int n_threads, FillReport* report = nullptr);

/// A rank's share of the grains, ascending by gid (the place in the order of birth).
struct DealtGrains {
  std::vector<GrainSeed> seeds;
  std::vector<std::uint64_t> gids;
};
/// The grains of make_grains, shared by ranks, wherever in space they belong; no rank holds them all. Of lattices each rank makes some
/// rows, lists are read so (or the root has them), and random fills are packed by the root, as bare spheres, and dealt out. The same grains
/// on any number of ranks. All ranks call it, and all throw where one does.
DealtGrains deal_grains(const Scene& scene, int n_threads, const World& world, FillReport* report = nullptr);

/// How many grains make_grains will give, without placing them, in each group and together. Exact, but that a lattice without a count may
/// lose sites to earlier groups. Throws SceneError.
std::vector<std::int64_t> count_groups(const Scene& scene);
std::int64_t count_grains(const Scene& scene);

}  // namespace moraine
