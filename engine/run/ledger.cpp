#include "engine/run/ledger.hpp"

#include <array>

#include "comm/totals.hpp"

namespace moraine {

EnergyLedger take_ledger(const World& world, const Particles& particles, const Contacts& contacts,
                         const Contacts::Velocities& now, Vec3 gravity, double damping, double dt) {
  std::array<ExactSum, 9> sums;
  ExactSum &kinetic = sums[0], &rotational = sums[1], &potential = sums[2], &normal = sums[3], &tangential = sums[4];
  ExactSum &lost_normal = sums[5], &lost_tangential = sums[6], &lost_friction = sums[7], &lost_drag = sums[8];
  const bool has_losses = particles.has(Field::dissipated);
  for (std::int32_t i = 0; i < particles.size(); ++i) {
    if (!particles.is_here(i)) continue;
    const auto k = static_cast<std::size_t>(i);
    const double mass = 1.0 / particles.inverse_mass(i);
    kinetic.add(0.5 * mass * squared_length(now.linear[k]));
    potential.add(-mass * dot(gravity, particles.position(i)));
    const double rotation =
        now.angular.empty() ? 0.0 : 0.5 / particles.inverse_inertia(i) * squared_length(now.angular[k]);
    rotational.add(rotation);
    if (!has_losses) continue;
    const double* const lost = particles.dissipated() + 4 * static_cast<std::ptrdiff_t>(i);
    lost_normal.add(lost[0]);
    lost_tangential.add(lost[1]);
    lost_friction.add(lost[2]);
    lost_drag.add(lost[3]);
    lost_drag.add(0.5 * dt * damping * mass * squared_length(now.linear[k]));
    lost_drag.add(dt * damping * rotation);
    if (particles.has(Field::gas_acceleration)) {
      const Vec3 push = particles.gas_acceleration(i);
      lost_drag.add(-0.25 * dt * mass * dot(push, particles.velocity(i) + now.linear[k]));
    }
  }
  contacts.for_each_contact(particles, dt, [&](const ContactReport& c) {
    if (!c.is_ours) return;
    // half of what a grain and its mirror image store is in the scene
    const double share = c.is_mirror ? 0.5 : 1.0;
    normal.add(share * c.result.energy_normal);
    tangential.add(share * c.result.energy_tangential);
    if (!has_losses) return;
    // Normal losses are rates at the positions, tangential ones are work on the way to them.
    lost_normal.add(0.5 * share * c.result.lost_normal);
    lost_tangential.add(share * c.result.lost_tangential);
    lost_friction.add(share * c.result.lost_friction);
  });
  total(world, sums);
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
