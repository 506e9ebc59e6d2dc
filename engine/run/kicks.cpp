#include "engine/run/kicks.hpp"

namespace moraine {

Kick kick_of(const Scene& scene, double h, double dt) {
  const double c = scene.time.damping;
  Kick kick;
  kick.keep = (1.0 - 0.5 * c * h) / (1.0 + 0.5 * c * h);
  kick.gain = h / (1.0 + 0.5 * c * h);
  kick.time = h;
  kick.drift = dt;
  kick.drag_loss = 0.25 * c * h;
  kick.gravity = scene.time.gravity;
  kick.is_flat = scene.domain.dimensions == 2;
  return kick;
}

Kick kick_to_positions(const Scene& scene, std::uint64_t step, double dt) {
  const double h = step == 0 ? 0.0 : 0.5 * dt;  // how late they are
  const double c = scene.time.damping;
  Kick kick = kick_of(scene, h, 0.0);
  kick.keep = 1.0 / (1.0 + c * h);
  kick.gain = h / (1.0 + c * h);
  return kick;
}

}  // namespace moraine
