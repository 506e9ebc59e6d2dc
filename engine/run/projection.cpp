#include "engine/run/projection.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <numeric>

#include "engine/contacts/ghost_rule.hpp"
#include "engine/contacts/law_table.hpp"
#include "engine/contacts/size_grids.hpp"
#include "engine/particles/fields.hpp"
#include "engine/particles/particles.hpp"
#include "engine/run/decomposition.hpp"
#include "engine/run/plan.hpp"
#include "engine/run/simulation.hpp"
#include "engine/threads.hpp"

namespace moraine {

namespace {

std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

Scene without_lists(const Scene& scene) {
  Scene copy = scene;
  for (ParticleGroup& group : copy.particles)
    if (auto* listed = std::get_if<ListedGrains>(&group.fill)) std::vector<GrainSeed>().swap(listed->grains);
  return copy;
}

/// Numbers of the grains of each part: those of part p are grains[begin[p]] to grains[begin[p + 1] - 1], ascending.
struct ByPart {
  std::vector<std::int64_t> begin;
  std::vector<std::int32_t> grains;
  std::span<const std::int32_t> of(std::int64_t part) const {
    return std::span(grains).subspan(at(begin[at(part)]), at(begin[at(part) + 1] - begin[at(part)]));
  }
};

ByPart by_part(std::span<const std::int32_t> owners, std::int64_t n_parts) {
  ByPart sorted;
  sorted.begin.assign(at(n_parts) + 1, 0);
  for (const std::int32_t owner : owners) ++sorted.begin[at(owner) + 1];
  std::partial_sum(sorted.begin.begin(), sorted.begin.end(), sorted.begin.begin());
  sorted.grains.resize(owners.size());
  std::vector<std::int64_t> next = sorted.begin;
  for (std::size_t i = 0; i < owners.size(); ++i)
    sorted.grains[at(next[at(owners[i])]++)] = static_cast<std::int32_t>(i);
  return sorted;
}

}  // namespace

Projection::Projection(const Scene& scene, std::span<const GrainSeed> grains, int n_threads)
    : scene_(without_lists(scene)), n_threads_(n_threads) {
  const Plan plan = make_plan(scene, n_threads);
  widest_skin_ = widest_skin(scene, plan);
  skin_ = plan.skin;
  SizeClasses::Census census;
  for (const GrainSeed& grain : grains) {
    positions_.push_back(grain.position);
    radii_.push_back(grain.radius);
    census.add(grain.radius);
    largest_radius_ = std::max(largest_radius_, grain.radius);
  }
  // Pairs, ghosts and cuts reach as far as the skin and what attracts beyond contact.
  const CohesionLaw cohesion = scene.contact.cohesion;
  const double range =
      cohesion == CohesionLaw::none ? 0.0 : SceneLaws(scene).attraction_range(cohesion, largest_radius_);
  widest_skin_ += range;
  skin_ += range;
  sizes_ = SizeClasses(census);
  for (int axis = 0; axis < 3; ++axis)  // a grain is kept apart from its own image
    if (scene.domain.periodic[at(axis)])
      skin_ = std::min(skin_, scene.domain.box().size()[axis] - 2.0 * largest_radius_);
  find_pairs(grains);
}

void Projection::find_pairs(std::span<const GrainSeed> grains) {
  FieldNeeds needs;
  needs.rotation = false;
  Particles particles(needs);
  put_grains(scene_, {grains.begin(), grains.end()}, particles);
  std::vector<Vec3> shifts(image::n_codes);
  const Vec3 period = scene_.domain.box().size();
  for (std::uint8_t code = 0; code < image::n_codes; ++code) {
    const auto steps = image::steps(code);
    shifts[code] = {steps[0] * period.x, steps[1] * period.y, steps[2] * period.z};
  }
  SizeGrids grids;
  grids.build(particles, sizes_, scene_.domain.box(), scene_.domain.periodic, shifts, skin_, n_threads_);
  std::vector<std::vector<Pair>> found(at(n_threads_));
  parallel(n_threads_, [&](int thread) {
    SizeGrids::Scratch scratch;
    grids.for_each_pair(particles, thread, n_threads_, scratch, [&](std::int32_t i, std::int32_t j, std::uint8_t code) {
      const double radii = particles.radius(i) + particles.radius(j);
      const double squared = squared_length(particles.position(i) + shifts[code] - particles.position(j));
      found[at(thread)].push_back({static_cast<std::int32_t>(particles.gid(i)),
                                   static_cast<std::int32_t>(particles.gid(j)), squared < radii * radii});
    });
  });
  for (std::vector<Pair>& share : found) {
    pairs_.insert(pairs_.end(), share.begin(), share.end());
    std::vector<Pair>().swap(share);
  }
}

std::int64_t Projection::bytes_per_ghost() const {
  std::int64_t n_doubles = 0;  // whatever the table says travels in every step
  for (const FieldInfo& row : field_table)
    if (row.travel == Travel::every_step && (scene_.contact.rotation || row.need != Need::rotation))
      n_doubles += row.components;
  return n_doubles * static_cast<std::int64_t>(sizeof(double));
}

Projection::Division Projection::divide(int n_parts) const {
  Division division{decompose(World(), n_parts, positions_, {}, scene_, largest_radius_, widest_skin_), {}};
  for (const Vec3& position : positions_) division.owners.push_back(division.parts.owner(position));
  return division;
}

std::vector<RankCounts> Projection::count(const Division& division) const {
  std::vector<RankCounts> ranks(at(division.parts.size()));
  count_pairs(division.owners, ranks);
  count_ghosts(division.parts, division.owners, ranks);
  return ranks;
}

void Projection::count_pairs(std::span<const std::int32_t> owners, std::vector<RankCounts>& ranks) const {
  std::vector<bool> is_border(owners.size(), false);
  for (const Pair& pair : pairs_) {
    const std::int32_t a = owners[at(pair.a)], b = owners[at(pair.b)];
    const std::int64_t touches = pair.touches ? 1 : 0, crosses = a != b ? 1 : 0;
    for (const std::int32_t owner : {a, b}) {
      RankCounts& rank = ranks[at(owner)];
      ++rank.n_pairs;
      rank.n_border_pairs += crosses;
      rank.n_contacts += touches;
      if (!crosses) break;
    }
    if (crosses) is_border[at(pair.a)] = is_border[at(pair.b)] = true;
  }
  for (std::size_t i = 0; i < owners.size(); ++i) {
    ++ranks[at(owners[i])].n_grains;
    ranks[at(owners[i])].n_border_grains += is_border[i] ? 1 : 0;
  }
}

/// What owners of larger grains need of others besides (ghost_rule.hpp), in order of grain.
std::vector<Projection::Smaller> Projection::smaller_ones(std::span<const std::int32_t> owners) const {
  std::vector<Smaller> smaller;
  for (const Pair& pair : pairs_) {
    if (sizes_.size() == 1 || owners[at(pair.a)] == owners[at(pair.b)]) continue;
    const int class_a = sizes_.of(radii_[at(pair.a)]), class_b = sizes_.of(radii_[at(pair.b)]);
    if (class_a < class_b) smaller.push_back({pair.a, owners[at(pair.b)]});
    if (class_b < class_a) smaller.push_back({pair.b, owners[at(pair.a)]});
  }
  std::sort(smaller.begin(), smaller.end());
  smaller.erase(std::unique(smaller.begin(), smaller.end()), smaller.end());
  return smaller;
}

std::vector<Projection::Sent> Projection::sent_from(const Subdomains& parts, int part,
                                                    std::span<const std::int32_t> own,
                                                    std::span<const Smaller> smaller) const {
  const auto near = parts.near(part, ghost_reach(largest_radius_, largest_radius_, skin_));
  std::vector<Sent> sent;
  for (const Subdomains::Near& other : near)
    if (sent.empty() || sent.back().to != other.part) sent.push_back({other.part, 0});
  const auto count = [&](int to) {
    ++std::lower_bound(sent.begin(), sent.end(), to, [](const Sent& s, int t) { return s.to < t; })->n;
  };
  auto next = smaller.begin();
  std::vector<int> named;
  for (const std::int32_t i : own) {
    named.clear();
    const double reach = ghost_reach(radii_[at(i)], sizes_.limit(sizes_.of(radii_[at(i)])), skin_);
    for_each_needing(parts, part, near, positions_[at(i)], reach, [&](int to) { named.push_back(to); });
    while (next != smaller.end() && next->grain < i) ++next;
    for (; next != smaller.end() && next->grain == i; ++next)
      if (std::find(named.begin(), named.end(), next->to) == named.end()) named.push_back(next->to);
    for (const int to : named) count(to);
  }
  std::erase_if(sent, [](const Sent& s) { return s.n == 0; });
  return sent;
}

void Projection::count_ghosts(const Subdomains& parts, std::span<const std::int32_t> owners,
                              std::vector<RankCounts>& ranks) const {
  const ByPart sorted = by_part(owners, parts.size());
  const std::vector<Smaller> smaller = smaller_ones(owners);
  std::vector<std::vector<Sent>> sent(ranks.size());
  parallel(n_threads_, [&](int thread) {
    const Range share = share_of(parts.size(), thread, n_threads_);
    for (std::int64_t part = share.begin; part < share.end; ++part)
      sent[at(part)] = sent_from(parts, static_cast<int>(part), sorted.of(part), smaller);
  });
  std::vector<std::vector<int>> neighbours(ranks.size());
  for (std::size_t part = 0; part < ranks.size(); ++part)
    for (const Sent& to : sent[part]) {
      ranks[part].n_sent += to.n;
      ranks[part].bytes += to.n * bytes_per_ghost();
      ++ranks[part].n_messages;
      ranks[at(to.to)].n_ghosts += to.n;
      neighbours[part].push_back(to.to);
      neighbours[at(to.to)].push_back(static_cast<int>(part));
    }
  for (std::size_t part = 0; part < ranks.size(); ++part) {
    std::vector<int>& all = neighbours[part];
    std::sort(all.begin(), all.end());
    ranks[part].n_neighbours = static_cast<int>(std::unique(all.begin(), all.end()) - all.begin());
  }
}

std::vector<RankCounts> count_ranks(const Scene& scene, std::span<const GrainSeed> grains, int n_parts) {
  return Projection(scene, grains, 1).count(n_parts);
}

namespace {

double largest_radius_of(std::span<const GrainSeed> grains) {
  double largest = 0.0;
  for (const GrainSeed& grain : grains) largest = std::max(largest, grain.radius);
  return largest;
}

/// The grains of the fullest part of a cut into parts of about so many.
std::vector<GrainSeed> block_of(const Scene& scene, std::span<const GrainSeed> grains, std::int64_t most) {
  const auto n = static_cast<std::int64_t>(grains.size());
  if (n <= most) return {grains.begin(), grains.end()};
  std::vector<Vec3> positions;
  for (const GrainSeed& grain : grains) positions.push_back(grain.position);
  const Subdomains parts = decompose(World(), static_cast<int>((n + most - 1) / most), positions, {}, scene,
                                     largest_radius_of(grains), widest_skin(scene, make_plan(scene, 1)));
  std::vector<std::int64_t> counts(at(parts.size()));
  for (const Vec3& position : positions) ++counts[at(parts.owner(position))];
  const auto fullest = static_cast<int>(std::max_element(counts.begin(), counts.end()) - counts.begin());
  std::vector<GrainSeed> block;
  for (const GrainSeed& grain : grains)
    if (parts.owner(grain.position) == fullest) block.push_back(grain);
  return block;
}

/// The scene with these grains instead of its own, and with the same time step; without its gas, whose cells do not grow with the grains
/// (gas_projection.hpp has them), and without what looks at it.
Scene scene_with(const Scene& scene, const std::vector<GrainSeed>& grains) {
  Scene block = without_lists(scene);
  block.gas.reset();
  block.output.probes.clear();
  block.time.step = choose_time_step(scene).step;
  ParticleGroup group;
  group.fill = ListedGrains{"", grains, true, true, true};
  block.particles = {group};
  return block;
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

struct Sample {
  double step = 0.0;  // [s]
  std::int64_t n_steps = 0;
  double memory = 0.0;  // [bytes]
};

Sample run_for(const Scene& scene, int n_threads, double seconds) {
  Simulation simulation(scene, n_threads);
  for (int warm = 0; warm < 3; ++warm) simulation.step();
  Sample sample;
  const auto start = std::chrono::steady_clock::now();
  const std::clock_t start_of_work = std::clock();
  do {
    simulation.step();
    ++sample.n_steps;
  } while (sample.n_steps < 5 || seconds_since(start) < seconds);
  // A thread alone waits for nothing but other programs, which are none of the scene's cost: the processor's time says what it took.
  const double worked = static_cast<double>(std::clock() - start_of_work) / CLOCKS_PER_SEC;
  sample.step = (n_threads == 1 ? worked : seconds_since(start)) / static_cast<double>(sample.n_steps);
  sample.memory = simulation.memory();
  return sample;
}

/// Time of a byte of records that are gathered into a message.
double measure_copy(double seconds) {
  constexpr std::size_t n = 100000, stride = 12, width = 9;  // doubles: more than second-level caches hold
  constexpr std::size_t apart = 5;  // grains of a border, in order of memory, are some records apart
  const std::vector<double> records(n * stride, 1.0);
  std::vector<double> message(1000 * width);
  const auto start = std::chrono::steady_clock::now();
  std::size_t n_copied = 0, from = 0;
  do {
    for (std::size_t k = 0; k < 1000; ++k, ++n_copied) {
      from = from + apart < n ? from + apart : 0;
      std::copy_n(records.data() + from * stride, width, message.data() + k * width);
    }
  } while (seconds_since(start) < seconds || message.back() != 1.0);
  return seconds_since(start) / static_cast<double>(n_copied * width * sizeof(double));
}

}  // namespace

Rates measure_rates(const Scene& scene, std::span<const GrainSeed> grains, int n_threads, std::int64_t most_grains,
                    double seconds) {
  Rates rates;
  rates.copy = measure_copy(0.02 * seconds);
  if (grains.empty()) return rates;
  const auto work = [](const Scene& block, const std::vector<GrainSeed>& seeds) {
    return work_of(count_ranks(block, seeds, 1)[0]);
  };
  const std::vector<GrainSeed> large = block_of(scene, grains, most_grains);
  const Scene large_scene = scene_with(scene, large);
  const Sample long_run = run_for(large_scene, n_threads, 0.75 * seconds);
  const std::vector<GrainSeed> small = block_of(large_scene, large, 100);
  const Scene small_scene = scene_with(scene, small);
  const Sample short_run = run_for(small_scene, n_threads, 0.1 * seconds);
  // Two runs, two unknowns; where the small block gains more from the caches than a step costs by itself, that is nothing, and where it took
  // longer than the large one, something else had the machine meanwhile.
  const double large_work = work(large_scene, large), small_work = work(small_scene, small);
  const double slope = (long_run.step - short_run.step) / std::max(1.0, large_work - small_work);
  rates.fixed = large.size() > small.size() && slope > 0.0 ? std::max(0.0, short_run.step - slope * small_work) : 0.0;
  rates.unit = (long_run.step - rates.fixed) / large_work;
  rates.n_grains = static_cast<std::int64_t>(large.size());
  rates.n_steps = long_run.n_steps;
  rates.bytes_per_grain = long_run.memory / static_cast<double>(large.size());
  rates.per_grain = long_run.step / static_cast<double>(large.size());
  return rates;
}

namespace {

struct RankTime {
  double work = 0.0, messages = 0.0;  // [s]
};

RankTime time_of(const RankCounts& rank, std::int64_t bytes_per_ghost, const Rates& rates, const Network& network) {
  const auto real = [](std::int64_t n) { return static_cast<double>(n); };
  const double border = rates.unit * (real(rank.n_border_pairs) + 4.0 * real(rank.n_border_grains));
  const double interior = rates.unit * work_of(rank) - border;
  const double sent = real(rank.n_sent * bytes_per_ghost), received = real(rank.n_ghosts * bytes_per_ghost);
  const double under_way = rank.n_neighbours * network.latency + std::max(sent, received) / network.bandwidth;
  RankTime time;
  time.work = interior + border;
  time.messages = rates.copy * (sent + received) + std::max(0.0, under_way - interior);
  return time;
}

}  // namespace

Prediction predict(std::span<const RankCounts> ranks, double one_rank_work, std::int64_t bytes_per_ghost,
                   const Rates& rates, const Network& network) {
  Prediction result;
  double work = 0.0, messages = 0.0, most_work = 0.0;
  for (const RankCounts& rank : ranks) {
    const RankTime time = time_of(rank, bytes_per_ghost, rates, network);
    work += time.work;
    messages += time.messages;
    most_work = std::max(most_work, time.work);
    result.step = std::max(result.step, rates.fixed + time.work + time.messages);
  }
  const auto n_counted = static_cast<double>(ranks.size());
  result.one_rank = rates.fixed + rates.unit * one_rank_work;
  if (!(result.step > 0.0)) return result;
  result.efficiency = result.one_rank / (n_counted * result.step);
  result.imbalance = work > 0.0 ? most_work * n_counted / work : 1.0;
  result.work = work / (n_counted * result.step);
  result.messages = messages / (n_counted * result.step);
  result.waiting = 1.0 - result.work - result.messages - rates.fixed / result.step;
  return result;
}

}  // namespace moraine
