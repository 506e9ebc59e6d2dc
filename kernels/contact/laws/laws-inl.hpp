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

struct NormalForce {
  Lanes total;    // F_n with its dashpot [N]
  Lanes elastic;  // F_n without [N]
  Lanes dashpot;  // gamma_n [N s/m]
  Lanes a;        // Hertz: sqrt(R* delta) [m]
  Lanes root_a;
};

/// F_n = k_n delta - gamma_n v_n.
HWY_INLINE NormalForce linear_normal(const Constants& c, const Motion& m) {
  NormalForce f;
  f.elastic = c.k_n * m.overlap;
  f.dashpot = c.g_n;
  f.total = fnma(c.g_n, m.v_n, f.elastic);
  return f;
}

/// F_n = 4/3 E* sqrt(R*) delta^(3/2) - gamma_n v_n (Hertz 1882; damping: Tsuji, Tanaka & Ishida 1992).
HWY_INLINE NormalForce hertz_normal(const Constants& c, const Motion& m, double dt) {
  NormalForce f;
  f.a = c.root_radius * sqrt(m.overlap);
  f.root_a = sqrt(f.a);
  const Lanes b = c.g_n * f.root_a, b_dt = b * Lanes(dt);
  f.dashpot = b * (sqrt(fma(b_dt, b_dt, c.four_masses)) - b_dt);
  f.elastic = c.k_n * f.a * m.overlap;
  f.total = fnma(f.dashpot, m.v_n, f.elastic);
  return f;
}

struct TangentialForce {
  Lanes3 force;     // F_t on a [N]
  Lanes3 h;         // displacement after the step [m]
  Lanes energy;     // stored in the displacement [J]; only with the ledger
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

/// h + v_t dt, turned into the tangential plane of this step.
HWY_INLINE Lanes3 advance_displacement(const Motion& m, Lanes3 h, double dt) {
  h = fma(Lanes(dt), m.v_t, h);
  return fnma(dot(h, m.normal), m.normal, h);
}

/// Spring and dashpot under Coulomb's cap (Cundall & Strack 1979): F_t = -k_t h - gamma_t v_t; where it slides, both are scaled
/// alike. (A spring that makes up for a dashpot beyond the cap, h = -(F_t + gamma_t v_t)/k_t, is wound backwards when the contact
/// begins; as a Mindlin contact stiffens it then pushes along the motion.)
HWY_INLINE TangentialForce spring(const Constants& c, const Motion& m, Lanes f_n, Lanes3 h, double dt, Lanes k_t,
                                  Lanes g_t) {
  TangentialForce t;
  t.h = advance_displacement(m, h, dt);
  t.force = fma(-k_t, t.h, Lanes3{-(g_t * m.v_t.x), -(g_t * m.v_t.y), -(g_t * m.v_t.z)});
  Lanes scale;
  t.slides = cap(c, f_n, t.force, scale);
  t.h = scale * t.h;
  return t;
}

/// F_t = mu F_N (1 - (1 - |h|/delta_max)^(3/2)) against h, constant beyond delta_max (Langston, Tuzun & Heyes 1995, after
/// Mindlin & Deresiewicz 1953), and a dashpot, under Coulomb's cap. delta_max is given or 3/2 mu F_N / k_t, so that k_t is the
/// stiffness at no displacement; F_N is the elastic normal force.
HWY_INLINE TangentialForce power(const Constants& c, const Motion& m, Lanes f_n, Lanes elastic, Lanes3 h, double dt,
                                 Lanes k_t, Lanes g_t) {
  TangentialForce t;
  const Lanes tiny(1e-300), one(1.0);
  t.h = advance_displacement(m, h, dt);
  const Lanes limit = c.mu * max(elastic, Lanes(0.0));
  const Lanes delta_max = max(select(c.displacement > Lanes(0.0), c.displacement, Lanes(1.5) * limit / k_t), tiny);
  const Lanes size = max(sqrt(dot(t.h, t.h)), tiny);
  const Lanes shorten = min(delta_max / size, one);
  t.h = shorten * t.h;
  const Lanes x = min(size / delta_max, one);
  const Lanes rest = one - x, root = sqrt(rest);
  const Lanes pull = limit * fnma(rest, root, one) / (shorten * size);
  t.force = Lanes3{-(g_t * m.v_t.x), -(g_t * m.v_t.y), -(g_t * m.v_t.z)};
  t.force = fnma(pull, t.h, t.force);
  Lanes scale;
  // past delta_max it slides, though without a dashpot only round-off tells its force from the limit
  t.slides.m = hn::Or(cap(c, f_n, t.force, scale).m, (size > delta_max).m);
  // integral of the law from 0 to |h|
  t.energy = limit * delta_max * (x - Lanes(0.4) * fnma(rest * rest, root, one));
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
/// that sticks is just what it stores; what is missing went to friction or to the dashpot. (The work of a force at the velocity
/// in the middle of the kick would need the other contacts' forces.)
template <NormalLaw normal, TangentialLaw tangential, bool has_ledger>
HWY_INLINE ContactForce contact_force(const Constants& c, const Motion& m, Lanes3 h, Lanes stored, double dt) {
  ContactForce f{};
  NormalForce n;
  if constexpr (normal == NormalLaw::linear)
    n = linear_normal(c, m);
  else
    n = hertz_normal(c, m, dt);
  f.normal = n.total;
  if constexpr (has_ledger) f.lost_normal = n.dashpot * m.v_n * fma(Lanes(0.5 * dt) * c.s, f.normal, m.v_n) * Lanes(dt);

  if constexpr (tangential == TangentialLaw::none) {
    const Lanes zero(0.0);
    f.tangential = f.h = {zero, zero, zero};
    f.energy = f.lost_tangential = f.lost_friction = zero;
  } else if constexpr (tangential == TangentialLaw::viscous) {
    f.tangential = {-(c.g_t * m.v_t.x), -(c.g_t * m.v_t.y), -(c.g_t * m.v_t.z)};
    Lanes scale;
    const LaneMask slides = cap(c, n.total, f.tangential, scale);
    if constexpr (has_ledger) {
      const Lanes lost = -(Lanes(dt) * dot(f.tangential, m.v_t));
      f.energy = Lanes(0.0);
      f.lost_friction = keep_if(slides, lost);
      f.lost_tangential = lost - f.lost_friction;
    }
  } else {
    // a Hertz contact grows stiffer with its area, but for a spring of given stiffness
    constexpr bool scales = normal == NormalLaw::hertz && tangential != TangentialLaw::spring;
    const Lanes k_t = scales ? c.k_t * n.a : c.k_t, g_t = scales ? c.g_t * n.root_a : c.g_t;
    TangentialForce t;
    if constexpr (tangential == TangentialLaw::power)
      t = power(c, m, n.total, n.elastic, h, dt, k_t, g_t);
    else
      t = spring(c, m, n.total, h, dt, k_t, g_t);
    f.tangential = t.force;
    f.h = t.h;
    if constexpr (has_ledger) {
      Lanes3 pull = -Lanes(1.0) * t.force;  // that of the dashpot as it is, of the spring the mean before and after
      if constexpr (tangential == TangentialLaw::power) {
        f.energy = t.energy;
      } else {
        f.energy = Lanes(0.5) * k_t * dot(t.h, t.h);
        pull = fma(Lanes(0.5) * k_t, h - t.h, pull);
      }
      const Lanes work = Lanes(dt) * dot(pull, m.v_t);
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
