#include "kernels/contact/reference/reference.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace moraine {

namespace {

struct Stiffness {
  double normal_force = 0.0;        // elastic, and of JKR with its attraction [N]
  double attraction = 0.0;          // of the other laws of cohesion [N]
  double pull_off = 0.0;            // of JKR [N]
  double normal = 0.0;              // [N/m], for rolling
  double normal_energy = 0.0;       // [J]
  double normal_dashpot = 0.0;      // gamma_n [N s/m]
  double tangential = 0.0;          // k_t [N/m]
  double tangential_dashpot = 0.0;  // gamma_t [N s/m]
};

/// gamma = 2 beta sqrt(k (1/s - gamma dt/2)): the dashpot for velocities half a step late (see laws/coefficients-inl.hpp).
double dashpot(double beta, double k, double s, double dt) {
  const double b = beta * std::sqrt(k);
  return std::sqrt(b * b * b * b * dt * dt + 4.0 * b * b / s) - b * b * dt;
}

/// The share of a step for which a dashpot acts on a contact that began, or ends, q steps from the positions; it grows
/// with that power of the overlap. The first two positions share what has to be damped up to half a step after the second.
double onset(double q, double power) {
  if (!(q < 2.0)) return 1.0;
  const auto damped = [power](double steps) { return std::pow(steps, power + 1.0) / (power + 1.0); };
  if (q < 1.0) return damped(1.5) * q / std::pow(q, power);
  return (damped(q + 0.5) - damped(1.5) * (q - 1.0)) / std::pow(q, power);
}

Stiffness linear(TangentialLaw law, const PairParameters& p, double overlap, double s, double dt) {
  Stiffness k;
  const double k_n = p[Parameter::normal_stiffness];
  k.normal = k_n;
  k.normal_force = k_n * overlap;
  k.normal_energy = 0.5 * k_n * overlap * overlap;
  k.normal_dashpot = dashpot(p[Parameter::damping], k_n, s, dt);
  k.tangential = p[Parameter::tangential_stiffness];
  k.tangential_dashpot =
      law == TangentialLaw::viscous ? p[Parameter::viscosity] : p[Parameter::tangential_damping] * k.normal_dashpot;
  return k;
}

/// All but the normal force and its energy, for a contact radius a [m].
Stiffness hertz(TangentialLaw law, const PairParameters& p, double a, double s, double dt) {
  Stiffness k;
  const double young = p[Parameter::young], beta = p[Parameter::damping];
  k.normal = 2.0 * young * a;
  k.normal_dashpot = dashpot(beta, 5.0 / 6.0 * 2.0 * young * a, s, dt);
  k.tangential = law == TangentialLaw::spring ? p[Parameter::tangential_stiffness] : 8.0 * p[Parameter::shear] * a;
  k.tangential_dashpot = law == TangentialLaw::viscous ? p[Parameter::viscosity]
                                                       : p[Parameter::tangential_damping] * 2.0 * std::sqrt(5.0 / 6.0) *
                                                             beta * std::sqrt(k.tangential / s);
  return k;
}

Stiffness hertz(TangentialLaw law, const PairParameters& p, double overlap, double s, double kappa, double dt) {
  const double a = std::sqrt(overlap / kappa), young = p[Parameter::young];
  Stiffness k = hertz(law, p, a, s, dt);
  k.normal_force = 4.0 / 3.0 * young * a * overlap;
  k.normal_energy = 8.0 / 15.0 * young * a * overlap * overlap;
  return k;
}

/// Contact radius [m] of the overlap: the larger real root of overlap = a^2/R - sqrt(2 pi W a/E), by halving.
double jkr_radius(double w, double young, double r, double overlap) {
  const auto overlap_of = [&](double a) { return a * a / r - std::sqrt(2.0 * std::numbers::pi * w * a / young); };
  double low = std::cbrt(0.125 * std::numbers::pi * w * r * r / young);  // where a contact breaks
  double high = std::max(2.0 * low, std::sqrt(std::max(overlap, 0.0) * r));
  while (overlap_of(high) < overlap) high *= 2.0;
  for (int i = 0; i < 200 && low < high; ++i) {
    const double middle = 0.5 * (low + high);
    if (middle == low || middle == high) break;
    (overlap_of(middle) < overlap ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

/// Work of the JKR force from the contact of no overlap to radius a [J]: the integral of F d(overlap).
double jkr_energy(double w, double young, double r, double a) {
  // F = 4 E a^3/(3 R) - sqrt(8 pi W E a^3), d(overlap)/da = 2 a/R - sqrt(pi W/(2 E a))
  const double p = std::sqrt(8.0 * std::numbers::pi * w * young), q = std::sqrt(0.5 * std::numbers::pi * w / young);
  const auto integral = [&](double x) {
    return 8.0 * young / (15.0 * r * r) * std::pow(x, 5.0) - 4.0 * young * q / (10.5 * r) * std::pow(x, 3.5) -
           4.0 * p / (7.0 * r) * std::pow(x, 3.5) + 0.5 * p * q * x * x;
  };
  return integral(a) - integral(std::cbrt(2.0 * std::numbers::pi * w * r * r / young));
}

Stiffness jkr(TangentialLaw law, const PairParameters& p, double overlap, double s, double kappa, double dt) {
  const double w = p[Parameter::cohesion], young = p[Parameter::young], r = 1.0 / kappa;
  if (!(w > 0.0)) return hertz(law, p, std::max(overlap, 0.0), s, kappa, dt);
  const double a = jkr_radius(w, young, r, overlap);
  Stiffness k = hertz(law, p, a, s, dt);
  k.normal_force = 4.0 / 3.0 * young * a * a * a / r - std::sqrt(8.0 * std::numbers::pi * w * young * a * a * a);
  k.normal_energy = jkr_energy(w, young, r, a);
  k.pull_off = jkr_pull_off(p, r);
  return k;
}

/// Area [m2] of the circle in which a sphere meets another, or a plane, and the volume [m3] that they share.
struct Lens {
  double area, volume;
};
Lens lens(double radius, double curvature, double overlap) {
  constexpr double pi = std::numbers::pi;
  const auto cap = [](double r, double height) { return pi * height * height * (r - height / 3.0); };
  if (curvature == 0.0) {
    const double distance = radius - overlap;
    return {pi * (radius * radius - distance * distance), cap(radius, overlap)};
  }
  const double other = 1.0 / curvature, apart = radius + other - overlap;
  const double along = (apart * apart + radius * radius - other * other) / (2.0 * apart);  // to the circle's plane
  return {pi * (radius * radius - along * along), cap(radius, radius - along) + cap(other, other - apart + along)};
}

/// Attraction [N] of the laws that add it to the normal law, and its energy [J], less than zero where it draws together.
void attract(CohesionLaw law, const PairParameters& p, const ReferenceContact& c, double mirror, double reduced_radius,
             Stiffness& k) {
  const double strength = p[Parameter::cohesion], range = p[Parameter::cohesion_range];
  const double deep = std::max(c.overlap, 0.0), gap = std::max(-c.overlap, 0.0);
  switch (law) {
    case CohesionLaw::none:
    case CohesionLaw::jkr: break;
    case CohesionLaw::sjkr: {
      const double other = mirror == 2.0 ? c.a.curvature : c.b.curvature;
      const Lens meeting = lens(1.0 / c.a.curvature, other, deep);
      k.attraction = strength * meeting.area;
      k.normal_energy -= strength * meeting.volume;  // a step nearer shares the circle's area times the step
      break;
    }
    case CohesionLaw::linear: {
      const double left = std::max(range - gap, 0.0);
      k.attraction = gap > 0.0 ? strength * left / range : strength;
      k.normal_energy -= strength * deep + (range > 0.0 ? 0.5 * strength * left * left / range : 0.0);
      break;
    }
    case CohesionLaw::liquid_bridge: {
      const double volume = p[Parameter::liquid_volume], r = 2.0 * reduced_radius;
      if (!(volume > 0.0)) break;
      const double f_0 = 2.0 * std::numbers::pi * r * strength, x = gap * std::sqrt(r / volume);
      k.attraction = f_0 / (1.0 + 1.05 * x + 2.5 * x * x);
      const double root = std::sqrt(4.0 * 2.5 - 1.05 * 1.05);
      const double integral = 2.0 / root * (std::atan((5.0 * x + 1.05) / root) - std::atan(1.05 / root));
      k.normal_energy += f_0 * (std::sqrt(volume / r) * integral - deep);
      break;
    }
  }
}

/// Energy [J] that a bond takes along when it breaks.
double energy_of_break(CohesionLaw law, const PairParameters& p, const ReferenceContact& c, double mirror,
                       double reduced_radius) {
  const double w = p[Parameter::cohesion], young = p[Parameter::young], r = reduced_radius;
  if (law == CohesionLaw::jkr)
    return w > 0.0 ? jkr_energy(w, young, r, std::cbrt(0.125 * std::numbers::pi * w * r * r / young)) : 0.0;
  Stiffness at_break;
  ReferenceContact apart = c;
  apart.overlap = -p[Parameter::cohesion_range];
  attract(law, p, apart, mirror, r, at_break);
  return at_break.normal_energy;
}

/// Scales the force to the limit where it is beyond.
bool cap(double limit, Vec3& force) {
  const double size = length(force);
  if (!(size > limit)) return false;
  force = (limit / size) * force;
  return true;
}

/// Scales the force of a spring k (stretched by h) and a dashpot g to the limit where it is beyond. The spring then keeps what the limit leaves of it
/// beside the dashpot, along the force never less than nothing.
bool hold_to_limit(double limit, double k, double g, Vec3 v, Vec3& h, Vec3& force) {
  const double size = length(force);
  if (!(size > limit)) return false;
  const Vec3 along = -force / size;  // the way that the spring is stretched
  const double by_dashpot = g * dot(v, along);
  const Vec3 across = v - dot(v, along) * along;
  h = (std::max(limit - by_dashpot, 0.0) * along - g * across) / k;
  force = -limit * along;
  return true;
}

/// Rolling resistance: torque on a [N m], what it remembers, and its energies. `pressing`: as Coulomb's limit takes it.
struct Resistance {
  Vec3 torque, angle;
  double energy = 0.0, work = 0.0, lost_dashpot = 0.0;
  bool yields = false;
};

Resistance roll(const LawChoice& laws, const PairParameters& p, const ReferenceContact& c, double mirror,
                double reduced_radius, double normal_stiffness, double pressing, double dt) {
  Resistance r;
  Vec3 spin = mirror * c.a.angular_velocity - c.b.angular_velocity;
  spin -= dot(spin, c.normal) * c.normal;
  const double limit = p[Parameter::rolling_friction] * reduced_radius * std::max(pressing, 0.0);
  if (laws.rolling == RollingLaw::constant) {
    const double slow = 4.0 * dt * limit * mirror * (c.a.inverse_inertia + c.b.inverse_inertia);
    const double size = std::max(length(spin), slow);
    if (size > 0.0) r.torque = -limit / size * spin;
    r.work = -dt * dot(r.torque, spin);
    r.yields = true;
    return r;
  }
  const auto about_contact = [](const ContactBody& body) {
    if (body.inverse_inertia == 0.0) return 0.0;
    const double radius = 1.0 / body.curvature;
    return 1.0 / (1.0 / body.inverse_inertia + radius * radius / body.inverse_mass);
  };
  const double k_r = rolling_stiffness(p, normal_stiffness, reduced_radius);
  r.angle = c.angle + dt * spin;
  r.angle -= dot(r.angle, c.normal) * c.normal;
  const double c_r =
      dashpot(p[Parameter::rolling_damping], k_r, mirror * (about_contact(c.a) + about_contact(c.b)), dt);
  r.torque = -k_r * r.angle - c_r * spin;
  r.yields = hold_to_limit(limit, k_r, c_r, spin, r.angle, r.torque);
  r.energy = 0.5 * k_r * squared_length(r.angle);
  r.lost_dashpot = r.yields ? 0.0 : dt * c_r * squared_length(spin);
  r.work = dt * dot(0.5 * k_r * (c.angle - r.angle) - r.torque, spin);
  return r;
}

}  // namespace

double jkr_pull_off(const PairParameters& p, double reduced_radius) {
  return 1.5 * std::numbers::pi * p[Parameter::cohesion] * reduced_radius;
}

double jkr_stiffness(const PairParameters& p, double reduced_radius) {
  const double young = p[Parameter::young];
  const double a_0 =
      std::cbrt(4.5 * std::numbers::pi * p[Parameter::cohesion] * reduced_radius * reduced_radius / young);
  return 1.2 * young * a_0;
}

double rolling_stiffness(const PairParameters& p, double normal_stiffness, double reduced_radius) {
  const double lever = p[Parameter::rolling_friction] * reduced_radius;
  return p[Parameter::rolling_stiffness] > 0.0 ? p[Parameter::rolling_stiffness]
                                               : 2.25 * normal_stiffness * lever * lever;
}

double attraction_range(CohesionLaw law, const PairParameters& p, double reduced_radius) {
  const double w = p[Parameter::cohesion], r = reduced_radius;
  switch (law) {
    case CohesionLaw::none:
    case CohesionLaw::sjkr: return 0.0;
    case CohesionLaw::linear:
    case CohesionLaw::liquid_bridge: return p[Parameter::cohesion_range];
    case CohesionLaw::jkr: break;
  }
  if (!(w > 0.0)) return 0.0;
  const double a_0 = std::cbrt(4.5 * std::numbers::pi * w * r * r / p[Parameter::young]);
  return 0.5 * a_0 * a_0 / r / std::cbrt(6.0);
}

ReferenceForce reference_contact(const LawChoice& laws, const PairParameters& p, const ReferenceContact& c, double dt,
                                 double mirror) {
  const TangentialLaw tangential = laws.tangential;
  const bool has_rotation = laws.has_rotation;
  ReferenceForce out;
  const double s = mirror * (c.a.inverse_mass + c.b.inverse_mass);
  const double s_t = has_rotation ? 3.5 * s : s;
  const double kappa = mirror * (c.a.curvature + c.b.curvature);
  const bool touches = c.overlap > 0.0;
  out.acts = touches ||
             (c.overlap > -attraction_range(laws.cohesion, p, 1.0 / kappa) && (c.is_bound || !has_bond(laws.cohesion)));
  if (!out.acts) {
    if (c.is_bound) out.lost_normal = energy_of_break(laws.cohesion, p, c, mirror, 1.0 / kappa);
    out.lost_friction = c.stored;
    return out;
  }
  Stiffness k;
  if (laws.cohesion == CohesionLaw::jkr)
    k = jkr(tangential, p, c.overlap, s, kappa, dt);
  else if (laws.normal == NormalLaw::linear)
    k = linear(tangential, p, std::max(c.overlap, 0.0), s, dt);
  else
    k = hertz(tangential, p, std::max(c.overlap, 0.0), s, kappa, dt);
  if (!touches && laws.cohesion != CohesionLaw::jkr) k.normal_dashpot = 0.0;
  attract(laws.cohesion, p, c, mirror, 1.0 / kappa, k);

  // Motion of the contact point.
  const Vec3 n = c.normal;
  const Vec3 v = c.a.velocity - c.b.velocity;
  const double v_n_one = dot(v, n);
  const double v_n = mirror * v_n_one;
  Vec3 v_t = v - v_n_one * n;
  if (has_rotation && tangential != TangentialLaw::none)
    v_t -= cross(c.a.arm * c.a.angular_velocity + c.b.arm * c.b.angular_velocity, n);

  // Between two steps it began, or will end; one that attracts begins and ends otherwise, and is damped for whole steps.
  const bool is_further = laws.cohesion != CohesionLaw::none || laws.rolling != RollingLaw::none;
  const double q = is_further ? std::numeric_limits<double>::infinity() : c.overlap / (std::abs(v_n) * dt);
  const double time = v_n < 0.0 ? std::min(q, 1.0) * dt : dt;
  const bool is_hertz = laws.normal == NormalLaw::hertz;
  k.normal_dashpot *= onset(q, is_hertz ? 0.25 : 0.0);
  const bool has_growing = is_hertz && (tangential == TangentialLaw::mindlin || tangential == TangentialLaw::power);
  k.tangential_dashpot *= onset(q, has_growing ? 0.25 : 0.0);

  const double f_rep = k.normal_force - k.normal_dashpot * v_n, f_n = f_rep - k.attraction;
  const double pressing = f_rep + 2.0 * k.pull_off;
  out.energy_normal = k.normal_energy;
  out.lost_normal = k.normal_dashpot * v_n * (v_n + 0.5 * dt * s * f_n) * dt;

  const double mu = tangential == TangentialLaw::none ? 0.0 : p[Parameter::friction];
  const double limit = mu * std::max(pressing, 0.0);
  Vec3 h = c.displacement + time * v_t;
  h -= dot(h, n) * n;
  Vec3 f_t;
  bool slides = false;
  double work = 0.0;  // on the contact in the step
  switch (tangential) {
    case TangentialLaw::none: h = {}; break;
    case TangentialLaw::viscous:
      h = {};
      f_t = -k.tangential_dashpot / (1.0 + 0.5 * dt * s_t * k.tangential_dashpot) * v_t;
      slides = cap(limit, f_t);
      work = -dt * dot(f_t, v_t + 0.5 * dt * s_t * f_t);
      break;
    case TangentialLaw::spring:
    case TangentialLaw::mindlin:
      f_t = -(k.tangential * h + k.tangential_dashpot * v_t);
      slides = hold_to_limit(limit, k.tangential, k.tangential_dashpot, v_t, h, f_t);
      out.energy_tangential = 0.5 * k.tangential * squared_length(h);
      work = -dt * dot(f_t + k.tangential * h, v_t + 0.5 * dt * s_t * f_t) +
             0.5 * time * k.tangential * dot(c.displacement + h, v_t);
      break;
    case TangentialLaw::power: {
      const double pull = mu * std::max(k.normal_force, 0.0);
      const double delta_max =
          p[Parameter::displacement] > 0.0 ? p[Parameter::displacement] : 1.5 * pull / k.tangential;
      const double size = length(h);
      if (size > delta_max) h = (delta_max / size) * h;
      const double x = delta_max > 0.0 ? std::min(size / delta_max, 1.0) : 1.0;
      f_t = -k.tangential_dashpot * v_t;
      const auto spring = [&](const Vec3& d) {
        const double stretch = length(d);
        if (!(stretch > 0.0) || !(delta_max > 0.0)) return Vec3{};
        return pull * (1.0 - std::pow(1.0 - std::min(stretch / delta_max, 1.0), 1.5)) / stretch * d;
      };
      f_t -= spring(h);
      slides = cap(limit, f_t) || size > delta_max;
      work = -dt * dot(f_t + spring(h), v_t + 0.5 * dt * s_t * f_t) +
             0.5 * time * dot(spring(c.displacement) + spring(h), v_t);
      out.energy_tangential = pull * delta_max * (x - 0.4 * (1.0 - std::pow(1.0 - x, 2.5)));
      break;
    }
  }
  out.displacement = h;
  Resistance rolling;
  if (laws.rolling != RollingLaw::none) rolling = roll(laws, p, c, mirror, 1.0 / kappa, k.normal, pressing, dt);
  out.angle = rolling.angle;
  out.energy_tangential += rolling.energy;
  const double lost = tangential == TangentialLaw::none ? 0.0 : work + rolling.work + c.stored - out.energy_tangential;
  const double dashpot_of_slide = dt * k.tangential_dashpot * dot(v_t, v_t + 0.5 * dt * s_t * f_t);
  out.lost_tangential = slides ? rolling.lost_dashpot : rolling.yields ? dashpot_of_slide : lost;
  out.lost_friction = lost - out.lost_tangential;
  out.slides = slides;
  out.yields = rolling.yields;

  out.force = f_n * n + f_t;
  if (has_rotation) {
    const Vec3 moment = cross(n, f_t);
    out.torque_a = rolling.torque - c.a.arm * moment;
    out.torque_b = -rolling.torque - c.b.arm * moment;
  }
  return out;
}

}  // namespace moraine
