// The further laws: cohesion, whose attraction may reach beyond contact, and rolling resistance. Equations and papers:
// kernels/contact/README.md. Other notation: coefficients-inl.hpp.
#if defined(MORAINE_KERNELS_CONTACT_FURTHER_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MORAINE_KERNELS_CONTACT_FURTHER_INL_HPP
#undef MORAINE_KERNELS_CONTACT_FURTHER_INL_HPP
#else
#define MORAINE_KERNELS_CONTACT_FURTHER_INL_HPP
#endif

#include <cmath>

#include "kernels/contact/laws/laws-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace moraine {
namespace HWY_NAMESPACE {

/// What the further laws must know of the two bodies. Of a mirror image and its grain the relative spin is twice the grain's.
struct Bodies {
  Lanes radius_a;          // [m]
  Lanes curvature_b;       // [1/m] zero for a wall
  Lanes reduced_radius;    // R* [m]
  Lanes spin_mobility;     // 1/I_a + 1/I_b [1/(kg m2)]; only with rolling
  Lanes rolling_mobility;  // the same of I + m r^2, about the contact point
  Lanes3 spin;             // omega_a - omega_b [rad/s]
};

/// Cohesion of each lane's contact; constant over the steps.
struct Cohesion {
  Lanes strength;  // JKR: F_c. Linear, liquid bridge: F_0 [N]. Simplified JKR: pi times the energy density [J/m3]
  Lanes scale;     // JKR: a_0 [m]. Liquid bridge: sqrt(R/V) [1/m], R = 2 R*
  Lanes spread;    // JKR: 2 R*/a_0^2 [1/m]
  Lanes range;     // gap up to which it attracts [m]
};

/// JKR: gap at which a contact breaks, in units of a_0^2/(2 R*); (1/6)^(1/3), y there the same.
inline constexpr double jkr_break = 0.55032120814910444;

HWY_INLINE Cohesion make_cohesion(CohesionLaw law, RowOf row, const Bodies& bodies) {
  Cohesion c{};
  c.range = Lanes(0.0);
  const Lanes strength = row(Parameter::cohesion);
  switch (law) {
    case CohesionLaw::none: break;
    case CohesionLaw::jkr: {
      const Lanes pi_w_r = Lanes(3.14159265358979323846) * strength * bodies.reduced_radius;
      c.strength = Lanes(1.5) * pi_w_r;
      c.scale = cbrt(Lanes(4.5) * pi_w_r * bodies.reduced_radius / row(Parameter::young));
      // no adhesion between these materials: any number will do, as the force is that of Hertz
      const Lanes squared = select(strength > Lanes(0.0), c.scale * c.scale, Lanes(1.0));
      c.spread = Lanes(2.0) * bodies.reduced_radius / squared;
      c.range = keep_if(strength > Lanes(0.0), Lanes(jkr_break) / c.spread);
      break;
    }
    case CohesionLaw::sjkr: c.strength = Lanes(3.14159265358979323846) * strength; break;
    case CohesionLaw::linear:
      c.strength = strength;
      c.range = row(Parameter::cohesion_range);
      break;
    case CohesionLaw::liquid_bridge: {
      const Lanes volume = row(Parameter::liquid_volume), r = Lanes(2.0) * bodies.reduced_radius;
      c.strength = keep_if(volume > Lanes(0.0), Lanes(2.0 * 3.14159265358979323846) * r * strength);
      c.scale = sqrt(r / select(volume > Lanes(0.0), volume, Lanes(1.0)));
      c.range = row(Parameter::cohesion_range);
      break;
    }
  }
  return c;
}

/// sqrt(a/a_0) of a JKR contact, from 2 y^4 - 4/3 y = d, the stable branch: the larger real root of that quartic, by Ferrari. Its
/// resolvent m^3 + d/2 m - 1/18 = 0 is convex above its root, where Newton's steps start (and are exact to round-off after eight).
HWY_INLINE Lanes jkr_root(Lanes d) {
  d = max(d, Lanes(-jkr_break));
  const Lanes half = Lanes(0.5) * d;
  Lanes m = select(d > Lanes(0.0), min(Lanes(0.38157141418444396), Lanes(1.0 / 9.0) / max(d, Lanes(1e-300))),
                   Lanes(0.60570686427737987));
  for (int i = 0; i < 8; ++i) {
    const Lanes square = m * m;
    m = fma(Lanes(2.0) * m, square, Lanes(1.0 / 18.0)) / fma(Lanes(3.0), square, half);
  }
  const Lanes root = sqrt(Lanes(2.0) * m);
  // sqrt(2/m) = 2/sqrt(2 m); round-off may make the difference negative where it is zero, at the break
  const Lanes rest = fnma(Lanes(2.0), m, Lanes(4.0 / 3.0) / root);
  return Lanes(0.5) * (root + sqrt(max(rest, Lanes(0.0))));
}

/// Area of the circle in which two spheres of that overlap meet, over pi [m2].
HWY_INLINE Lanes squared_meeting_radius(const Bodies& b, Lanes overlap) {
  const Lanes sum = fma(b.radius_a, b.curvature_b, Lanes(1.0)), part = overlap * b.curvature_b;  // over r_b
  const Lanes apart = sum - part;
  const Lanes product = (Lanes(2.0) * b.radius_a - overlap) * (Lanes(2.0) - part) * (Lanes(2.0) * sum - part);
  return Lanes(0.25) * overlap * product / (apart * apart);
}

/// Energy [J] that a bond takes along when it breaks at its range.
HWY_INLINE Lanes energy_of_break(CohesionLaw law, const Cohesion& c) {
  if (law == CohesionLaw::jkr) return Lanes(0.51482702191705757) * c.strength / max(c.spread, Lanes(1e-300));
  // rare: Willett's force over the gap from 0 to the range, in closed form
  alignas(64) double strength[n_lanes], scale[n_lanes], range[n_lanes];
  store(strength, c.strength), store(scale, c.scale), store(range, c.range);
  for (int lane = 0; lane < n_lanes; ++lane) {
    const double root = 2.9828677476549308;  // sqrt(4 2.5 - 1.05^2)
    const double angle = std::atan((5.0 * scale[lane] * range[lane] + 1.05) / root) - std::atan(1.05 / root);
    strength[lane] *= 2.0 * angle / (root * scale[lane]);
  }
  return load(strength);
}

struct Attraction {
  Lanes force;     // to be taken from the repulsive force [N]
  Lanes pressing;  // what Coulomb's limit has besides the repulsive force [N]
};

/// Attraction at a gap (an overlap below zero) or in contact, but for JKR, which is a normal law of its own.
HWY_INLINE Lanes attraction(CohesionLaw law, const Cohesion& c, const Bodies& b, Lanes overlap) {
  const Lanes zero(0.0), one(1.0), gap = max(-overlap, zero);
  switch (law) {
    case CohesionLaw::sjkr: return c.strength * squared_meeting_radius(b, max(overlap, zero));
    case CohesionLaw::linear: return c.strength * select(gap > zero, max(one - gap / c.range, zero), one);
    case CohesionLaw::liquid_bridge: {
      const Lanes x = gap * c.scale;
      return c.strength / fma(fma(Lanes(2.5), x, Lanes(1.05)), x, one);
    }
    default: return zero;
  }
}

/// F_n = 4 F_c (y^6 - y^3) - gamma_n v_n, y^2 = a/a_0 (Johnson, Kendall & Roberts 1971), with the dashpot of Hertz for this a.
HWY_INLINE NormalForce jkr_normal(const Constants& c, const Cohesion& w, const Motion& m, double dt) {
  NormalForce f;
  const Lanes y = jkr_root(w.spread * m.overlap), cube = y * y * y;
  const LaneMask is_sticky = w.strength > Lanes(0.0);
  const Lanes hertz_a = c.root_radius * sqrt(max(m.overlap, Lanes(0.0)));
  f.a = select(is_sticky, w.scale * y * y, hertz_a);
  f.root_a = sqrt(f.a);
  const Lanes b = c.g_n * f.root_a, b_dt = b * Lanes(dt);
  f.dashpot = b * (sqrt(fma(b_dt, b_dt, c.four_masses)) - b_dt);
  f.elastic = select(is_sticky, Lanes(4.0) * w.strength * cube * (cube - Lanes(1.0)), c.k_n * f.a * m.overlap);
  f.total = fnma(f.dashpot, m.v_n, f.elastic);
  return f;
}

/// Rolling resistance of a contact.
struct Rolling {
  Lanes3 torque;             // on a, the opposite on b [N m]
  Lanes3 angle;              // rolled since, as far as it is remembered [rad]
  Lanes energy;              // [J]
  Lanes work, lost_dashpot;  // against the resistance in this step; of it in the dashpot [J]
  LaneMask yields;
};

/// A torque of constant size against the relative spin (Zhou et al. 1999; model A of Ai et al. 2011): mu_r R* F_n. No larger than what
/// takes a quarter of the relative spin in a step, so that grains at rest in up to a dozen contacts stay there.
HWY_INLINE Rolling rolling_constant(const Bodies& bodies, Lanes3 spin, Lanes limit, double dt) {
  Rolling r{};
  const Lanes slow = Lanes(4.0 * dt) * limit * bodies.spin_mobility;
  const Lanes size = sqrt(dot(spin, spin));
  const Lanes ratio = limit / max(max(size, slow), Lanes(1e-300));
  r.torque = {-(ratio * spin.x), -(ratio * spin.y), -(ratio * spin.z)};
  r.angle = {Lanes(0.0), Lanes(0.0), Lanes(0.0)};
  r.energy = r.lost_dashpot = Lanes(0.0);
  r.work = -(Lanes(dt) * dot(r.torque, spin));
  r.yields = limit > Lanes(-1.0);
  return r;
}

/// Elastic-plastic spring and dashpot (model C of Ai et al. 2011): -k_r theta - c_r omega, both scaled alike to mu_r R* F_n where they are
/// beyond it, as the tangential spring is.
HWY_INLINE Rolling rolling_spring(const Motion& m, const Bodies& bodies, Lanes3 spin, Lanes3 before, Lanes limit,
                                  Lanes k_r, Lanes damping, double dt) {
  Rolling r;
  const Lanes step(dt);
  r.angle = fma(step, spin, before);
  r.angle = fnma(dot(r.angle, m.normal), m.normal, r.angle);
  // as for the normal dashpot: made for velocities half a step late
  const Lanes b = damping * sqrt(k_r), b_dt = b * step;
  const Lanes dashpot = b * (sqrt(fma(b_dt, b_dt, Lanes(4.0) / bodies.rolling_mobility)) - b_dt);
  r.torque = fma(-k_r, r.angle, Lanes3{-(dashpot * spin.x), -(dashpot * spin.y), -(dashpot * spin.z)});
  const Lanes square = dot(r.torque, r.torque);
  r.yields = square > limit * limit;
  const Lanes scale = select(r.yields, limit / sqrt(square), Lanes(1.0));
  r.torque = scale * r.torque;
  r.angle = scale * r.angle;
  r.energy = Lanes(0.5) * k_r * dot(r.angle, r.angle);
  r.lost_dashpot = select(r.yields, Lanes(0.0), step * dashpot * dot(spin, spin));
  const Lanes3 pull = fma(Lanes(0.5) * k_r, before - r.angle, -Lanes(1.0) * r.torque);
  r.work = step * dot(pull, spin);
  return r;
}

struct FurtherForce {
  ContactForce contact;
  Rolling rolling;
};

/// The whole contact with the further laws. `touches`: lanes in which the bodies overlap; the others attract each other, or do nothing.
template <NormalLaw normal, TangentialLaw tangential, bool has_rotation, bool has_ledger>
HWY_INLINE FurtherForce further_force(CohesionLaw cohesion, RollingLaw rolling, const Constants& c, const Cohesion& w,
                                      const Bodies& bodies, RowOf row, LaneMask touches, const Motion& m, Lanes3 h,
                                      Lanes3 angle, Lanes stored, double dt) {
  FurtherForce out{};
  ContactForce& f = out.contact;
  const Lanes zero(0.0);
  const Onset whole{Lanes(1.0), Lanes(1.0), Lanes(dt)};  // what attracts does not begin at no overlap
  NormalForce n;
  Lanes pressing;  // what Coulomb's limit takes
  if (normal == NormalLaw::hertz && cohesion == CohesionLaw::jkr) {
    n = jkr_normal(c, w, m, dt);
    pressing = fma(Lanes(2.0), w.strength, n.total);  // Thornton (1991)
  } else {
    Motion in_contact = m;
    in_contact.overlap = keep_if(touches, m.overlap);
    if constexpr (normal == NormalLaw::linear)
      n = linear_normal(c, in_contact, whole);
    else
      n = hertz_normal(c, in_contact, whole, dt);
    n.dashpot = keep_if(touches, n.dashpot);
    pressing = keep_if(touches, n.total);
    n.total = pressing - attraction(cohesion, w, bodies, m.overlap);
  }
  f.normal = n.total;
  if constexpr (has_ledger) f.lost_normal = n.dashpot * m.v_n * fma(Lanes(0.5 * dt) * c.s, f.normal, m.v_n) * Lanes(dt);

  constexpr bool scales = normal == NormalLaw::hertz;
  const Lanes k_t = scales ? c.k_t * n.a : c.k_t, g_t = scales ? c.g_t * n.root_a : c.g_t;
  const TangentialForce t = spring(c, m, pressing, h, whole.time, k_t, g_t);
  f.tangential = t.force;
  f.h = t.h;

  Rolling& r = out.rolling;
  r.torque = r.angle = {zero, zero, zero};
  r.energy = r.work = r.lost_dashpot = zero;
  r.yields = zero > zero;
  if constexpr (has_rotation) {
    if (rolling != RollingLaw::none) {
      const Lanes3 spin = fnma(dot(bodies.spin, m.normal), m.normal, bodies.spin);
      const Lanes lever = row(Parameter::rolling_friction) * bodies.reduced_radius;
      const Lanes limit = lever * max(pressing, zero);
      if (rolling == RollingLaw::constant) {
        r = rolling_constant(bodies, spin, limit, dt);
      } else {
        const Lanes k_n = scales ? Lanes(1.5) * c.k_n * n.a : c.k_n;  // 2 E* a with Hertz
        const Lanes given = row(Parameter::rolling_stiffness);
        const Lanes k_r = select(given > zero, given, Lanes(2.25) * lever * lever * k_n);
        r = rolling_spring(m, bodies, spin, angle, limit, k_r, row(Parameter::rolling_damping), dt);
      }
    }
  }
  if constexpr (has_ledger) {
    // As in contact_force, the two springs together: what is missing went to their dashpots while they stick, or else to friction.
    const Lanes3 after = k_t * t.h, twice = fma(k_t, h, after), middle = fma(c.half_kick, t.force, m.v_t);
    const Lanes work = fnma(Lanes(dt), dot(t.force + after, middle), Lanes(0.5 * dt) * dot(twice, m.v_t));
    f.energy = fma(Lanes(0.5) * k_t, dot(t.h, t.h), r.energy);
    const Lanes lost = work + r.work + (stored - f.energy);
    const Lanes dashpot = Lanes(dt) * g_t * dot(m.v_t, middle);
    f.lost_tangential = select(t.slides, r.lost_dashpot, select(r.yields, dashpot, lost));
    f.lost_friction = lost - f.lost_tangential;
  }
  return out;
}

}  // namespace HWY_NAMESPACE
}  // namespace moraine
HWY_AFTER_NAMESPACE();

#endif
