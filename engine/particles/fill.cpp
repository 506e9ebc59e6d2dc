#include "engine/particles/fill.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>

#include "comm/totals.hpp"
#include "engine/particles/lattice.hpp"
#include "engine/particles/pack.hpp"
#include "engine/particles/pack_occupied.hpp"
#include "engine/particles/parcel.hpp"
#include "engine/particles/sizes.hpp"
#include "engine/scene/agree.hpp"
#include "engine/scene/lists.hpp"
#include "engine/threads.hpp"
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
  const World& world;          // whose ranks share the grains
};

/// This rank's grains of a group, or of all so far, ascending by their numbers over all groups.
struct Share {
  std::vector<GrainSeed> seeds;
  std::vector<std::uint64_t> numbers;
};
/// The same before they have a material and velocities.
struct BareShare {
  std::vector<PackGrain> grains;
  std::vector<std::uint64_t> numbers;
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

/// Calls f(radius) for the grains of a random fill: as many as asked, or until the volume asked for is reached as closely as it can be.
template <typename Function>
void draw_radii(const Birth& birth, const RandomFill& fill, double region_volume, Function f) {
  if (fill.count.has_value() == fill.solid_fraction.has_value())
    fail(birth, ".fill", "give either `count` or `solid_fraction`");
  const DiameterSampler diameter = sampler_of(birth);
  if (fill.count) {
    if (*fill.count < 0) fail(birth, ".fill.count", "must not be negative");
    for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(*fill.count); ++i) f(draw_radius(birth, diameter, i));
    return;
  }
  if (!(*fill.solid_fraction >= 0.0 && *fill.solid_fraction < 1.0))
    fail(birth, ".fill.solid_fraction", fmt::format("{:g} must lie between 0 and 1", *fill.solid_fraction));
  const double wanted = *fill.solid_fraction * region_volume;
  double sum = 0.0;
  for (std::uint64_t i = 0;; ++i) {
    const double radius = draw_radius(birth, diameter, i);
    if (sum + 0.5 * sphere_volume(radius) > wanted) return;
    sum += sphere_volume(radius);
    if (i == std::uint64_t{1} << 31) fail(birth, ".fill", "a group cannot hold more than 2147483648 grains");
    f(radius);
  }
}

/// The box of what lies within `reach` [m] of a box along each axis.
Box widened(Box box, double reach) {
  box.low -= Vec3{reach, reach, reach};
  box.high += Vec3{reach, reach, reach};
  return box;
}

/// The grains born so far, on whatever rank, that reach into the box that this rank asks for, in order of birth. All ranks
/// call it; who asks for nothing gives Box::empty().
std::vector<PackGrain> grains_near(const World& world, const Share& born, const PackSpace& space, const Box& box) {
  struct Numbered {
    PackGrain grain;
    std::uint64_t number;
  };
  std::vector<Parcel> parcels;
  const std::array<double, 6> own = {box.low.x, box.low.y, box.low.z, box.high.x, box.high.y, box.high.z};
  const std::vector<double> boxes = world.gather(std::span<const double>(own));
  std::vector<Numbered> near;
  for (int rank = 0; rank < world.size(); ++rank) {
    const double* const b = boxes.data() + 6 * static_cast<std::ptrdiff_t>(rank);
    if (!(b[0] <= b[3])) continue;
    const Vec3 low{b[0], b[1], b[2]}, high{b[3], b[4], b[5]}, middle = 0.5 * (low + high);
    std::vector<Numbered> wanted;
    for (std::size_t i = 0; i < born.seeds.size(); ++i) {
      const GrainSeed& seed = born.seeds[i];
      const Vec3 d = space.difference(seed.position, middle);
      bool is_near = true;
      for (int k = 0; k < 3; ++k) is_near = is_near && std::abs(d[k]) <= 0.5 * (high[k] - low[k]) + seed.radius;
      if (is_near) wanted.push_back({{seed.position, seed.radius}, born.numbers[i]});
    }
    if (rank == world.rank()) {
      near = std::move(wanted);
    } else if (!wanted.empty()) {
      ParcelWriter parcel;
      parcel.put_all(std::span<const Numbered>(wanted));
      parcels.push_back({rank, parcel.take()});
    }
  }
  if (!world.is_alone())
    for (const Parcel& parcel : world.exchange(std::move(parcels))) {
      const std::size_t n = near.size();
      near.resize(n + parcel.bytes.size() / sizeof(Numbered));
      ParcelReader(parcel.bytes).get_all(std::span(near).subspan(n));
    }
  std::sort(near.begin(), near.end(), [](const Numbered& a, const Numbered& b) { return a.number < b.number; });
  std::vector<PackGrain> grains;
  for (const Numbered& one : near) grains.push_back(one.grain);
  return grains;
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

void pack(Mixture& mixture, const Container& container, std::span<const PackGrain> fixed, int n_threads) {
  const Birth& first = mixture.births[0];
  std::uint64_t seed = first.group.seed;
  for (const Birth& birth : mixture.births.subspan(1)) seed = mix64(seed) ^ birth.group.seed;
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

/// Draws the sizes of each group in turn.
void draw_mixture(Mixture& mixture, std::span<Birth> births, const Container& container) {
  for (Birth& birth : births) {
    birth.first_number = births[0].first_number + mixture.grains.size();
    draw_radii(birth, random_fill(birth), volume(container.region()), [&](double radius) {
      mixture.grains.push_back({container.extent().low, radius});
      mixture.largest = std::max(mixture.largest, radius);
    });
    check_largest(birth, container, mixture.largest);
    mixture.ends.push_back(mixture.grains.size());
  }
}

/// What the root has packed, dealt out: of each group every rank gets as many, in order of rank. Some at a time, so that the root does
/// not hold them twice.
std::vector<BareShare> deal_out(const std::vector<Birth>& births, Mixture& mixture) {
  const World& world = births[0].world;
  mixture.ends.resize(births.size());
  std::vector<std::uint64_t> ends(mixture.ends.begin(), mixture.ends.end());
  world.max(ends);
  std::vector<BareShare> shares(births.size());
  std::uint64_t begin = 0;
  for (std::size_t part = 0; part < births.size(); ++part) {
    const auto n = static_cast<std::int64_t>(ends[part] - begin);
    BareShare& own = shares[part];
    const auto rows_of = [&](int rank) { return share_of(n, rank, world.size()); };
    for (std::int64_t i = rows_of(world.rank()).begin; i < rows_of(world.rank()).end; ++i)
      own.numbers.push_back(births[0].first_number + begin + static_cast<std::uint64_t>(i));
    own.grains.reserve(own.numbers.size());
    constexpr std::int64_t at_a_time = 1 << 20;
    for (std::int64_t first = 0; first < n; first += at_a_time) {
      std::vector<Parcel> parcels;
      for (int rank = 0; rank < world.size() && world.is_root(); ++rank) {
        const Range rows = {std::max(rows_of(rank).begin, first), std::min(rows_of(rank).end, first + at_a_time)};
        if (rows.empty()) continue;
        const PackGrain* const from = mixture.grains.data() + begin + rows.begin;
        if (rank == world.rank()) {
          own.grains.insert(own.grains.end(), from, from + rows.size());
          continue;
        }
        ParcelWriter parcel;
        parcel.put_all(std::span(from, static_cast<std::size_t>(rows.size())));
        parcels.push_back({rank, parcel.take()});
      }
      if (world.is_alone()) continue;
      for (const Parcel& parcel : world.exchange(std::move(parcels))) {
        const std::size_t had = own.grains.size();
        own.grains.resize(had + parcel.bytes.size() / sizeof(PackGrain));
        ParcelReader(parcel.bytes).get_all(std::span(own.grains).subspan(had));
      }
    }
    begin = ends[part];
  }
  std::vector<PackGrain>().swap(mixture.grains);
  return shares;
}

/// Packs the grains of all groups together, at the root: every grain's place hangs on those of all others. Only the root holds them all,
/// as bare spheres and only until they are dealt out.
std::vector<BareShare> fill_randomly(std::vector<Birth>& births, const Share& born, int n_threads,
                                     std::vector<std::string>& notes) {
  const World& world = births[0].world;
  const Container container(births[0].scene, random_fill(births[0]).region);
  if (!(volume(container.region()) > 0.0)) fail(births[0], ".fill", "the region has no volume inside the domain");
  Mixture mixture;
  mixture.births = births;
  agree(world, [&] {
    if (world.is_root()) draw_mixture(mixture, births, container);
  });
  std::vector<PackGrain> fixed;
  if (births[0].first_number > 0)
    fixed = grains_near(world, born, container.space(),
                        world.is_root() ? widened(container.extent(), 1.1 * mixture.largest) : Box::empty());
  agree(world, [&] {
    if (world.is_root()) pack(mixture, container, fixed, n_threads);
  });
  for (std::size_t part = 0; part < births.size(); ++part)
    notes.push_back(world.is_root() ? describe_part(mixture, part, container) : "");
  return deal_out(births, mixture);
}

/// Each rank looks after some rows of the lattice. Sites are numbered along all rows, and what a grain is by chance goes by the number
/// of its site; grains by those sites that are free.
BareShare fill_lattice(const Birth& birth, const LatticeFill& fill, const Share& born, std::string& note) {
  const World& world = birth.world;
  const Container container(birth.scene, fill.region);
  const DiameterSampler diameter = sampler_of(birth);
  check_largest(birth, container, 0.5 * diameter.largest());
  const double spacing = fill.spacing > 0.0 ? fill.spacing : 1.001 * diameter.largest();
  if (spacing < diameter.largest())
    fail(birth, ".fill.spacing",
         fmt::format("{:g} m is less than the largest diameter, {:g} m", spacing, diameter.largest()));
  const LatticeRows rows(container, fill.kind, spacing, 0.5 * diameter.largest());
  const Range own_rows = share_of(rows.size(), world.rank(), world.size());
  std::uint64_t n_sites = 0;
  Box around = Box::empty();
  rows.for_each_site(own_rows, [&](Vec3 site) {
    ++n_sites;
    around.include(site);
  });
  const std::uint64_t first_site = world.sum_before(n_sites);

  std::vector<PackGrain> fixed;
  if (birth.first_number > 0)
    fixed =
        grains_near(world, born, container.space(), n_sites > 0 ? widened(around, diameter.largest()) : Box::empty());
  std::vector<double> radii;
  for (const PackGrain& grain : fixed) radii.push_back(grain.radius);
  OccupiedSpace occupied(container.space(), container.extent(), radii);
  for (const PackGrain& grain : fixed) occupied.insert(grain);

  const double play = 0.5 * std::clamp(fill.jitter, 0.0, 1.0) * (spacing - diameter.largest());
  const std::uint64_t wanted =
      fill.count ? static_cast<std::uint64_t>(std::max<std::int64_t>(0, *fill.count)) : ~std::uint64_t{0};
  BareShare share;
  share.grains.reserve(std::min(n_sites, wanted));
  std::uint64_t next_site = first_site;
  rows.for_each_site(own_rows, [&](Vec3 site) {
    const std::uint64_t i = next_site++;
    PackGrain grain{site, draw_radius(birth, diameter, i)};
    const Vec3 moved =
        site + play * random_in_ball(birth.group.seed, birth.first_number + i, container.space().is_flat);
    if (play > 0.0 && container.fits(moved, grain.radius)) grain.position = container.space().wrapped(moved);
    if (fixed.empty() || !occupied.overlaps(grain)) share.grains.push_back(grain);
  });

  const std::uint64_t first = world.sum_before(share.grains.size());
  std::array<std::uint64_t, 2> all = {share.grains.size(), n_sites};
  world.sum(all);
  auto n_grains = all[0];
  if (fill.count) {
    if (n_grains < wanted)
      fail(birth, ".fill.count",
           fmt::format("{} grains asked, but the lattice has only {} free sites in {}", wanted, n_grains,
                       describe(container.region())));
    n_grains = wanted;
    share.grains.resize(std::min<std::uint64_t>(share.grains.size(), wanted > first ? wanted - first : 0));
  }
  share.numbers.reserve(share.grains.size());
  for (std::uint64_t i = 0; i < share.grains.size(); ++i) share.numbers.push_back(birth.first_number + first + i);
  note =
      fmt::format("{} grains on a {} lattice of spacing {:g} m in {}", n_grains,
                  fill.kind == LatticeFill::Kind::cubic ? "cubic" : "hexagonal", spacing, describe(container.region()));
  if (all[1] > all[0]) note += fmt::format("; {} sites left out where other grains are", all[1] - all[0]);
  return share;
}

/// Velocities around the group's own: normal deviations, less their mass-weighted mean, so that the group's momentum is
/// exactly its mass times the velocity asked for. (Their variance is therefore smaller by a factor 1 - 1/N.)
/// The ranks of `world` share the group.
void give_velocities(const Birth& birth, Share& share, const World& world) {
  const ParticleGroup& group = birth.group;
  for (GrainSeed& grain : share.seeds) grain.velocity = group.velocity;
  if (!(group.velocity_deviation > 0.0)) return;
  const int dimensions = birth.scene.domain.dimensions;
  ExactSum3 momentum;
  ExactSum mass;
  for (std::size_t i = 0; i < share.seeds.size(); ++i) {
    GrainSeed& grain = share.seeds[i];
    Vec3 deviation;
    for (int k = 0; k < dimensions; ++k)
      deviation[k] = group.velocity_deviation * random_normal(group.seed, share.numbers[i], RandomPurpose::velocity,
                                                              static_cast<std::uint64_t>(k));
    const double m = birth.scene.materials[grain.material].density * sphere_volume(grain.radius);
    grain.velocity += deviation;
    momentum.add(m * deviation);
    mass.add(m);
  }
  const double total_mass = total(world, mass);
  if (!(total_mass > 0.0)) return;
  const Vec3 total_momentum{total(world, momentum.x), total(world, momentum.y), total(world, momentum.z)};
  const Vec3 mean = total_momentum / total_mass;
  for (GrainSeed& grain : share.seeds) grain.velocity -= mean;
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

void check_listed(const Birth& birth, const ListedGrains& list, Share& share) {
  std::vector<GrainSeed>& grains = share.seeds;
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
}

/// Where the list is scattered, all ranks have rows of it; else the root has all.
Share list_grains(const Birth& birth, const ListedGrains& list, std::string& note) {
  const bool is_scattered = list.share.n_ranks > 1;
  Share share;
  if (is_scattered || birth.world.is_root()) share.seeds = list.grains;
  for (std::size_t i = 0; i < share.seeds.size(); ++i) share.numbers.push_back(birth.first_number + list.share.row(i));
  agree(birth.world, [&] { check_listed(birth, list, share); });
  if (!list.has_velocity) give_velocities(birth, share, is_scattered ? birth.world : World());
  note = fmt::format("{} grains{}", facts_of(list).n_grains,
                     list.source.empty() ? " listed in the scene" : " from " + list.source);
  return share;
}

Share clothe(const Birth& birth, BareShare bare) {
  const std::uint16_t material = material_of(birth);
  Share share;
  share.numbers = std::move(bare.numbers);
  share.seeds.reserve(bare.grains.size());
  for (const PackGrain& grain : bare.grains)
    share.seeds.push_back({grain.position, {}, birth.group.angular_velocity, grain.radius, material});
  std::vector<PackGrain>().swap(bare.grains);
  give_velocities(birth, share, birth.world);
  return share;
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
    const LatticeRows rows(container, lattice->kind, spacing, 0.5 * largest);
    std::int64_t n_sites = 0;
    rows.for_each_site({0, rows.size()}, [&](Vec3) { ++n_sites; });
    return n_sites;
  }
  const auto& fill = std::get<RandomFill>(birth.group.fill);
  const Container container(birth.scene, fill.region);
  if (fill.count) return *fill.count;
  const double rough =
      fill.solid_fraction.value_or(0.0) * volume(container.region()) / mean_sphere_volume(sampler_of(birth));
  if (rough > worth_counting) return static_cast<std::int64_t>(std::min(rough, 1e15));
  std::int64_t n_grains = 0;
  draw_radii(birth, fill, volume(container.region()), [&](double) { ++n_grains; });
  return n_grains;
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

void append(Share& all, Share part) {
  if (all.seeds.empty()) {  // the usual scene has one group, and may have millions of grains
    all = std::move(part);
    return;
  }
  all.seeds.insert(all.seeds.end(), part.seeds.begin(), part.seeds.end());
  all.numbers.insert(all.numbers.end(), part.numbers.begin(), part.numbers.end());
}

Share bear(std::vector<Birth>& births, const Share& born, int n_threads, std::vector<std::string>& notes) {
  const Birth& first = births[0];
  if (const auto* list = std::get_if<ListedGrains>(&first.group.fill))
    return list_grains(first, *list, notes.emplace_back());
  if (const auto* lattice = std::get_if<LatticeFill>(&first.group.fill))
    return clothe(first, fill_lattice(first, *lattice, born, notes.emplace_back()));
  std::vector<BareShare> parts = fill_randomly(births, born, n_threads, notes);
  Share all;
  for (std::size_t part = 0; part < births.size(); ++part) append(all, clothe(births[part], std::move(parts[part])));
  return all;
}

/// Of all ranks.
std::uint64_t number_of(const World& world, const ParticleGroup& group, const Share& newborn) {
  if (const auto* const list = std::get_if<ListedGrains>(&group.fill)) return facts_of(*list).n_grains;
  std::uint64_t n = newborn.seeds.size();
  world.sum(std::span(&n, 1));
  return n;
}

}  // namespace

DealtGrains deal_grains(const Scene& scene, int n_threads, const World& world, FillReport* report) {
  Share grains;
  std::uint64_t first_number = 0;
  for (std::size_t i = 0; i < scene.particles.size();) {
    std::vector<Birth> births = next_births(scene, i, first_number, world);
    std::vector<std::string> notes;
    Share newborn = bear(births, grains, n_threads, notes);
    first_number += number_of(world, scene.particles[i], newborn);
    append(grains, std::move(newborn));
    for (std::size_t k = 0; report && k < births.size(); ++k)
      report->text += fmt::format("{}: {}\n", births[k].key, notes[k]);
    i += births.size();
  }
  return {std::move(grains.seeds), std::move(grains.numbers)};
}

std::vector<GrainSeed> make_grains(const Scene& scene, int n_threads, FillReport* report) {
  return deal_grains(scene, n_threads, World(), report).seeds;
}

std::vector<std::int64_t> count_groups(const Scene& scene) {
  const World alone;
  std::uint64_t first_number = 0;
  std::vector<std::int64_t> n_grains;
  for (std::size_t i = 0; i < scene.particles.size(); ++i) {
    n_grains.push_back(count_group({scene, scene.particles[i], group_key(i), first_number, alone}));
    first_number += static_cast<std::uint64_t>(n_grains.back());
  }
  return n_grains;
}

std::int64_t count_grains(const Scene& scene) {
  const std::vector<std::int64_t> n_grains = count_groups(scene);
  return std::accumulate(n_grains.begin(), n_grains.end(), std::int64_t{0});
}

}  // namespace moraine
