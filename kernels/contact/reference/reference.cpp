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
  const Stiffness k = normal == NormalLaw::linear ? linear(tangential, p, c.overlap, s, dt)
                                                  : hertz(tangential, p, c.overlap, s, kappa, dt);

  // Motion of the contact point.
  const Vec3 n = c.normal;
  const Vec3 v = c.a.velocity - c.b.velocity;
  const double v_n_one = dot(v, n);
  const double v_n = mirror * v_n_one;
  Vec3 v_t = v - v_n_one * n;
  if (has_rotation && tangential != TangentialLaw::none)
    v_t -= cross(c.a.arm * c.a.angular_velocity + c.b.arm * c.b.angular_velocity, n);

  const double f_n = k.normal_force - k.normal_dashpot * v_n;
  out.energy_normal = k.normal_energy;
  out.lost_normal = k.normal_dashpot * v_n * (v_n + 0.5 * dt * s * f_n) * dt;

  const double mu = tangential == TangentialLaw::none ? 0.0 : p[Parameter::friction];
  const double limit = mu * std::max(f_n, 0.0);
  Vec3 h = c.displacement + dt * v_t;
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
      work = -dt * dot(f_t, v_t);
      break;
    case TangentialLaw::spring:
    case TangentialLaw::mindlin:
      f_t = -(k.tangential * h + k.tangential_dashpot * v_t);
      slides = cap(limit, f_t, scale);
      h = scale * h;
      out.energy_tangential = 0.5 * k.tangential * squared_length(h);
      work = dt * dot(0.5 * k.tangential * (c.displacement - h) - f_t, v_t);
      break;
    case TangentialLaw::power: {
      const double pull = mu * std::max(k.normal_force, 0.0);
      const double delta_max =
          p[Parameter::displacement] > 0.0 ? p[Parameter::displacement] : 1.5 * pull / k.tangential;
      const double size = length(h);
      if (size > delta_max) h = (delta_max / size) * h;
      const double x = delta_max > 0.0 ? std::min(size / delta_max, 1.0) : 1.0;
      f_t = -k.tangential_dashpot * v_t;
      if (size > 0.0 && delta_max > 0.0) f_t -= pull * (1.0 - std::pow(1.0 - x, 1.5)) / std::min(size, delta_max) * h;
      slides = cap(limit, f_t, scale) || size > delta_max;
      work = -dt * dot(f_t, v_t);
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
