// Summing the forces of each grain in canonical order, and advancing it.
//
// Integration: leapfrog, velocities half a step before positions,
//   v(n+1/2) = v(n-1/2) + a(n) dt,   x(n+1) = x(n) + v(n+1/2) dt,
// which is the kick-drift-kick form of velocity Verlet with one force evaluation a step (Verlet 1967; Hairer, Lubich &
// Wanner 2003). The first kick is half a step. Bulk viscosity, F = -c m v and T = -c I omega, is taken at the mean of the old and
// the new velocity.
//
// A grain's force is the sum over its pairs in the order of its entries (by the other's gid), then over its wall touches.
#pragma once

#include <cstdint>

#include "kernels/base/box.hpp"
#include "kernels/base/range.hpp"

namespace moraine {

/// Where a pair's slot is, and with which sign it enters: its place among all slots << 1 | is_b.
using Entry = std::uint32_t;
inline constexpr Entry entry_is_b = 1;
constexpr Entry make_entry(std::uint32_t slot, bool is_b) { return slot << 1 | (is_b ? entry_is_b : 0); }

/// The kick of one step.
struct Kick {
  double keep = 1.0;   // factor of the old velocity and spin: (1 - c dt/2)/(1 + c dt/2)
  double gain = 0.0;   // [s] factor of the acceleration, linear and angular: dt/(1 + c dt/2)
  double time = 0.0;   // [s] how long the kick is: dt
  double drift = 0.0;  // [s] dt
  double drag_loss =
      0.0;       // [1] share of m |v_old + v_new|^2 lost to bulk viscosity in the step, and of spin likewise: c dt/4
  Vec3 gravity;  // [m/s2]
  bool is_flat = false;  // two dimensions: no motion along z, no spin but about z
};

struct GrainSums {
  double* records = nullptr;
  std::int32_t first_grain = 0;            // offsets[0] belongs to this grain
  const std::uint32_t* offsets = nullptr;  // entries of grain i: [offsets[i - first], offsets[i - first + 1])
  const Entry* entries = nullptr;
  const void* slots = nullptr;  // of all pairs: doubles, with mixed precision floats
  std::uint64_t* acting =
      nullptr;  // a bit for each entry, those of a grain from a word of its own on: only these are summed, and then
                // set to zero; nullptr: all are summed
  const std::uint32_t* first_word = nullptr;  // of each grain, and the end; nullptr: each has one word
  double mass_unit = 1.0;                     // [kg] of what is in these, with mixed precision
  // Wall touches of the grains to be advanced, in their order.
  const std::int32_t* wall_grain = nullptr;
  const double* wall_slots = nullptr;
  std::int64_t n_wall = 0;
  Box inside;  // grains that leave it are reported
  Kick kick;
  double* dissipated = nullptr;  // four doubles a grain, or nullptr
  const double* push = nullptr;  // further acceleration of each grain, three doubles, or nullptr [m/s2]
  double* force = nullptr;       // contact force of each grain, three doubles, or nullptr [N]
  double* torque = nullptr;      // [N m]
};

struct MotionResult {
  double max_speed_squared = 0.0;  // [m2/s2] an upper bound of the grains' (largest components)
  bool is_any_outside = false;
  bool is_any_not_finite = false;
};

/// Advances the grains `list[range]`, or the grains of `range` themselves where list is nullptr.
using MotionKernel = MotionResult (*)(const GrainSums& sums, const std::int32_t* list, Range range);

/// `has_further`: slots have a rolling torque. `is_mixed`: those of pairs are floats; they are summed in double.
MotionKernel motion_kernel(bool has_rotation, bool has_ledger, bool has_further = false, bool is_mixed = false);

/// How far grains have gone from their places x0, as seen from frames that move with those around them.
struct RoomUse {
  const double* records = nullptr;
  std::int64_t record_size = 0;            // doubles
  const double* places = nullptr;          // x0 [m] and one over its room [1/m] of each grain
  const double* frames = nullptr;          // V and c [m/s] of each frame; nullptr: all are at rest
  const std::int32_t* frame_of = nullptr;  // of each grain
  double age = 0.0;                        // t [s] since they lay there
};
/// The largest share of its room that any grain has used [-].
struct RoomShares {
  double in_frames = 0.0;  // |x - x0 - V t| + c t, over the room
  double at_rest = 0.0;    // |x - x0|, over the room
  void include(const RoomShares& other) {
    in_frames = in_frames > other.in_frames ? in_frames : other.in_frames;
    at_rest = at_rest > other.at_rest ? at_rest : other.at_rest;
  }
};
/// Of the grains `list[range]`, or of `range` itself where list is nullptr.
using RoomKernel = RoomShares (*)(const RoomUse& use, const std::int32_t* list, Range range);
RoomKernel room_kernel();

}  // namespace moraine
