#include "engine/run/guard.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "engine/scene/checks.hpp"

namespace moraine {

namespace {

std::string text(Vec3 v) { return fmt::format("({:.6g}, {:.6g}, {:.6g})", v.x, v.y, v.z); }

std::string grain_text(const GuardView& view, std::int32_t i) {
  const Particles& p = view.particles;
  return fmt::format("grain {} (material {}, radius {:.4g} m, at {} m, velocity {} m/s)", p.gid(i),
                     view.scene.materials[p.material(i)].name, p.radius(i), text(p.position(i)), text(p.velocity(i)));
}

std::string other_text(const GuardView& view, const ContactReport& c, std::int32_t seen_from) {
  if (c.other < 0)
    return fmt::format(
        "wall \"{}\"",
        view.scene.walls[static_cast<std::size_t>(view.walls.surfaces()[static_cast<std::size_t>(c.surface)].wall)]
            .name);
  return grain_text(view, c.grain == seen_from ? c.other : c.grain);
}

std::string contacts_text(const GuardView& view, std::int32_t i) {
  constexpr std::size_t most = 6;
  std::vector<ContactReport> found;
  view.contacts.for_each_contact(view.particles, view.dt, [&](const ContactReport& c) {
    if (c.grain == i || c.other == i) found.push_back(c);
  });
  std::sort(found.begin(), found.end(), [](const auto& x, const auto& y) { return x.overlap > y.overlap; });
  if (found.empty()) return "\n  it touches nothing";
  std::string lines = fmt::format("\n  it touches {}:", found.size());
  for (std::size_t k = 0; k < std::min(most, found.size()); ++k)
    lines += fmt::format("\n    {}: overlap {:.4g} m ({:.3g} of the smaller radius), force {:.4g} N",
                         other_text(view, found[k], i), found[k].overlap, found[k].overlap / found[k].smaller_radius,
                         length(found[k].result.force));
  return lines;
}

std::string cure(const GuardView& view) {
  const double steps = view.steps_per_contact;
  if (steps < 15.0)
    return fmt::format(
        "\n  likely cause: the time step {:.4g} s gives the shortest contact only {:.1f} steps; use time.step = "
        "\"auto\" or at "
        "most {:.4g} s",
        view.dt, steps, view.dt * steps / 20.0);
  return fmt::format(
      "\n  likely cause: grains too soft for their load or speed (raise the stiffness; the step then falls), or an "
      "impact faster "
      "than foreseen (set time.max_speed), or grains put into each other or into a wall; the step {:.4g} s is {:.0f} "
      "to a contact",
      view.dt, steps);
}

std::string head(const GuardView& view) { return fmt::format("step {}, t = {:.6g} s: ", view.step, view.time); }

/// A contact at the start that is deeper than allowed.
std::string explain_start_overlap(const GuardView& view, const ContactReport& contact) {
  const Vec3 p = view.particles.position(contact.grain);
  const std::string other = contact.other >= 0 ? fmt::format("grain {}", view.particles.gid(contact.other))
                                               : other_text(view, contact, contact.grain);
  return fmt::format(
      "at the start grain {} at ({:.6g}, {:.6g}, {:.6g}) m overlaps {} by {:.3g} of the smaller radius; at most {} is "
      "allowed: move the grains apart or away from the wall",
      view.particles.gid(contact.grain), p.x, p.y, p.z, other, contact.overlap / contact.smaller_radius,
      checks::max_start_overlap);
}

}  // namespace

std::int32_t fastest_grain(const Particles& particles) {
  std::int32_t fastest = -1;
  double speed = -1.0;
  for (std::int32_t i = 0; i < particles.size(); ++i) {
    if (!particles.is_here(i)) continue;
    const double v = squared_length(particles.velocity(i));
    if (v > speed || (v == speed && particles.gid(i) < particles.gid(fastest))) {
      speed = v;
      fastest = i;
    }
  }
  return fastest;
}

std::int32_t furthest_for_its_size(const Particles& particles) {
  std::int32_t furthest = -1;
  double most = -1.0;
  for (std::int32_t i = 0; i < particles.size(); ++i) {
    if (!particles.is_here(i)) continue;
    const double radius = particles.radius(i), v = squared_length(particles.velocity(i)) / (radius * radius);
    if (v > most || (v == most && particles.gid(i) < particles.gid(furthest))) {
      most = v;
      furthest = i;
    }
  }
  return furthest;
}

std::string explain_overlap(const GuardView& view) {
  ContactReport worst;
  double ratio = -1.0;
  view.contacts.for_each_contact(view.particles, view.dt, [&](const ContactReport& c) {
    const double r = c.overlap / c.smaller_radius;
    if (r > ratio || (r == ratio && view.particles.gid(c.grain) < view.particles.gid(worst.grain))) {
      ratio = r;
      worst = c;
    }
  });
  if (ratio < 0.0) return head(view) + "an overlap ran away; the grains have parted since" + cure(view);
  return head(view) +
         fmt::format(
             "overlap runs away: {} is {:.4g} m deep in {}, {:.3g} of the smaller radius (limit run.max_overlap = "
             "{:.3g})",
             grain_text(view, worst.grain), worst.overlap, other_text(view, worst, worst.grain), ratio,
             view.scene.run.max_overlap) +
         contacts_text(view, worst.grain) + cure(view);
}

std::int32_t first_not_finite(const Particles& p) {
  std::int32_t first = -1;
  const auto is_bad = [&](std::int32_t i) {
    const Vec3 v = p.velocity(i), w = p.angular_velocity(i);
    return !std::isfinite(v.x + v.y + v.z) || !std::isfinite(w.x + w.y + w.z);
  };
  for (std::int32_t i = 0; i < p.size(); ++i)
    if (is_bad(i) && (first < 0 || p.gid(i) < p.gid(first))) first = i;
  return first;
}

std::string explain_not_finite(const GuardView& view) {
  const std::int32_t first = first_not_finite(view.particles);
  const std::string who = first < 0 ? std::string("a grain") : grain_text(view, first);
  return head(view) + "the velocity of " + who + " is not finite" + cure(view);
}

std::string explain_speed(const GuardView& view, std::int32_t grain) {
  const double speed = length(view.particles.velocity(grain));
  return head(view) +
         fmt::format("{} moves {:.3g} of its radius in one step: contacts would be missed", grain_text(view, grain),
                     speed * view.dt / view.particles.radius(grain)) +
         contacts_text(view, grain) + cure(view);
}

std::string explain_fast_wall(const GuardView& view, double wander, double smallest_radius) {
  return head(view) +
         fmt::format(
             "a wall moves {:.4g} m in one step, {:.3g} of the smallest radius: contacts would be missed; set a "
             "time.step of at most {:.3g} s, or move the wall more slowly",
             wander, wander / smallest_radius, 0.1 * view.dt * smallest_radius / wander);
}

std::string explain_outside(const GuardView& view, std::int32_t grain) {
  static constexpr const char* faces[] = {"x-low", "x-high", "y-low", "y-high", "z-low", "z-high"};
  const Vec3 p = view.particles.position(grain);
  const Domain& domain = view.scene.domain;
  std::string face = "a face";
  for (int axis = 0; axis < 3; ++axis) {
    if (domain.periodic[static_cast<std::size_t>(axis)]) continue;
    if (p[axis] < domain.low[axis]) face = faces[2 * axis];
    if (p[axis] >= domain.high[axis]) face = faces[2 * axis + 1];
  }
  return head(view) + fmt::format(
                          "{} has left the domain through {} and there is no outlet: put an [[outlet]] with face = "
                          "\"{}\" there, close "
                          "the walls, or make the domain larger",
                          grain_text(view, grain), face, face);
}

std::string explain_stale_list(const GuardView& view, double travelled, double skin, int n_hops) {
  const std::int32_t fastest = fastest_grain(view.particles);
  return head(view) + fmt::format(
                          "two grains may have come nearer to each other by {:.4g} m since the pair list was made, and "
                          "meet outside its skin of {:.4g} m: within {} one became many times as fast as any had been, "
                          "before the ranks could agree on "
                          "a new list{}; set run.skin = {:.4g} or wider, or take fewer ranks",
                          2.0 * travelled, skin, n_hops == 1 ? std::string("a step") : fmt::format("{} steps", n_hops),
                          fastest < 0 ? std::string() : " (the fastest is " + grain_text(view, fastest) + ")",
                          4.0 * travelled);
}

void check_start(const GuardView& view, const World& world) {
  std::string worst;
  std::uint64_t n_deep = 0, first = ~std::uint64_t{0};
  view.contacts.for_each_contact(view.particles, view.dt, [&](const ContactReport& c) {
    if (!c.is_ours || !(c.overlap > checks::max_start_overlap * c.smaller_radius)) return;
    ++n_deep;
    if (view.particles.gid(c.grain) >= first) return;
    first = view.particles.gid(c.grain);
    worst = explain_start_overlap(view, c);
  });
  world.sum(std::span(&n_deep, 1));
  if (n_deep == 0) return;
  const std::vector<std::uint64_t> firsts = world.gather(first);
  world.broadcast(worst, static_cast<int>(std::min_element(firsts.begin(), firsts.end()) - firsts.begin()));
  if (n_deep > 1) worst += " (" + std::to_string(n_deep) + " such contacts)";
  throw SceneError({{"particles", worst, false}});
}

std::string fault_of_grains(const GuardView& view, std::uint64_t n_left) {
  const Particles& particles = view.particles;
  const Box box = view.scene.domain.box();
  const auto is_finite = [](Vec3 v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); };
  std::uint64_t n_away = 0;
  for (std::int32_t i = 0; i < particles.size(); ++i) {
    if (!particles.is_here(i)) {
      ++n_away;
      continue;
    }
    const bool is_sound = is_finite(particles.position(i)) && is_finite(particles.velocity(i)) &&
                          is_finite(particles.angular_velocity(i));
    if (is_sound && box.contains(particles.position(i))) continue;
    return "the grain with gid " + std::to_string(particles.gid(i)) +
           (is_sound ? " has been put outside the domain"
                     : " has been given a position or velocity that is not finite");
  }
  if (n_away != n_left) return "a grain has been given a position that is not a number";
  return {};
}

}  // namespace moraine
