// Contact laws: what one contact gives, as a function of plain values, one contact a lane.
//
// Notation (also in kernels/contact/README.md)
//   delta   overlap [m]                    v_n   normal velocity, positive when separating [m/s]
//   s       1/m_a + 1/m_b [1/kg]           v_t   tangential velocity of the contact point, a relative to b [m/s]
//   kappa   1/r_a + 1/r_b [1/m]            h     tangential displacement [m]
//   F_n     normal force, positive when repulsive [N]     F_t  tangential force on a [N]
//
// Velocities come half a step before the positions (leapfrog): a dashpot sees v - dt/2 a. In a contact of two bodies that acts as
// if the reduced mass were 1/s - gamma dt/2, so that the restitution would be wrong by the order of dt. The dashpot is therefore
// made for that mass: gamma = 2 beta sqrt(k (1/s - gamma dt/2)), which is
//   gamma = b (sqrt(4/s + b^2 dt^2) - b dt),   b = beta sqrt(k),
// so that this error is gone, for any damping (gamma dt/2 < 1/s). A contact at rest is left alone: its overlap is F/k. What a
// dashpot does where a contact begins and ends between two steps: Onset, in laws-inl.hpp. The viscous tangential law has no rest to
// keep; its force is taken at the velocity in the middle of the kick, F = -gamma (v + dt/2 s_t F), stable for any viscosity;
// s_t = 7/2 s for spheres that rotate (1/m + r^2/I).
#if defined(MORAINE_KERNELS_CONTACT_COEFFICIENTS_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MORAINE_KERNELS_CONTACT_COEFFICIENTS_INL_HPP
#undef MORAINE_KERNELS_CONTACT_COEFFICIENTS_INL_HPP
#else
#define MORAINE_KERNELS_CONTACT_COEFFICIENTS_INL_HPP
#endif

#include "kernels/base/simd/lanes-inl.hpp"
#include "kernels/contact/parameters.hpp"

HWY_BEFORE_NAMESPACE();
namespace moraine {
namespace HWY_NAMESPACE {

/// What a law needs to know of a contact besides its motion; constant over the steps, so that a uniform scene computes it once.
template <typename Real>
struct Constants {
  Lanes<Real> s;  // inverse reduced mass [1/kg]
  Lanes<Real> mu;
  Lanes<Real> k_n, g_n;      // linear: k_n, gamma_n. Hertz: 4/3 E*, b / sqrt(a)
  Lanes<Real> k_t, g_t;      // linear: k_t, gamma_t. Mindlin: 8 G*, gamma_t / sqrt(a). Viscous: -, gamma_t
  Lanes<Real> half_kick;     // dt/2 s_t
  Lanes<Real> four_masses;   // Hertz: 4/s
  Lanes<Real> root_radius;   // Hertz: sqrt(R*)
  Lanes<Real> displacement;  // power: delta_max, or 0
};

/// Parameters of each lane's pair of materials.
template <typename Real>
struct RowOf {
  const LawTable* table;
  const std::uint8_t* species;  // of the lanes; nullptr: row 0
  HWY_INLINE Lanes<Real> operator()(Parameter p) const {
    const double* column = table->column(p);
    return species ? gather<Real>(column, species) : Lanes<Real>(column[0]);
  }
};

template <NormalLaw normal, TangentialLaw tangential, bool has_rotation, typename Real>
HWY_INLINE Constants<Real> make_constants(RowOf<Real> row, Lanes<Real> s, Lanes<Real> kappa, double dt) {
  constexpr bool has_spring = tangential == TangentialLaw::spring || tangential == TangentialLaw::power;
  Constants<Real> c{};
  const Lanes<Real> one(1.0);
  c.s = s;
  c.mu = tangential == TangentialLaw::none ? 0.0 : row(Parameter::friction);
  const Lanes<Real> beta = row(Parameter::damping);
  if constexpr (normal == NormalLaw::linear) {
    c.k_n = row(Parameter::normal_stiffness);
    const Lanes<Real> b = beta * sqrt(c.k_n), b_dt = b * dt;
    c.g_n = b * (sqrt(fma(b_dt, b_dt, 4.0 / s)) - b_dt);
    if constexpr (has_spring) {
      c.k_t = row(Parameter::tangential_stiffness);
      c.g_t = row(Parameter::tangential_damping) * c.g_n;
    }
  } else {
    // With a = sqrt(R* delta): F = 4/3 E* a delta; the dashpot is that of a spring k = 5/6 S_n, S_n = 2 E* a (Tsuji et al. 1992);
    // S_t = 8 G* a (Mindlin 1949), gamma_t = ratio 2 sqrt(5/6) beta sqrt(S_t / s).
    const Lanes<Real> young = row(Parameter::young), damping = 0.91287092917527685576 * beta;
    c.k_n = (4.0 / 3.0) * young;
    c.g_n = damping * sqrt(2.0 * young);
    c.four_masses = 4.0 / s;
    c.root_radius = sqrt(one / kappa);
    if constexpr (tangential == TangentialLaw::mindlin || has_spring) {
      c.k_t = tangential == TangentialLaw::spring ? row(Parameter::tangential_stiffness) : 8.0 * row(Parameter::shear);
      c.g_t = row(Parameter::tangential_damping) * damping * sqrt(c.four_masses * c.k_t);
    }
  }
  c.half_kick = (0.5 * dt) * (has_rotation ? 3.5 * s : s);
  if constexpr (tangential == TangentialLaw::viscous) c.g_t = row(Parameter::viscosity);
  if constexpr (tangential == TangentialLaw::power) c.displacement = row(Parameter::displacement);
  return c;
}

}  // namespace HWY_NAMESPACE
}  // namespace moraine
HWY_AFTER_NAMESPACE();

#endif
