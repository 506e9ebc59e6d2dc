#include "engine/run/simulation.hpp"

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <stdexcept>

#include "comm/first_text.hpp"
#include "comm/totals.hpp"
#include "engine/contacts/contacts.hpp"
#include "engine/particles/particles.hpp"
#include "engine/run/balance.hpp"
#include "engine/run/census.hpp"
#include "engine/run/coarse_fields.hpp"
#include "engine/run/decomposition.hpp"
#include "engine/run/flight_record.hpp"
#include "engine/run/force_maps.hpp"
#include "engine/run/gas_phase.hpp"
#include "engine/run/grain_kind.hpp"
#include "engine/run/guard.hpp"
#include "engine/run/image_check.hpp"
#include "engine/run/image_rows.hpp"
#include "engine/run/kicks.hpp"
#include "engine/run/list_watch.hpp"
#include "engine/run/population.hpp"
#include "engine/run/probes.hpp"
#include "engine/run/state_hash.hpp"
#include "engine/run/step_watch.hpp"
#include "engine/run/wall_drivers.hpp"
#include "engine/scene/lists.hpp"
#include "engine/walls/walls.hpp"

namespace moraine {

namespace {

/// A grain that moves further than this part of its radius in a step misses contacts.
constexpr double max_travel = 0.2;

/// Of which a flight record tells.
constexpr int most_grains_of_cell = 8;

FieldNeeds needs_of(const Scene& scene) {
  FieldNeeds needs;
  needs.rotation = scene.contact.rotation;
  needs.energy = scene.output.energy;
  needs.gas = scene.gas && scene.gas->drag;
  const auto wants = [&](const char* name) {
    return std::find(scene.output.fields.begin(), scene.output.fields.end(), name) != scene.output.fields.end();
  };
  needs.force = wants("force");
  needs.torque = wants("torque") && scene.contact.rotation;
  return needs;
}

void check(const Scene& scene, const World& world) {
  std::vector<Problem> problems = validate(scene, world);
  std::erase_if(problems, [](const Problem& problem) { return problem.is_warning; });
  if (!problems.empty()) throw SceneError(std::move(problems));
}

/// What checkpoints of runs in mixed precision hold under "precision"; those of others have no such entry.
constexpr double mixed_precision = 2.0;

void expect_precision(const Scene& scene, const Image& image) {
  const bool was_mixed = image.accumulators.contains("precision"), is_mixed = scene.run.precision == Precision::mixed;
  if (was_mixed == is_mixed) return;
  const std::string was = was_mixed ? "mixed" : "double", is = is_mixed ? "mixed" : "double";
  throw SceneError({{"run.precision",
                     "is \"" + is + "\", but the checkpoint is of a run in " + was +
                         " precision; a run goes on in the precision it had: set run.precision = \"" + was +
                         "\", or begin a new run with its grains (particles.fill.file)",
                     false}});
}

/// Lists of start positions have done their work once the grains are born; they weigh as much as the grains.
void forget_lists(Scene& scene) {
  for (ParticleGroup& group : scene.particles)
    if (auto* listed = std::get_if<ListedGrains>(&group.fill)) std::vector<GrainSeed>().swap(listed->grains);
}

/// What was freed inside the heap goes back to the system.
void trim_heap() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

}  // namespace

/// What this step does besides advancing the grains; decided in one place.
struct StepPlan {
  bool rebuild = false;
  bool search_walls = false;  // a rebuild does it anyway
};

struct Simulation::Parts {
  Scene scene;
  int n_threads;
  Plan plan;
  Walls walls;
  WallDrivers drivers;
  Population population;
  Particles particles;
  std::optional<Contacts> contacts;
  std::optional<GasPhase> gas;
  GrainKind kind;
  Stopwatch stopwatch;

  std::uint64_t step = 0;
  double dt = 0.0;
  BodyForce body_force;
  std::vector<double> push;  // [m/s2] three values a grain, with what the gas gives; empty without body force
  double energy_initial = 0.0;
  bool has_energy_initial = false;
  std::vector<std::vector<double>> probe_memory;
  std::map<std::size_t, CoarseFields> fields;  // of probes, by number
  ForceMaps force_maps;

  ListWatch list;
  StepResult result;
  StepWatch watch;

  FlightRecorder recorder;

  World world;
  bool is_stop_wanted = false, is_stop_agreed = false;
  std::uint64_t n_cuts = 0;

  Balancer balancer;
  std::uint64_t rebuilds_since_balance = 0, step_of_balance = 0;
  // For tests.
  std::function<int(std::uint64_t)> forced_threads;
  bool are_equal_boxes_forced = false;

  Parts(const Scene& s, int threads, const World& ranks)
      : scene(s),
        n_threads(threads),
        plan(make_plan(s, threads)),
        walls(s),
        drivers(scene, walls, plan.time_step.step),
        population(scene, ranks, plan.time_step.step),
        particles(needs_of(s)),
        dt(plan.time_step.step),
        probe_memory(s.output.probes.size()),
        force_maps(s, walls),
        recorder(s.run.max_overlap),
        world(ranks),
        balancer(ranks, s.run.balance, threads) {
    walls.move_to(0.0, dt);
    for (std::size_t k = 0; k < s.output.probes.size(); ++k)
      if (s.output.probes[k].kind == Probe::Kind::fields) fields.try_emplace(k, s, s.output.probes[k], ranks);
  }

  double time() const { return static_cast<double>(step) * dt; }
  GuardView guard_view() const {
    return {scene, particles, *contacts, walls, time(), dt, step, plan.time_step.steps_per_contact};
  }
  ListView list_view() {
    return {*contacts, particles, walls, stopwatch, step, time(), result.max_speed, result.used_room, n_threads};
  }

  void make_contacts();
  void advance_gas();
  StepPlan decide();
  bool look();
  [[noreturn]] void stop_for_stale_list();
  void divide(Subdomains subdomains);
  double largest_push() const;
  void rebuild(const Births& births = {});
  void search_walls();
  void move_walls();
  bool balance();
  bool is_balance_due();
  Balancer::Measure measure() const;
  void cut(std::span<const float> weights);
  void start(Phase phase) { stopwatch.start(phase, phase == Phase::gas ? balancer.n_gas_threads() : n_threads); }
  void advance();
  void cross_faces();
  void apply_body_force();
  void guard();
  [[noreturn]] void stop(const std::string& why, const std::vector<std::int32_t>& grains);
  [[noreturn]] void stop_for_gas(const std::string& why);
  void begin_record(Concern concern);
  void tick();

  void after_rebuild();
  void bear_from_inlets();
  void renew_list();
  void take_memory(Image& image);
  std::size_t memory_of_probes() const;
  std::vector<double> sample_fields(CoarseFields& probe);
  EnergyLedger energy();
  std::vector<double> remembered() const;
  Image image_head() const;
};

void Simulation::Parts::make_contacts() {
  kind = kind_of(world, scene, particles);
  contacts.emplace(scene, walls, kind, world);
  watch = StepWatch(scene, plan.time_step, kind.smallest_radius);
  contacts->watch_overlaps_beyond(recorder.watched_overlap());
  list = ListWatch(scene, plan, kind, contacts->range(), world.is_alone(), step);
  if (!world.is_alone()) cut({});
}

/// Divides space anew, into equal boxes where nothing is to follow the grains but cores; grains move at the next rebuild.
/// Weights of this rank's grains, in any unit that all ranks use; empty: all the same.
void Simulation::Parts::cut(std::span<const float> weights) {
  std::vector<Vec3> positions;
  std::vector<float> those_here;
  for (std::int32_t i = 0; i < particles.size(); ++i)
    if (particles.is_here(i)) {
      positions.push_back(particles.position(i));
      if (!weights.empty()) those_here.push_back(weights[static_cast<std::size_t>(i)]);
    }
  const double widest = widest_skin(scene, plan) + contacts->range();
  const bool is_even = scene.run.balance == Balance::off || scene.run.balance == Balance::threads;
  divide(is_even ? decompose_evenly(world, world.size(), scene, kind.largest_radius, widest)
                 : decompose(world, world.size(), positions, those_here, scene, kind.largest_radius, widest));
  ++n_cuts;
}

void Simulation::Parts::divide(Subdomains subdomains) {
  list.set_hops(subdomains.most_hops());
  contacts->set_subdomains(std::move(subdomains));
}

/// Every eighth rebuild, and after some hundred steps in any case.
bool Simulation::Parts::is_balance_due() {
  constexpr std::uint64_t rebuilds = 8, steps = 400;
  if (++rebuilds_since_balance < rebuilds && step < step_of_balance + steps) return false;
  rebuilds_since_balance = 0;
  step_of_balance = step;
  return step > 0;
}

Balancer::Measure Simulation::Parts::measure() const {
  Balancer::Measure now;
  now.step = step;
  now.time = time();
  now.n_grains = static_cast<double>(particles.size());
  now.n_pairs = static_cast<double>(contacts->n_pairs());
  now.counted = 4.0 * now.n_grains + now.n_pairs;
  now.rebuild = stopwatch.work(Phase::rebuild);
  now.advance = stopwatch.work(Phase::advance);
  now.gas = stopwatch.work(Phase::gas);
  for (const Phase phase : {Phase::rebuild, Phase::gas, Phase::look, Phase::advance, Phase::faces, Phase::guard}) {
    const PhaseWork work = stopwatch.work(phase);
    now.all_waited += work.waited;
    now.all_worked += work.working;
    now.all_held += work.held;
  }
  now.n_rebuilds = list.n_rebuilds();
  return now;
}

/// Looks where the work is by now: cores may change hands, for which a rebuild is the moment, and cuts may move (true).
bool Simulation::Parts::balance() {
  if (forced_threads) balancer.force(forced_threads(list.n_rebuilds()));
  bool moves_cuts = false;
  if (are_equal_boxes_forced) {
    are_equal_boxes_forced = false;
    divide(decompose_evenly(world, world.size(), scene, kind.largest_radius, widest_skin(scene, plan)));
  } else if (is_balance_due()) {
    const Balancer::Decision decision = balancer.look(measure());
    moves_cuts = decision.moves_cuts;
    if (moves_cuts) {
      std::vector<float> weights(static_cast<std::size_t>(particles.size()));
      for (std::int32_t i = 0; i < particles.size(); ++i)
        weights[static_cast<std::size_t>(i)] =
            static_cast<float>(decision.weight) * (4.0f + 0.5f * static_cast<float>(contacts->pairs().n_pairs_of(i)));
      cut(weights);
    }
  }
  n_threads = balancer.n_threads();
  return moves_cuts;
}

/// The largest acceleration that the gas gives a grain, or the body force has given it in the last step [m/s2].
double Simulation::Parts::largest_push() const {
  double largest = 0.0;
  if (particles.has(Field::gas_acceleration))
    for (std::int32_t i = 0; i < particles.size(); ++i)
      largest = std::max(largest, squared_length(particles.gas_acceleration(i)));
  for (std::size_t k = 0; k + 2 < push.size(); k += 3)
    largest = std::max(largest, squared_length(Vec3{push[k], push[k + 1], push[k + 2]}));
  return std::sqrt(largest);
}

/// Asks for the body force at the present positions, and adds what the gas gives.
void Simulation::Parts::apply_body_force() {
  if (!body_force) return;
  push.assign(3 * static_cast<std::size_t>(particles.size()), 0.0);
  body_force(push);
  if (const double* const gas_push = particles.gas_acceleration())
    for (std::size_t k = 0; k < push.size(); ++k) push[k] += gas_push[k];
  contacts->set_push(push.data());
}

/// The gas steps to the grains as they are, and sets what they feel until it steps again.
void Simulation::Parts::advance_gas() {
  if (!gas || !gas->is_due(step)) return;
  start(Phase::gas);
  balancer.enter_gas_phases();
  gas->set_grain_threads(n_threads);
  try {
    gas->advance(particles, time());
  } catch (const RunError& error) {
    stop_for_gas(error.what());
  }
  balancer.enter_grain_phases();
  list.look_at(step, list_view());  // what was foreseen without knowing how the gas would push
}

StepPlan Simulation::Parts::decide() {
  const ListView now = list_view();
  StepPlan todo;
  if (list.is_old(time())) {
    todo.rebuild = true;
  } else if (world.is_alone()) {
    todo.rebuild = list.is_used_up();
  } else if (list.is_look_due(now)) {
    start(Phase::look);
    todo.rebuild = look();
  } else if (!list.foresee(now)) {
    stop_for_stale_list();
  }
  todo.search_walls = !todo.rebuild && list.must_search_walls(now);
  return todo;
}

/// All ranks look how far their grains have come since the rebuild, and agree: to rebuild now (true), or when to look again. What else they must
/// all know goes along.
bool Simulation::Parts::look() {
  const ListView now = list_view();
  std::array<double, 5> most = {list.measure(now), result.max_speed, is_stop_wanted ? 1.0 : 0.0, largest_push(),
                                watch.fastest()};
  world.max(most);
  watch.see(most[4], time());
  is_stop_agreed = most[2] > 0.0;
  const double furthest = body_force ? 1.0
                          : gas      ? std::min<double>(64.0, static_cast<double>(gas->until_next(step)))
                                     : 64.0;
  return list.agree(now, {most[0], most[1], most[3], furthest});
}

void Simulation::Parts::stop_for_stale_list() {
  const std::int32_t fastest = fastest_grain(particles);
  stop(explain_stale_list(guard_view(), list.travelled(), list.skin(), list.n_hops()),
       fastest < 0 ? std::vector<std::int32_t>() : std::vector{fastest});
}

void Simulation::Parts::rebuild(const Births& births) {
  start(Phase::rebuild);
  if (contacts->are_set_aside()) trim_heap();  // of the image
  const auto n_before = static_cast<double>(list.n_rebuilds());
  list.begin_rebuild();
  const double before = n_before > 0.0 ? stopwatch.seconds(Phase::rebuild) / n_before : 0.0;
  const double begin = threads::now();
  const bool is_cut = balance();
  contacts->rebuild(particles, list.width(), time(), n_threads, births);
  after_rebuild();
  if (is_cut) balancer.note_cut(step, threads::now() - begin - before);
}

/// Walls have moved under the grains: what these may touch is looked for anew. No rank asks another.
void Simulation::Parts::search_walls() {
  start(Phase::rebuild);
  contacts->search_walls(particles, list.width().wall_skin, time(), n_threads);
  walls.mark();
  list.note_wall_search();
}

/// To the time of the grains' new positions. Servos go by what the grains did to them in this step.
void Simulation::Parts::move_walls() {
  drivers.advance(world, contacts->wall_sums().pushes);
  walls.move_to(time(), dt);
  if (const double wander = walls.last_wander(); wander > max_travel * kind.smallest_radius)
    throw RunError(explain_fast_wall(guard_view(), wander, kind.smallest_radius));
}

void Simulation::Parts::after_rebuild() {
  walls.mark();
  population.note_rebuild();
  list.note_rebuild(list_view());
  if (world.is_alone()) return;
  drivers.compare_scripts(world);
  if (look()) list.look_at(step + 1, list_view());  // they are that fast
  population.count();
}

void Simulation::Parts::advance() {
  start(Phase::advance);
  // Velocities start at the positions, and are half a step behind them from then on: the first step's kick, and what walls do in it, is half as long.
  contacts->advance(particles, kick_of(scene, step == 0 ? 0.5 * dt : dt, dt), dt, list.travelled(), n_threads, result,
                    step == 0 ? 0.5 : 1.0);
  if (step == 0 && particles.has(Field::dissipated)) {  // rates are counted for half a step at the start
    double* const lost = particles.dissipated();
    for (std::ptrdiff_t i = 0; i < particles.size(); ++i) lost[4 * i] *= 0.5;
  }
  if (!force_maps.empty()) force_maps.add(contacts->triangle_forces());
  if (!list.note_step(list_view())) stop_for_stale_list();
}

/// What inlets owe and find room for comes in, with the rebuild that it takes.
void Simulation::Parts::bear_from_inlets() {
  if (!population.is_birth_due(step)) return;
  start(Phase::rebuild);
  if (contacts->are_set_aside() || list.has_wall_changed(time())) rebuild();
  contacts->refresh(particles);
  const std::vector<Newborn> born = population.bear(step, {world, contacts->subdomains(), particles, walls, time()});
  if (born.empty()) return;
  for (const Newborn& grain : born) result.max_speed = std::max(result.max_speed, length(grain.seed.velocity));
  rebuild(population.births_of(born, contacts->subdomains(), particles));
}

void Simulation::Parts::cross_faces() {
  start(Phase::faces);
  const std::int32_t lost = population.cross_faces(
      result.outside, {particles, *contacts, time(), static_cast<double>(step + 1) * dt, n_threads});
  if (lost >= 0) stop(explain_outside(guard_view(), lost), {lost});
}

/// The run ends here, with the last steps of the grains concerned.
void Simulation::Parts::stop(const std::string& why, const std::vector<std::int32_t>& grains) {
  throw RecordedRunError(why, {recorder.finish(guard_view(), grains), {}, {}, {}});
}

/// Not all ranks need be here: no rank asks another.
void Simulation::Parts::stop_for_gas(const std::string& why) {
  if (contacts->are_set_aside()) rebuild();  // then this rank is alone
  const ConcernedCells own = gas->find_concerned();
  const std::vector<std::int32_t> grains = grains_in(gas->grid(), {own}, particles, most_grains_of_cell);
  throw RecordedRunError(why, {grains.empty() ? "" : recorder.finish(guard_view(), grains),
                               gas->rows_of_cells(own, time()),
                               gas->rows_of_steps(),
                               {}});
}

void Simulation::Parts::begin_record(Concern concern) {
  renew_list();
  FlightRecord record;
  record.subject = name_of(concern);
  if (concern == Concern::energy) {
    recorder.follow(guard_view(), most_moved_grains(guard_view()), std::move(record));
    return;
  }
  const std::vector<ConcernedCells> cells = gas->find_concerned_of_all();
  record.gas_cells = gas->rows_of_cells(cells[static_cast<std::size_t>(world.rank())], time());
  record.gas_steps = gas->rows_of_steps();
  recorder.follow(guard_view(), grains_in(gas->grid(), cells, particles, most_grains_of_cell), std::move(record));
}

void Simulation::Parts::guard() {
  start(Phase::guard);
  watch.see(result.max_speed, time());
  if (result.is_any_not_finite) {
    const std::int32_t first = first_not_finite(particles);
    stop(explain_not_finite(guard_view()), first < 0 ? std::vector<std::int32_t>() : std::vector{first});
  }
  const double travel = result.max_speed * dt / (max_travel * kind.smallest_radius);
  const bool is_fast = travel > 0.5;
  if (result.has_large_overlap || is_fast || recorder.is_watching()) {
    if (recorder.note(guard_view(), result.has_large_overlap, is_fast))
      stop(explain_overlap(guard_view()), deepest_grains(guard_view()));
    contacts->watch_overlaps_beyond(recorder.watched_overlap());
  }
  if (recorder.is_following()) recorder.note_followed(guard_view());
  if (travel > 1.0) {
    const std::int32_t fastest = furthest_for_its_size(particles);
    if (fastest >= 0 && length(particles.velocity(fastest)) * dt > max_travel * particles.radius(fastest))
      stop(explain_speed(guard_view(), fastest), {fastest});
  }
}

void Simulation::Parts::tick() {
  ++step;
  move_walls();
  start(Phase::observe);
}

/// What contacts remember, for an image. Alone, as the image weighs as much as the list, the list goes meanwhile: the next rebuild
/// takes what pairs remember back from it.
void Simulation::Parts::take_memory(Image& image) {
  if (!world.is_alone()) {
    gather_memory(particles, *contacts, image);
    return;
  }
  list.set_old();
  contacts->release_index();
  trim_heap();
  gather_memory(particles, *contacts, image);
  contacts->set_aside();
  contacts->give_back(carry_by_place(particles, image));
  trim_heap();
}

/// Makes list and ghosts good for the present positions, for those who look at contacts between steps.
void Simulation::Parts::renew_list() {
  const StepPlan todo = decide();
  if (todo.rebuild)
    rebuild();
  else if (todo.search_walls)
    search_walls();
  contacts->refresh(particles);
}

/// Of those that keep sums on grids and triangles [bytes].
std::size_t Simulation::Parts::memory_of_probes() const {
  std::size_t bytes = force_maps.memory();
  for (const auto& [number, probe] : fields) bytes += probe.memory();
  return bytes;
}

/// With the velocities that go with the forces of now, so that momentum balances to the second order in the step.
std::vector<double> Simulation::Parts::sample_fields(CoarseFields& probe) {
  renew_list();
  apply_body_force();
  const Contacts::Velocities now =
      contacts->velocities_now(particles, kick_to_positions(scene, step, dt), dt, n_threads);
  const double* const pushes = push.empty() ? particles.gas_acceleration() : push.data();
  return probe.add({particles, *contacts, now.linear, pushes, time(), dt, n_threads});
}

EnergyLedger Simulation::Parts::energy() {
  renew_list();
  apply_body_force();
  const Kick half_kick = kick_to_positions(scene, step, dt);
  const Contacts::Velocities now = contacts->velocities_now(particles, half_kick, dt, n_threads);
  EnergyLedger ledger =
      take_ledger(world, particles, *contacts, now, scene.time.gravity, scene.time.damping, 2.0 * half_kick.time);
  const CensusTaker all = population.total(*contacts);
  ledger.left = all.energy_left.value();
  // Half of what walls do in the present step is done at the positions.
  ExactSum present;
  if (walls.is_any_moving() && step > 0)
    contacts->for_each_wall_contact(particles, dt, [&](const ContactReport& contact) {
      present.add(0.5 * dt * dot(contact.result.force, contact.wall_velocity));
    });
  ledger.wall_work = all.wall_work.value() + total(world, present);
  if (!has_energy_initial) {
    energy_initial = ledger.total();
    has_energy_initial = true;
  }
  ledger.initial = energy_initial;
  return ledger;
}

/// What the run remembers besides its grains and gas, the same on all ranks.
std::vector<double> Simulation::Parts::remembered() const {
  std::vector<double> all = drivers.hashed();
  const std::vector<double> owed = population.hashed();
  all.insert(all.end(), owed.begin(), owed.end());
  if (scene.run.precision == Precision::mixed) all.push_back(mixed_precision);  // runs in double keep their hashes
  return all;
}

Image Simulation::Parts::image_head() const {
  Image image;
  image.step = step;
  image.time = time();
  image.time_step = dt;
  image.domain = scene.domain.box();
  image.periodic = scene.domain.periodic;
  for (std::size_t w = 0; w < scene.walls.size(); ++w) {
    if (scene.walls[w].motion.empty()) continue;
    const Pose& pose = walls.wall_pose(static_cast<std::int32_t>(w));
    std::vector<double>& numbers = image.accumulators[pose_name(scene.walls[w].name)];
    for (const Vec3& row : {pose.rows[0], pose.rows[1], pose.rows[2], pose.shift})
      numbers.insert(numbers.end(), {row.x, row.y, row.z});
  }
  return image;
}

Simulation::Simulation(const Scene& scene, int n_threads, const World& world) {
  check(scene, world);
  parts_ = std::make_unique<Parts>(scene, n_threads, world);
  Parts& p = *parts_;
  p.population.bear_first(p.particles, n_threads);
  if (is_scattered(scene) && p.population.n_born() != p.plan.n_grains)
    throw std::logic_error("the lists of the scene were read by other ranks than those that run it");
  if (scene.gas) p.gas.emplace(scene, p.plan, world, n_threads);
  p.make_contacts();
  forget_lists(p.scene);
  p.rebuild();
  check_start(p.guard_view(), world);
  if (scene.output.energy) p.energy();
  p.start(Phase::observe);
}

Simulation::Simulation(const Scene& scene, int n_threads, const Image& image, const World& world) {
  check(scene, world);
  parts_ = std::make_unique<Parts>(scene, n_threads, world);
  Parts& p = *parts_;
  if (image.time_step != p.dt)
    throw SceneError({{"time.step",
                       "is " + std::to_string(p.dt) + " s, but the checkpoint was written with " +
                           std::to_string(image.time_step) + " s; a run goes on with the step it had",
                       false}});
  if (!(image.domain == scene.domain.box()) || image.periodic != scene.domain.periodic)
    throw SceneError({{"domain", "is not the one that the checkpoint was written with", false}});
  expect_precision(scene, image);
  expect_possible(scene, p.walls.surfaces().size(), image);
  p.step = p.step_of_balance = image.step;
  p.energy_initial = kept_number(image.accumulators, "energy_initial");
  p.has_energy_initial = scene.output.energy;
  for (std::size_t k = 0; k < p.probe_memory.size(); ++k)
    if (const auto found = image.accumulators.find("probe_" + scene.output.probes[k].name);
        found != image.accumulators.end())
      p.probe_memory[k] = found->second;
  for (auto& [number, probe] : p.fields) probe.restore(image);
  p.force_maps.restore(world, image.accumulators);
  p.drivers.restore(image.accumulators);
  p.walls.move_to(p.time(), p.dt);
  PairCarry pairs;
  WallCarry wall_memory;
  put_rows(world, image, p.particles, pairs, wall_memory);
  p.population.restore(image.accumulators, p.particles);
  if (scene.gas) {
    p.gas.emplace(scene, p.plan, world, n_threads);
    p.gas->restore(image);
  }
  p.make_contacts();
  forget_lists(p.scene);
  p.contacts->restore(p.particles, std::move(pairs), std::move(wall_memory), p.list.width(), p.time(), n_threads);
  p.after_rebuild();
  p.start(Phase::observe);
}

Simulation::~Simulation() = default;
Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;

void Simulation::step() {
  Parts& p = *parts_;
  p.drivers.ask_scripts(p.step);
  p.bear_from_inlets();
  p.advance_gas();
  const StepPlan todo = p.decide();
  if (todo.rebuild)
    p.rebuild();
  else if (todo.search_walls)
    p.search_walls();
  p.apply_body_force();
  p.advance();
  p.guard();
  p.cross_faces();
  p.tick();
}

void Simulation::begin_record(Concern concern) { parts_->begin_record(concern); }

std::vector<FlightRecord> Simulation::take_records(bool is_end) { return parts_->recorder.take_followed(is_end); }

std::size_t Simulation::n_known_warnings() const { return parts_->watch.n_warnings(); }

std::vector<std::string> Simulation::step_warnings() const {
  double fastest = parts_->watch.fastest();
  parts_->world.max(std::span(&fastest, 1));
  parts_->watch.see(fastest, parts_->time());
  return parts_->watch.warnings();
}

std::vector<std::string> Simulation::known_warnings() const { return parts_->watch.warnings(); }

std::optional<GasTotals> Simulation::gas_totals() const {
  if (!parts_->gas) return std::nullopt;
  return parts_->gas->totals();
}

const World& Simulation::world() const { return parts_->world; }
void Simulation::ask_to_stop() {
  parts_->is_stop_wanted = true;
  if (parts_->world.is_alone()) parts_->is_stop_agreed = true;
}
bool Simulation::is_stop_agreed() const { return parts_->is_stop_agreed; }
void Simulation::forget_stop() { parts_->is_stop_wanted = parts_->is_stop_agreed = false; }

void Simulation::set_body_force(BodyForce force) {
  Parts& p = *parts_;
  p.body_force = std::move(force);
  p.list.look_at(p.step, p.list_view());
  p.push.clear();
  p.contacts->set_push(nullptr);
}

void Simulation::set_wall_motion(const std::string& wall, WallFunction function, std::uint64_t every) {
  parts_->drivers.set_script(wall, std::move(function), every);
}

std::optional<FieldView> Simulation::view(Field field) {
  if (!parts_->particles.has(field)) return std::nullopt;
  return parts_->particles.view(field);
}

void Simulation::remove_left() {
  Parts& p = *parts_;
  if (p.world.is_alone() && static_cast<std::uint64_t>(p.particles.size()) != n_grains()) p.rebuild();
}

void Simulation::grains_changed() {
  Parts& p = *parts_;
  const std::string fault = first_text(p.world, fault_of_grains(p.guard_view(), p.population.n_away()));
  if (!fault.empty()) throw std::invalid_argument(fault);
  p.list.set_old();
  p.contacts->grains_changed();
}
const Scene& Simulation::scene() const { return parts_->scene; }
const Plan& Simulation::plan() const { return parts_->plan; }
std::uint64_t Simulation::step_number() const { return parts_->step; }
double Simulation::time() const { return parts_->time(); }
double Simulation::time_step() const { return parts_->dt; }
std::uint64_t Simulation::n_born() const { return parts_->population.n_born(); }
std::uint64_t Simulation::n_left() const { return parts_->population.n_left(); }
std::uint64_t Simulation::n_grains() const { return n_born() - n_left(); }
std::uint64_t Simulation::n_rebuilds() const { return parts_->list.n_rebuilds(); }
std::uint64_t Simulation::n_wall_searches() const { return parts_->list.n_wall_searches(); }
std::uint64_t Simulation::n_looks() const { return parts_->list.n_looks(); }
std::uint64_t Simulation::n_early_looks() const { return parts_->list.n_early_looks(); }
std::vector<std::string> Simulation::take_notes() { return parts_->population.take_notes(); }
double Simulation::memory() const {
  const Parts& p = *parts_;
  return static_cast<double>(p.particles.memory() + p.contacts->memory() + (p.gas ? p.gas->memory() : 0) +
                             p.memory_of_probes());
}
void Simulation::bound_skin(double widest) { parts_->list.bound_skin(widest); }
std::vector<PhaseTime> Simulation::phases() const {
  std::vector<PhaseTime> rows;
  const Stopwatch& watch = parts_->stopwatch;
  const bool is_alone = parts_->world.is_alone();
  for (const Phase phase :
       {Phase::rebuild, Phase::gas, Phase::look, Phase::advance, Phase::faces, Phase::guard, Phase::observe}) {
    const double waited = is_alone ? 0.0 : watch.waited(phase);
    rows.push_back({Stopwatch::name(phase), watch.seconds(phase) - waited});
    const char* const name = phase == Phase::rebuild   ? "waiting in rebuilds"
                             : phase == Phase::gas     ? "waiting in the gas"
                             : phase == Phase::look    ? "waiting in looks"
                             : phase == Phase::advance ? "waiting for ghosts"
                                                       : nullptr;
    if (name && !is_alone) rows.push_back({name, waited});
  }
  return rows;
}

std::vector<NamedWork> Simulation::work() const {
  std::vector<NamedWork> rows;
  for (const Phase phase : {Phase::rebuild, Phase::gas, Phase::look, Phase::advance, Phase::faces, Phase::guard})
    rows.push_back({Stopwatch::name(phase), parts_->stopwatch.work(phase)});
  return rows;
}

int Simulation::n_threads() const { return parts_->n_threads; }
const BalanceTotals& Simulation::balance() const { return parts_->balancer.totals(); }
std::vector<BalanceRow> Simulation::take_balance_rows() { return parts_->balancer.take_rows(); }
std::vector<std::string> Simulation::take_balance_notes() { return parts_->balancer.take_notes(); }
std::vector<std::string> Simulation::keep_to_cores() { return parts_->balancer.keep_to_cores(); }
void Simulation::force_counting() { parts_->balancer.count_only(); }
void Simulation::force_equal_boxes() {
  parts_->are_equal_boxes_forced = !parts_->world.is_alone();
  parts_->list.set_old();
}
void Simulation::force_threads(std::function<int(std::uint64_t)> choose) { parts_->forced_threads = std::move(choose); }

HaloCounts Simulation::halo_counts() const { return parts_->contacts->ghosts().counts(); }
std::uint64_t Simulation::n_migrated() const { return parts_->contacts->n_migrated(); }
std::uint64_t Simulation::n_cuts() const { return parts_->n_cuts; }
std::int64_t Simulation::n_own_pairs() const { return parts_->contacts->n_pairs(); }
std::uint64_t Simulation::n_own_grains() const { return static_cast<std::uint64_t>(parts_->particles.size()); }

void Simulation::begin_force_maps() { parts_->force_maps.begin(); }

Hash128 Simulation::state_hash() const {
  // A wall that vanishes in this very step takes what its contacts remember along.
  if (parts_->contacts->are_set_aside() || parts_->list.has_wall_changed(parts_->time())) parts_->rebuild();
  parts_->contacts->refresh(parts_->particles);  // so that ghosts' contacts know who has left or crossed a face
  return moraine::state_hash(parts_->world, parts_->particles, *parts_->contacts, parts_->step, parts_->remembered(),
                             parts_->gas ? &*parts_->gas : nullptr);
}

Image Simulation::snapshot(const std::vector<std::string>& fields) const {
  Parts& p = *parts_;
  Image image = p.image_head();
  std::vector<Field> wanted;
  for (const FieldInfo& row : field_table) {
    const bool is_asked = fields.empty()
                              ? row.travel != Travel::never || p.particles.has(row.field)
                              : row.field == Field::gid || row.field == Field::position || row.field == Field::radius ||
                                    std::find(fields.begin(), fields.end(), row.name) != fields.end();
    if (is_asked && p.particles.has(row.field)) wanted.push_back(row.field);
  }
  gather_fields(p.particles, wanted, image);
  p.population.count();
  share_out_rows(p.world, p.population.n_born(), image);
  if (p.gas) p.gas->gather_shown(image);
  image.maps = p.force_maps.maps(p.world, p.walls);
  image.hash = state_hash();
  return image;
}

Image Simulation::checkpoint() const {
  Parts& p = *parts_;
  Image image = p.image_head();
  image.hash = state_hash();
  p.take_memory(image);
  std::vector<Field> wanted;
  for (const FieldInfo& row : field_table)
    if (row.travel != Travel::never && p.particles.has(row.field)) wanted.push_back(row.field);
  gather_fields(p.particles, wanted, image);
  p.population.count();
  share_out_rows(p.world, p.population.n_born(), image);
  if (p.gas) p.gas->gather_kept(image);
  for (const auto& [number, probe] : p.fields) probe.keep(image);
  p.force_maps.keep(p.world, image.accumulators);
  p.population.keep(*p.contacts, image.accumulators);
  image.accumulators["energy_initial"] = {p.energy_initial};
  if (p.scene.run.precision == Precision::mixed) image.accumulators["precision"] = {mixed_precision};
  p.drivers.keep(image.accumulators);
  for (std::size_t k = 0; k < p.probe_memory.size(); ++k)
    if (!p.probe_memory[k].empty()) image.accumulators["probe_" + p.scene.output.probes[k].name] = p.probe_memory[k];
  return image;
}

EnergyLedger Simulation::energy() const {
  if (!parts_->scene.output.energy)
    throw std::logic_error("the scene keeps no energy ledger: set output.energy = true");
  parts_->population.count();
  return parts_->energy();
}

std::vector<std::string> Simulation::probe_columns(std::size_t probe) const {
  return moraine::probe_columns(parts_->scene, parts_->scene.output.probes.at(probe));
}

std::vector<double> Simulation::probe_row(std::size_t probe) {
  Parts& p = *parts_;
  const Probe& wanted = p.scene.output.probes.at(probe);
  if (wanted.kind == Probe::Kind::fields) return p.sample_fields(p.fields.at(probe));
  p.renew_list();
  std::optional<EnergyLedger> ledger;
  if (p.scene.output.energy && wanted.kind == Probe::Kind::energy) ledger = p.energy();
  const CensusTaker all = p.population.total(*p.contacts);
  std::optional<GasView> gas;
  if (p.gas) gas.emplace(p.gas->view());
  const ProbeView view{p.world,
                       p.scene,
                       p.walls,
                       p.particles,
                       *p.contacts,
                       p.dt,
                       ledger ? &*ledger : nullptr,
                       all.census(),
                       &p.population.inlets(),
                       p.time(),
                       gas ? &*gas : nullptr};
  return moraine::probe_row(view, wanted, p.probe_memory[probe]);
}

FieldImage Simulation::fields(std::size_t probe) const {
  FieldImage image = parts_->fields.at(probe).image();
  image.step = parts_->step;
  image.time_step = parts_->dt;
  return image;
}

void Simulation::begin_fields(std::size_t probe) { parts_->fields.at(probe).begin(); }

}  // namespace moraine
