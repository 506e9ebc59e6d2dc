#include "kernels/contact/reference/reference.hpp"

#include <algorithm>
#include <cmath>

namespace moraine {

namespace {

struct Stiffness {
  double normal_force = 0.0;        // elastic [N]
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
  k.normal_force = k_n * overlap;
  k.normal_energy = 0.5 * k_n * overlap * overlap;
  k.normal_dashpot = dashpot(p[Parameter::damping], k_n, s, dt);
  k.tangential = p[Parameter::tangential_stiffness];
  k.tangential_dashpot =
      law == TangentialLaw::viscous ? p[Parameter::viscosity] : p[Parameter::tangential_damping] * k.normal_dashpot;
  return k;
}

Stiffness hertz(TangentialLaw law, const PairParameters& p, double overlap, double s, double kappa, double dt) {
  Stiffness k;
  const double a = std::sqrt(overlap / kappa);
  const double young = p[Parameter::young], beta = p[Parameter::damping];
  k.normal_force = 4.0 / 3.0 * young * a * overlap;
  k.normal_energy = 8.0 / 15.0 * young * a * overlap * overlap;
  k.normal_dashpot = dashpot(beta, 5.0 / 6.0 * 2.0 * young * a, s, dt);
  k.tangential = law == TangentialLaw::spring ? p[Parameter::tangential_stiffness] : 8.0 * p[Parameter::shear] * a;
  k.tangential_dashpot = law == TangentialLaw::viscous ? p[Parameter::viscosity]
                                                       : p[Parameter::tangential_damping] * 2.0 * std::sqrt(5.0 / 6.0) *
                                                             beta * std::sqrt(k.tangential / s);
  return k;
}

/// Scales the force to the limit where it is beyond; `scale` is by how much.
bool cap(double limit, Vec3& force, double& scale) {
  const double size = length(force);
  scale = 1.0;
  if (!(size > limit)) return false;
  scale = limit / size;
  force = scale * force;
  return true;
}

}  // namespace

ReferenceForce reference_contact(NormalLaw normal, TangentialLaw tangential, bool has_rotation, const PairParameters& p,
                                 const ReferenceContact& c, double dt, double mirror) {
  ReferenceForce out;
  const double s = mirror * (c.a.inverse_mass + c.b.inverse_mass);
  const double s_t = has_rotation ? 3.5 * s : s;
  const double kappa = mirror * (c.a.curvature + c.b.curvature);
  Stiffness k = normal == NormalLaw::linear ? linear(tangential, p, c.overlap, s, dt)
                                            : hertz(tangential, p, c.overlap, s, kappa, dt);

  // Motion of the contact point.
  const Vec3 n = c.normal;
  const Vec3 v = c.a.velocity - c.b.velocity;
  const double v_n_one = dot(v, n);
  const double v_n = mirror * v_n_one;
  Vec3 v_t = v - v_n_one * n;
  if (has_rotation && tangential != TangentialLaw::none)
    v_t -= cross(c.a.arm * c.a.angular_velocity + c.b.arm * c.b.angular_velocity, n);

  // Between two steps it began, or will end.
  const double q = c.overlap / (std::abs(v_n) * dt);
  const double time = v_n < 0.0 ? std::min(q, 1.0) * dt : dt;
  const bool is_hertz = normal == NormalLaw::hertz;
  k.normal_dashpot *= onset(q, is_hertz ? 0.25 : 0.0);
  const bool has_growing = is_hertz && (tangential == TangentialLaw::mindlin || tangential == TangentialLaw::power);
  k.tangential_dashpot *= onset(q, has_growing ? 0.25 : 0.0);

  const double f_n = k.normal_force - k.normal_dashpot * v_n;
  out.energy_normal = k.normal_energy;
  out.lost_normal = k.normal_dashpot * v_n * (v_n + 0.5 * dt * s * f_n) * dt;

  const double mu = tangential == TangentialLaw::none ? 0.0 : p[Parameter::friction];
  const double limit = mu * std::max(f_n, 0.0);
  Vec3 h = c.displacement + time * v_t;
  h -= dot(h, n) * n;
  Vec3 f_t;
  bool slides = false;
  double scale = 1.0;
  double work = 0.0;  // on the contact in the step
  switch (tangential) {
    case TangentialLaw::none: h = {}; break;
    case TangentialLaw::viscous:
      h = {};
      f_t = -k.tangential_dashpot / (1.0 + 0.5 * dt * s_t * k.tangential_dashpot) * v_t;
      slides = cap(limit, f_t, scale);
      work = -dt * dot(f_t, v_t + 0.5 * dt * s_t * f_t);
      break;
    case TangentialLaw::spring:
    case TangentialLaw::mindlin:
      f_t = -(k.tangential * h + k.tangential_dashpot * v_t);
      if (const double pull = length(f_t); pull > limit) {
        const Vec3 along = -f_t / pull;  // the way that the spring is stretched
        h = std::max(limit - k.tangential_dashpot * dot(v_t, along), 0.0) / k.tangential * along;
      }
      slides = cap(limit, f_t, scale);
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
      slides = cap(limit, f_t, scale) || size > delta_max;
      work = -dt * dot(f_t + spring(h), v_t + 0.5 * dt * s_t * f_t) + 0.5 * time * dot(spring(c.displacement) + spring(h), v_t);
      out.energy_tangential = pull * delta_max * (x - 0.4 * (1.0 - std::pow(1.0 - x, 2.5)));
      break;
    }
  }
  out.displacement = h;
  const double lost = tangential == TangentialLaw::none ? 0.0 : work + c.stored - out.energy_tangential;
  (slides ? out.lost_friction : out.lost_tangential) = lost;
  out.slides = slides;

  out.force = f_n * n + f_t;
  if (has_rotation) {
    const Vec3 moment = cross(n, f_t);
    out.torque_a = -c.a.arm * moment;
    out.torque_b = -c.b.arm * moment;
  }
  return out;
}

}  // namespace moraine
