// Groups of grains: sizes, fills, and grains listed one by one.
#include <algorithm>
#include <numbers>
#include <numeric>

#include "engine/scene/checks.hpp"
#include "engine/scene/lists.hpp"
#include "kernels/base/sphere.hpp"

namespace moraine::checks {

namespace {

constexpr double most_grains = 2147483648.0;  // of a group
constexpr double max_solid_fraction = 0.74;   // densest packing of equal spheres, pi / (3 sqrt 2) = 0.7405

/// Mean of the cubed diameter [m3]; normal and lognormal without their truncation.
double mean_cube(const SizeDistribution& d) {
  const auto cube = [](double x) { return x * x * x; };
  switch (d.kind) {
    case SizeDistribution::Kind::single: return cube(d.value);
    case SizeDistribution::Kind::uniform: return (d.low + d.high) * (d.low * d.low + d.high * d.high) / 4.0;
    case SizeDistribution::Kind::normal: return cube(d.mean) + 3.0 * d.mean * d.deviation * d.deviation;
    case SizeDistribution::Kind::lognormal: {
      const double ratio = d.deviation / d.mean;
      return cube(d.mean) * cube(1.0 + ratio * ratio);
    }
    case SizeDistribution::Kind::list: break;
  }
  double sum = 0.0, weight = 0.0;
  for (std::size_t i = 0; i < d.values.size(); ++i) {
    const double w = i < d.weights.size() ? d.weights[i] : 1.0;
    sum += w * cube(d.values[i]);
    weight += w;
  }
  return sum / weight;
}

double volume(const Region& region) {
  if (const auto* box = std::get_if<BoxRegion>(&region)) return box->box.volume();
  if (const auto* cylinder = std::get_if<CylinderRegion>(&region))
    return std::numbers::pi * cylinder->radius * cylinder->radius * cylinder->length;
  return sphere_volume(std::get<SphereRegion>(region).radius);
}

}  // namespace

Box bounds(const Region& region) {
  if (const auto* box = std::get_if<BoxRegion>(&region)) return box->box;
  if (const auto* sphere = std::get_if<SphereRegion>(&region))
    return Box{sphere->centre, sphere->centre}.grown(sphere->radius);
  const auto& cylinder = std::get<CylinderRegion>(region);
  Box box = Box{cylinder.base, cylinder.base}.grown(cylinder.radius);
  box.low[cylinder.axis] = cylinder.base[cylinder.axis];
  box.high[cylinder.axis] = cylinder.base[cylinder.axis] + cylinder.length;
  return box;
}

namespace {

/// True where the shape itself can be used.
bool check_shape(const Region& region, const std::string& key, Findings& found) {
  if (const auto* box = std::get_if<BoxRegion>(&region)) return found.box(key + ".box", box->box);
  if (const auto* sphere = std::get_if<SphereRegion>(&region)) {
    const bool has_centre = found.finite(key + ".sphere.centre", sphere->centre, "m");
    return found.positive(key + ".sphere.radius", sphere->radius, "m") && has_centre;
  }
  const auto& cylinder = std::get<CylinderRegion>(region);
  bool is_good = found.finite(key + ".cylinder.base", cylinder.base, "m");
  is_good = found.positive(key + ".cylinder.radius", cylinder.radius, "m") && is_good;
  is_good = found.positive(key + ".cylinder.length", cylinder.length, "m") && is_good;
  if (cylinder.axis < 0 || cylinder.axis > 2) {
    found.error(key + ".cylinder.axis", "is {}; expected x, y or z (0, 1 or 2)", cylinder.axis);
    is_good = false;
  }
  return is_good;
}

/// A region given by its end points may miss the domain by the rounding of a sum.
double slack(const Domain& domain) {
  double extent = 0.0;
  for (int axis = 0; axis < 3; ++axis)
    extent = std::max({extent, std::abs(domain.low[axis]), std::abs(domain.high[axis])});
  return 1e-12 * extent;
}

}  // namespace

bool check_region(const Scene& scene, const Region& region, const std::string& key, Findings& found) {
  if (!check_shape(region, key, found)) return false;
  if (!is_usable(scene.domain)) return true;
  const Box box = bounds(region);
  const Box allowed = scene.domain.box().grown(slack(scene.domain));
  for (int axis = 0; axis < 3; ++axis) {
    if (box.low[axis] >= allowed.low[axis] && box.high[axis] <= allowed.high[axis]) continue;
    found.error(key, "reaches from {} m; outside the domain, {} m", text(box), text(scene.domain.box()));
    return false;
  }
  return true;
}

void check_room(const Box& bounds, double largest, const std::string& key, const Domain& domain, Findings& found) {
  const Vec3 size = bounds.size();
  for (int axis = 0; axis < 3; ++axis) {
    if ((axis == 2 && domain.dimensions == 2) || size[axis] >= largest) continue;
    found.error(key, "is {:.6g} m wide along {}: too narrow for the largest diameter, {:.6g} m", size[axis],
                axis_names[axis], largest);
    return;
  }
}

namespace {

void check_count(const std::optional<std::int64_t>& count, const std::string& key, Findings& found) {
  if (!count) return;
  if (*count < 1) found.error(key + ".count", "is {}; expected 1 or more", *count);
  if (static_cast<double>(*count) > most_grains)
    found.error(key + ".count", "is {}; a group cannot hold more than {:.0f} grains", *count, most_grains);
}

void check_random_fill(const Scene& scene, const ParticleGroup& group, const RandomFill& fill, const std::string& key,
                       Findings& found) {
  const bool has_region = check_region(scene, fill.region, key + ".region", found);
  if (fill.solid_fraction.has_value() == fill.count.has_value())
    found.error(key, "has {}; expected exactly one of solid_fraction and count",
                fill.count ? "both solid_fraction and count" : "neither solid_fraction nor count");
  check_count(fill.count, key, found);
  if (fill.solid_fraction && !(*fill.solid_fraction > 0.0 && *fill.solid_fraction < max_solid_fraction))
    found.error(key + ".solid_fraction",
                "is {}; expected more than 0 and less than {} (random packings reach about 0.6)", *fill.solid_fraction,
                max_solid_fraction);
  const double largest = diameter_range(group).second;
  if (!has_region || largest == 0.0) return;
  check_room(bounds(fill.region), largest, key + ".region", scene.domain, found);
  if (fill.solid_fraction) {
    const double n = *fill.solid_fraction * volume(fill.region) / (mean_cube(group.diameter) * std::numbers::pi / 6.0);
    if (n > most_grains)
      found.error(key + ".solid_fraction",
                  "is {}: that takes about {:.3g} grains; a group cannot hold more than {:.0f}", *fill.solid_fraction,
                  n, most_grains);
  }
  if (!fill.count || *fill.count < 1 || scene.domain.dimensions != 3) return;
  const double solids = static_cast<double>(*fill.count) * mean_cube(group.diameter) * std::numbers::pi / 6.0;
  const double fraction = solids / volume(fill.region);
  if (fraction >= max_solid_fraction)
    found.error(key + ".count",
                "is {}: the grains would fill {:.3g} of the region, more than {}; at most {:.0f} can fit", *fill.count,
                fraction, max_solid_fraction,
                std::floor(static_cast<double>(*fill.count) * max_solid_fraction / fraction));
}

void check_lattice_fill(const Scene& scene, const ParticleGroup& group, const LatticeFill& fill, const std::string& key,
                        Findings& found) {
  const bool has_region = check_region(scene, fill.region, key + ".region", found);
  const double largest = diameter_range(group).second;
  if (has_region && largest > 0.0) check_room(bounds(fill.region), largest, key + ".region", scene.domain, found);
  if (found.not_negative(key + ".spacing", fill.spacing, "m") && fill.spacing > 0.0 && fill.spacing < largest)
    found.error(key + ".spacing", "is {} m, less than the largest diameter, {:.6g} m: grains would overlap",
                fill.spacing, largest);
  if (!(fill.jitter >= 0.0 && fill.jitter <= 1.0))
    found.error(key + ".jitter", "is {}; expected 0 to 1, a share of the free gap", fill.jitter);
  check_count(fill.count, key, found);
  if (!has_region || largest == 0.0 || !(fill.spacing >= 0.0)) return;
  const double spacing = fill.spacing > 0.0 ? fill.spacing : largest;
  const Vec3 size = bounds(fill.region).size();
  double n = fill.kind == LatticeFill::Kind::hexagonal ? std::numbers::sqrt2 : 1.0;
  for (int axis = 0; axis < scene.domain.dimensions; ++axis) n *= std::max(1.0, size[axis] / spacing);
  if (n > most_grains)
    found.error(key + ".lattice", "has about {:.3g} sites {:.3g} m apart in its region; at most {:.0f} are possible", n,
                spacing, most_grains);
}

/// Something that listed grains do wrong: how many of them, and what is said of one, the worst and of equals the first.
struct Offence {
  std::uint64_t count = 0;
  double badness = 0.0;
  std::uint64_t number = 0;  // of that one, in the order of the lists
  std::string key, text;
};

/// Of the shares of all ranks.
void add_up(const World& world, Offence& offence) {
  if (world.is_alone()) return;
  const bool is_here = offence.count > 0;
  world.sum(std::span(&offence.count, 1));
  if (offence.count == 0) return;
  const std::vector<double> badness = world.gather(is_here ? offence.badness : -infinity);
  const std::vector<std::uint64_t> numbers = world.gather(offence.number);
  std::size_t holder = 0;
  for (std::size_t rank = 1; rank < badness.size(); ++rank)
    if (badness[rank] > badness[holder] || (badness[rank] == badness[holder] && numbers[rank] < numbers[holder]))
      holder = rank;
  world.broadcast(offence.key, static_cast<int>(holder));
  world.broadcast(offence.text, static_cast<int>(holder));
}

/// The ranks that share a list, or all lists of a scene; this one alone where it has them whole.
World sharing(const ListedGrains& list, const Findings& found) { return list.whole ? found.world() : World(); }
World sharing(const Scene& scene, const Findings& found) { return is_shared(scene) ? found.world() : World(); }

/// Offenders among the grains here: how many, and the first.
struct Offenders {
  std::uint64_t count = 0;
  std::size_t first = 0;
  void add(std::size_t i) {
    if (count++ == 0) first = i;
  }
};

template <class Predicate>
Offenders offenders(const std::vector<GrainSeed>& grains, Predicate is_bad) {
  Offenders bad;
  for (std::size_t i = 0; i < grains.size(); ++i)
    if (is_bad(grains[i])) bad.add(i);
  return bad;
}

std::string where_from(const ListedGrains& fill) { return fill.source.empty() ? "" : " of " + fill.source; }
std::string key_of(const ListedGrains& fill, const std::string& key) {
  return key + (fill.source.empty() ? ".positions" : ".file");
}
std::string count_of(std::uint64_t bad, std::uint64_t all) { return fmt::format("({} of {} grains)", bad, all); }

bool is_finite(Vec3 v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

void check_listed_grains(const Scene& scene, const ListedGrains& fill, const std::string& group_key, Findings& found) {
  const std::string key = key_of(fill, group_key);
  const std::vector<GrainSeed>& grains = fill.grains;
  const ListFacts facts = facts_of(fill);
  if (facts.n_grains == 0) {
    found.error(key, "{} no grains", fill.source.empty() ? "lists" : fill.source + " holds");
    return;
  }
  const World world = sharing(fill, found);
  const auto report = [&](const Offenders& bad, const auto& describe) {
    Offence offence{bad.count, 0.0, fill.share.row(bad.first), key, ""};
    if (bad.count)
      offence.text = fmt::format("grain {}{} {}", offence.number, where_from(fill), describe(grains[bad.first]));
    add_up(world, offence);
    if (offence.count) found.error(key, "{} {}", offence.text, count_of(offence.count, facts.n_grains));
  };
  const auto is_not_a_number = [](const GrainSeed& g) {
    return !is_finite(g.position) || !is_finite(g.velocity) || !is_finite(g.angular_velocity);
  };
  report(offenders(grains, is_not_a_number),
         [](const GrainSeed&) { return "has a position or velocity that is not finite"; });
  if (is_usable(scene.domain)) {
    const Box domain = scene.domain.box();
    report(offenders(grains, [&](const GrainSeed& g) { return is_finite(g.position) && !domain.contains(g.position); }),
           [&](const GrainSeed& g) {
             return fmt::format("is at {} m, outside the domain, {} m", text(g.position), text(domain));
           });
  }
  if (fill.has_radius)
    report(offenders(grains, [](const GrainSeed& g) { return !(std::isfinite(g.radius) && g.radius > 0.0); }),
           [](const GrainSeed& g) { return fmt::format("has a radius of {} m; expected more than 0", g.radius); });
  if (!scene.materials.empty())
    report(offenders(grains, [&](const GrainSeed& g) { return g.material >= scene.materials.size(); }),
           [&](const GrainSeed& g) {
             return fmt::format("has material number {}; the scene has {} materials", g.material,
                                scene.materials.size());
           });
}

}  // namespace

void check_sizes(const SizeDistribution& d, const std::string& key, Findings& found) {
  using Kind = SizeDistribution::Kind;
  if (d.kind == Kind::single) {
    found.positive(key, d.value, "m");
    return;
  }
  if (d.kind == Kind::list) {
    if (d.values.empty()) found.error(key + ".values", "is empty; list at least one diameter [m]");
    for (std::size_t i = 0; i < d.values.size(); ++i)
      found.positive(fmt::format("{}.values[{}]", key, i), d.values[i], "m");
    for (std::size_t i = 0; i < d.weights.size(); ++i)
      found.not_negative(fmt::format("{}.weights[{}]", key, i), d.weights[i], "-");
    if (!d.weights.empty() && d.weights.size() != d.values.size())
      found.error(key + ".weights", "has {} entries for {} values; expected one each", d.weights.size(),
                  d.values.size());
    else if (!d.weights.empty() && !(std::accumulate(d.weights.begin(), d.weights.end(), 0.0) > 0.0))
      found.error(key + ".weights", "are all 0; at least one diameter must be wanted");
    return;
  }
  const bool has_low = found.positive(key + ".low", d.low, "m");
  const bool has_high = found.positive(key + ".high", d.high, "m");
  const bool has_bounds = has_low && has_high && d.low <= d.high;
  if (has_low && has_high && !has_bounds)
    found.error(key + ".high", "is {}; expected at least low = {} [m]", d.high, d.low);
  if (d.kind == Kind::uniform) return;
  const bool has_mean = found.positive(key + ".mean", d.mean, "m");
  if (!found.not_negative(key + ".deviation", d.deviation, "m") || !has_mean || !has_bounds) return;
  if (d.low > d.mean + 4.0 * d.deviation || d.high < d.mean - 4.0 * d.deviation)
    found.error(key, "bounds {} to {} m leave out nearly all of a distribution of mean {} and deviation {} m", d.low,
                d.high, d.mean, d.deviation);
}

namespace {

/// Radius of a listed grain where it can be known before the sizes are drawn; 0 where not.
double known_radius(const ParticleGroup& group, const ListedGrains& fill, const GrainSeed& grain) {
  if (fill.has_radius) return grain.radius;
  return group.diameter.kind == SizeDistribution::Kind::single ? group.diameter.value / 2.0 : 0.0;
}

/// Where a listed grain came from: group, place among the grains of the group that are here.
using Origin = std::pair<std::uint32_t, std::uint32_t>;

/// The listed grains here that have a usable radius and place.
struct ListedCensus {
  std::vector<ListedSphere> spheres;
  std::vector<Origin> origin;
};

ListedCensus census(const Scene& scene) {
  ListedCensus all;
  const Box domain = scene.domain.box();
  for (std::size_t g = 0; g < scene.particles.size(); ++g) {
    const auto* fill = std::get_if<ListedGrains>(&scene.particles[g].fill);
    if (!fill) continue;
    for (std::size_t i = 0; i < fill->grains.size(); ++i) {
      const double radius = known_radius(scene.particles[g], *fill, fill->grains[i]);
      if (!(radius > 0.0) || !std::isfinite(radius) || !domain.contains(fill->grains[i].position)) continue;
      all.spheres.push_back({fill->grains[i].position, radius});
      all.origin.emplace_back(static_cast<std::uint32_t>(g), static_cast<std::uint32_t>(i));
    }
  }
  return all;
}

const ListedGrains& list_of(const Scene& scene, Origin origin) {
  return std::get<ListedGrains>(scene.particles[origin.first].fill);
}
/// Number over all lists.
std::uint64_t number_of(const Scene& scene, Origin origin) {
  std::uint64_t number = list_of(scene, origin).share.row(origin.second);
  for (std::size_t g = 0; g < origin.first; ++g)
    if (const auto* fill = std::get_if<ListedGrains>(&scene.particles[g].fill)) number += facts_of(*fill).n_grains;
  return number;
}
std::string name_of(const Scene& scene, Origin origin) {
  const ListedGrains& fill = list_of(scene, origin);
  return fmt::format("grain {} of {}", fill.share.row(origin.second),
                     fill.source.empty() ? fmt::format("particles[{}]", origin.first) : fill.source);
}
std::string key_of(const Scene& scene, Origin origin) {
  return key_of(list_of(scene, origin), fmt::format("particles[{}].fill", origin.first));
}

/// Where every rank has a part of the grains only, their contacts tell, once there are any.
void check_overlaps_of_grains(const Scene& scene, const ListedCensus& all, Findings& found) {
  if (is_scattered(scene)) return;
  const OverlapReport report = find_overlaps(all.spheres, scene.domain, max_start_overlap);
  Offence offence;
  offence.count = static_cast<std::uint64_t>(report.count);
  if (report.count > 0) {
    const auto first = all.origin[static_cast<std::size_t>(report.first)];
    const auto second = all.origin[static_cast<std::size_t>(report.second)];
    offence.key = key_of(scene, second);
    offence.text = fmt::format(
        "{} and {} overlap by {:.4g} m, {:.0f} % of the smaller radius; at most {:.0f} % is allowed at the "
        "start",
        name_of(scene, first), name_of(scene, second), report.overlap, 100.0 * report.relative,
        100.0 * max_start_overlap);
  }
  add_up(sharing(scene, found), offence);
  if (offence.count)
    found.error(offence.key, "{} ({} pair{} beyond it)", offence.text, offence.count, offence.count == 1 ? "" : "s");
}

/// Flat walls that stand at the start, as planes that face the grains.
std::vector<std::pair<PlaneShape, std::size_t>> flat_walls(const Scene& scene) {
  std::vector<std::pair<PlaneShape, std::size_t>> planes;
  for (std::size_t i = 0; i < scene.walls.size(); ++i) {
    const WallDefinition& wall = scene.walls[i];
    if (wall.from > 0.0) continue;
    if (const auto* plane = std::get_if<PlaneShape>(&wall.shape)) {
      const double norm = length(plane->normal);
      if (norm > 0.0 && std::isfinite(norm) && is_finite(plane->point))
        planes.push_back({{plane->point, plane->normal / norm}, i});
    } else if (const auto* shape = std::get_if<BoxShape>(&wall.shape)) {
      for (int axis = 0; axis < 3; ++axis) {
        Vec3 normal;
        normal[axis] = 1.0;
        planes.push_back({{shape->box.low, normal}, i});
        planes.push_back({{shape->box.high, -normal}, i});
      }
    }
  }
  return planes;
}

void check_overlaps_with_walls(const Scene& scene, const ListedCensus& all, Findings& found) {
  const World world = sharing(scene, found);
  for (const auto& [plane, wall] : flat_walls(scene)) {
    Offence offence;
    offence.badness = max_start_overlap;
    std::size_t which = 0;
    for (std::size_t i = 0; i < all.spheres.size(); ++i) {
      const ListedSphere& sphere = all.spheres[i];
      const double relative = 1.0 - dot(sphere.centre - plane.point, plane.normal) / sphere.radius;
      if (!(relative > max_start_overlap)) continue;
      ++offence.count;
      if (relative > offence.badness) offence.badness = relative, which = i;
    }
    if (offence.count) {
      offence.number = number_of(scene, all.origin[which]);
      offence.key = key_of(scene, all.origin[which]);
      offence.text = fmt::format(
          "{} reaches {:.4g} m, {:.0f} % of its radius, into wall \"{}\"; at most {:.0f} % is allowed at the start",
          name_of(scene, all.origin[which]), offence.badness * all.spheres[which].radius, 100.0 * offence.badness,
          scene.walls[wall].name, 100.0 * max_start_overlap);
    }
    add_up(world, offence);
    if (offence.count)
      found.error(offence.key, "{} ({} grain{} beyond it)", offence.text, offence.count, offence.count == 1 ? "" : "s");
  }
}

void check_group(const Scene& scene, const ParticleGroup& group, const std::string& key,
                 const std::vector<std::string>& materials, Findings& found) {
  const auto* listed = std::get_if<ListedGrains>(&group.fill);
  if (!listed || !group.material.empty()) {
    if (scene.material_index(group.material) < 0)
      found.error(key + ".material", "\"{}\" is not a material{}", group.material, nearest(group.material, materials));
  }
  if (!listed || !listed->has_radius) check_sizes(group.diameter, key + ".diameter", found);
  found.finite(key + ".velocity", group.velocity, "m/s");
  found.not_negative(key + ".velocity_deviation", group.velocity_deviation, "m/s");
  if (found.finite(key + ".angular_velocity", group.angular_velocity, "rad/s") && !scene.contact.rotation &&
      group.angular_velocity != Vec3{})
    found.warning(key + ".angular_velocity", "does nothing with contact.rotation = false");
  if (scene.domain.dimensions == 2 && group.velocity.z != 0.0)
    found.warning(key + ".velocity", "has a z component of {} m/s, which does nothing in two dimensions",
                  group.velocity.z);
  if (const auto* random = std::get_if<RandomFill>(&group.fill))
    check_random_fill(scene, group, *random, key + ".fill", found);
  if (const auto* lattice = std::get_if<LatticeFill>(&group.fill))
    check_lattice_fill(scene, group, *lattice, key + ".fill", found);
  if (listed) check_listed_grains(scene, *listed, key + ".fill", found);
}

}  // namespace

std::pair<double, double> diameter_range(const ParticleGroup& group) {
  double low = 0.0, high = 0.0;
  const auto include = [&](double diameter) {
    if (!std::isfinite(diameter) || diameter <= 0.0) return;
    low = low == 0.0 ? diameter : std::min(low, diameter);
    high = std::max(high, diameter);
  };
  const SizeDistribution& d = group.diameter;
  if (const auto* listed = std::get_if<ListedGrains>(&group.fill); listed && listed->has_radius) {
    const ListFacts facts = facts_of(*listed);
    for (const ListFacts::OfMaterial& kind : facts.of_material) {
      include(kind.smallest);
      include(kind.largest);
    }
  } else if (d.kind == SizeDistribution::Kind::single) {
    include(d.value);
  } else if (d.kind == SizeDistribution::Kind::list) {
    for (const double value : d.values) include(value);
  } else {
    include(d.low);
    include(d.high);
  }
  return {low, high};
}

void check_particles(const Scene& scene, Findings& found) {
  if (scene.particles.empty() && scene.inlets.empty() && !scene.gas)
    found.error("particles", "missing: the scene has no grains; add [[particles]], or an [[inlet]]");
  std::vector<std::string> materials;
  for (const Material& material : scene.materials) materials.push_back(material.name);
  for (std::size_t i = 0; i < scene.particles.size(); ++i)
    check_group(scene, scene.particles[i], fmt::format("particles[{}]", i), materials, found);
  if (!is_usable(scene.domain)) return;
  const ListedCensus all = census(scene);
  check_overlaps_of_grains(scene, all, found);
  check_overlaps_with_walls(scene, all, found);
}

}  // namespace moraine::checks
