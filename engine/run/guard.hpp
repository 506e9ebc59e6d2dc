// When a run runs away, or begins with what it cannot have: which grain, what it touches, why it is likely and what to do.
#pragma once

#include <cstdint>
#include <string>

#include "comm/world.hpp"
#include "engine/contacts/contacts.hpp"
#include "engine/particles/particles.hpp"
#include "engine/scene/scene.hpp"
#include "engine/walls/walls.hpp"

namespace moraine {

/// What the messages need to know of the run.
struct GuardView {
  const Scene& scene;
  const Particles& particles;
  const Contacts& contacts;
  const Walls& walls;
  double time = 0.0;  // [s]
  double dt = 0.0;    // [s]
  std::uint64_t step = 0;
  double steps_per_contact = 0.0;
};

/// The contact that is deepest relative to the smaller radius.
std::string explain_overlap(const GuardView& view);
/// The first grain whose position or velocity is not a number.
std::string explain_not_finite(const GuardView& view);
/// The fastest grain moves so far in a step that contacts are missed.
std::string explain_speed(const GuardView& view, std::int32_t grain);
/// A wall moves so far in a step [m] that contacts of grains of that radius [m] are missed.
std::string explain_fast_wall(const GuardView& view, double wander, double smallest_radius);
/// Two grains may have come nearer to each other by twice `travelled` [m] before the ranks looked: more than the skin of the pair list [m].
std::string explain_stale_list(const GuardView& view, double travelled, double skin, int n_hops);
/// Grain outside the domain where there is no outlet.
std::string explain_outside(const GuardView& view, std::int32_t grain);

/// Throws SceneError, on all ranks, with the contact of lowest gid that is deeper than a start allows. All ranks.
void check_start(const GuardView& view, const World& world);
/// What is wrong with positions and velocities that come from outside, where so many of this rank's grains have left and still have a place;
/// empty where nothing is.
std::string fault_of_grains(const GuardView& view, std::uint64_t n_left);

/// Index of the grain of lowest gid whose velocity is not finite, or -1.
std::int32_t first_not_finite(const Particles& particles);

/// Index of the fastest grain, or -1 where there are none.
std::int32_t fastest_grain(const Particles& particles);
/// The one that moves by most of its own radius in a step, or -1.
std::int32_t furthest_for_its_size(const Particles& particles);

}  // namespace moraine
