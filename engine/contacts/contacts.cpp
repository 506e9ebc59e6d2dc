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
  LawChoice choice = law_choice(scene);
  choice.is_uniform = is_uniform;
  return choice;
}

/// What the next tile will be the first to read, and what comes in an order that no processor foresees: the records of the grains that its
/// own may touch. They come from memory while this tile is swept.
void ask_for_records(const Particles& particles, std::int32_t first, std::int32_t n) {
  constexpr std::int64_t line = 64;
  const auto bytes = static_cast<std::int64_t>(sizeof(double)) * particles.stride();
  const std::int64_t begin = bytes * std::min(first, particles.size());
  const std::int64_t end = bytes * std::min(first + n, particles.size());
  const char* const records = reinterpret_cast<const char*>(particles.records());
  for (std::int64_t at = begin; at < end; at += line) __builtin_prefetch(records + at, 1, 2);
}

/// Bonds at walls are looked at a little beyond their range, so that a break is seen.
double wall_reach(const LawChoice& choice, double range) { return has_bond(choice.cohesion) ? 1.5 * range : range; }

}  // namespace

Contacts::Contacts(const Scene& scene, const Walls& walls, const GrainKind& kind, const World& world)
    : domain_(scene.domain.box()),
      periodic_(scene.domain.periodic),
      laws_(scene),
      choice_(choose_laws(scene, kind.is_uniform && laws_.n_pair_species == 1)),  // uniform: all pairs go by row 0
      kernels_(contact_kernels(choice_)),
      motion_(motion_kernel(choice_.has_rotation, choice_.has_ledger, choice_.has_further(), choice_.is_mixed)),
      mass_unit_(choice_.is_mixed ? mass_unit_for(kind.largest_mass) : 1.0),
      pair_table_(in_units_of_mass(laws_.pairs, mass_unit_)),
      wall_table_(in_units_of_mass(laws_.walls, mass_unit_)),
      uniform_inverse_mass_(kind.inverse_mass),
      largest_radius_(kind.largest_radius),
      sizes_(kind.sizes),
      max_overlap_(scene.run.max_overlap),
      range_(laws_.attraction_range(choice_.cohesion, kind.largest_radius)),
      walls_(&walls),
      measures_walls_(walls.is_any_moving() && (scene.output.energy || !walls.servo_walls().empty())),
      image_shift_(image_shifts(domain_.size())),
      world_(world),
      wall_contacts_(walls, scene.domain, memory_of(choice_), choice_.has_further(),
                     slot_size(choice_.has_rotation, choice_.has_ledger, choice_.has_further()),
                     wall_reach(choice_, range_)) {
  needs_.memory = memory_of(choice_);
  needs_.range = range_;
  needs_.has_images = periodic_[0] || periodic_[1] || periodic_[2];
  needs_.has_species = laws_.n_pair_species > 1;
  needs_.slot_size = slot_size(choice_.has_rotation, choice_.has_ledger, choice_.has_further());
  needs_.is_mixed = choice_.is_mixed;
  needs_.species_table = laws_.pair_species.data();
  needs_.n_materials = laws_.n_materials;
  for (const Surface& surface : walls.surfaces())
    has_map_.push_back(scene.walls[static_cast<std::size_t>(surface.wall)].has_force_map);
  if (std::find(has_map_.begin(), has_map_.end(), true) == has_map_.end()) has_map_.clear();
}

void Contacts::rebuild(Particles& particles, const ListWidth& width, double time, int n_threads, const Births& births) {
  travel_.forget();
  rooms_.forget();
  if (!set_aside_) refresh(particles);  // pairs are carried over by the images in which they are now
  std::vector<std::uint8_t> is_leaving = leaving_grains(world_, subdomains_, particles);
  PairCarry pairs;
  WallCarry walls;
  if (set_aside_) {
    pairs = std::move(set_aside_->pairs);
    walls = std::move(set_aside_->walls);
    set_aside_.reset();
  } else {
    pairs = pairs_.carry(particles, is_leaving, choice_.has_ledger, n_threads);
    pairs_.forget();
    walls = wall_contacts_.carry();
  }
  take_in(particles, births, pairs, is_leaving, n_threads);
  build(particles, pairs, walls, is_leaving, width, time, n_threads);
}

/// Newborns behind the grains that are there; they remember nothing.
void Contacts::take_in(Particles& particles, const Births& births, PairCarry& pairs,
                       std::vector<std::uint8_t>& is_leaving, int n_threads) const {
  if (births.n == 0) return;
  const std::int32_t first = particles.size();
  std::vector<std::int32_t> same_place(static_cast<std::size_t>(first));
  std::iota(same_place.begin(), same_place.end(), 0);
  particles.reorder(same_place, n_threads, births.n);
  births.put(first);
  if (!pairs.begin.empty()) pairs.begin.resize(static_cast<std::size_t>(particles.size()) + 1, pairs.begin.back());
  is_leaving = leaving_grains(world_, subdomains_, particles);
}

void Contacts::set_aside() {
  set_aside_ = SetAside{{}, wall_contacts_.carry()};
  pairs_ = PairList();
  wall_contacts_.release();
  cells_ = Cells();
}

void Contacts::restore(Particles& particles, PairCarry pairs, WallCarry walls, const ListWidth& width, double time,
                       int n_threads) {
  build(particles, pairs, walls, leaving_grains(world_, subdomains_, particles), width, time, n_threads);
}

void Contacts::build(Particles& particles, PairCarry& pairs, WallCarry& walls, std::span<const std::uint8_t> is_leaving,
                     const ListWidth& width, double time, int n_threads) {
  std::array<bool, 3> wraps = periodic_;  // the directions in which this rank's grains meet their own images
  if (!world_.is_alone()) {
    n_migrated_ +=
        migrate(world_, subdomains_, is_leaving, needs_.memory.has_further(), particles, pairs, walls, n_threads);
    for (int axis = 0; axis < 3; ++axis) wraps[static_cast<std::size_t>(axis)] = subdomains_.spans(world_.rank(), axis);
  }
  // In the order of the cells of the smallest; where sizes differ widely, each class has its own cells besides, for the search.
  const double reach = width.skin + range_;  // between surfaces
  swept_ = {};
  cells_.sort(Centres::of(particles), domain_, wraps, 2.0 * sizes_.smallest_limit() + reach, n_threads);
  particles.reorder(cells_.order(), n_threads);
  SizeGrids grids;
  if (sizes_.size() > 1) grids.build(particles, sizes_, domain_, wraps, image_shift_, reach, n_threads);
  if (!world_.is_alone()) ghosts_.make(world_, subdomains_, particles, sizes_, grids, reach);
  std::vector<double> rooms;
  if (world_.is_alone())
    rooms = sizes_.size() > 1 ? rooms_.begin_at_rest(particles, width.skin, n_threads)
                              : rooms_.begin(particles, cells_, width, 2.0 * largest_radius_ + range_, n_threads);
  else
    travel_.begin(particles, where_none_meets_others(2.0 * cells_.reach()), n_threads);
  pairs_.note_times(thread_seconds_);
  thread_seconds_.clear();
  least_seconds_.clear();
  pairs_.build(particles, cells_, grids, ghosts_.copies(), image_shift_, width.skin, rooms, needs_, cells_.order(),
               pairs, n_threads);
  wall_contacts_.build(particles, pairs_, width.wall_skin, time, cells_.order(), walls, n_threads);
  skin_ = width.skin;
  age_ = used_at_rest_ = 0.0;
  measured_from_ = PairList::next_opening(0.0);
}

/// This rank's box without what is nearer than `distance` [m] to faces that others are behind.
Box Contacts::where_none_meets_others(double distance) const {
  Box box = subdomains_.box(world_.rank());
  for (int axis = 0; axis < 3; ++axis) {
    if (subdomains_.spans(world_.rank(), axis)) {
      box.low[axis] = -infinity;
      box.high[axis] = infinity;
    }
    box.low[axis] += distance;  // outer faces that are not periodic lie at infinity
    box.high[axis] -= distance;
  }
  return box;
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
  WallSums walls;
  RoomShares used;       // alone
  double seconds = 0.0;  // at work
  char padding[64];      // threads write their own cache lines
};

void Contacts::advance(Particles& particles, const Kick& kick, double dt, double travelled, int n_threads,
                       StepResult& result, double counted) {
  const int n_active = std::min(n_threads, static_cast<int>(pairs_.threads().size()));
  std::vector<ThreadStep> steps(static_cast<std::size_t>(n_active));
  if (!has_map_.empty()) triangle_forces_.assign(static_cast<std::size_t>(n_active), {});
  if (!ghosts_.are_fresh()) ghosts_.start_refresh(particles);
  // Where grains turn out to be nearer to their places than was known, bands close. What they held in the last step is swept once more: a
  // contact that has ended meanwhile must be seen to end.
  const double used = 2.0 * travelled / skin_;
  const Approach approach = {std::max(used, swept_.own), swept_.border};
  age_ += kick.drift;
  parallel(n_active, [&](int thread) {
    advance_thread(particles, kick, dt, used, approach, counted, thread, steps[static_cast<std::size_t>(thread)]);
  });
  if (std::isfinite(travelled)) swept_ = {used, 0.5 * used + ghosts_.heard().travelled / skin_};
  ghosts_.set_fresh(world_.is_alone());
  result = StepResult{};
  RoomShares used_now;
  for (const ThreadStep& step : steps) {
    result.n_touching += step.result.n_touching;
    result.has_large_overlap = result.has_large_overlap || step.result.has_large_overlap;
    result.is_any_not_finite = result.is_any_not_finite || step.result.is_any_not_finite;
    result.max_speed = std::max(result.max_speed, step.result.max_speed);
    used_now.include(step.used);
    result.outside.insert(result.outside.end(), step.result.outside.begin(), step.result.outside.end());
  }
  if (world_.is_alone()) result.used_room = used_room(particles, used_now, result.max_speed * kick.drift, n_threads);
  if (measures_walls_) {
    wall_sums_.pushes.assign(walls_->servo_walls().size(), ExactSum());
    for (const ThreadStep& step : steps) {
      wall_sums_.work.add(step.walls.work);
      for (std::size_t k = 0; k < step.walls.pushes.size(); ++k) wall_sums_.pushes[k].add(step.walls.pushes[k]);
    }
  }
  std::sort(result.outside.begin(), result.outside.end());
  // A step in which the system has taken a processor away says nothing of the share.
  constexpr double much_longer = 1.3;
  thread_seconds_.resize(steps.size(), 0.0);
  least_seconds_.resize(steps.size(), infinity);
  for (std::size_t thread = 0; thread < steps.size(); ++thread) {
    least_seconds_[thread] = std::min(least_seconds_[thread], steps[thread].seconds);
    thread_seconds_[thread] += std::min(steps[thread].seconds, much_longer * least_seconds_[thread]);
  }
}

/// The largest share of its room that a grain has used, or a bound of it. In a bed at rest no band opens for long, whatever its grains do: they are
/// looked at when they can have come so far. `measured`: by this step, if it did; `way` [m]: none has come further in it.
double Contacts::used_room(const Particles& particles, RoomShares measured, double way, int n_threads) {
  const double in_a_step = way / rooms_.least();
  double used = used_at_rest_ += in_a_step;
  if (!measures_rooms_ && used >= measured_from_) measured = rooms_.measure(particles, age_, n_threads);
  if (measures_rooms_ || used >= measured_from_) {
    used_at_rest_ = measured.at_rest;
    measured_from_ = PairList::next_opening(used_at_rest_);
    used = rooms_.used(measured, age_);
  }
  measures_rooms_ = used_at_rest_ + 2.0 * in_a_step >= measured_from_;
  return used;
}

void Contacts::advance_thread(Particles& particles, const Kick& kick, double dt, double used, const Approach& approach,
                              double counted, int thread, ThreadStep& step) {
  ThreadPairs& mine = pairs_.threads()[static_cast<std::size_t>(thread)];
  PairSweep sweep;
  sweep.records = particles.records();
  sweep.a = mine.a.data();
  sweep.b = mine.b.data();
  sweep.image = needs_.has_images ? mine.image.data() : nullptr;
  sweep.image_shift = image_shift_.data();
  sweep.species = needs_.has_species ? mine.species.data() : nullptr;
  sweep.history = mine.history.data();
  sweep.was_near = mine.was_near.data();
  sweep.marks = mine.marks.data();
  sweep.acting = mine.acting.data();
  sweep.table = &pair_table_;
  sweep.mass_unit = mass_unit_;
  sweep.inverse_mass = uniform_inverse_mass_;
  sweep.radius = largest_radius_;  // of all, where the sweep asks
  sweep.dt = dt;
  sweep.max_overlap = max_overlap_;
  sweep.rolling = choice_.rolling;
  sweep.cohesion = choice_.cohesion;
  sweep.range = range_;

  GrainSums sums;
  sums.records = particles.records();
  sums.first_grain = mine.grain_begin;
  sums.offsets = mine.offsets.data();
  sums.entries = mine.entries.data();
  sums.slots = pairs_.slots();
  sums.acting = mine.acting.data();
  sums.first_word = mine.first_word.empty() ? nullptr : mine.first_word.data();
  sums.mass_unit = mass_unit_;
  sums.inside = domain_;
  sums.kick = kick;
  sums.dissipated = choice_.has_ledger ? particles.dissipated() : nullptr;
  sums.force = particles.force();
  sums.push = push_ ? push_ : particles.gas_acceleration();
  sums.torque = particles.torque();

  StepResult& result = step.result;
  if (measures_walls_) step.walls.pushes.resize(walls_->servo_walls().size());
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
    note(kernels_.walls(
        {particles.records(), touches, &wall_table_, dt, max_overlap_, choice_.rolling, choice_.cohesion, mass_unit_},
        {0, n}));
    wall_contacts_.remember(thread, candidates);
    if (measures_walls_)
      wall_contacts_.measure(particles, thread, candidates, dt, counted, choice_.has_ledger, step.walls);
    if (!has_map_.empty())
      wall_contacts_.note_forces(particles, thread, candidates, has_map_,
                                 triangle_forces_[static_cast<std::size_t>(thread)]);
    sums.wall_grain = touches.grain;
    sums.wall_slots = touches.slots;
    sums.n_wall = n;
  };
  const auto advance_grains = [&](const std::int32_t* list, Range range) {
    if (range.empty()) return;
    const MotionResult moved = motion_(sums, list, range);
    speed_squared = std::max(speed_squared, moved.max_speed_squared);
    if (world_.is_alone() && measures_rooms_) step.used.include(rooms_.measure(particles, age_, list, range));
    result.is_any_not_finite = result.is_any_not_finite || moved.is_any_not_finite;
    if (!moved.is_any_outside) return;
    for (std::int64_t n = range.begin; n < range.end; ++n) {
      const std::int32_t i = list ? list[n] : static_cast<std::int32_t>(n);
      if (particles.is_here(i) && !domain_.contains(particles.position(i))) result.outside.push_back(i);
    }
  };

  const std::int64_t slot = needs_.slot_size * static_cast<std::int64_t>(number_size(choice_.is_mixed));  // bytes
  PairSweep kept = sweep;
  kept.takes_all = choice_.has_ledger;  // what a contact has lost at its end is zero again one step later
  const auto sweep_kept = [&](const Tile& tile, double share) {
    const std::int64_t far = PairList::far_begin(tile.kept_bands, tile.pair_end, share);
    if (far > tile.kept_begin)
      note(kernels_.pairs(kept, {tile.kept_begin, far}, pairs_.slots() + tile.kept_slot * slot));
  };
  const std::size_t n_tiles = mine.tiles.size() - (mine.has_border ? 1 : 0);
  double begin = threads::now();
  for (std::size_t t = 0; t < n_tiles; ++t) {
    const Tile& tile = mine.tiles[t];
    ask_for_records(particles, tile.grain_end + cells_.furthest_in_column(), tile.grain_end - tile.grain_begin);
    const std::int64_t far = PairList::far_begin(tile.ring_bands, tile.kept_begin, approach.own);
    for (std::int64_t k = tile.ring_begin; k < far;) {  // up to the end of the ring, then from its start
      const std::int64_t place = k & mine.ring_mask;
      const std::int64_t end = std::min(far, k + (std::int64_t{mine.ring_mask} + 1 - place));
      note(kernels_.pairs(sweep, {k, end}, pairs_.slots() + (mine.ring_slot + place) * slot));
      k = end;
    }
    sweep_kept(tile, approach.own);
    touch_walls(wall_contacts_.tile(thread, t));
    if (tile.plain_begin < 0)
      advance_grains(nullptr, {tile.grain_begin, tile.grain_end});
    else
      advance_grains(mine.plain.data(), {tile.plain_begin, tile.plain_end});
  }
  step.seconds = threads::now() - begin;
  // Border pairs need the ghosts, deferred grains the slots of all threads. The first thread speaks for the rank.
  if (thread == 0 && !ghosts_.are_fresh()) finish_refresh(particles);
  if (mine.has_border) {
    barrier();
    sweep_kept(mine.tiles.back(), std::max(approach.border, 0.5 * used + ghosts_.heard().travelled / skin_));
  }
  barrier();
  begin = threads::now();
  touch_walls(wall_contacts_.deferred(thread));
  sums.acting = nullptr;  // they sum all
  advance_grains(mine.deferred.data(), {0, static_cast<std::int64_t>(mine.deferred.size())});
  step.seconds += threads::now() - begin;
  result.max_speed = std::sqrt(speed_squared);
}

Contacts::Velocities Contacts::velocities_now(Particles& particles, const Kick& half_kick, double dt, int n_threads) {
  const auto copy_of = [](const auto* values, std::size_t n) {
    return std::vector<std::remove_cvref_t<decltype(*values)>>(values, values ? values + n : values);
  };
  const auto n = static_cast<std::size_t>(particles.size());
  const std::vector<double> records = copy_of(particles.records(), n * static_cast<std::size_t>(particles.stride()));
  const std::vector<double> dissipated = copy_of(particles.dissipated(), 4 * n);
  const std::vector<double> force = copy_of(particles.force(), 3 * n), torque = copy_of(particles.torque(), 3 * n);
  std::vector<std::vector<std::byte>> histories;
  std::vector<std::vector<std::uint16_t>> were_near;
  for (const ThreadPairs& t : pairs_.threads()) {
    histories.push_back(copy_of(t.history.data(), t.history.size()));
    were_near.push_back(copy_of(t.was_near.data(), t.was_near.size()));
  }
  const auto walls = wall_contacts_.save();
  const WallSums wall_sums = wall_sums_;

  const bool were_fresh = ghosts_.are_fresh();
  StepResult ignored;
  advance(particles, half_kick, dt, std::numeric_limits<double>::infinity(), n_threads, ignored, 0.0);
  Velocities now;
  for (std::int32_t i = 0; i < particles.size(); ++i) {
    now.linear.push_back(particles.velocity(i));
    if (choice_.has_rotation) now.angular.push_back(particles.angular_velocity(i));
  }

  const auto put_back = [](const auto& values, auto* to) { std::copy(values.begin(), values.end(), to); };
  put_back(records, particles.records());
  if (particles.dissipated()) put_back(dissipated, particles.dissipated());
  if (particles.force()) put_back(force, particles.force());
  if (particles.torque()) put_back(torque, particles.torque());
  for (std::size_t t = 0; t < histories.size(); ++t) {
    put_back(histories[t], pairs_.threads()[t].history.data());
    put_back(were_near[t], pairs_.threads()[t].was_near.data());
  }
  wall_contacts_.put_back(walls);
  wall_sums_ = wall_sums;
  ghosts_.set_fresh(were_fresh);
  return now;
}

ReferenceContact Contacts::pair_contact(const Particles& particles, std::int32_t a, std::int32_t b, std::uint8_t image,
                                        const PairMemory* memory) const {
  ReferenceContact contact;
  const Vec3 separation = particles.position(a) - particles.position(b) + image_shift_[image];
  const double distance = length(separation);
  contact.overlap = particles.radius(a) + particles.radius(b) - distance;
  if (!(contact.overlap > -range_)) return contact;
  contact.normal = separation / distance;
  const auto body = [&](std::int32_t i) {
    return ContactBody{particles.velocity(i),
                       particles.angular_velocity(i),
                       particles.inverse_mass(i),
                       1.0 / particles.radius(i),
                       particles.radius(i) - 0.5 * contact.overlap,
                       choice_.has_rotation ? particles.inverse_inertia(i) : 0.0};
  };
  contact.a = body(a);
  contact.b = body(b);
  if (memory) {
    contact.displacement = {memory->displacement[0], memory->displacement[1], memory->displacement[2]};
    contact.stored = memory->energy;
    contact.angle = {memory->further.angle[0], memory->further.angle[1], memory->further.angle[2]};
    contact.is_bound = memory->further.bond != 0.0;
  }
  return contact;
}

ReferenceContact Contacts::wall_contact(const Particles& particles, const WallContact& touch, double mirror) const {
  ReferenceContact contact;
  contact.overlap = mirror * (particles.radius(touch.grain) - touch.touch.distance);
  contact.normal = touch.touch.normal;
  contact.a = {particles.velocity(touch.grain),
               particles.angular_velocity(touch.grain),
               particles.inverse_mass(touch.grain),
               1.0 / particles.radius(touch.grain),
               touch.touch.distance,
               choice_.has_rotation ? particles.inverse_inertia(touch.grain) : 0.0};
  contact.b.velocity = touch.wall_velocity;
  contact.displacement = {touch.memory.displacement[0], touch.memory.displacement[1], touch.memory.displacement[2]};
  contact.stored = touch.memory.energy;
  const FurtherMemory& further = touch.memory.further;
  contact.angle = {further.angle[0], further.angle[1], further.angle[2]};
  contact.is_bound = further.bond != 0.0;
  return contact;
}

}  // namespace moraine
