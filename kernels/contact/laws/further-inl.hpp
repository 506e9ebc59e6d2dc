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
template <typename Real>
struct Bodies {
  Lanes<Real> radius_a;          // [m]
  Lanes<Real> curvature_b;       // [1/m] zero for a wall
  Lanes<Real> reduced_radius;    // R* [m]
  Lanes<Real> spin_mobility;     // 1/I_a + 1/I_b [1/(kg m2)]; only with rolling
  Lanes<Real> rolling_mobility;  // the same of I + m r^2, about the contact point
  Lanes3<Real> spin;             // omega_a - omega_b [rad/s]
};

/// Cohesion of each lane's contact; constant over the steps.
template <typename Real>
struct Cohesion {
  Lanes<Real> strength;  // JKR: F_c. Linear, liquid bridge: F_0 [N]. Simplified JKR: pi times the energy density [J/m3]
  Lanes<Real> scale;     // JKR: a_0 [m]. Liquid bridge: sqrt(R/V) [1/m], R = 2 R*
  Lanes<Real> spread;    // JKR: 2 R*/a_0^2 [1/m]
  Lanes<Real> range;     // gap up to which it attracts [m]
};

/// JKR: gap at which a contact breaks, in units of a_0^2/(2 R*); (1/6)^(1/3), y there the same.
inline constexpr double jkr_break = 0.55032120814910444;

template <typename Real>
HWY_INLINE Cohesion<Real> make_cohesion(CohesionLaw law, RowOf<Real> row, const Bodies<Real>& bodies) {
  Cohesion<Real> c{};
  c.range = 0.0;
  const Lanes<Real> strength = row(Parameter::cohesion);
  switch (law) {
    case CohesionLaw::none: break;
    case CohesionLaw::jkr: {
      const Lanes<Real> pi_w_r = 3.14159265358979323846 * strength * bodies.reduced_radius;
      c.strength = 1.5 * pi_w_r;
      c.scale = cbrt(4.5 * pi_w_r * bodies.reduced_radius / row(Parameter::young));
      // no adhesion between these materials: any number will do, as the force is that of Hertz
      const Lanes<Real> squared = select(strength > 0.0, c.scale * c.scale, 1.0);
      c.spread = 2.0 * bodies.reduced_radius / squared;
      c.range = keep_if(strength > 0.0, jkr_break / c.spread);
      break;
    }
    case CohesionLaw::sjkr: c.strength = 3.14159265358979323846 * strength; break;
    case CohesionLaw::linear:
      c.strength = strength;
      c.range = row(Parameter::cohesion_range);
      break;
    case CohesionLaw::liquid_bridge: {
      const Lanes<Real> volume = row(Parameter::liquid_volume), r = 2.0 * bodies.reduced_radius;
      c.strength = keep_if(volume > 0.0, (2.0 * 3.14159265358979323846) * r * strength);
      c.scale = sqrt(r / select(volume > 0.0, volume, 1.0));
      c.range = row(Parameter::cohesion_range);
      break;
    }
  }
  return c;
}

/// sqrt(a/a_0) of a JKR contact, from 2 y^4 - 4/3 y = d, the stable branch: the larger real root of that quartic, by Ferrari. Its
/// resolvent m^3 + d/2 m - 1/18 = 0 is convex above its root, where Newton's steps start (and are exact to round-off after eight).
template <typename Real>
HWY_INLINE Lanes<Real> jkr_root(Lanes<Real> d) {
  d = max(d, -jkr_break);
  const Lanes<Real> half = 0.5 * d;
  Lanes<Real> m = select(d > 0.0, min(0.38157141418444396, (1.0 / 9.0) / max(d, tiny<Real>)), 0.60570686427737987);
  for (int i = 0; i < 8; ++i) {
    const Lanes<Real> square = m * m;
    m = fma(2.0 * m, square, (1.0 / 18.0)) / fma(3.0, square, half);
  }
  const Lanes<Real> root = sqrt(2.0 * m);
  // sqrt(2/m) = 2/sqrt(2 m); round-off may make the difference negative where it is zero, at the break
  const Lanes<Real> rest = fnma(2.0, m, (4.0 / 3.0) / root);
  return 0.5 * (root + sqrt(max(rest, 0.0)));
}

/// Area of the circle in which two spheres of that overlap meet, over pi [m2].
template <typename Real>
HWY_INLINE Lanes<Real> squared_meeting_radius(const Bodies<Real>& b, Lanes<Real> overlap) {
  const Lanes<Real> sum = fma(b.radius_a, b.curvature_b, 1.0), part = overlap * b.curvature_b;  // over r_b
  const Lanes<Real> apart = sum - part;
  const Lanes<Real> product = (2.0 * b.radius_a - overlap) * (2.0 - part) * (2.0 * sum - part);
  return 0.25 * overlap * product / (apart * apart);
}

/// Energy [J] that a bond takes along when it breaks at its range.
template <typename Real>
HWY_INLINE Lanes<Real> energy_of_break(CohesionLaw law, const Cohesion<Real>& c) {
  if (law == CohesionLaw::jkr) return 0.51482702191705757 * c.strength / max(c.spread, tiny<Real>);
  // rare: Willett's force over the gap from 0 to the range, in closed form
  constexpr int n = n_lanes<Real>;
  alignas(64) Real strength[n], scale[n], range[n];
  store(strength, c.strength), store(scale, c.scale), store(range, c.range);
  for (int lane = 0; lane < n; ++lane) {
    const double root = 2.9828677476549308;  // sqrt(4 2.5 - 1.05^2)
    const double per_length = scale[lane];
    const double angle = std::atan((5.0 * per_length * range[lane] + 1.05) / root) - std::atan(1.05 / root);
    strength[lane] = static_cast<Real>(strength[lane] * (2.0 * angle / (root * per_length)));
  }
  return load(strength);
}

template <typename Real>
struct Attraction {
  Lanes<Real> force;     // to be taken from the repulsive force [N]
  Lanes<Real> pressing;  // what Coulomb's limit has besides the repulsive force [N]
};

/// Attraction at a gap (an overlap below zero) or in contact, but for JKR, which is a normal law of its own.
template <typename Real>
HWY_INLINE Lanes<Real> attraction(CohesionLaw law, const Cohesion<Real>& c, const Bodies<Real>& b,
                                  Lanes<Real> overlap) {
  const Lanes<Real> zero(0.0), one(1.0), gap = max(-overlap, zero);
  switch (law) {
    case CohesionLaw::sjkr: return c.strength * squared_meeting_radius(b, max(overlap, zero));
    case CohesionLaw::linear: return c.strength * select(gap > zero, max(one - gap / c.range, zero), one);
    case CohesionLaw::liquid_bridge: {
      const Lanes<Real> x = gap * c.scale;
      return c.strength / fma(fma(2.5, x, 1.05), x, one);
    }
    default: return zero;
  }
}

/// F_n = 4 F_c (y^6 - y^3) - gamma_n v_n, y^2 = a/a_0 (Johnson, Kendall & Roberts 1971), with the dashpot of Hertz for this a.
template <typename Real>
HWY_INLINE NormalForce<Real> jkr_normal(const Constants<Real>& c, const Cohesion<Real>& w, const Motion<Real>& m,
                                        double dt) {
  NormalForce<Real> f;
  const Lanes<Real> y = jkr_root(w.spread * m.overlap), cube = y * y * y;
  const LaneMask<Real> is_sticky = w.strength > 0.0;
  const Lanes<Real> hertz_a = c.root_radius * sqrt(max(m.overlap, 0.0));
  f.a = select(is_sticky, w.scale * y * y, hertz_a);
  f.root_a = sqrt(f.a);
  const Lanes<Real> b = c.g_n * f.root_a, b_dt = b * dt;
  f.dashpot = b * (sqrt(fma(b_dt, b_dt, c.four_masses)) - b_dt);
  f.elastic = select(is_sticky, 4.0 * w.strength * cube * (cube - 1.0), c.k_n * f.a * m.overlap);
  f.total = fnma(f.dashpot, m.v_n, f.elastic);
  return f;
}

/// Rolling resistance of a contact.
template <typename Real>
struct Rolling {
  Lanes3<Real> torque;             // on a, the opposite on b [N m]
  Lanes3<Real> angle;              // rolled since, as far as it is remembered [rad]
  Lanes<Real> energy;              // [J]
  Lanes<Real> work, lost_dashpot;  // against the resistance in this step; of it in the dashpot [J]
  LaneMask<Real> yields;
};

/// A torque of constant size against the relative spin (Zhou et al. 1999; model A of Ai et al. 2011): mu_r R* F_n. No larger than what
/// takes a quarter of the relative spin in a step, so that grains at rest in up to a dozen contacts stay there.
template <typename Real>
HWY_INLINE Rolling<Real> rolling_constant(const Bodies<Real>& bodies, Lanes3<Real> spin, Lanes<Real> limit, double dt) {
  Rolling<Real> r{};
  const Lanes<Real> slow = (4.0 * dt) * limit * bodies.spin_mobility;
  const Lanes<Real> size = sqrt(dot(spin, spin));
  const Lanes<Real> ratio = limit / max(max(size, slow), tiny<Real>);
  r.torque = {-(ratio * spin.x), -(ratio * spin.y), -(ratio * spin.z)};
  r.angle = {0.0, 0.0, 0.0};
  r.energy = r.lost_dashpot = 0.0;
  r.work = -(dt * dot(r.torque, spin));
  r.yields = limit > -1.0;
  return r;
}

/// Elastic-plastic spring and dashpot (model C of Ai et al. 2011): -k_r theta - c_r omega, together at most mu_r R* F_n, as the tangential
/// spring is.
template <typename Real>
HWY_INLINE Rolling<Real> rolling_spring(const Motion<Real>& m, const Bodies<Real>& bodies, Lanes3<Real> spin,
                                        Lanes3<Real> before, Lanes<Real> limit, Lanes<Real> k_r, Lanes<Real> damping,
                                        double dt) {
  Rolling<Real> r;
  const Lanes<Real> step(dt);
  r.angle = fma(step, spin, before);
  r.angle = fnma(dot(r.angle, m.normal), m.normal, r.angle);
  // as for the normal dashpot: made for velocities half a step late
  const Lanes<Real> b = damping * sqrt(k_r), b_dt = b * step;
  const Lanes<Real> dashpot = b * (sqrt(fma(b_dt, b_dt, 4.0 / bodies.rolling_mobility)) - b_dt);
  r.torque = fma(-k_r, r.angle, Lanes3<Real>{-(dashpot * spin.x), -(dashpot * spin.y), -(dashpot * spin.z)});
  r.yields = hold_to_limit(limit, k_r, dashpot, spin, r.angle, r.torque);
  r.energy = 0.5 * k_r * dot(r.angle, r.angle);
  r.lost_dashpot = select(r.yields, 0.0, step * dashpot * dot(spin, spin));
  const Lanes3<Real> pull = fma(0.5 * k_r, before - r.angle, -1.0 * r.torque);
  r.work = step * dot(pull, spin);
  return r;
}

template <typename Real>
struct FurtherForce {
  ContactForce<Real> contact;
  Rolling<Real> rolling;
};

/// The whole contact with the further laws. `touches`: lanes in which the bodies overlap; the others attract each other, or do nothing.
template <NormalLaw normal, TangentialLaw tangential, bool has_rotation, bool has_ledger, typename Real>
HWY_INLINE FurtherForce<Real> further_force(CohesionLaw cohesion, RollingLaw rolling, const Constants<Real>& c,
                                            const Cohesion<Real>& w, const Bodies<Real>& bodies, RowOf<Real> row,
                                            LaneMask<Real> touches, const Motion<Real>& m, Lanes3<Real> h,
                                            Lanes3<Real> angle, Lanes<Real> stored, double dt) {
  FurtherForce<Real> out{};
  ContactForce<Real>& f = out.contact;
  const Lanes<Real> zero(0.0);
  const Onset<Real> whole{1.0, 1.0, dt};  // what attracts does not begin at no overlap
  NormalForce<Real> n;
  Lanes<Real> pressing;  // what Coulomb's limit takes
  if (normal == NormalLaw::hertz && cohesion == CohesionLaw::jkr) {
    n = jkr_normal(c, w, m, dt);
    pressing = fma(2.0, w.strength, n.total);  // Thornton (1991)
  } else {
    Motion<Real> in_contact = m;
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
  if constexpr (has_ledger) f.lost_normal = n.dashpot * m.v_n * fma((0.5 * dt) * c.s, f.normal, m.v_n) * dt;

  constexpr bool scales = normal == NormalLaw::hertz;
  const Lanes<Real> k_t = scales ? c.k_t * n.a : c.k_t, g_t = scales ? c.g_t * n.root_a : c.g_t;
  const TangentialForce<Real> t = spring(c, m, pressing, h, whole.time, k_t, g_t);
  f.tangential = t.force;
  f.h = t.h;

  Rolling<Real>& r = out.rolling;
  r.torque = r.angle = {zero, zero, zero};
  r.energy = r.work = r.lost_dashpot = zero;
  r.yields = zero > zero;
  if constexpr (has_rotation) {
    if (rolling != RollingLaw::none) {
      const Lanes3<Real> spin = fnma(dot(bodies.spin, m.normal), m.normal, bodies.spin);
      const Lanes<Real> lever = row(Parameter::rolling_friction) * bodies.reduced_radius;
      const Lanes<Real> limit = lever * max(pressing, zero);
      if (rolling == RollingLaw::constant) {
        r = rolling_constant(bodies, spin, limit, dt);
      } else {
        const Lanes<Real> k_n = scales ? 1.5 * c.k_n * n.a : c.k_n;  // 2 E* a with Hertz
        const Lanes<Real> given = row(Parameter::rolling_stiffness);
        const Lanes<Real> k_r = select(given > zero, given, 2.25 * lever * lever * k_n);
        r = rolling_spring(m, bodies, spin, angle, limit, k_r, row(Parameter::rolling_damping), dt);
      }
    }
  }
  if constexpr (has_ledger) {
    // As in contact_force, the two springs together: what is missing went to their dashpots while they stick, or else to friction.
    const Lanes3<Real> after = k_t * t.h, twice = fma(k_t, h, after), middle = fma(c.half_kick, t.force, m.v_t);
    const Lanes<Real> work = fnma(dt, dot(t.force + after, middle), (0.5 * dt) * dot(twice, m.v_t));
    f.energy = fma(0.5 * k_t, dot(t.h, t.h), r.energy);
    const Lanes<Real> lost = work + r.work + (stored - f.energy);
    const Lanes<Real> dashpot = dt * g_t * dot(m.v_t, middle);
    f.lost_tangential = select(t.slides, r.lost_dashpot, select(r.yields, dashpot, lost));
    f.lost_friction = lost - f.lost_tangential;
  }
  return out;
}

}  // namespace HWY_NAMESPACE
}  // namespace moraine
HWY_AFTER_NAMESPACE();

#endif
