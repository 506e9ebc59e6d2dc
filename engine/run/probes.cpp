#include "engine/run/probes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "comm/totals.hpp"
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

std::vector<double> values_of(std::span<const ExactSum> sums) {
  std::vector<double> values;
  for (const ExactSum& sum : sums) values.push_back(sum.value());
  return values;
}

std::vector<double> wall_force(const ProbeView& view, const Probe& probe) {
  const int wall = wall_index(view.scene, probe.wall);
  std::array<ExactSum, 6> sums;  // force, torque
  view.contacts.for_each_wall_contact(view.particles, view.dt, [&](const ContactReport& c) {
    if (view.walls.surfaces()[static_cast<std::size_t>(c.surface)].wall != wall) return;
    const Vec3 force = -c.result.force, torque = cross(c.point, force);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      sums[axis].add(force[static_cast<int>(axis)]);
      sums[axis + 3].add(torque[static_cast<int>(axis)]);
    }
  });
  total(view.world, sums);
  return values_of(sums);
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
  total(view.world, sums);
  std::vector<double> row = values_of(sums);
  for (int bin = 0; bin < probe.bins; ++bin) {
    Box slice = view.scene.domain.box();
    const double low = extent.low[probe.axis], width = (extent.high[probe.axis] - low) / probe.bins;
    slice.low[probe.axis] = low + bin * width;
    slice.high[probe.axis] = bin + 1 == probe.bins ? extent.high[probe.axis] : low + (bin + 1) * width;
    const double area = view.walls.area(wall, slice);
    double& value = row[static_cast<std::size_t>(bin)];
    value = area > 0.0 ? value / area : 0.0;
  }
  return row;
}

/// Sums over grains: number, volume, velocity, square of the velocity, contacts.
enum GrainSum : std::size_t { number, volume, velocity_x, velocity_y, velocity_z, square, n_ends, n_grain_sums };

std::vector<double> region(const ProbeView& view, const Probe& probe) {
  const Particles& p = view.particles;
  std::array<ExactSum, n_grain_sums> sums;
  std::vector<bool> is_in(static_cast<std::size_t>(p.size()), false);
  for (std::int32_t i = 0; i < p.size(); ++i) {
    if (!p.is_here(i) || !probe.region.contains(p.position(i))) continue;
    is_in[static_cast<std::size_t>(i)] = true;
    const Vec3 v = p.velocity(i);
    sums[number].add(1.0);
    sums[volume].add(sphere_volume(p.radius(i)));
    for (int axis = 0; axis < 3; ++axis) sums[velocity_x + static_cast<std::size_t>(axis)].add(v[axis]);
    sums[square].add(squared_length(v));
  }
  // Each grain counts its own contacts, so a contact with a ghost counts for this rank's grain only.
  const auto is_own_inside = [&](std::int32_t i) {
    return i >= 0 && p.is_owned(i) && is_in[static_cast<std::size_t>(i)];
  };
  view.contacts.for_each_contact(p, view.dt, [&](const ContactReport& c) {
    if (!(c.overlap > 0.0)) return;
    if (is_own_inside(c.grain)) sums[n_ends].add(1.0);
    if (is_own_inside(c.other)) sums[n_ends].add(1.0);
  });
  total(view.world, sums);
  const std::vector<double> value = values_of(sums);
  const double n = value[number], share = n > 0.0 ? 1.0 / n : 0.0;
  const Vec3 mean = share * Vec3{value[velocity_x], value[velocity_y], value[velocity_z]};
  const double temperature = std::max(0.0, share * value[square] - squared_length(mean)) / 3.0;
  return {n, value[volume] / probe.region.volume(), mean.x, mean.y, mean.z, temperature, value[n_ends] * share};
}

std::vector<double> profile(const ProbeView& view, const Probe& probe) {
  const Particles& p = view.particles;
  const auto bins = static_cast<std::size_t>(probe.bins);
  constexpr std::size_t width = square;  // number, volume, velocity
  std::vector<ExactSum> sums(bins * width);
  for (std::int32_t i = 0; i < p.size(); ++i) {
    if (!p.is_here(i) || !probe.region.contains(p.position(i))) continue;
    const auto bin =
        static_cast<std::size_t>(std::clamp(bin_of(probe, probe.region, p.position(i)), 0, probe.bins - 1));
    ExactSum* const own = &sums[bin * width];
    own[number].add(1.0);
    own[volume].add(sphere_volume(p.radius(i)));
    for (int axis = 0; axis < 3; ++axis) own[velocity_x + static_cast<std::size_t>(axis)].add(p.velocity(i)[axis]);
  }
  total(view.world, sums);
  const std::vector<double> values = values_of(sums);
  std::vector<double> row;
  for (std::size_t bin = 0; bin < bins; ++bin) {
    const double* const own = &values[bin * width];
    const double n = own[number];
    row.push_back(own[volume] * probe.bins / probe.region.volume());
    for (std::size_t k = velocity_x; k <= velocity_z; ++k) row.push_back(n > 0.0 ? own[k] / n : 0.0);
  }
  return row;
}

std::vector<double> contacts(const ProbeView& view) {
  std::array<ExactSum, 2> sums;  // number, overlap
  double deepest = 0.0;
  view.contacts.for_each_contact(view.particles, view.dt, [&](const ContactReport& c) {
    if (!c.is_ours || !(c.overlap > 0.0)) return;
    sums[0].add(1.0);
    sums[1].add(c.overlap / c.smaller_radius);
    deepest = std::max(deepest, c.overlap / c.smaller_radius);
  });
  total(view.world, sums);
  view.world.max(std::span(&deepest, 1));
  const double n = sums[0].value();
  return {n, n > 0.0 ? sums[1].value() / n : 0.0, deepest};
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
    case Probe::Kind::pressure:
    case Probe::Kind::pressure_drop:
    case Probe::Kind::bed_height:
    case Probe::Kind::gas_profile:
    case Probe::Kind::gas_mean: return gas_probe_columns(scene, probe);
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
    case Probe::Kind::pressure:
    case Probe::Kind::pressure_drop:
    case Probe::Kind::bed_height:
    case Probe::Kind::gas_profile:
    case Probe::Kind::gas_mean: {
      const auto number = static_cast<std::size_t>(&probe - view.scene.output.probes.data());
      return gas_probe_row(view.world, view.scene, probe, number, view.particles, view.gas, view.time, last);
    }
  }
  return {};
}

}  // namespace moraine
