#include "engine/run/ledger.hpp"

#include <algorithm>
#include <tuple>

#include "kernels/base/exact_sum.hpp"

namespace moraine {

Measurement measure(const Particles& particles, const Contacts& contacts, Vec3 gravity, double dt) {
  Measurement now;
  contacts.for_each_contact(particles, dt, [&](const ContactReport& report) { now.contacts.push_back(report); });
  const auto key = [&](const ContactReport& c) {
    return std::tuple(particles.gid(c.grain), c.other >= 0 ? 0 : 1, c.other >= 0 ? particles.gid(c.other) : std::uint64_t{0},
                      c.surface, c.point.x, c.point.y, c.point.z);
  };
  std::sort(now.contacts.begin(), now.contacts.end(), [&](const auto& x, const auto& y) { return key(x) < key(y); });
  const auto n = static_cast<std::size_t>(particles.size());
  now.acceleration.assign(n, gravity);
  now.angular_acceleration.assign(n, Vec3{});
  for (const ContactReport& c : now.contacts) {
    const auto add = [&](std::int32_t i, Vec3 force, Vec3 torque) {
      now.acceleration[static_cast<std::size_t>(i)] += particles.inverse_mass(i) * force;
      now.angular_acceleration[static_cast<std::size_t>(i)] += particles.inverse_inertia(i) * torque;
    };
    add(c.grain, c.result.force, c.result.torque_a);
    if (c.other >= 0) add(c.other, -c.result.force, c.result.torque_b);
  }
  return now;
}

EnergyLedger take_ledger(const Particles& particles, const Measurement& now, Vec3 gravity, double damping, double dt) {
  ExactSum kinetic, rotational, potential, normal, tangential, lost_normal, lost_tangential, lost_friction, lost_drag;
  const bool has_losses = particles.has(Field::dissipated);
  for (std::int32_t i = 0; i < particles.size(); ++i) {
    if (!particles.is_here(i)) continue;
    const auto k = static_cast<std::size_t>(i);
    const double mass = 1.0 / particles.inverse_mass(i);
    // with bulk viscosity the half kick is implicit, as the whole one is
    const double half_drag = 1.0 + 0.5 * damping * dt;
    const Vec3 v = (particles.velocity(i) + 0.5 * dt * now.acceleration[k]) / half_drag;
    kinetic.add(0.5 * mass * squared_length(v));
    potential.add(-mass * dot(gravity, particles.position(i)));
    if (particles.has(Field::angular_velocity)) {
      const Vec3 w = particles.angular_velocity(i) + 0.5 * dt * now.angular_acceleration[k];
      rotational.add(0.5 / particles.inverse_inertia(i) * squared_length(w));
    }
    if (has_losses) {
      const double* const lost = particles.dissipated() + 4 * static_cast<std::ptrdiff_t>(i);
      lost_normal.add(lost[0]);
      lost_tangential.add(lost[1]);
      lost_friction.add(lost[2]);
      lost_drag.add(lost[3]);
      lost_drag.add(0.5 * dt * damping * mass * squared_length(v));
    }
  }
  for (const ContactReport& c : now.contacts) {
    // half of what a grain and its mirror image store is in the scene; the report's normal force acts on the grain alone
    const double share = c.is_mirror ? 0.5 : 1.0;
    normal.add(share * c.result.energy_normal);
    tangential.add(share * c.result.energy_tangential);
    if (!has_losses) continue;
    // Normal losses are rates at the positions, tangential ones are work on the way to them.
    lost_normal.add(0.5 * share * c.result.lost_normal);
    lost_tangential.add(share * c.result.lost_tangential);
    lost_friction.add(share * c.result.lost_friction);
  }
  EnergyLedger ledger;
  ledger.kinetic = kinetic.value();
  ledger.rotational = rotational.value();
  ledger.potential = potential.value();
  ledger.elastic_normal = normal.value();
  ledger.elastic_tangential = tangential.value();
  ledger.lost_normal = lost_normal.value();
  ledger.lost_tangential = lost_tangential.value();
  ledger.lost_friction = lost_friction.value();
  ledger.lost_drag = lost_drag.value();
  return ledger;
}

}  // namespace moraine
