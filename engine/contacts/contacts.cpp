#include "engine/contacts/contacts.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "engine/contacts/migration.hpp"
#include "engine/threads.hpp"

namespace moraine {

namespace {

std::vector<Vec3> image_shifts(Vec3 period) {
  std::vector<Vec3> shifts(image::n_codes);
  for (std::uint8_t code = 0; code < image::n_codes; ++code) {
    const auto steps = image::steps(code);
    shifts[code] = {steps[0] * period.x, steps[1] * period.y, steps[2] * period.z};
  }
  return shifts;
}

LawChoice choose_laws(const Scene& scene, bool is_uniform) {
  return {scene.contact.normal, scene.contact.tangential, scene.contact.rotation, is_uniform, scene.output.energy};
}

}  // namespace

Contacts::Contacts(const Scene& scene, const Walls& walls, const GrainKind& kind, const World& world)
    : domain_(scene.domain.box()),
      periodic_(scene.domain.periodic),
      laws_(scene),
      choice_(choose_laws(scene, kind.is_uniform && laws_.n_pair_species == 1)),  // uniform: all pairs go by row 0
      kernels_(contact_kernels(choice_)),
      motion_(motion_kernel(choice_.has_rotation, choice_.has_ledger)),
      uniform_inverse_mass_(kind.inverse_mass),
      largest_radius_(kind.largest_radius),
      sizes_(kind.sizes),
      max_overlap_(scene.run.max_overlap),
      walls_(&walls),
      image_shift_(image_shifts(domain_.size())),
      world_(world),
      wall_contacts_(walls, scene.domain, moraine::has_history(scene.contact.tangential),
                     slot_size(choice_.has_rotation, choice_.has_ledger)) {
  needs_.memory_columns = moraine::has_history(choice_.tangential) ? memory_columns(choice_.has_ledger) : 0;
  needs_.has_images = periodic_[0] || periodic_[1] || periodic_[2];
  needs_.has_species = laws_.n_pair_species > 1;
  needs_.slot_size = slot_size(choice_.has_rotation, choice_.has_ledger);
  needs_.species_table = laws_.pair_species.data();
  needs_.n_materials = laws_.n_materials;
}

void Contacts::rebuild(Particles& particles, double skin, double time, int n_threads) {
  if (set_aside_) {
    SetAside memory = std::move(*set_aside_);
    set_aside_.reset();
    build(particles, memory.pairs, memory.walls, leaving_grains(world_, subdomains_, particles), skin, time, n_threads);
    return;
  }
  refresh(particles);  // pairs are carried over by the images in which they are now
  const std::vector<std::uint8_t> is_leaving = leaving_grains(world_, subdomains_, particles);
  PairCarry pairs = pairs_.carry(particles, is_leaving, choice_.has_ledger, n_threads);
  pairs_.forget();
  WallCarry walls = wall_contacts_.carry();
  build(particles, pairs, walls, is_leaving, skin, time, n_threads);
}

void Contacts::set_aside() {
  set_aside_ = SetAside{{}, wall_contacts_.carry()};
  pairs_ = PairList();
  wall_contacts_.release();
  cells_ = Cells();
}

void Contacts::restore(Particles& particles, PairCarry pairs, WallCarry walls, double skin, double time,
                       int n_threads) {
  build(particles, pairs, walls, leaving_grains(world_, subdomains_, particles), skin, time, n_threads);
}

void Contacts::build(Particles& particles, PairCarry& pairs, WallCarry& walls, std::span<const std::uint8_t> is_leaving,
                     double skin, double time, int n_threads) {
  std::array<bool, 3> wraps = periodic_;  // the directions in which this rank's grains meet their own images
  if (!world_.is_alone()) {
    n_migrated_ += migrate(world_, subdomains_, is_leaving, particles, pairs, walls, n_threads);
    for (int axis = 0; axis < 3; ++axis) wraps[static_cast<std::size_t>(axis)] = subdomains_.spans(world_.rank(), axis);
  }
  // In the order of the cells of the smallest; where sizes differ widely, each class has its own cells besides, for the search.
  cells_.sort(Centres::of(particles), domain_, wraps, 2.0 * sizes_.smallest_limit() + skin, n_threads);
  particles.reorder(cells_.order(), n_threads);
  SizeGrids grids;
  if (sizes_.size() > 1) grids.build(particles, sizes_, domain_, wraps, image_shift_, skin, n_threads);
  if (!world_.is_alone()) ghosts_.make(world_, subdomains_, particles, sizes_, grids, skin);
  pairs_.build(particles, cells_, grids, ghosts_.copies(), image_shift_, skin, needs_, cells_.order(), pairs,
               n_threads);
  wall_contacts_.build(particles, pairs_, skin, time, cells_.order(), walls, n_threads);
}

void Contacts::refresh(Particles& particles) {
  if (ghosts_.are_fresh()) return;
  ghosts_.start_refresh(particles);
  finish_refresh(particles);
}

void Contacts::finish_refresh(Particles& particles) {
  pairs_.follow_ghosts(particles, ghosts_.finish_refresh(particles), energy_left_);
}

struct Contacts::ThreadStep {
  StepResult result;
  char padding[64];  // threads write their own cache lines
};

void Contacts::advance(Particles& particles, const Kick& kick, double dt, double travelled, int n_threads,
                       StepResult& result) {
  const int n_active = std::min(n_threads, static_cast<int>(pairs_.threads().size()));
  std::vector<ThreadStep> steps(static_cast<std::size_t>(n_active));
  if (!ghosts_.are_fresh()) ghosts_.start_refresh(particles);
  parallel(n_active, [&](int thread) {
    advance_thread(particles, kick, dt, travelled, thread, steps[static_cast<std::size_t>(thread)]);
  });
  ghosts_.set_fresh(world_.is_alone());
  result = StepResult{};
  for (const ThreadStep& step : steps) {
    result.n_touching += step.result.n_touching;
    result.has_large_overlap = result.has_large_overlap || step.result.has_large_overlap;
    result.is_any_not_finite = result.is_any_not_finite || step.result.is_any_not_finite;
    result.max_speed = std::max(result.max_speed, step.result.max_speed);
    result.outside.insert(result.outside.end(), step.result.outside.begin(), step.result.outside.end());
  }
  std::sort(result.outside.begin(), result.outside.end());
}

void Contacts::advance_thread(Particles& particles, const Kick& kick, double dt, double travelled, int thread,
                              ThreadStep& step) {
  ThreadPairs& mine = pairs_.threads()[static_cast<std::size_t>(thread)];
  PairSweep sweep;
  sweep.records = particles.records();
  sweep.a = mine.a.data();
  sweep.b = mine.b.data();
  sweep.image = needs_.has_images ? mine.image.data() : nullptr;
  sweep.image_shift = image_shift_.data();
  sweep.species = needs_.has_species ? mine.species.data() : nullptr;
  sweep.history = mine.history.data();
  sweep.table = &laws_.pairs;
  sweep.inverse_mass = uniform_inverse_mass_;
  sweep.radius = largest_radius_;  // of all, where the sweep asks
  sweep.dt = dt;
  sweep.max_overlap = max_overlap_;

  GrainSums sums;
  sums.records = particles.records();
  sums.first_grain = mine.grain_begin;
  sums.offsets = mine.offsets.data();
  sums.entries = mine.entries.data();
  sums.ring = mine.ring.data();
  sums.ring_mask = mine.ring_mask;
  sums.kept = pairs_.kept_slots();
  sums.inside = domain_;
  sums.kick = kick;
  sums.dissipated = choice_.has_ledger ? particles.dissipated() : nullptr;
  sums.force = particles.force();
  sums.push = particles.gas_acceleration();
  sums.torque = particles.torque();

  StepResult& result = step.result;
  double speed_squared = 0.0;
  const auto note = [&](const SweepResult& swept) {
    result.n_touching += swept.n_touching;
    result.has_large_overlap = result.has_large_overlap || swept.has_large_overlap;
  };
  const auto touch_walls = [&](Range candidates) {
    sums.n_wall = 0;
    if (candidates.empty()) return;
    const std::int64_t n =
        wall_contacts_.touch(particles, thread, candidates, laws_.wall_species.data(), laws_.n_walls, sums.dissipated);
    const WallTouches& touches = wall_contacts_.touches(thread);
    note(kernels_.walls({particles.records(), touches, &laws_.walls, dt, max_overlap_}, {0, n}));
    wall_contacts_.remember(thread, candidates);
    sums.wall_grain = touches.grain;
    sums.wall_slots = touches.slots;
    sums.n_wall = n;
  };
  const auto advance_grains = [&](const std::int32_t* list, Range range) {
    if (range.empty()) return;
    const MotionResult moved = motion_(sums, list, range);
    speed_squared = std::max(speed_squared, moved.max_speed_squared);
    result.is_any_not_finite = result.is_any_not_finite || moved.is_any_not_finite;
    if (!moved.is_any_outside) return;
    for (std::int64_t n = range.begin; n < range.end; ++n) {
      const std::int32_t i = list ? list[n] : static_cast<std::int32_t>(n);
      if (particles.is_here(i) && !domain_.contains(particles.position(i))) result.outside.push_back(i);
    }
  };

  const int slot = needs_.slot_size;
  const auto sweep_kept = [&](const Tile& tile) {
    if (tile.pair_end > tile.kept_begin)
      note(kernels_.pairs(sweep, {tile.kept_begin, tile.pair_end},
                          pairs_.kept_slots() + std::int64_t{tile.kept_slot} * slot));
  };
  const std::size_t n_tiles = mine.tiles.size() - (mine.has_border ? 1 : 0);
  for (std::size_t t = 0; t < n_tiles; ++t) {
    const Tile& tile = mine.tiles[t];
    const std::int64_t far = pairs_.far_begin(tile, travelled);
    for (std::int64_t k = tile.ring_begin; k < tile.kept_begin;) {  // up to the end of the ring, then from its start
      const std::int64_t place = k & mine.ring_mask;
      const std::int64_t end =
          std::min(k < far ? far : tile.kept_begin, k + (std::int64_t{mine.ring_mask} + 1 - place));
      double* const slots = mine.ring.data() + place * slot;
      if (k < far)
        note(kernels_.pairs(sweep, {k, end}, slots));
      else  // what cannot touch gives nothing
        std::fill_n(slots, (end - k) * slot, 0.0);
      k = end;
    }
    sweep_kept(tile);
    touch_walls(wall_contacts_.tile(thread, t));
    if (tile.plain_begin < 0)
      advance_grains(nullptr, {tile.grain_begin, tile.grain_end});
    else
      advance_grains(mine.plain.data(), {tile.plain_begin, tile.plain_end});
  }
  // Border pairs need the ghosts, deferred grains the slots of all threads. The first thread speaks for the rank.
  if (thread == 0 && !ghosts_.are_fresh()) finish_refresh(particles);
  if (mine.has_border) {
    barrier();
    sweep_kept(mine.tiles.back());
  }
  barrier();
  touch_walls(wall_contacts_.deferred(thread));
  advance_grains(mine.deferred.data(), {0, static_cast<std::int64_t>(mine.deferred.size())});
  result.max_speed = std::sqrt(speed_squared);
}

Contacts::Velocities Contacts::velocities_now(Particles& particles, const Kick& half_kick, double dt, int n_threads) {
  const auto copy_of = [](const double* values, std::size_t n) {
    return std::vector<double>(values, values ? values + n : values);
  };
  const auto n = static_cast<std::size_t>(particles.size());
  const std::vector<double> records = copy_of(particles.records(), n * static_cast<std::size_t>(particles.stride()));
  const std::vector<double> dissipated = copy_of(particles.dissipated(), 4 * n);
  const std::vector<double> force = copy_of(particles.force(), 3 * n), torque = copy_of(particles.torque(), 3 * n);
  std::vector<std::vector<double>> histories;
  for (const ThreadPairs& t : pairs_.threads()) histories.push_back(copy_of(t.history.data(), t.history.size()));
  const auto walls = wall_contacts_.save();

  const bool were_fresh = ghosts_.are_fresh();
  StepResult ignored;
  advance(particles, half_kick, dt, std::numeric_limits<double>::infinity(), n_threads, ignored);
  Velocities now;
  for (std::int32_t i = 0; i < particles.size(); ++i) {
    now.linear.push_back(particles.velocity(i));
    if (choice_.has_rotation) now.angular.push_back(particles.angular_velocity(i));
  }

  const auto put_back = [](const std::vector<double>& values, double* to) {
    std::copy(values.begin(), values.end(), to);
  };
  put_back(records, particles.records());
  if (particles.dissipated()) put_back(dissipated, particles.dissipated());
  if (particles.force()) put_back(force, particles.force());
  if (particles.torque()) put_back(torque, particles.torque());
  for (std::size_t t = 0; t < histories.size(); ++t) put_back(histories[t], pairs_.threads()[t].history.data());
  wall_contacts_.put_back(walls);
  ghosts_.set_fresh(were_fresh);
  return now;
}

ReferenceContact Contacts::pair_contact(const Particles& particles, std::int32_t a, std::int32_t b, std::uint8_t image,
                                        const PairMemory* memory) const {
  ReferenceContact contact;
  const Vec3 separation = particles.position(a) - particles.position(b) + image_shift_[image];
  const double distance = length(separation);
  contact.overlap = particles.radius(a) + particles.radius(b) - distance;
  if (!(contact.overlap > 0.0)) return contact;
  contact.normal = separation / distance;
  const auto body = [&](std::int32_t i) {
    return ContactBody{particles.velocity(i), particles.angular_velocity(i), particles.inverse_mass(i),
                       1.0 / particles.radius(i), particles.radius(i) - 0.5 * contact.overlap};
  };
  contact.a = body(a);
  contact.b = body(b);
  if (memory) {
    contact.displacement = {memory->displacement[0], memory->displacement[1], memory->displacement[2]};
    contact.stored = memory->energy;
  }
  return contact;
}

ReferenceContact Contacts::wall_contact(const Particles& particles, const WallContact& touch, double mirror) const {
  ReferenceContact contact;
  contact.overlap = mirror * (particles.radius(touch.grain) - touch.touch.distance);
  contact.normal = touch.touch.normal;
  contact.a = {particles.velocity(touch.grain), particles.angular_velocity(touch.grain),
               particles.inverse_mass(touch.grain), 1.0 / particles.radius(touch.grain), touch.touch.distance};
  contact.b.velocity = touch.wall_velocity;
  contact.displacement = {touch.memory.displacement[0], touch.memory.displacement[1], touch.memory.displacement[2]};
  contact.stored = touch.memory.energy;
  return contact;
}

}  // namespace moraine
