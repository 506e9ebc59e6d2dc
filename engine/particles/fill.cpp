#include "engine/particles/fill.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>

#include "comm/totals.hpp"
#include "engine/particles/lattice.hpp"
#include "engine/particles/pack.hpp"
#include "engine/particles/pack_occupied.hpp"
#include "engine/particles/sizes.hpp"
#include "engine/scene/lists.hpp"
#include "kernels/base/exact_sum.hpp"
#include "kernels/base/random.hpp"
#include "kernels/base/sphere.hpp"

namespace moraine {
namespace {

/// Above this share of the volume (the area, in two dimensions) relaxation is quicker than adding grains one by one.
constexpr double loosest_relaxed = 0.30;

/// A group on its way into the world.
struct Birth {
  const Scene& scene;
  const ParticleGroup& group;
  std::string key;             // of the group in the scene, for messages
  std::uint64_t first_number;  // of its first grain, counted over all groups
  const World& world;          // whose ranks share the lists, where they do
};

[[noreturn]] void fail(const Birth& birth, const std::string& part, const std::string& message) {
  throw SceneError({Problem{birth.key + part, message}});
}

DiameterSampler sampler_of(const Birth& birth) {
  try {
    return DiameterSampler(birth.group.diameter);
  } catch (const std::invalid_argument& error) {
    fail(birth, ".diameter", error.what());
  }
}

std::uint16_t material_of(const Birth& birth) {
  const int index = birth.scene.material_index(birth.group.material);
  if (index < 0) fail(birth, ".material", fmt::format("there is no material \"{}\"", birth.group.material));
  return static_cast<std::uint16_t>(index);
}

/// Radii of grain 0, 1, ... of a group [m].
double draw_radius(const Birth& birth, const DiameterSampler& diameter, std::uint64_t i) {
  return 0.5 * diameter(random_uniform(birth.group.seed, birth.first_number + i, RandomPurpose::radius));
}

/// The radii of a random fill: as many as asked, or until the volume asked for is reached as closely as it can be.
std::vector<double> draw_radii(const Birth& birth, const RandomFill& fill, double region_volume) {
  if (fill.count.has_value() == fill.solid_fraction.has_value())
    fail(birth, ".fill", "give either `count` or `solid_fraction`");
  const DiameterSampler diameter = sampler_of(birth);
  std::vector<double> radii;
  if (fill.count) {
    if (*fill.count < 0) fail(birth, ".fill.count", "must not be negative");
    for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(*fill.count); ++i)
      radii.push_back(draw_radius(birth, diameter, i));
    return radii;
  }
  if (!(*fill.solid_fraction >= 0.0 && *fill.solid_fraction < 1.0))
    fail(birth, ".fill.solid_fraction", fmt::format("{:g} must lie between 0 and 1", *fill.solid_fraction));
  const double wanted = *fill.solid_fraction * region_volume;
  double sum = 0.0;
  while (true) {
    const double radius = draw_radius(birth, diameter, radii.size());
    if (sum + 0.5 * sphere_volume(radius) > wanted) return radii;
    sum += sphere_volume(radius);
    if (radii.size() == std::size_t{1} << 31) fail(birth, ".fill", "a group cannot hold more than 2147483648 grains");
    radii.push_back(radius);
  }
}

/// The grains born so far that may come near a region.
std::vector<PackGrain> grains_near(const std::vector<GrainSeed>& seeds, const Container& container, double reach) {
  std::vector<PackGrain> near;
  const PackSpace& space = container.space();
  const Box& extent = container.extent();
  const Vec3 middle = 0.5 * (extent.low + extent.high);
  for (const GrainSeed& seed : seeds) {
    const Vec3 d = space.difference(seed.position, middle);
    bool is_near = true;
    for (int k = 0; k < 3; ++k)
      is_near = is_near && std::abs(d[k]) <= 0.5 * (extent.high[k] - extent.low[k]) + seed.radius + reach;
    if (is_near) near.push_back({seed.position, seed.radius});
  }
  return near;
}

double total_volume(std::span<const PackGrain> grains) {
  ExactSum sum;
  for (const PackGrain& grain : grains) sum.add(sphere_volume(grain.radius));
  return sum.value();
}

/// How full a packing is: by volume, or by area of the discs seen in two dimensions.
double crowding(const Container& container, std::span<const PackGrain> grains) {
  if (!container.space().is_flat) return total_volume(grains) / volume(container.region());
  const Vec3 size = container.extent().size();
  double area = 0.0;
  for (const PackGrain& grain : grains) area += std::numbers::pi * grain.radius * grain.radius;
  return area / (size.x * size.y);
}

/// Too large a grain for a periodic direction would touch itself.
void check_largest(const Birth& birth, const Container& container, double radius) {
  for (int k = 0; k < 3; ++k) {
    const double size = birth.scene.domain.high[k] - birth.scene.domain.low[k];
    if (container.space().periodic[static_cast<std::size_t>(k)] && 2.0 * radius > size)
      fail(birth, ".diameter",
           fmt::format("a grain of {:g} m is wider than the periodic domain ({:g} m along {})", 2.0 * radius, size,
                       "xyz"[k]));
  }
}

/// Consecutive groups that are to fill the same region at random, and so are packed together: mixtures would not get as
/// dense if the grains of one group had to find room among those of another that can no longer move.
struct Mixture {
  std::span<const Birth> births;
  std::vector<PackGrain> grains;  // of all groups, one after the other
  std::vector<std::size_t> ends;  // where each group ends in `grains`
  double largest = 0.0;           // [m] radius
};

[[noreturn]] void fail_too_dense(const Mixture& mixture, const Container& container, double scale) {
  const double asked = total_volume(mixture.grains) / volume(container.region());
  std::string others;
  for (const Birth& birth : mixture.births.subspan(1))
    others += (others.empty() ? ", together with those of " : ", ") + birth.key;
  fail(mixture.births[0], ".fill",
       fmt::format(
           "{} grains (solid fraction {:.4f}){} do not fit into {} without overlap: {:.4f} was reached. Ask for less, "
           "or "
           "make the region larger; a random packing of equal grains ends at about 0.63, walls and other grains close "
           "by lower it",
           mixture.grains.size(), asked, others, describe(container.region()), asked * scale * scale * scale));
}

void pack(Mixture& mixture, const Container& container, const std::vector<GrainSeed>& born, int n_threads) {
  const Birth& first = mixture.births[0];
  std::uint64_t seed = first.group.seed;
  for (const Birth& birth : mixture.births.subspan(1)) seed = mix64(seed) ^ birth.group.seed;
  const std::vector<PackGrain> fixed = grains_near(born, container, 1.1 * mixture.largest);
  const PackProblem problem{container, fixed, seed, first.first_number, n_threads};
  if (crowding(container, mixture.grains) <= loosest_relaxed && pack_sequentially(problem, mixture.grains)) return;
  const Relaxation relaxation = pack_by_relaxation(problem, mixture.grains);
  if (!relaxation.is_free) fail_too_dense(mixture, container, relaxation.scale);
}

std::string describe_part(const Mixture& mixture, std::size_t part, const Container& container) {
  const std::size_t begin = part == 0 ? 0 : mixture.ends[part - 1];
  const std::span<const PackGrain> grains(mixture.grains.data() + begin, mixture.ends[part] - begin);
  return fmt::format("{} grains at random, solid fraction {:.4f} of {}", grains.size(),
                     total_volume(grains) / volume(container.region()), describe(container.region()));
}

const RandomFill& random_fill(const Birth& birth) { return std::get<RandomFill>(birth.group.fill); }

/// Draws the sizes of each group in turn, and packs them all.
Mixture fill_randomly(std::vector<Birth>& births, const std::vector<GrainSeed>& born, int n_threads,
                      std::vector<std::string>& notes) {
  const Container container(births[0].scene, random_fill(births[0]).region);
  const double region_volume = volume(container.region());
  if (!(region_volume > 0.0)) fail(births[0], ".fill", "the region has no volume inside the domain");
  Mixture mixture;
  mixture.births = births;
  for (Birth& birth : births) {
    birth.first_number = births[0].first_number + mixture.grains.size();
    for (const double radius : draw_radii(birth, random_fill(birth), region_volume)) {
      mixture.grains.push_back({container.extent().low, radius});
      mixture.largest = std::max(mixture.largest, radius);
    }
    check_largest(birth, container, mixture.largest);
    mixture.ends.push_back(mixture.grains.size());
  }
  pack(mixture, container, born, n_threads);
  for (std::size_t part = 0; part < births.size(); ++part) notes.push_back(describe_part(mixture, part, container));
  return mixture;
}

std::vector<PackGrain> fill_lattice(const Birth& birth, const LatticeFill& fill, const std::vector<GrainSeed>& born,
                                    std::string& note) {
  const Container container(birth.scene, fill.region);
  const DiameterSampler diameter = sampler_of(birth);
  check_largest(birth, container, 0.5 * diameter.largest());
  const double spacing = fill.spacing > 0.0 ? fill.spacing : 1.001 * diameter.largest();
  if (spacing < diameter.largest())
    fail(birth, ".fill.spacing",
         fmt::format("{:g} m is less than the largest diameter, {:g} m", spacing, diameter.largest()));
  const std::vector<Vec3> sites = lattice_sites(container, fill.kind, spacing, 0.5 * diameter.largest());

  const std::vector<PackGrain> fixed = grains_near(born, container, diameter.largest());
  std::vector<double> radii;
  for (const PackGrain& grain : fixed) radii.push_back(grain.radius);
  OccupiedSpace occupied(container.space(), container.extent(), radii);
  for (const PackGrain& grain : fixed) occupied.insert(grain);

  const double play = 0.5 * std::clamp(fill.jitter, 0.0, 1.0) * (spacing - diameter.largest());
  const auto wanted = static_cast<std::size_t>(fill.count.value_or(static_cast<std::int64_t>(sites.size())));
  std::vector<PackGrain> grains;
  std::size_t n_taken = 0;
  for (const Vec3 site : sites) {
    if (grains.size() == wanted) break;
    const std::uint64_t i = grains.size();
    PackGrain grain{site, draw_radius(birth, diameter, i)};
    const Vec3 moved =
        site + play * random_in_ball(birth.group.seed, birth.first_number + i, container.space().is_flat);
    if (play > 0.0 && container.fits(moved, grain.radius)) grain.position = container.space().wrapped(moved);
    if (!fixed.empty() && occupied.overlaps(grain))
      ++n_taken;
    else
      grains.push_back(grain);
  }
  if (fill.count && grains.size() < wanted)
    fail(birth, ".fill.count",
         fmt::format("{} grains asked, but the lattice has only {} free sites in {}", wanted, grains.size(),
                     describe(container.region())));
  note =
      fmt::format("{} grains on a {} lattice of spacing {:g} m in {}", grains.size(),
                  fill.kind == LatticeFill::Kind::cubic ? "cubic" : "hexagonal", spacing, describe(container.region()));
  if (n_taken > 0) note += fmt::format("; {} sites left out where other grains are", n_taken);
  return grains;
}

/// Velocities around the group's own: normal deviations, less their mass-weighted mean, so that the group's momentum is
/// exactly its mass times the velocity asked for. (Their variance is therefore smaller by a factor 1 - 1/N.)
/// `share`: the rank's part of the group.
void give_velocities(const Birth& birth, std::span<GrainSeed> grains, const ListShare& share = {}) {
  const ParticleGroup& group = birth.group;
  for (GrainSeed& grain : grains) grain.velocity = group.velocity;
  if (!(group.velocity_deviation > 0.0)) return;
  const int dimensions = birth.scene.domain.dimensions;
  ExactSum3 momentum;
  ExactSum mass;
  for (std::size_t i = 0; i < grains.size(); ++i) {
    Vec3 deviation;
    for (int k = 0; k < dimensions; ++k)
      deviation[k] = group.velocity_deviation * random_normal(group.seed, birth.first_number + share.row(i),
                                                              RandomPurpose::velocity, static_cast<std::uint64_t>(k));
    const double m = birth.scene.materials[grains[i].material].density * sphere_volume(grains[i].radius);
    grains[i].velocity += deviation;
    momentum.add(m * deviation);
    mass.add(m);
  }
  const World world = share.n_ranks > 1 ? birth.world : World();
  const double total_mass = total(world, mass);
  if (!(total_mass > 0.0)) return;
  const Vec3 total_momentum{total(world, momentum.x), total(world, momentum.y), total(world, momentum.z)};
  const Vec3 mean = total_momentum / total_mass;
  for (GrainSeed& grain : grains) grain.velocity -= mean;
}

/// Brings a listed grain into the domain where that is periodic; false where it lies outside for good.
bool bring_inside(const Domain& domain, Vec3& position) {
  PackSpace space;
  space.box = domain.box();
  space.periodic = domain.periodic;
  position = space.wrapped(position);
  for (int k = 0; k < 3; ++k)
    if (!(position[k] >= domain.low[k] && position[k] <= domain.high[k])) return false;
  return true;
}

std::vector<GrainSeed> list_grains(const Birth& birth, const ListedGrains& list, std::string& note) {
  std::vector<GrainSeed> grains = list.grains;
  const std::string where = list.source.empty() ? "" : fmt::format(" of {}", list.source);
  const std::optional<DiameterSampler> diameter =
      list.has_radius ? std::nullopt : std::optional<DiameterSampler>(sampler_of(birth));
  for (std::size_t i = 0; i < grains.size(); ++i) {
    GrainSeed& grain = grains[i];
    const std::uint64_t row = list.share.row(i);
    const Vec3 p = grain.position;
    if (!list.has_radius) grain.radius = draw_radius(birth, *diameter, row);
    if (!(grain.radius > 0.0) || !std::isfinite(grain.radius))
      fail(birth, ".fill",
           fmt::format("grain {}{} has the radius {:g} m; it must be greater than zero", row + 1, where, grain.radius));
    if (!bring_inside(birth.scene.domain, grain.position))
      fail(birth, ".fill",
           fmt::format("grain {}{} at ({:g}, {:g}, {:g}) m lies outside the domain", row + 1, where, p.x, p.y, p.z));
    if (!birth.group.material.empty())
      grain.material = material_of(birth);
    else if (grain.material >= birth.scene.materials.size())
      fail(birth, ".fill",
           fmt::format("grain {}{} names material number {}, there are {}", row + 1, where, grain.material,
                       birth.scene.materials.size()));
    if (!list.has_velocity) grain.angular_velocity = birth.group.angular_velocity;
  }
  if (!list.has_velocity) give_velocities(birth, grains, list.share);
  note = fmt::format("{} grains{}", facts_of(list).n_grains,
                     list.source.empty() ? " listed in the scene" : " from " + list.source);
  return grains;
}

std::vector<GrainSeed> clothe(const Birth& birth, std::span<const PackGrain> bare) {
  const std::uint16_t material = material_of(birth);
  std::vector<GrainSeed> grains;
  grains.reserve(bare.size());
  for (const PackGrain& grain : bare)
    grains.push_back({grain.position, {}, birth.group.angular_velocity, grain.radius, material});
  give_velocities(birth, grains);
  return grains;
}

/// Beyond so many grains a rough number will do for what counts them: counting takes the memory that the grains take.
constexpr double worth_counting = 2e7;

double mean_sphere_volume(const DiameterSampler& diameter) {
  constexpr int n = 64;
  double sum = 0.0;
  for (int i = 0; i < n; ++i) sum += sphere_volume(0.5 * diameter((i + 0.5) / n));
  return sum / n;
}

std::int64_t count_group(const Birth& birth) {
  if (const auto* list = std::get_if<ListedGrains>(&birth.group.fill))
    return static_cast<std::int64_t>(facts_of(*list).n_grains);
  if (const auto* lattice = std::get_if<LatticeFill>(&birth.group.fill)) {
    if (lattice->count) return *lattice->count;
    const double largest = sampler_of(birth).largest();
    const Container container(birth.scene, lattice->region);
    const double spacing = lattice->spacing > 0.0 ? lattice->spacing : 1.001 * largest;
    const double density = lattice->kind == LatticeFill::Kind::hexagonal ? std::numbers::sqrt2 : 1.0;
    const double rough = density * volume(container.region()) / (spacing * spacing * spacing);
    if (!container.space().is_flat && rough > worth_counting) return static_cast<std::int64_t>(std::min(rough, 1e15));
    return static_cast<std::int64_t>(lattice_sites(container, lattice->kind, spacing, 0.5 * largest).size());
  }
  const auto& fill = std::get<RandomFill>(birth.group.fill);
  const Container container(birth.scene, fill.region);
  if (fill.count) return *fill.count;
  const double rough =
      fill.solid_fraction.value_or(0.0) * volume(container.region()) / mean_sphere_volume(sampler_of(birth));
  if (rough > worth_counting) return static_cast<std::int64_t>(std::min(rough, 1e15));
  return static_cast<std::int64_t>(draw_radii(birth, fill, volume(container.region())).size());
}

std::string group_key(std::size_t index) { return fmt::format("particles[{}]", index); }

bool is_same(const Region& a, const Region& b) {
  return a.index() == b.index() && bounds(a) == bounds(b) &&
         (!std::holds_alternative<CylinderRegion>(a) ||
          std::get<CylinderRegion>(a).axis == std::get<CylinderRegion>(b).axis);
}

/// Groups from `first` on that can be born together: one, or a mixture.
std::vector<Birth> next_births(const Scene& scene, std::size_t first, std::uint64_t first_number, const World& world) {
  std::vector<Birth> births;
  for (std::size_t i = first; i < scene.particles.size(); ++i) {
    const auto* fill = std::get_if<RandomFill>(&scene.particles[i].fill);
    if (i > first && !(fill && is_same(fill->region, random_fill(births[0]).region))) break;
    births.push_back({scene, scene.particles[i], group_key(i), first_number, world});
    if (!fill) break;
  }
  return births;
}

std::vector<GrainSeed> bear(std::vector<Birth>& births, const std::vector<GrainSeed>& born, int n_threads,
                            std::vector<std::string>& notes) {
  const Birth& first = births[0];
  if (const auto* list = std::get_if<ListedGrains>(&first.group.fill))
    return list_grains(first, *list, notes.emplace_back());
  if (const auto* lattice = std::get_if<LatticeFill>(&first.group.fill))
    return clothe(first, fill_lattice(first, *lattice, born, notes.emplace_back()));
  const Mixture mixture = fill_randomly(births, born, n_threads, notes);
  std::vector<GrainSeed> grains;
  for (std::size_t part = 0; part < births.size(); ++part) {
    const std::span<const PackGrain> bare(mixture.grains.data() + grains.size(), mixture.ends[part] - grains.size());
    const std::vector<GrainSeed> clothed = clothe(births[part], bare);
    grains.insert(grains.end(), clothed.begin(), clothed.end());
  }
  return grains;
}

}  // namespace

std::vector<GrainSeed> make_grains(const Scene& scene, int n_threads, FillReport* report, const World& world) {
  std::vector<GrainSeed> grains;
  std::uint64_t first_number = 0;
  for (std::size_t i = 0; i < scene.particles.size();) {
    std::vector<Birth> births = next_births(scene, i, first_number, world);
    std::vector<std::string> notes;
    std::vector<GrainSeed> newborn = bear(births, grains, n_threads, notes);
    const auto* const list = std::get_if<ListedGrains>(&scene.particles[i].fill);
    first_number += list ? facts_of(*list).n_grains : newborn.size();
    if (grains.empty())
      grains = std::move(newborn);  // the usual scene has one group, and may have millions of grains
    else
      grains.insert(grains.end(), newborn.begin(), newborn.end());
    for (std::size_t k = 0; report && k < births.size(); ++k)
      report->text += fmt::format("{}: {}\n", births[k].key, notes[k]);
    i += births.size();
  }
  return grains;
}

std::vector<std::uint64_t> listed_gids(const Scene& scene) {
  std::vector<std::uint64_t> gids;
  std::uint64_t first = 0;
  for (const ParticleGroup& group : scene.particles) {
    const auto& list = std::get<ListedGrains>(group.fill);
    for (std::size_t i = 0; i < list.grains.size(); ++i) gids.push_back(first + list.share.row(i));
    first += facts_of(list).n_grains;
  }
  return gids;
}

std::int64_t count_grains(const Scene& scene) {
  const World alone;
  std::int64_t n_grains = 0;
  for (std::size_t i = 0; i < scene.particles.size(); ++i)
    n_grains += count_group({scene, scene.particles[i], group_key(i), static_cast<std::uint64_t>(n_grains), alone});
  return n_grains;
}

}  // namespace moraine
