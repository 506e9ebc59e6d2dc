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
  Vec3 velocity;              // [m/s]
  Vec3 angular_velocity;      // [rad/s]
  double inverse_mass = 0.0;  // [1/kg]
  double curvature = 0.0;     // [1/m] one over the radius
  double arm = 0.0;           // [m] from the centre to the contact point
};

struct ReferenceContact {
  double overlap = 0.0;  // [m]
  Vec3 normal;           // unit, from b to a
  ContactBody a, b;
  Vec3 displacement;    // [m] before the step
  double stored = 0.0;  // [J] in the tangential spring before the step
};

struct ReferenceForce {
  Vec3 force;                                                            // on a [N]
  Vec3 torque_a, torque_b;                                               // [N m]
  Vec3 displacement;                                                     // [m] after the step
  double energy_normal = 0.0;                                            // stored in the normal spring [J]
  double energy_tangential = 0.0;                                        // stored in the tangential one [J]
  double lost_normal = 0.0, lost_tangential = 0.0, lost_friction = 0.0;  // in the step [J]
  bool slides = false;
};

/// Force, memory and energies of one contact over a step of dt [s]; velocities half a step before the positions.
/// `mirror` is 2 where b is the mirror image of a: the motion given is then that of a relative to the mirror.
ReferenceForce reference_contact(NormalLaw normal, TangentialLaw tangential, bool has_rotation, const PairParameters& p,
                                 const ReferenceContact& contact, double dt, double mirror = 1.0);

}  // namespace moraine
