#include "engine/run/probes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "kernels/base/exact_sum.hpp"
#include "kernels/base/sphere.hpp"

namespace moraine {

namespace {

constexpr const char* axis_names[] = {"x", "y", "z"};

int wall_index(const Scene& scene, const std::string& name) {
  for (std::size_t w = 0; w < scene.walls.size(); ++w)
    if (scene.walls[w].name == name) return static_cast<int>(w);
  return -1;
}

/// Extent of the probe along its axis: of the wall, or of the region.
Box extent_of(const ProbeView& view, const Probe& probe) {
  if (probe.kind == Probe::Kind::wall_pressure)
    return view.walls.extent(wall_index(view.scene, probe.wall), view.scene.domain.box());
  return probe.region;
}

int bin_of(const Probe& probe, const Box& extent, Vec3 p) {
  const double low = extent.low[probe.axis], size = extent.high[probe.axis] - low;
  if (!(size > 0.0)) return 0;
  return static_cast<int>(std::floor((p[probe.axis] - low) / size * probe.bins));
}

std::vector<double> wall_force(const ProbeView& view, const Probe& probe) {
  const int wall = wall_index(view.scene, probe.wall);
  ExactSum3 force, torque;
  view.contacts.for_each_wall_contact(view.particles, view.dt, [&](const ContactReport& c) {
    if (view.walls.surfaces()[static_cast<std::size_t>(c.surface)].wall != wall) return;
    force.add(-c.result.force);
    torque.add(cross(c.point, -c.result.force));
  });
  const Vec3 f = force.value(), t = torque.value();
  return {f.x, f.y, f.z, t.x, t.y, t.z};
}

std::vector<double> wall_pressure(const ProbeView& view, const Probe& probe) {
  const int wall = wall_index(view.scene, probe.wall);
  const Box extent = extent_of(view, probe);
  std::vector<ExactSum> sums(static_cast<std::size_t>(probe.bins));
  view.contacts.for_each_wall_contact(view.particles, view.dt, [&](const ContactReport& c) {
    if (view.walls.surfaces()[static_cast<std::size_t>(c.surface)].wall != wall) return;
    const int bin = bin_of(probe, extent, c.point);
    if (bin >= 0 && bin < probe.bins) sums[static_cast<std::size_t>(bin)].add(dot(c.result.force, c.normal));
  });
  const double area = view.walls.area(wall, view.scene.domain.box()) / probe.bins;
  std::vector<double> row;
  for (const ExactSum& sum : sums) row.push_back(area > 0.0 ? sum.value() / area : 0.0);
  return row;
}

std::vector<double> region(const ProbeView& view, const Probe& probe) {
  const Particles& p = view.particles;
  ExactSum volume, squares;
  ExactSum3 velocity;
  double n = 0.0;
  std::vector<bool> is_in(static_cast<std::size_t>(p.size()), false);
  for (std::int32_t i = 0; i < p.size(); ++i) {
    if (!p.is_here(i) || !probe.region.contains(p.position(i))) continue;
    is_in[static_cast<std::size_t>(i)] = true;
    n += 1.0;
    volume.add(sphere_volume(p.radius(i)));
    velocity.add(p.velocity(i));
    squares.add(squared_length(p.velocity(i)));
  }
  double n_ends = 0.0;
  view.contacts.for_each_contact(view.particles, view.dt, [&](const ContactReport& c) {
    if (is_in[static_cast<std::size_t>(c.grain)]) n_ends += 1.0;
    if (c.other >= 0 && is_in[static_cast<std::size_t>(c.other)]) n_ends += 1.0;
  });
  const double share = n > 0.0 ? 1.0 / n : 0.0;
  const Vec3 mean = share * velocity.value();
  const double temperature = std::max(0.0, share * squares.value() - squared_length(mean)) / 3.0;
  return {n, volume.value() / probe.region.volume(), mean.x, mean.y, mean.z, temperature, n_ends * share};
}

std::vector<double> profile(const ProbeView& view, const Probe& probe) {
  const Particles& p = view.particles;
  const auto bins = static_cast<std::size_t>(probe.bins);
  std::vector<ExactSum> volume(bins);
  std::vector<ExactSum3> velocity(bins);
  std::vector<double> count(bins, 0.0);
  for (std::int32_t i = 0; i < p.size(); ++i) {
    if (!p.is_here(i) || !probe.region.contains(p.position(i))) continue;
    const auto bin =
        static_cast<std::size_t>(std::clamp(bin_of(probe, probe.region, p.position(i)), 0, probe.bins - 1));
    volume[bin].add(sphere_volume(p.radius(i)));
    velocity[bin].add(p.velocity(i));
    count[bin] += 1.0;
  }
  std::vector<double> row;
  for (std::size_t bin = 0; bin < bins; ++bin) {
    const Vec3 v = count[bin] > 0.0 ? velocity[bin].value() / count[bin] : Vec3{};
    row.insert(row.end(), {volume[bin].value() * probe.bins / probe.region.volume(), v.x, v.y, v.z});
  }
  return row;
}

std::vector<double> contacts(const ProbeView& view) {
  ExactSum overlap;
  double deepest = 0.0;
  double n = 0.0;
  view.contacts.for_each_contact(view.particles, view.dt, [&](const ContactReport& c) {
    overlap.add(c.overlap / c.smaller_radius);
    deepest = std::max(deepest, c.overlap / c.smaller_radius);
    n += 1.0;
  });
  return {n, n > 0.0 ? overlap.value() / n : 0.0, deepest};
}

std::vector<double> mass(const ProbeView& view, std::vector<double>& last) {
  const Census& c = view.census;
  if (last.size() != 2) last = {view.time, c.mass_left};
  const double elapsed = view.time - last[0];
  const double flow = elapsed > 0.0 ? (c.mass_left - last[1]) / elapsed : 0.0;
  last = {view.time, c.mass_left};
  return {c.n_born, c.n_born - c.n_left, c.n_left, c.mass_born, c.mass_born - c.mass_left, c.mass_left, flow};
}

std::vector<double> energy(const EnergyLedger& e) {
  return {e.kinetic,   e.rotational,  e.elastic_normal,  e.elastic_tangential,
          e.potential, e.lost_normal, e.lost_tangential, e.lost_friction,
          e.lost_drag, e.left,        e.total(),         e.error()};
}

}  // namespace

std::vector<std::string> probe_columns(const Scene& scene, const Probe& probe) {
  std::vector<std::string> names;
  switch (probe.kind) {
    case Probe::Kind::energy:
      return {"kinetic [J]",
              "rotational [J]",
              "elastic normal [J]",
              "elastic tangential [J]",
              "potential [J]",
              "lost to normal dashpots [J]",
              "lost to tangential dashpots [J]",
              "lost to friction [J]",
              "lost to drag [J]",
              "left [J]",
              "total [J]",
              "error [J]"};
    case Probe::Kind::wall_force:
      return {"force x [N]", "force y [N]", "force z [N]", "torque x [N m]", "torque y [N m]", "torque z [N m]"};
    case Probe::Kind::region:
      return {"grains",
              "solid fraction",
              "velocity x [m/s]",
              "velocity y [m/s]",
              "velocity z [m/s]",
              "granular temperature [m2/s2]",
              "coordination number"};
    case Probe::Kind::mass:
      return {"born", "inside", "left", "mass born [kg]", "mass inside [kg]", "mass left [kg]", "outflow [kg/s]"};
    case Probe::Kind::contacts: return {"contacts", "mean overlap / radius", "largest overlap / radius"};
    case Probe::Kind::wall_pressure:
    case Probe::Kind::profile: {
      Box extent = probe.region;
      if (probe.kind == Probe::Kind::wall_pressure)
        extent = Walls(scene).extent(wall_index(scene, probe.wall), scene.domain.box());
      const double low = extent.low[probe.axis], size = (extent.high[probe.axis] - low) / probe.bins;
      for (int bin = 0; bin < probe.bins; ++bin) {
        const std::string at = fmt::format("{} {:.6g} m", axis_names[probe.axis], low + (bin + 0.5) * size);
        if (probe.kind == Probe::Kind::wall_pressure) {
          names.push_back("pressure at " + at + " [Pa]");
        } else {
          names.push_back("solid fraction at " + at);
          for (const char* axis : axis_names) names.push_back(fmt::format("velocity {} at {} [m/s]", axis, at));
        }
      }
      return names;
    }
  }
  return names;
}

std::vector<double> probe_row(const ProbeView& view, const Probe& probe, std::vector<double>& last) {
  switch (probe.kind) {
    case Probe::Kind::energy: return view.energy ? energy(*view.energy) : std::vector<double>{};
    case Probe::Kind::wall_force: return wall_force(view, probe);
    case Probe::Kind::wall_pressure: return wall_pressure(view, probe);
    case Probe::Kind::region: return region(view, probe);
    case Probe::Kind::mass: return mass(view, last);
    case Probe::Kind::profile: return profile(view, probe);
    case Probe::Kind::contacts: return contacts(view);
  }
  return {};
}

}  // namespace moraine
