#include "engine/run/list_watch.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/run/decomposition.hpp"
#include "engine/walls/motion.hpp"

namespace moraine {

namespace {

/// How much faster than the fastest grain one may become in a collision: two of the same mass, both at that speed, can give all their energy
/// to one (sqrt 2); a light grain that runs head-on into a heavy one comes back up to three times as fast.
double speed_gain(double mass_ratio) { return std::max(1.5, (3.0 * mass_ratio - 1.0) / (mass_ratio + 1.0)); }

/// The widest skin that tells a grain from its own image [m].
double room_beside_image(const Scene& scene, double largest_radius, double range) {
  double widest = infinity;
  for (int axis = 0; axis < 3; ++axis)
    if (scene.domain.periodic[static_cast<std::size_t>(axis)])
      widest = std::min(widest, scene.domain.box().size()[axis] - 2.0 * largest_radius - range);
  if (!(widest > 1e-6 * largest_radius) && largest_radius > 0.0)
    throw SceneError(
        {{"domain", "a periodic direction is not wider than the largest grain: no room to tell a grain from its image",
          false}});
  return widest;
}

}  // namespace

ListWatch::ListWatch(const Scene& scene, const Plan& plan, const GrainKind& kind, double range, bool is_alone,
                     std::uint64_t step)
    : dt_(plan.time_step.step),
      mean_diameter_(plan.mean_diameter),
      widest_((is_alone && kind.sizes.size() == 1 ? 2.0 : 1.0) * widest_skin(scene, plan)),
      room_(room_beside_image(scene, kind.largest_radius, range)),
      is_skin_given_(scene.run.skin > 0.0),
      speed_gain_(speed_gain(kind.mass_ratio)),
      gravity_(length(scene.time.gravity)),
      wall_speed_(fastest_wall(scene)),
      is_alone_(is_alone),
      skin_(std::min(plan.skin, room_)),
      last_surprise_(step) {}

/// The skin is a matter of speed only. A rebuild costs about as much as nine steps, and a wider skin s adds about 1.1 s/d to
/// their cost (d the mean diameter; pairs that are too far apart to touch are not swept); with N steps between rebuilds, N in
/// proportion to s, the sum 9/N + 1.1 s/d is least at N s/d = 8, which each rebuild moves towards.
///
/// Alone, where each grain has room for its own motion, that of the fastest decides.
void ListWatch::begin_rebuild() {
  ++n_rebuilds_;
  if (is_skin_given_ || n_rebuilds_ <= 1 || steps_since_rebuild_ == 0) return;
  const double wanted = wanted_skin_ > 0.0
                            ? wanted_skin_ / skin_
                            : std::sqrt(8.0 * mean_diameter_ / (static_cast<double>(steps_since_rebuild_) * skin_));
  skin_ = std::min(std::clamp(skin_ * std::clamp(wanted, 0.7, 1.4), 0.01 * mean_diameter_, widest_), room_);
}

void ListWatch::note_rebuild(const ListView& now) {
  is_old_ = false;
  travelled_ = travelled_to_walls_ = 0.0;
  are_walls_of_rebuild_ = true;
  steps_since_rebuild_ = 0;
  if (has_wall_changed(now.time)) last_surprise_ = now.step;
  next_wall_change_ = now.walls.next_change(now.time);
  wanted_skin_ = is_alone_ ? now.contacts.wanted_skin() : 0.0;
}

/// With grains that have room of their own the skin may be wide; walls are looked for as often as before.
ListWidth ListWatch::width() const {
  const bool is_even = !is_alone_ || is_skin_given_;
  return {skin_, is_even ? skin_ : std::min(skin_, 0.4 * mean_diameter_), dt_, mean_diameter_, is_even};
}

void ListWatch::note_wall_search() {
  ++n_wall_searches_;
  travelled_to_walls_ = 0.0;
  are_walls_of_rebuild_ = false;
}

Travelled ListWatch::measure_all(const ListView& now) {
  const Travelled measured = now.contacts.travelled(now.particles, now.n_threads);
  travelled_ = measured.of_pairs();
  if (are_walls_of_rebuild_) travelled_to_walls_ = measured.furthest;
  return measured;
}

double ListWatch::measure(const ListView& now) { return measure_all(now).of_pairs(); }

/// True where a look would gain no more than so many steps, few beside those since the rebuild.
bool ListWatch::is_rebuild_better(double n_steps) const {
  return n_steps < std::max(1.0, 0.125 * static_cast<double>(steps_since_rebuild_));
}

/// Candidates are good until walls or grains have used up the room that they were given.
bool ListWatch::must_search_walls(const ListView& now) {
  if (now.walls.is_any_moving() && now.walls.wander() > allowed_wander()) return true;
  if (now.walls.surfaces().empty() || travelled_to_walls_ <= allowed_travel_to_walls()) return false;
  if (are_walls_of_rebuild_) {
    now.stopwatch.start(Phase::look, now.n_threads);
    if (is_alone_)
      travelled_to_walls_ = now.contacts.furthest(now.particles, now.n_threads);
    else
      measure(now);
  }
  return travelled_to_walls_ > allowed_travel_to_walls();
}

bool ListWatch::is_look_due(const ListView& now) {
  next_look_ = std::min(next_look_, now.contacts.ghosts().own().next_look);  // others may have called
  if (now.step < next_look_) return false;
  n_early_looks_ += now.step < agreed_look_ ? 1 : 0;
  return true;
}

/// Between looks the ranks need not talk: even if the grain that has come furthest becomes as fast as a collision can make it, and falls freely
/// besides, it stays within what the list allows. Nobody looks more than twice as far ahead as it has seen since the start, or since
/// a wall has come or gone. Where a look would gain little, the rebuild comes at once.
bool ListWatch::agree(const ListView& now, const Look& look) {
  ++n_looks_;
  const double left = 0.95 * (allowed_travel() - look.travelled);
  if (!(left > 0.0)) return true;
  // How many steps until that is used up: v n + g n (n + 1) / 2 = left, v and g in metres a step.
  pull_ = gravity_ + look.push;
  const double g = pull_ * dt_ * dt_, v = speed_gain_ * (look.max_speed + wall_speed_) * dt_ + 0.5 * g;
  const double reach =
      std::floor(2.0 * left / (v + std::sqrt(v * v + 2.0 * g * left)));  // infinite where nothing moves
  if (is_rebuild_better(reach)) return true;
  const double n = std::min({look.furthest_ahead, 2.0 * static_cast<double>(now.step - last_surprise_) + 1.0, reach});
  look_at(now.step + static_cast<std::uint64_t>(n), now);
  return false;
}

void ListWatch::look_at(std::uint64_t when, const ListView& now) {
  next_look_ = agreed_look_ = when;
  tell(now);
}

void ListWatch::tell(const ListView& now) const {
  if (!is_alone_) now.contacts.tell({next_look_, travelled_, now.max_speed});
}

/// What was foreseen at the last look holds unless grains have become faster than one collision makes them. Where
/// they have, and this rank could not wait any longer, it calls the others to look early: the call goes with the messages of each step
/// from neighbour to neighbour, and so all know of it in the step in which they look.
///
/// A grain of the border further than half the skin from its place at the rebuild still meets nobody who is not in the list, as long as no
/// grain of another rank has come further than the rest of the skin (note_step), and all who have such grains say so.
bool ListWatch::foresee(const ListView& now) {
  // How far the furthest may come until the step before the earliest look that all can still be told of.
  const double n = n_hops_;
  const double speed = std::max(speed_gain_ * fastest_nearby_, fastest_nearby_ + n * speed_gained_);
  const double ahead = n * dt_ * speed + 0.5 * n * (n + 1.0) * pull_ * dt_ * dt_;
  const std::uint64_t earliest = now.step + static_cast<std::uint64_t>(n_hops_) + 1;
  const auto is_time = [&] { return earliest < next_look_ && travelled_ + ahead > allowed_travel(); };
  // Who is near a grain that is about to have come too far must know how far its own have come, not only a bound of it.
  const double theirs = now.contacts.ghosts().heard().travelled, margin = dt_ * speed;
  const bool is_asked =
      theirs + margin > allowed_travel() && travelled_ + theirs + 2.0 * margin > 2.0 * allowed_travel();
  if (is_time() || is_asked || travelled_ > allowed_travel()) {
    const Travelled measured = measure_all(now);
    if (is_time()) next_look_ = earliest;
    if (measured.of_pairs() > allowed_travel() &&
        !(measured.nearer <= allowed_travel() && now.contacts.ghosts().hears_all_near()))
      return false;
  }
  tell(now);
  return true;
}

bool ListWatch::note_step(const ListView& now) {
  ++steps_since_rebuild_;
  if (!is_alone_) {  // other ranks' grains count as well; what they say of them comes with the messages of the step
    const double heard = now.contacts.ghosts().heard().travelled;
    const bool is_mine = travelled_ > allowed_travel() && travelled_ >= heard;  // one rank speaks
    if (is_mine && travelled_ + heard > 2.0 * allowed_travel()) return false;
  }
  travelled_ = is_alone_ ? 0.5 * skin_ * now.used_room : travelled_ + now.max_speed * dt_;
  travelled_to_walls_ += now.max_speed * dt_;
  if (is_alone_) return true;
  const double fastest = std::max(now.max_speed, now.contacts.ghosts().heard().max_speed) + wall_speed_;
  speed_gained_ = std::max(0.0, fastest - std::exchange(fastest_nearby_, fastest));
  next_look_ = std::min(next_look_, now.contacts.ghosts().own().next_look);
  tell(now);
  return true;
}

}  // namespace moraine
