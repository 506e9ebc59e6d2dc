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
struct Motion {
  Lanes overlap;  // delta [m]
  Lanes3 normal;  // unit, from b to a
  Lanes v_n;      // [m/s]
  Lanes3 v_t;     // [m/s]
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
struct Onset {
  Lanes constant,
      growing;  // w of dashpots that are constant, and that grow with the root of the radius of the contact area
  Lanes time;   // for which the contact has moved since the positions before [s]
};

/// w where f = 1: 3/2 q, 2 - q/2, 1.
HWY_INLINE Lanes weight_of_constant(Lanes q) {
  return min(Lanes(1.5) * q, max(fnma(Lanes(0.5), q, Lanes(2.0)), Lanes(1.0)));
}

/// w where f = q^(1/4), F = 4/5 q^(5/4).
HWY_INLINE Lanes weight_of_growing(Lanes q) {
  const Lanes one(1.0), first(1.32801830364038591);  // F(3/2)
  const Lanes later = q + Lanes(0.5);
  const Lanes whole = Lanes(0.8) * later * sqrt(sqrt(later));
  const Lanes both = fnma(first, max(q - one, Lanes(0.0)), whole);
  const Lanes weighted = select(q < one, first * q, both) / sqrt(sqrt(q));
  return select(q < Lanes(2.0), weighted, one);
}

HWY_INLINE Onset onset_of(const Motion& m, double dt) {
  const Lanes one(1.0), travel = Lanes(dt) * abs(m.v_n);
  Onset onset{one, one, Lanes(dt)};
  const LaneMask is_young = (m.overlap > Lanes(0.0)) & (m.overlap < Lanes(2.0) * travel);
  if (none(is_young)) return onset;
  const Lanes q = m.overlap / travel;
  onset.constant = select(is_young, weight_of_constant(q), one);
  onset.growing = select(is_young, weight_of_growing(q), one);
  onset.time = select(is_young & (m.v_n < Lanes(0.0)), Lanes(dt) * min(q, one), onset.time);
  return onset;
}

struct NormalForce {
  Lanes total;    // F_n with its dashpot [N]
  Lanes elastic;  // F_n without [N]
  Lanes dashpot;  // gamma_n [N s/m]
  Lanes a;        // Hertz: sqrt(R* delta) [m]
  Lanes root_a;
};

/// F_n = k_n delta - w gamma_n v_n.
HWY_INLINE NormalForce linear_normal(const Constants& c, const Motion& m, const Onset& onset) {
  NormalForce f;
  f.elastic = c.k_n * m.overlap;
  f.dashpot = onset.constant * c.g_n;
  f.total = fnma(f.dashpot, m.v_n, f.elastic);
  return f;
}

/// F_n = 4/3 E* sqrt(R*) delta^(3/2) - w gamma_n v_n (Hertz 1882; damping: Tsuji, Tanaka & Ishida 1992).
HWY_INLINE NormalForce hertz_normal(const Constants& c, const Motion& m, const Onset& onset, double dt) {
  NormalForce f;
  f.a = c.root_radius * sqrt(m.overlap);
  f.root_a = sqrt(f.a);
  const Lanes b = c.g_n * f.root_a, b_dt = b * Lanes(dt);
  f.dashpot = onset.growing * (b * (sqrt(fma(b_dt, b_dt, c.four_masses)) - b_dt));
  f.elastic = c.k_n * f.a * m.overlap;
  f.total = fnma(f.dashpot, m.v_n, f.elastic);
  return f;
}

struct TangentialForce {
  Lanes3 force;  // F_t on a [N]
  Lanes3 h;      // displacement after the step [m]
  Lanes energy;  // stored in the displacement [J]; only with the ledger, and with the power law, as what follows
  Lanes3 after,
      before;  // along h: force of the spring, and what it would have been for the displacement before the step [N]
  LaneMask slides;  // at Coulomb's limit
};

/// Scales f to Coulomb's limit mu F_n where it is beyond; `scale` is by how much (1 elsewhere).
HWY_INLINE LaneMask cap(const Constants& c, Lanes f_n, Lanes3& f, Lanes& scale) {
  const Lanes limit = c.mu * max(f_n, Lanes(0.0));
  const Lanes square = dot(f, f);
  const LaneMask beyond = square > limit * limit;
  scale = Lanes(1.0);
  if (any(beyond)) {
    scale = select(beyond, limit / sqrt(square), scale);
    f = scale * f;
  }
  return beyond;
}

/// h + v_t dt, turned into the tangential plane of this step; in the first step for the time since the contact began.
HWY_INLINE Lanes3 advance_displacement(const Motion& m, Lanes3 h, Lanes time) {
  h = fma(time, m.v_t, h);
  return fnma(dot(h, m.normal), m.normal, h);
}

/// Spring and dashpot under Coulomb's cap (Cundall & Strack 1979): F_t = -k_t h - gamma_t v_t. Where it slides, the spring keeps what
/// the limit leaves of it beside the dashpot, h = (mu F_n - gamma_t v_t)/k_t along the force, but never less than nothing. (Without
/// this bound it is wound backwards where the dashpot alone is beyond the limit, as when a contact begins; a Mindlin
/// contact, which then stiffens, pushes along the motion.) It never grows by that.
HWY_INLINE TangentialForce spring(const Constants& c, const Motion& m, Lanes f_n, Lanes3 h, Lanes time, Lanes k_t,
                                  Lanes g_t) {
  TangentialForce t;
  const Lanes zero(0.0);
  t.h = advance_displacement(m, h, time);
  t.force = fma(-k_t, t.h, -g_t * m.v_t);
  const Lanes limit = c.mu * max(f_n, zero), square = dot(t.force, t.force);
  t.slides = square > limit * limit;
  if (none(t.slides)) return t;
  const Lanes inverse = Lanes(1.0) / sqrt(square);
  const Lanes left = max(fma(g_t * inverse, dot(m.v_t, t.force), limit), zero);
  t.h = select(t.slides, -(left * inverse / k_t) * t.force, t.h);
  t.force = select(t.slides, limit * inverse, Lanes(1.0)) * t.force;
  return t;
}

/// F_t = mu F_N (1 - (1 - |h|/delta_max)^(3/2)) against h, constant beyond delta_max (Langston, Tuzun & Heyes 1995, after
/// Mindlin & Deresiewicz 1953), and a dashpot, under Coulomb's cap. delta_max is given or 3/2 mu F_N / k_t, so that k_t is the
/// stiffness at no displacement; F_N is the elastic normal force.
HWY_INLINE TangentialForce power(const Constants& c, const Motion& m, Lanes f_n, Lanes elastic, Lanes3 h, Lanes time,
                                 Lanes k_t, Lanes g_t) {
  TangentialForce t;
  const Lanes tiny(1e-300), one(1.0);
  t.h = advance_displacement(m, h, time);
  const Lanes limit = c.mu * max(elastic, Lanes(0.0));
  const Lanes delta_max = max(select(c.displacement > Lanes(0.0), c.displacement, Lanes(1.5) * limit / k_t), tiny);
  const Lanes size = max(sqrt(dot(t.h, t.h)), tiny);
  const Lanes shorten = min(delta_max / size, one);
  t.h = shorten * t.h;
  const Lanes x = min(size / delta_max, one);
  const Lanes rest = one - x, root = sqrt(rest);
  const Lanes pull = limit * fnma(rest, root, one) / (shorten * size);
  t.after = pull * t.h;
  t.force = fma(-g_t, m.v_t, -one * t.after);
  Lanes scale;
  // past delta_max it slides, though without a dashpot only round-off tells its force from the limit
  t.slides.m = hn::Or(cap(c, f_n, t.force, scale).m, (size > delta_max).m);
  // integral of the law from 0 to |h|
  t.energy = limit * delta_max * (x - Lanes(0.4) * fnma(rest * rest, root, one));
  const Lanes size_before = max(sqrt(dot(h, h)), tiny);
  const Lanes rest_before = one - min(size_before / delta_max, one);
  t.before = (limit * fnma(rest_before, sqrt(rest_before), one) / size_before) * h;
  return t;
}

struct ContactForce {
  Lanes normal;
  Lanes3 tangential;
  Lanes3 h;
  Lanes energy;                                       // stored tangentially [J]
  Lanes lost_normal, lost_tangential, lost_friction;  // in this step [J]
};

/// The whole contact: normal law, tangential law, and with the ledger where the energy went.
///
/// Losses: the work of a spring over a step is the mean of its forces before and after times the displacement, which for a spring
/// that sticks is just what it stores; what is missing went to friction or to the dashpot. Dashpots take the velocity in the middle
/// of the kick, as this contact alone would make it (that of the other contacts is not known here).
template <NormalLaw normal, TangentialLaw tangential, bool has_ledger>
HWY_INLINE ContactForce contact_force(const Constants& c, const Motion& m, Lanes3 h, Lanes stored, double dt) {
  ContactForce f{};
  NormalForce n;
  const Onset onset = onset_of(m, dt);
  if constexpr (normal == NormalLaw::linear)
    n = linear_normal(c, m, onset);
  else
    n = hertz_normal(c, m, onset, dt);
  f.normal = n.total;
  if constexpr (has_ledger) f.lost_normal = n.dashpot * m.v_n * fma(Lanes(0.5 * dt) * c.s, f.normal, m.v_n) * Lanes(dt);

  if constexpr (tangential == TangentialLaw::none) {
    const Lanes zero(0.0);
    f.tangential = f.h = {zero, zero, zero};
    f.energy = f.lost_tangential = f.lost_friction = zero;
  } else if constexpr (tangential == TangentialLaw::viscous) {
    const Lanes g_t = onset.constant * c.g_t;
    f.tangential = -(g_t / fma(g_t, c.half_kick, Lanes(1.0))) * m.v_t;
    Lanes scale;
    const LaneMask slides = cap(c, n.total, f.tangential, scale);
    if constexpr (has_ledger) {
      const Lanes lost = -(Lanes(dt) * dot(f.tangential, fma(c.half_kick, f.tangential, m.v_t)));
      f.energy = Lanes(0.0);
      f.lost_friction = keep_if(slides, lost);
      f.lost_tangential = lost - f.lost_friction;
    }
  } else {
    // a Hertz contact grows stiffer with its area, but for a spring of given stiffness
    constexpr bool scales = normal == NormalLaw::hertz && tangential != TangentialLaw::spring;
    const Lanes k_t = scales ? c.k_t * n.a : c.k_t;
    const Lanes g_t = scales ? onset.growing * (c.g_t * n.root_a) : onset.constant * c.g_t;
    TangentialForce t;
    if constexpr (tangential == TangentialLaw::power)
      t = power(c, m, n.total, n.elastic, h, onset.time, k_t, g_t);
    else
      t = spring(c, m, n.total, h, onset.time, k_t, g_t);
    f.tangential = t.force;
    f.h = t.h;
    if constexpr (has_ledger) {
      // that of the spring by its mean before and after, that of the dashpot at the velocity in the middle of the kick
      Lanes3 after, twice;  // force of the spring against it, and the sum of those before and after
      if constexpr (tangential == TangentialLaw::power) {
        f.energy = t.energy;
        after = t.after;
        twice = t.after + t.before;
      } else {
        f.energy = Lanes(0.5) * k_t * dot(t.h, t.h);
        after = k_t * t.h;
        twice = fma(k_t, h, after);
      }
      const Lanes3 middle = fma(c.half_kick, t.force, m.v_t);
      const Lanes work = fnma(Lanes(dt), dot(t.force + after, middle), Lanes(0.5) * onset.time * dot(twice, m.v_t));
      const Lanes lost = work + (stored - f.energy);
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
