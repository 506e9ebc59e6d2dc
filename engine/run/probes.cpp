#include "engine/run/probes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "comm/totals.hpp"
#include "engine/run/coarse_fields.hpp"
#include "engine/scene/lists.hpp"
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

/// The axis that a wall turns about first of all: probes tell the torque about it.
const WallMotion* turning(const Scene& scene, const Probe& probe) {
  const int wall = wall_index(scene, probe.wall);
  if (wall < 0) return nullptr;
  const std::vector<WallMotion>& motions = scene.walls[static_cast<std::size_t>(wall)].motion;
  const auto found = std::find_if(motions.begin(), motions.end(), [](const WallMotion& m) { return m.turns(); });
  return found == motions.end() ? nullptr : &*found;
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
  std::array<ExactSum, 8> sums;  // force, torque, power, torque about its axis
  const WallMotion* const motion = turning(view.scene, probe);
  view.contacts.for_each_wall_contact(view.particles, view.dt, [&](const ContactReport& c) {
    if (view.walls.surfaces()[static_cast<std::size_t>(c.surface)].wall != wall) return;
    const Vec3 force = -c.result.force, torque = cross(c.point, force);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      sums[axis].add(force[static_cast<int>(axis)]);
      sums[axis + 3].add(torque[static_cast<int>(axis)]);
    }
    sums[6].add(-dot(force, c.wall_velocity));
    if (motion) sums[7].add(dot(normalized(motion->axis), cross(c.point - motion->origin, force)));
  });
  total(view.world, sums);
  std::vector<double> row = values_of(sums);
  const WallDefinition& definition = view.scene.walls[static_cast<std::size_t>(wall)];
  row.resize(definition.motion.empty() ? 6 : motion ? 8 : 7);
  for (std::size_t k = 0; k < view.walls.servo_walls().size(); ++k)
    if (view.walls.servo_walls()[k] == wall) {
      const ServoState& servo = view.walls.servo_states()[k];
      row.insert(row.end(), {servo.place, servo.speed});
    }
  return row;
}

std::vector<std::string> wall_force_columns(const Scene& scene, const Probe& probe) {
  std::vector<std::string> names = {"force x [N]",    "force y [N]",    "force z [N]",
                                    "torque x [N m]", "torque y [N m]", "torque z [N m]"};
  const int wall = wall_index(scene, probe.wall);
  if (wall < 0 || scene.walls[static_cast<std::size_t>(wall)].motion.empty()) return names;
  names.push_back("power [W]");
  if (turning(scene, probe)) names.push_back("torque about the axis [N m]");
  for (const WallMotion& m : scene.walls[static_cast<std::size_t>(wall)].motion)
    if (m.kind == WallMotion::Kind::servo) {
      names.push_back(m.torque ? "servo angle [rad]" : "servo place [m]");
      names.push_back(m.torque ? "servo speed [rad/s]" : "servo speed [m/s]");
    }
  return names;
}

std::vector<double> wall_pressure(const ProbeView& view, const Probe& probe) {
  const int wall = wall_index(view.scene, probe.wall);
  const Box extent = extent_of(view, probe);
  std::vector<ExactSum> sums(static_cast<std::size_t>(probe.bins));
  view.contacts.for_each_wall_contact(view.particles, view.dt, [&](const ContactReport& c) {
    if (view.walls.surfaces()[static_cast<std::size_t>(c.surface)].wall != wall) return;
    const int bin = bin_of(probe, extent, view.walls.wall_pose(wall).to_home(c.point));
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

/// Materials that grains are made of, where a probe tells them apart.
std::vector<std::size_t> species_of(const Scene& scene, const Probe& probe) {
  std::vector<std::size_t> species;
  if (!probe.by_material) return species;
  const std::vector<bool> is_grain = grain_materials(scene);
  for (std::size_t m = 0; m < is_grain.size(); ++m)
    if (is_grain[m]) species.push_back(m);
  return species;
}

/// Of the grains of each species in the region: number, mass, solid fraction, velocity of their centre of mass, granular temperature (the mean
/// square of velocities relative to it, weighed by mass, over the number of dimensions), centre of mass.
std::vector<double> species_in_region(const ProbeView& view, const Probe& probe) {
  enum Sum : std::size_t { n, mass, volume, momentum, square = momentum + 3, moment, n_sums = moment + 3 };
  const std::vector<std::size_t> species = species_of(view.scene, probe);
  std::vector<ExactSum> sums(view.scene.materials.size() * n_sums);
  const Particles& p = view.particles;
  for (std::int32_t i = 0; i < p.size() && !species.empty(); ++i) {
    if (!p.is_here(i) || !probe.region.contains(p.position(i))) continue;
    ExactSum* const own = &sums[p.material(i) * n_sums];
    const double m = 1.0 / p.inverse_mass(i);
    const Vec3 v = p.velocity(i), x = p.position(i);
    own[n].add(1.0);
    own[mass].add(m);
    own[volume].add(sphere_volume(p.radius(i)));
    for (std::size_t a = 0; a < 3; ++a) {
      own[momentum + a].add(m * v[static_cast<int>(a)]);
      own[moment + a].add(m * x[static_cast<int>(a)]);
    }
    own[square].add(m * squared_length(v));
  }
  total(view.world, sums);
  const std::vector<double> values = values_of(sums);
  std::vector<double> row;
  for (const std::size_t material : species) {
    const double* const own = &values[material * n_sums];
    const double share = own[mass] > 0.0 ? 1.0 / own[mass] : 0.0;
    const Vec3 mean = share * Vec3{own[momentum], own[momentum + 1], own[momentum + 2]};
    const double temperature = std::max(0.0, share * own[square] - squared_length(mean)) / view.scene.domain.dimensions;
    row.insert(row.end(), {own[n], own[mass], own[volume] / probe.region.volume(), mean.x, mean.y, mean.z, temperature,
                           share * own[moment], share * own[moment + 1], share * own[moment + 2]});
  }
  return row;
}

std::vector<std::string> region_columns(const Scene& scene, const Probe& probe) {
  std::vector<std::string> names = {"grains",
                                    "solid fraction",
                                    "velocity x [m/s]",
                                    "velocity y [m/s]",
                                    "velocity z [m/s]",
                                    "granular temperature [m2/s2]",
                                    "coordination number"};
  for (const std::size_t material : species_of(scene, probe))
    for (const char* what : {"{} grains", "{} mass [kg]", "{} solid fraction", "{} velocity x [m/s]",
                             "{} velocity y [m/s]", "{} velocity z [m/s]", "{} granular temperature [m2/s2]",
                             "{} centre x [m]", "{} centre y [m]", "{} centre z [m]"})
      names.push_back(fmt::format(fmt::runtime(what), scene.materials[material].name));
  return names;
}

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
  const double temperature = std::max(0.0, share * value[square] - squared_length(mean)) / view.scene.domain.dimensions;
  std::vector<double> row = {
      n, value[volume] / probe.region.volume(), mean.x, mean.y, mean.z, temperature, value[n_ends] * share};
  const std::vector<double> of_species = species_in_region(view, probe);
  row.insert(row.end(), of_species.begin(), of_species.end());
  return row;
}

/// Slices of all grains, then those of each species.
std::vector<double> profile(const ProbeView& view, const Probe& probe) {
  const Particles& p = view.particles;
  const std::vector<std::size_t> species = species_of(view.scene, probe);
  const auto bins = static_cast<std::size_t>(probe.bins);
  constexpr std::size_t width = square;  // number, volume, velocity
  std::vector<std::size_t> group_of(view.scene.materials.size(), 0);
  for (std::size_t s = 0; s < species.size(); ++s) group_of[species[s]] = s + 1;
  std::vector<ExactSum> sums((1 + species.size()) * bins * width);
  for (std::int32_t i = 0; i < p.size(); ++i) {
    if (!p.is_here(i) || !probe.region.contains(p.position(i))) continue;
    const auto bin =
        static_cast<std::size_t>(std::clamp(bin_of(probe, probe.region, p.position(i)), 0, probe.bins - 1));
    const auto add = [&](std::size_t group) {
      ExactSum* const own = &sums[(group * bins + bin) * width];
      own[number].add(1.0);
      own[volume].add(sphere_volume(p.radius(i)));
      for (int axis = 0; axis < 3; ++axis) own[velocity_x + static_cast<std::size_t>(axis)].add(p.velocity(i)[axis]);
    };
    add(0);
    if (const std::size_t group = group_of[p.material(i)]; group > 0) add(group);
  }
  total(view.world, sums);
  const std::vector<double> values = values_of(sums);
  std::vector<double> row;
  for (std::size_t slice = 0; slice < (1 + species.size()) * bins; ++slice) {
    const double* const own = &values[slice * width];
    const double n = own[number];
    row.push_back(own[volume] * probe.bins / probe.region.volume());
    for (std::size_t k = velocity_x; k <= velocity_z; ++k) row.push_back(n > 0.0 ? own[k] / n : 0.0);
  }
  return row;
}

/// Of a profile along an axis, or of the pressure on a wall.
std::vector<std::string> slice_columns(const Scene& scene, const Probe& probe) {
  const bool is_wall = probe.kind == Probe::Kind::wall_pressure;
  const Box extent = is_wall ? Walls(scene).extent(wall_index(scene, probe.wall), scene.domain.box()) : probe.region;
  std::vector<std::string> groups = {""};
  for (const std::size_t material : species_of(scene, probe))
    if (!is_wall) groups.push_back(scene.materials[material].name + " ");
  const double low = extent.low[probe.axis], size = (extent.high[probe.axis] - low) / probe.bins;
  std::vector<std::string> names;
  for (const std::string& group : groups)
    for (int bin = 0; bin < probe.bins; ++bin) {
      const std::string at = fmt::format("{} {:.6g} m", axis_names[probe.axis], low + (bin + 0.5) * size);
      if (is_wall) {
        names.push_back("pressure at " + at + " [Pa]");
        continue;
      }
      names.push_back(group + "solid fraction at " + at);
      for (const char* axis : axis_names) names.push_back(fmt::format("{}velocity {} at {} [m/s]", group, axis, at));
    }
  return names;
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

/// The materials of grains, where there are several to tell apart.
std::vector<std::size_t> told_materials(const Scene& scene) {
  std::vector<std::size_t> told;
  const std::vector<bool> is_grain = grain_materials(scene);
  for (std::size_t m = 0; m < is_grain.size(); ++m)
    if (is_grain[m]) told.push_back(m);
  return told.size() > 1 ? told : std::vector<std::size_t>{};
}

std::vector<double> mass(const ProbeView& view, std::vector<double>& last) {
  const Census& c = view.census;
  if (last.size() != 2) last = {view.time, c.mass_left};
  const double elapsed = view.time - last[0];
  const double flow = elapsed > 0.0 ? (c.mass_left - last[1]) / elapsed : 0.0;
  last = {view.time, c.mass_left};
  std::vector<double> row = {
      c.n_born, c.n_born - c.n_left, c.n_left, c.mass_born, c.mass_born - c.mass_left, c.mass_left, flow};
  for (const std::size_t m : told_materials(view.scene)) {
    const Census::OfMaterial& kind = c.of_material[m];
    row.insert(row.end(), {kind.n_born, kind.n_born - kind.n_left, kind.n_left, kind.mass_born,
                           kind.mass_born - kind.mass_left, kind.mass_left});
  }
  if (view.scene.outlets.size() > 1) row.insert(row.end(), c.n_left_through.begin(), c.n_left_through.end());
  for (std::size_t k = 0; k < view.scene.inlets.size(); ++k) {
    const Inlets::Account account = view.inlets->account(k);
    row.insert(row.end(), {static_cast<double>(account.n_born), account.mass_born, static_cast<double>(account.n_owed),
                           account.mass_owed});
  }
  return row;
}

std::vector<std::string> mass_columns(const Scene& scene) {
  std::vector<std::string> names = {"born",           "inside",        "left", "mass born [kg]", "mass inside [kg]",
                                    "mass left [kg]", "outflow [kg/s]"};
  for (const std::size_t m : told_materials(scene))
    for (const char* what :
         {"{} born", "{} inside", "{} left", "{} mass born [kg]", "{} mass inside [kg]", "{} mass left [kg]"})
      names.push_back(fmt::format(fmt::runtime(what), scene.materials[m].name));
  if (scene.outlets.size() > 1)
    for (const Outlet& outlet : scene.outlets) names.push_back("left through " + outlet.name);
  for (const Inlet& inlet : scene.inlets)
    for (const char* what : {"born at {}", "mass born at {} [kg]", "owed at {}", "mass owed at {} [kg]"})
      names.push_back(fmt::format(fmt::runtime(what), inlet.name));
  return names;
}

/// Lacey's index (1954, J. Appl. Chem. 4, 257): 0 where the kinds are apart, 1 where they lie as at random. Each cell of the region
/// weighs as many as its grains are; variances of the share of one kind: of unmixed grains p (1 - p), of a random mixture
/// p (1 - p) over the mean number of grains in a cell.
std::vector<double> mixing(const ProbeView& view, const Probe& probe) {
  const Particles& p = view.particles;
  const int material = view.scene.material_index(probe.material);
  const Vec3 size = probe.region.size();
  const double width = std::max({size.x, size.y, size.z}) / probe.bins;
  std::array<std::int64_t, 3> n_cells;
  for (int axis = 0; axis < 3; ++axis)
    n_cells[static_cast<std::size_t>(axis)] =
        std::max<std::int64_t>(1, static_cast<std::int64_t>(std::lround(size[axis] / width)));
  std::vector<std::uint64_t> counts(2 * static_cast<std::size_t>(n_cells[0] * n_cells[1] * n_cells[2]), 0);
  for (std::int32_t i = 0; i < p.size(); ++i) {
    if (!p.is_here(i) || !probe.region.contains(p.position(i))) continue;
    std::int64_t cell = 0;
    for (int axis = 2; axis >= 0; --axis) {
      const std::int64_t n = n_cells[static_cast<std::size_t>(axis)];
      const double along = (p.position(i)[axis] - probe.region.low[axis]) / size[axis] * static_cast<double>(n);
      cell = cell * n + std::clamp<std::int64_t>(static_cast<std::int64_t>(along), 0, n - 1);
    }
    ++counts[2 * static_cast<std::size_t>(cell)];
    if (p.material(i) == material) ++counts[2 * static_cast<std::size_t>(cell) + 1];
  }
  if (!view.world.is_alone()) view.world.sum(std::span<std::uint64_t>(counts));
  double n_all = 0.0, n_kind = 0.0, n_filled = 0.0;
  for (std::size_t c = 0; c < counts.size(); c += 2) {
    n_all += static_cast<double>(counts[c]);
    n_kind += static_cast<double>(counts[c + 1]);
    n_filled += counts[c] > 0 ? 1.0 : 0.0;
  }
  const double share = n_all > 0.0 ? n_kind / n_all : 0.0;
  double variance = 0.0;
  for (std::size_t c = 0; c < counts.size(); c += 2) {
    if (counts[c] == 0) continue;
    const auto n = static_cast<double>(counts[c]), off = static_cast<double>(counts[c + 1]) / n - share;
    variance += n / n_all * off * off;
  }
  const double unmixed = share * (1.0 - share), random = n_all > 0.0 ? unmixed * n_filled / n_all : 0.0;
  const double index = unmixed > random ? (unmixed - variance) / (unmixed - random) : 0.0;
  return {index, share, n_all, n_filled};
}

std::vector<double> energy(const EnergyLedger& e) {
  return {e.kinetic,     e.rotational,      e.elastic_normal, e.elastic_tangential, e.potential,
          e.lost_normal, e.lost_tangential, e.lost_friction,  e.lost_drag,          e.left,
          e.wall_work,   e.total(),         e.error()};
}

}  // namespace

std::vector<std::string> probe_columns(const Scene& scene, const Probe& probe) {
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
              "work of moving walls [J]",
              "total [J]",
              "error [J]"};
    case Probe::Kind::wall_force: return wall_force_columns(scene, probe);
    case Probe::Kind::region: return region_columns(scene, probe);
    case Probe::Kind::mass: return mass_columns(scene);
    case Probe::Kind::mixing:
      return {"mixing index", "share of " + probe.material, "grains looked at", "cells with grains"};
    case Probe::Kind::contacts: return {"contacts", "mean overlap / radius", "largest overlap / radius"};
    case Probe::Kind::fields: return CoarseFields::columns();
    case Probe::Kind::wall_pressure:
    case Probe::Kind::profile: return slice_columns(scene, probe);
    case Probe::Kind::pressure:
    case Probe::Kind::pressure_drop:
    case Probe::Kind::bed_height:
    case Probe::Kind::gas_profile:
    case Probe::Kind::gas_mean: return gas_probe_columns(scene, probe);
  }
  return {};
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
    case Probe::Kind::mixing: return mixing(view, probe);
    case Probe::Kind::fields: break;  // Simulation has them
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
