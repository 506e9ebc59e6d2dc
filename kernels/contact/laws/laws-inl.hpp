// The normal and tangential laws. Notation, and why dashpots are as they are: coefficients-inl.hpp.
#if defined(MORAINE_KERNELS_CONTACT_LAWS_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MORAINE_KERNELS_CONTACT_LAWS_INL_HPP
#undef MORAINE_KERNELS_CONTACT_LAWS_INL_HPP
#else
#define MORAINE_KERNELS_CONTACT_LAWS_INL_HPP
#endif

#include "kernels/contact/laws/coefficients-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace moraine {
namespace HWY_NAMESPACE {

/// The motion of a contact, one a lane; lanes that do not touch may hold anything.
template <typename Real>
struct Motion {
  Lanes<Real> overlap;  // delta [m]
  Lanes3<Real> normal;  // unit, from b to a
  Lanes<Real> v_n;      // [m/s]
  Lanes3<Real> v_t;     // [m/s]
};

/// How a contact is in the step in which it begins, and in the last ones before it ends. Kicks reach from half a step before the
/// positions to half a step after, so that a contact that began q steps ago should by now have damped for q + 1/2 steps; a dashpot
/// that acts from the first positions with overlap on, for a whole step each, is up to half a step too early or too late, and so at
/// its end: an error of first order, different from impact to impact. q = delta / (|v_n| dt) is known, so dashpots are weighted by
///   w(q) f(q) = 3/2 G q                   q < 1       G = integral of f from 0 to 3/2, over 3/2
///             = F(q + 1/2) - w f (q - 1)  q < 2       F(x) = integral of f from 0 to x
///             = f(q)                      else
/// where f is how the dashpot grows with the overlap: 1 if it is constant, q^(1/4) in a Hertz contact. So the kicks of the first (or
/// last) two positions give together what they should, wherever between two steps the contact begins; w is continuous,
/// and 0 at q = 0, so that round-off does not decide whether a contact has ended. A contact at rest has q = infinity and w = 1.
template <typename Real>
struct Onset {
  Lanes<Real> constant,
      growing;       // w of dashpots that are constant, and that grow with the root of the radius of the contact area
  Lanes<Real> time;  // for which the contact has moved since the positions before [s]
};

/// w where f = 1: 3/2 q, 2 - q/2, 1.
template <typename Real>
HWY_INLINE Lanes<Real> weight_of_constant(Lanes<Real> q) {
  return min(1.5 * q, max(fnma(0.5, q, 2.0), 1.0));
}

/// w where f = q^(1/4), F = 4/5 q^(5/4).
template <typename Real>
HWY_INLINE Lanes<Real> weight_of_growing(Lanes<Real> q) {
  const Lanes<Real> one(1.0), first(1.32801830364038591);  // F(3/2)
  const Lanes<Real> later = q + 0.5;
  const Lanes<Real> whole = 0.8 * later * sqrt(sqrt(later));
  const Lanes<Real> both = fnma(first, max(q - one, 0.0), whole);
  const Lanes<Real> weighted = select(q < one, first * q, both) / sqrt(sqrt(q));
  return select(q < 2.0, weighted, one);
}

template <typename Real>
HWY_INLINE Onset<Real> onset_of(const Motion<Real>& m, double dt) {
  const Lanes<Real> one(1.0), travel = dt * abs(m.v_n);
  Onset<Real> onset{one, one, dt};
  const LaneMask<Real> is_young = (m.overlap > 0.0) & (m.overlap < 2.0 * travel);
  if (none(is_young)) return onset;
  const Lanes<Real> q = m.overlap / travel;
  onset.constant = select(is_young, weight_of_constant(q), one);
  onset.growing = select(is_young, weight_of_growing(q), one);
  onset.time = select(is_young & (m.v_n < 0.0), dt * min(q, one), onset.time);
  return onset;
}

template <typename Real>
struct NormalForce {
  Lanes<Real> total;    // F_n with its dashpot [N]
  Lanes<Real> elastic;  // F_n without [N]
  Lanes<Real> dashpot;  // gamma_n [N s/m]
  Lanes<Real> a;        // Hertz: sqrt(R* delta) [m]
  Lanes<Real> root_a;
};

/// F_n = k_n delta - w gamma_n v_n.
template <typename Real>
HWY_INLINE NormalForce<Real> linear_normal(const Constants<Real>& c, const Motion<Real>& m, const Onset<Real>& onset) {
  NormalForce<Real> f;
  f.elastic = c.k_n * m.overlap;
  f.dashpot = onset.constant * c.g_n;
  f.total = fnma(f.dashpot, m.v_n, f.elastic);
  return f;
}

/// F_n = 4/3 E* sqrt(R*) delta^(3/2) - w gamma_n v_n (Hertz 1882; damping: Tsuji, Tanaka & Ishida 1992).
template <typename Real>
HWY_INLINE NormalForce<Real> hertz_normal(const Constants<Real>& c, const Motion<Real>& m, const Onset<Real>& onset,
                                          double dt) {
  NormalForce<Real> f;
  f.a = c.root_radius * sqrt(m.overlap);
  f.root_a = sqrt(f.a);
  const Lanes<Real> b = c.g_n * f.root_a, b_dt = b * dt;
  f.dashpot = onset.growing * (b * (sqrt(fma(b_dt, b_dt, c.four_masses)) - b_dt));
  f.elastic = c.k_n * f.a * m.overlap;
  f.total = fnma(f.dashpot, m.v_n, f.elastic);
  return f;
}

template <typename Real>
struct TangentialForce {
  Lanes3<Real> force;  // F_t on a [N]
  Lanes3<Real> h;      // displacement after the step [m]
  Lanes<Real> energy;  // stored in the displacement [J]; only with the ledger, and with the power law, as what follows
  Lanes3<Real> after,
      before;  // along h: force of the spring, and what it would have been for the displacement before the step [N]
  LaneMask<Real> slides;  // at Coulomb's limit
};

/// Scales f to Coulomb's limit mu F_n where it is beyond.
template <typename Real>
HWY_INLINE LaneMask<Real> cap(const Constants<Real>& c, Lanes<Real> f_n, Lanes3<Real>& f) {
  const Lanes<Real> limit = c.mu * max(f_n, 0.0);
  const Lanes<Real> square = dot(f, f);
  const LaneMask<Real> beyond = square > limit * limit;
  if (any(beyond)) f = select(beyond, limit / sqrt(square), 1.0) * f;
  return beyond;
}

/// h + v_t dt, turned into the tangential plane of this step; in the first step for the time since the contact began.
template <typename Real>
HWY_INLINE Lanes3<Real> advance_displacement(const Motion<Real>& m, Lanes3<Real> h, Lanes<Real> time) {
  h = fma(time, m.v_t, h);
  return fnma(dot(h, m.normal), m.normal, h);
}

/// Scales the force -k h - g v of a spring and a dashpot to a limit where it is beyond it; those lanes. There the spring keeps what
/// the limit leaves of it beside the dashpot, k h = -F - g v, but along the force never less than nothing. (Without
/// this bound it is wound backwards where the dashpot alone is beyond the limit, as when a contact begins; a Mindlin
/// contact, which then stiffens, pushes along the motion.) Across the force it takes up the dashpot as well: spring and dashpot of the
/// next step then point where those of this one did, and friction turns towards the motion with the way that is slid. (A spring
/// laid along the force would turn with the number of steps.)
template <typename Real>
HWY_INLINE LaneMask<Real> hold_to_limit(Lanes<Real> limit, Lanes<Real> k, Lanes<Real> g, Lanes3<Real> v,
                                        Lanes3<Real>& h, Lanes3<Real>& force) {
  const Lanes<Real> square = dot(force, force);
  const LaneMask<Real> beyond = square > limit * limit;
  if (none(beyond)) return beyond;
  const Lanes<Real> inverse = 1.0 / sqrt(square);
  const Lanes<Real> held = max(limit, -(g * inverse) * dot(v, force));  // by spring and dashpot, along the force
  h = select(beyond, -1.0 / k, 1.0) * select(beyond, fma(held * inverse, force, g * v), h);
  force = select(beyond, limit * inverse, 1.0) * force;
  return beyond;
}

/// Spring and dashpot under Coulomb's cap (Cundall & Strack 1979): F_t = -k_t h - gamma_t v_t.
template <typename Real>
HWY_INLINE TangentialForce<Real> spring(const Constants<Real>& c, const Motion<Real>& m, Lanes<Real> f_n,
                                        Lanes3<Real> h, Lanes<Real> time, Lanes<Real> k_t, Lanes<Real> g_t) {
  TangentialForce<Real> t;
  t.h = advance_displacement(m, h, time);
  t.force = fma(-k_t, t.h, -g_t * m.v_t);
  t.slides = hold_to_limit(c.mu * max(f_n, 0.0), k_t, g_t, m.v_t, t.h, t.force);
  return t;
}

/// Of y(x) = 1 - (1 - x)^(3/2), 0 <= x <= 1: y/x, and the integral from 0 to x, x - 2/5 (1 - (1 - x)^(5/2)); so written that nothing
/// cancels where x is small: 1 - p^(n/2) = (1 - p^n)/(1 + p^(n/2)).
template <typename Real>
struct PowerCurve {
  Lanes<Real> slope, integral;
};
template <typename Real>
HWY_INLINE PowerCurve<Real> power_curve(Lanes<Real> x) {
  const Lanes<Real> rest = 1.0 - x, rest_3_2 = rest * sqrt(rest), square = x * x;
  PowerCurve<Real> curve;
  curve.slope = fma(x, x - 3.0, 3.0) / (1.0 + rest_3_2);
  const Lanes<Real> over = 1.0 / fma(rest, rest_3_2, 1.0);
  const Lanes<Real> fifth = fma(x, fma(x, fma(x, x - 5.0, 10.0), -10.0), 5.0);  // (1 - (1 - x)^5)/x
  const Lanes<Real> other = fma(x, fma(x, fma(-0.4, x, 2.0), -4.0), 4.0);
  curve.integral = square * over * fnma(fifth, over, other);
  return curve;
}

/// F_t = mu F_N (1 - (1 - |h|/delta_max)^(3/2)) against h, constant beyond delta_max (Langston, Tuzun & Heyes 1995, after
/// Mindlin & Deresiewicz 1953), and a dashpot, under Coulomb's cap. delta_max is given or 3/2 mu F_N / k_t, so that k_t is the
/// stiffness at no displacement; F_N is the elastic normal force.
template <typename Real>
HWY_INLINE TangentialForce<Real> power(const Constants<Real>& c, const Motion<Real>& m, Lanes<Real> f_n,
                                       Lanes<Real> elastic, Lanes3<Real> h, Lanes<Real> time, Lanes<Real> k_t,
                                       Lanes<Real> g_t) {
  TangentialForce<Real> t;
  t.h = advance_displacement(m, h, time);
  const Lanes<Real> limit = c.mu * max(elastic, 0.0);
  const Lanes<Real> given = select(c.displacement > 0.0, c.displacement, 1.5 * limit / k_t);
  const Lanes<Real> delta_max = max(given, tiny<Real>);
  const Lanes<Real> size = sqrt(dot(t.h, t.h));
  t.h = select(size > delta_max, delta_max / size, 1.0) * t.h;
  const PowerCurve<Real> curve = power_curve(min(size / delta_max, 1.0));
  t.after = (limit * curve.slope / delta_max) * t.h;
  t.force = fma(-g_t, m.v_t, -1.0 * t.after);
  // past delta_max it slides, though without a dashpot only round-off tells its force from the limit
  t.slides = cap(c, f_n, t.force) | (size > delta_max);
  t.energy = limit * delta_max * curve.integral;
  const Lanes<Real> size_before = sqrt(dot(h, h));
  const PowerCurve<Real> before = power_curve(min(size_before / delta_max, 1.0));
  t.before = (limit * before.slope / max(size_before, delta_max)) * h;
  return t;
}

template <typename Real>
struct ContactForce {
  Lanes<Real> normal;
  Lanes3<Real> tangential;
  Lanes3<Real> h;
  Lanes<Real> energy;                                       // stored tangentially [J]
  Lanes<Real> lost_normal, lost_tangential, lost_friction;  // in this step [J]
};

/// The whole contact: normal law, tangential law, and with the ledger where the energy went.
///
/// Losses: the work of a spring over a step is the mean of its forces before and after times the displacement, which for a spring
/// that sticks is just what it stores; what is missing went to friction or to the dashpot. Dashpots take the velocity in the middle
/// of the kick, as this contact alone would make it (that of the other contacts is not known here).
template <NormalLaw normal, TangentialLaw tangential, bool has_ledger, typename Real>
HWY_INLINE ContactForce<Real> contact_force(const Constants<Real>& c, const Motion<Real>& m, Lanes3<Real> h,
                                            Lanes<Real> stored, double dt) {
  ContactForce<Real> f{};
  NormalForce<Real> n;
  const Onset<Real> onset = onset_of(m, dt);
  if constexpr (normal == NormalLaw::linear)
    n = linear_normal(c, m, onset);
  else
    n = hertz_normal(c, m, onset, dt);
  f.normal = n.total;
  if constexpr (has_ledger) f.lost_normal = n.dashpot * m.v_n * fma((0.5 * dt) * c.s, f.normal, m.v_n) * dt;

  if constexpr (tangential == TangentialLaw::none) {
    const Lanes<Real> zero(0.0);
    f.tangential = f.h = {zero, zero, zero};
    f.energy = f.lost_tangential = f.lost_friction = zero;
  } else if constexpr (tangential == TangentialLaw::viscous) {
    const Lanes<Real> g_t = onset.constant * c.g_t;
    f.tangential = -(g_t / fma(g_t, c.half_kick, 1.0)) * m.v_t;
    const LaneMask<Real> slides = cap(c, n.total, f.tangential);
    if constexpr (has_ledger) {
      const Lanes<Real> lost = -(dt * dot(f.tangential, fma(c.half_kick, f.tangential, m.v_t)));
      f.energy = 0.0;
      f.lost_friction = keep_if(slides, lost);
      f.lost_tangential = lost - f.lost_friction;
    }
  } else {
    // a Hertz contact grows stiffer with its area, but for a spring of given stiffness
    constexpr bool scales = normal == NormalLaw::hertz && tangential != TangentialLaw::spring;
    const Lanes<Real> k_t = scales ? c.k_t * n.a : c.k_t;
    const Lanes<Real> g_t = scales ? onset.growing * (c.g_t * n.root_a) : onset.constant * c.g_t;
    TangentialForce<Real> t;
    if constexpr (tangential == TangentialLaw::power)
      t = power(c, m, n.total, n.elastic, h, onset.time, k_t, g_t);
    else
      t = spring(c, m, n.total, h, onset.time, k_t, g_t);
    f.tangential = t.force;
    f.h = t.h;
    if constexpr (has_ledger) {
      // that of the spring by its mean before and after, that of the dashpot at the velocity in the middle of the kick
      Lanes3<Real> after, twice;  // force of the spring against it, and the sum of those before and after
      if constexpr (tangential == TangentialLaw::power) {
        f.energy = t.energy;
        after = t.after;
        twice = t.after + t.before;
      } else {
        f.energy = 0.5 * k_t * dot(t.h, t.h);
        after = k_t * t.h;
        twice = fma(k_t, h, after);
      }
      const Lanes3<Real> middle = fma(c.half_kick, t.force, m.v_t);
      const Lanes<Real> work = fnma(dt, dot(t.force + after, middle), 0.5 * onset.time * dot(twice, m.v_t));
      const Lanes<Real> lost = work + (stored - f.energy);
      f.lost_friction = keep_if(t.slides, lost);
      f.lost_tangential = lost - f.lost_friction;
    }
  }
  return f;
}

}  // namespace HWY_NAMESPACE
}  // namespace moraine
HWY_AFTER_NAMESPACE();

#endif
