#include "engine/run/flight_record.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace moraine {

namespace {

constexpr const char* header =
    "step,time [s],grain,x [m],y [m],z [m],vx [m/s],vy [m/s],vz [m/s],touches,overlap [m],overlap over smaller "
    "radius [-],fx [N],fy [N],fz [N]\n";

std::string row_start(const GuardView& view, std::int32_t i) {
  const Particles& p = view.particles;
  const Vec3 x = p.position(i), v = p.velocity(i);
  return fmt::format("{},{:.9g},{},{:.9g},{:.9g},{:.9g},{:.6g},{:.6g},{:.6g},", view.step, view.time, p.gid(i), x.x,
                     x.y, x.z, v.x, v.y, v.z);
}

std::string wall_name(const GuardView& view, std::int32_t surface) {
  const std::int32_t wall = view.walls.surfaces()[static_cast<std::size_t>(surface)].wall;
  std::string name = "wall " + view.scene.walls[static_cast<std::size_t>(wall)].name;
  std::replace_if(
      name.begin(), name.end(), [](char c) { return c == ',' || c == '"' || c == '\n'; }, ' ');
  return name;
}

/// Force on grain i.
std::string contact_row(const GuardView& view, const ContactReport& c, std::int32_t i) {
  const double sign = c.grain == i ? 1.0 : -1.0;
  const Vec3 force = sign * c.result.force;
  const std::string other = c.other < 0 ? wall_name(view, c.surface)
                                        : fmt::format("grain {}", view.particles.gid(c.grain == i ? c.other : c.grain));
  return fmt::format("{}{},{:.6g},{:.4g},{:.6g},{:.6g},{:.6g}\n", row_start(view, i), other, c.overlap,
                     c.overlap / c.smaller_radius, force.x, force.y, force.z);
}

std::string rows_of(const GuardView& view, std::vector<std::int32_t> grains) {
  std::sort(grains.begin(), grains.end());
  grains.erase(std::unique(grains.begin(), grains.end()), grains.end());
  std::vector<std::string> rows(grains.size());
  view.contacts.for_each_contact(view.particles, view.dt, [&](const ContactReport& c) {
    for (std::size_t k = 0; k < grains.size(); ++k)
      if (c.grain == grains[k] || c.other == grains[k]) rows[k] += contact_row(view, c, grains[k]);
  });
  std::string all;
  for (std::size_t k = 0; k < grains.size(); ++k)
    all += rows[k].empty() ? row_start(view, grains[k]) + "nothing,,,,,\n" : rows[k];
  return all;
}

struct Deepest {
  double ratio = -1.0;
  ContactReport contact;
};

Deepest deepest(const GuardView& view) {
  Deepest found;
  view.contacts.for_each_contact(view.particles, view.dt, [&](const ContactReport& c) {
    const double ratio = c.overlap / c.smaller_radius;
    if (ratio > found.ratio) found = {ratio, c};
  });
  return found;
}

std::vector<std::int32_t> grains_of(const ContactReport& contact) {
  std::vector<std::int32_t> grains = {contact.grain};
  if (contact.other >= 0) grains.push_back(contact.other);
  return grains;
}

}  // namespace

bool FlightRecorder::note(const GuardView& view, bool is_deep, bool is_fast) {
  const bool was_exact = !is_calm();  // then what is deep is too deep
  if (is_calm() && !is_deep && !is_fast) return false;
  if (phase_ < n_watched) {
    const Deepest worst = deepest(view);
    std::vector<std::int32_t> grains;
    if (worst.ratio > 0.25 * max_overlap_) grains = grains_of(worst.contact);
    if (const std::int32_t fastest = fastest_grain(view.particles); is_fast && fastest >= 0) grains.push_back(fastest);
    steps_.push_back(rows_of(view, grains));
    if (is_deep && worst.ratio > max_overlap_) return true;
  }
  if (++phase_ == n_watched + n_rest) {
    phase_ = 0;
    steps_.clear();
  }
  return was_exact && is_deep;
}

std::string FlightRecorder::finish(const GuardView& view, const std::vector<std::int32_t>& grains) {
  std::string text = header;
  for (const std::string& rows : steps_) text += rows;
  return text + rows_of(view, grains);
}

void FlightRecorder::follow(const GuardView& view, const std::vector<std::int32_t>& grains, FlightRecord record) {
  Followed one{std::move(record), {}};
  for (const std::int32_t i : grains) one.gids.push_back(view.particles.gid(i));
  std::sort(one.gids.begin(), one.gids.end());
  one.record.grains = header + rows_of(view, grains);
  followed_.push_back(std::move(one));
}

void FlightRecorder::note_followed(const GuardView& view) {
  const Particles& p = view.particles;
  for (Followed& one : followed_) {
    if (one.n_steps == n_watched) continue;
    if (one.n_steps++ == 0) one.record.grains = header;  // the state at its beginning was for a run that ends there
    std::vector<std::int32_t> grains;
    for (std::int32_t i = 0; i < p.size(); ++i)
      if (p.is_here(i) && std::binary_search(one.gids.begin(), one.gids.end(), p.gid(i))) grains.push_back(i);
    one.record.grains += rows_of(view, grains);
  }
}

std::vector<FlightRecord> FlightRecorder::take_followed(bool is_end) {
  std::vector<FlightRecord> complete;
  std::erase_if(followed_, [&](Followed& one) {
    const bool is_complete = is_end || one.n_steps >= n_watched;
    if (is_complete) complete.push_back(std::move(one.record));
    return is_complete;
  });
  return complete;
}

std::vector<std::int32_t> most_moved_grains(const GuardView& view) {
  std::vector<std::int32_t> grains = deepest_grains(view);
  for (const std::int32_t i : {fastest_grain(view.particles), furthest_for_its_size(view.particles)})
    if (i >= 0) grains.push_back(i);
  return grains;
}

std::vector<std::int32_t> deepest_grains(const GuardView& view) {
  const Deepest worst = deepest(view);
  return worst.ratio < 0.0 ? std::vector<std::int32_t>() : grains_of(worst.contact);
}

}  // namespace moraine
