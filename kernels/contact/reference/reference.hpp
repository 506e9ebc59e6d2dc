// The contact laws again, in plain scalar code: slow, obvious, and written apart from the compiled sweeps, which are tested
// against it. The energy ledger and the probes use it too, at the rate of outputs.
//
// Notation and equations: kernels/contact/README.md.
#pragma once

#include "kernels/base/vec3.hpp"
#include "kernels/contact/parameters.hpp"

namespace moraine {

/// One side of a contact. A wall has no inverse mass and no curvature; its velocity is that of the point touched.
struct ContactBody {
  Vec3 velocity;                 // [m/s]
  Vec3 angular_velocity;         // [rad/s]
  double inverse_mass = 0.0;     // [1/kg]
  double curvature = 0.0;        // [1/m] one over the radius
  double arm = 0.0;              // [m] from the centre to the contact point
  double inverse_inertia = 0.0;  // [1/(kg m2)]; only with rolling resistance
};

struct ReferenceContact {
  double overlap = 0.0;  // [m] less than zero: a gap
  Vec3 normal;           // unit, from b to a
  ContactBody a, b;
  Vec3 displacement;      // [m] before the step
  double stored = 0.0;    // [J] in the tangential and the rolling spring before the step
  Vec3 angle;             // [rad] rolled, before the step
  bool is_bound = false;  // a bond is made, before the step
};

struct ReferenceForce {
  Vec3 force;                      // on a [N]
  Vec3 torque_a, torque_b;         // [N m]
  Vec3 displacement;               // [m] after the step
  Vec3 angle;                      // [rad] rolled, after the step
  double energy_normal = 0.0;      // stored in the normal spring, less that of the attraction [J]
  double energy_tangential = 0.0;  // stored in the tangential and the rolling spring [J]
  double lost_normal = 0.0, lost_tangential = 0.0, lost_friction = 0.0;  // in the step [J]
  bool slides = false;
  bool yields = false;  // the rolling spring is at its limit
  bool acts = false;    // there is a force: the bodies touch, or attract each other from afar
};

/// Force, memory and energies of one contact over a step of dt [s]; velocities half a step before the positions.
/// `mirror` is 2 where b is the mirror image of a: the motion given is then that of a relative to the mirror.
ReferenceForce reference_contact(const LawChoice& laws, const PairParameters& p, const ReferenceContact& contact,
                                 double dt, double mirror = 1.0);

/// Gap [m] up to which two bodies of reduced radius [m] attract each other (where a contact must be made first: once it is).
double attraction_range(CohesionLaw law, const PairParameters& p, double reduced_radius);
/// Force at which a JKR contact is pulled apart [N], and its stiffness where it rests without load [N/m].
double jkr_pull_off(const PairParameters& p, double reduced_radius);
double jkr_stiffness(const PairParameters& p, double reduced_radius);
/// k_r [N m/rad] of the rolling spring for a normal stiffness [N/m].
double rolling_stiffness(const PairParameters& p, double normal_stiffness, double reduced_radius);

}  // namespace moraine
