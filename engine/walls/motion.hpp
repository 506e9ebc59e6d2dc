// Where a wall is that moves, and how fast: closed forms of time, so that every layout and every restart gives the same bits.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "engine/scene/scene.hpp"

namespace moraine {

/// A rigid motion away from home: the place X of a wall as the scene describes it is now at turn(X) + shift.
struct Pose {
  std::array<Vec3, 3> rows = {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};
  Vec3 shift;              // [m]
  bool is_turned = false;  // rows are not the identity

  Vec3 turn(Vec3 v) const { return is_turned ? Vec3{dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)} : v; }
  Vec3 turn_back(Vec3 v) const { return is_turned ? v.x * rows[0] + v.y * rows[1] + v.z * rows[2] : v; }
  Vec3 to_world(Vec3 home) const { return turn(home) + shift; }
  Vec3 to_home(Vec3 world) const { return turn_back(world - shift); }
};

/// The turn by an angle [rad] about a unit axis (Rodrigues 1840).
Pose turn_about(Vec3 axis, double angle);

/// Velocity of the material point of a wall that is now at x: velocity + spin x (x - centre).
struct WallVelocity {
  Vec3 velocity;  // [m/s]
  Vec3 spin;      // [rad/s]
  Vec3 centre;    // [m]
  Vec3 at(Vec3 x) const { return velocity + cross(spin, x - centre); }
};

/// What a servo has come to: the only motion that remembers.
struct ServoState {
  double place = 0.0;  // [m] or [rad]
  double speed = 0.0;  // [m/s] or [rad/s]
  bool operator==(const ServoState&) const = default;
};

/// How fast a wall is moved by a script: the velocity of the point that was at its `origin` [m/s], and the wall's angular velocity [rad/s].
struct WallRates {
  Vec3 velocity, spin;
};

/// Where a script has brought a wall, and what it does in the present step.
struct ScriptState {
  Vec3 origin;  // [m] a point of the wall at home ...
  Vec3 centre;  // [m] ... and where it is now
  Pose pose;
  Vec3 velocity, spin;  // of that point [m/s]; of the wall [rad/s]
};

/// After `dt` [s] at these rates: the centre by v dt, the wall about it by the angle |spin| dt. Rows are made orthonormal again in each step
/// (Gram & Schmidt), so that a million steps do not stretch a wall.
ScriptState advanced(const ScriptState& script, double dt);
/// As numbers, for checkpoints and hashes, and back.
std::vector<double> numbers_of(const ScriptState& script);
ScriptState script_state_of(Vec3 origin, std::span<const double> numbers);
constexpr std::size_t n_script_numbers = 18;

/// How far the motion has come along or about its own axis at that time [m or rad], and how fast that changes. Not of translations.
struct Advance {
  double place = 0.0;
  double speed = 0.0;
};
Advance advance_of(const WallMotion& motion, double time, const ServoState& servo);

/// Pose and velocity of a wall whose motions are these.
struct WallState {
  Pose pose;
  WallVelocity velocity;
};
WallState state_of(std::span<const WallMotion> motions, double time, const ServoState& servo);

/// The fastest that any wall of a scene ever becomes inside its domain, at most [m/s].
double fastest_wall(const Scene& scene);

/// Corner 0 to 7 of a box.
Vec3 corner_of(const Box& box, int number);

/// The speed [m/s or rad/s] of a servo after a step, given the force along (torque about) its axis by which the grains push it.
double next_speed(const WallMotion& servo, double speed, double push, double dt);

}  // namespace moraine
