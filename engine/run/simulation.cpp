#include "engine/run/simulation.hpp"

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <stdexcept>

#include "engine/contacts/contacts.hpp"
#include "engine/particles/fill.hpp"
#include "engine/particles/particles.hpp"
#include "engine/run/census.hpp"
#include "engine/run/decomposition.hpp"
#include "engine/run/gas_phase.hpp"
#include "engine/run/guard.hpp"
#include "engine/run/image_rows.hpp"
#include "engine/run/probes.hpp"
#include "engine/run/state_hash.hpp"
#include "engine/scene/checks.hpp"
#include "engine/scene/lists.hpp"
#include "engine/threads.hpp"
#include "engine/walls/walls.hpp"

namespace moraine {

namespace {

/// A grain that moves further than this part of its radius in a step misses contacts.
constexpr double max_travel = 0.2;

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

/// Of the grains of all ranks, which call it together.
GrainKind kind_of(const World& world, const Particles& particles) {
  // Largest radius, inverse mass and material, then the largest of the negative ones, which gives the smallest.
  std::array<double, 6> most;
  most.fill(-infinity);
  for (std::int32_t i = 0; i < particles.size(); ++i) {
    const std::array<double, 3> values = {particles.radius(i), particles.inverse_mass(i),
                                          static_cast<double>(particles.material(i))};
    for (std::size_t k = 0; k < 3; ++k) {
      most[k] = std::max(most[k], values[k]);
      most[k + 3] = std::max(most[k + 3], -values[k]);
    }
  }
  world.max(most);
  GrainKind kind;
  if (most[0] < 0.0) return kind;  // there are no grains
  kind.largest_radius = most[0];
  kind.smallest_radius = -most[3];
  kind.inverse_mass = most[1];
  kind.mass_ratio = most[1] / -most[4];
  kind.is_uniform = most[0] == -most[3] && most[1] == -most[4] && most[2] == -most[5];
  return kind;
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
};

struct Simulation::Parts {
  Scene scene;
  int n_threads;
  Plan plan;
  Walls walls;
  Particles particles;
  std::optional<Contacts> contacts;
  std::optional<GasPhase> gas;
  GrainKind kind;
  Stopwatch stopwatch;

  std::uint64_t step = 0;
  double dt = 0.0;
  CensusTaker census;                    // of this rank
  std::uint64_t n_left_at_rebuild = 0;   // of this rank: who has left since then still has a place in the arrays
  std::uint64_t n_born = 0, n_left = 0;  // of all ranks, when they last counted
  BodyForce body_force;
  std::vector<double> push;  // [m/s2] three values a grain, with what the gas gives; empty without body force
  double energy_initial = 0.0;
  bool has_energy_initial = false;
  std::vector<std::vector<double>> probe_memory;

  // Until when the pair list is good.
  double skin = 0.0;        // [m]
  bool is_list_old = true;  // it must be rebuilt, however little has moved
  double travelled = 0.0;   // [m] no grain has moved further since the rebuild
  std::vector<Vec3> place_at_rebuild;
  double next_wall_change = 0.0;  // [s]
  std::uint64_t n_rebuilds = 0, steps_since_rebuild = 0;
  StepResult result;

  // Several ranks: when they look next at how far all have come, and what they divide.
  World world;
  std::uint64_t next_look = 0, last_surprise = 0, n_looks = 0;  // [steps]
  bool is_stop_wanted = false, is_stop_agreed = false;
  std::uint64_t n_cuts = 0, rebuilds_since_cut = 0;
  double worked_until_cut = 0.0;  // [s] of this rank

  Parts(const Scene& s, int threads, const World& ranks)
      : scene(s),
        n_threads(threads),
        plan(make_plan(s, threads)),
        walls(s),
        particles(needs_of(s)),
        dt(plan.time_step.step),
        probe_memory(s.output.probes.size()),
        world(ranks) {}

  double time() const { return static_cast<double>(step) * dt; }
  double mean_diameter() const { return 10.0 * plan.skin; }  // [m] as the plan has it
  double allowed_travel() const { return 0.5 * skin * (1.0 - 1e-9); }
  GuardView guard_view() const {
    return {scene, particles, *contacts, walls, time(), dt, step, plan.time_step.steps_per_contact};
  }

  void bear_grains();
  void make_contacts();
  void choose_skin();
  double widest_skin() const;
  void advance_gas();
  StepPlan decide();
  bool look();
  double speed_gain() const;
  void check_travel();
  double largest_travel() const;
  double largest_push() const;
  void rebuild();
  void balance();
  double worked() const;
  void cut(std::span<const float> weights);
  void count();
  Kick kick_of(double h) const;
  void advance();
  void cross_faces();
  void apply_body_force();
  std::string fault_of_grains() const;
  void guard();
  void tick();

  void after_rebuild();
  bool leaves_through_outlet(Vec3 position) const;
  void remove(std::int32_t i);
  void check_start();
  void renew_list();
  void take_memory(Image& image);
  CensusTaker full_census() const;
  EnergyLedger energy();
  Image image_head() const;
};

void Simulation::Parts::make_contacts() {
  kind = kind_of(world, particles);
  contacts.emplace(scene, walls, kind, world);
  skin = plan.skin;
  choose_skin();
  if (!world.is_alone()) cut({});
}

/// Divides space anew; grains move at the next rebuild. Weights of this rank's grains, in any unit that all ranks use; empty: all the same.
void Simulation::Parts::cut(std::span<const float> weights) {
  std::vector<Vec3> positions;
  std::vector<float> those_here;
  for (std::int32_t i = 0; i < particles.size(); ++i)
    if (particles.is_here(i)) {
      positions.push_back(particles.position(i));
      if (!weights.empty()) those_here.push_back(weights[static_cast<std::size_t>(i)]);
    }
  contacts->set_subdomains(decompose(world, world.size(), positions, those_here, scene, kind.largest_radius,
                                     moraine::widest_skin(scene, plan)));
  ++n_cuts;
  rebuilds_since_cut = 0;
  worked_until_cut = worked();
}

/// Time that this rank has spent on its grains, waiting left out [s].
double Simulation::Parts::worked() const {
  return stopwatch.seconds(Phase::advance) - contacts->ghosts().halo().waited();
}

/// Moves the cuts where the ranks' work has drifted apart: counted in pairs and grains, and each rank's count weighed by what it was
/// measured to cost there.
void Simulation::Parts::balance() {
  constexpr std::uint64_t least_rebuilds = 8;
  constexpr double tolerated = 1.1;
  if (world.is_alone() || ++rebuilds_since_cut < least_rebuilds) return;
  std::vector<float> weights(static_cast<std::size_t>(particles.size()));
  double work = 0.0;
  for (std::int32_t i = 0; i < particles.size(); ++i)
    work += weights[static_cast<std::size_t>(i)] = 4.0f + static_cast<float>(contacts->pairs().n_pairs_of(i));
  const std::vector<double> all_work = world.gather(work), all_seconds = world.gather(worked() - worked_until_cut);
  const auto imbalance = [](const std::vector<double>& values) {
    const double sum = std::accumulate(values.begin(), values.end(), 0.0);
    const double most = *std::max_element(values.begin(), values.end());
    return sum > 0.0 ? most * static_cast<double>(values.size()) / sum : 1.0;
  };
  if (imbalance(all_work) < tolerated && imbalance(all_seconds) < tolerated) {
    rebuilds_since_cut = 0;  // look again after as many
    return;
  }
  const double sum_work = std::accumulate(all_work.begin(), all_work.end(), 0.0);
  const double sum_seconds = std::accumulate(all_seconds.begin(), all_seconds.end(), 0.0);
  if (work > 0.0 && sum_seconds > 0.0) {
    const double relative = (worked() - worked_until_cut) / work / (sum_seconds / sum_work);
    for (float& weight : weights) weight *= static_cast<float>(std::clamp(relative, 0.7, 1.4));
  }
  cut(weights);
}

double Simulation::Parts::widest_skin() const {
  double widest = infinity;
  for (int axis = 0; axis < 3; ++axis)
    if (scene.domain.periodic[static_cast<std::size_t>(axis)])
      widest = std::min(widest, scene.domain.box().size()[axis] - 2.0 * kind.largest_radius);
  return widest;
}

/// The skin is a matter of speed only. A rebuild costs about as much as nine steps, and a wider skin s adds about 1.1 s/d to
/// their cost (d the mean diameter; pairs that are too far apart to touch are not swept); with N steps between rebuilds, N in
/// proportion to s, the sum 9/N + 1.1 s/d is least at N s/d = 8, which each rebuild moves towards.
void Simulation::Parts::choose_skin() {
  if (scene.run.skin <= 0.0 && n_rebuilds > 1 && steps_since_rebuild > 0) {
    const double diameter = mean_diameter();
    const double wanted = std::sqrt(8.0 * diameter / (static_cast<double>(steps_since_rebuild) * skin));
    skin = std::clamp(skin * std::clamp(wanted, 0.7, 1.4), 0.01 * diameter, moraine::widest_skin(scene, plan));
  }
  const double widest = widest_skin();
  if (!(widest > 1e-6 * kind.largest_radius) && kind.largest_radius > 0.0)
    throw SceneError(
        {{"domain", "a periodic direction is not wider than the largest grain: no room to tell a grain from its image",
          false}});
  skin = std::min(skin, widest);
}

double Simulation::Parts::largest_travel() const {
  std::vector<double> squares(static_cast<std::size_t>(n_threads), 0.0);
  parallel(n_threads, [&](int thread) {
    const Range share = share_of(particles.size(), thread, n_threads);
    double largest = 0.0;
    for (std::int64_t i = share.begin; i < share.end; ++i) {
      const double moved = squared_length(particles.position(i) - place_at_rebuild[static_cast<std::size_t>(i)]);
      if (moved > largest) largest = moved;  // false for grains that have left
    }
    squares[static_cast<std::size_t>(thread)] = largest;
  });
  return std::sqrt(*std::max_element(squares.begin(), squares.end()));
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
  stopwatch.start(Phase::gas);
  gas->advance(particles, time());
  next_look = step;  // what was foreseen without knowing how the gas would push
}

StepPlan Simulation::Parts::decide() {
  StepPlan todo;
  todo.rebuild = is_list_old || time() >= next_wall_change;
  if (todo.rebuild) return todo;
  if (!world.is_alone()) {
    if (step >= next_look)
      todo.rebuild = look();
    else
      check_travel();
  } else if (travelled > allowed_travel()) {
    // The bound adds up the fastest grain of every step; where it is used up, look how far the grains have really come.
    travelled = largest_travel();
    todo.rebuild = travelled > 0.95 * allowed_travel();
  }
  return todo;
}

/// How much faster than the fastest grain one may become in a collision: two of the same mass, both at that speed, can give all their energy
/// to one (sqrt 2); a light grain that runs head-on into a heavy one comes back up to three times as fast.
double Simulation::Parts::speed_gain() const {
  return std::max(1.5, (3.0 * kind.mass_ratio - 1.0) / (kind.mass_ratio + 1.0));
}

/// All ranks look how far their grains have come since the rebuild, and agree: to rebuild now (true), or when to look again. Between looks
/// they need not talk: even if the grain that has come furthest becomes as fast as a collision can make it, and falls freely besides,
/// it stays within what the list allows. Nobody looks more than twice as far ahead as it has seen since the start, or since
/// a wall has come or gone. Where a look would gain little, the rebuild comes at once.
bool Simulation::Parts::look() {
  ++n_looks;
  travelled = largest_travel();
  std::array<double, 4> most = {travelled, result.max_speed, is_stop_wanted ? 1.0 : 0.0, largest_push()};
  world.max(most);
  is_stop_agreed = most[2] > 0.0;
  const double left = 0.95 * (allowed_travel() - most[0]);
  if (!(left > 0.0)) return true;
  // How many steps until that is used up: v n + g n (n + 1) / 2 = left, v and g in metres a step.
  const double g = (length(scene.time.gravity) + most[3]) * dt * dt, v = speed_gain() * most[1] * dt + 0.5 * g;
  const double reach =
      std::floor(2.0 * left / (v + std::sqrt(v * v + 2.0 * g * left)));  // infinite where nothing moves
  if (reach < std::max(1.0, 0.125 * static_cast<double>(steps_since_rebuild))) return true;
  const double furthest = body_force ? 1.0
                          : gas      ? std::min<double>(64.0, static_cast<double>(gas->until_next(step)))
                                     : 64.0;
  const double n = std::min({furthest, 2.0 * static_cast<double>(step - last_surprise) + 1.0, reach});
  next_look = step + static_cast<std::uint64_t>(n);
  return false;
}

/// Between looks, a rank whose grains have come too far all the same must not go on.
void Simulation::Parts::check_travel() {
  if (travelled <= allowed_travel()) return;
  travelled = largest_travel();
  if (travelled <= allowed_travel()) return;
  throw RunError(explain_stale_list(guard_view(), travelled, skin));
}

void Simulation::Parts::rebuild() {
  stopwatch.start(Phase::rebuild);
  ++n_rebuilds;
  if (contacts->are_set_aside()) trim_heap();  // of the image
  choose_skin();
  balance();
  place_at_rebuild = {};
  contacts->rebuild(particles, skin, time(), n_threads);
  after_rebuild();
}

void Simulation::Parts::after_rebuild() {
  is_list_old = false;
  travelled = 0.0;
  steps_since_rebuild = 0;
  n_left_at_rebuild = census.n_left;
  if (time() >= next_wall_change) last_surprise = step;
  next_wall_change = walls.next_change(time());
  place_at_rebuild.resize(static_cast<std::size_t>(particles.size()));
  parallel(n_threads, [&](int thread) {
    const Range share = share_of(particles.size(), thread, n_threads);
    for (std::int64_t i = share.begin; i < share.end; ++i)
      place_at_rebuild[static_cast<std::size_t>(i)] = particles.position(i);
  });
  if (world.is_alone()) return;
  if (look()) next_look = step + 1;  // they are that fast
  count();
}

/// How many grains there are by now, on all ranks.
void Simulation::Parts::count() {
  std::array<std::uint64_t, 2> counts = {census.n_born, census.n_left};
  world.sum(counts);
  n_born = counts[0];
  n_left = counts[1];
}

/// A kick over h [s].
Kick Simulation::Parts::kick_of(double h) const {
  const double c = scene.time.damping;
  Kick kick;
  kick.keep = (1.0 - 0.5 * c * h) / (1.0 + 0.5 * c * h);
  kick.gain = h / (1.0 + 0.5 * c * h);
  kick.spin_gain = h;
  kick.drift = dt;
  kick.drag_loss = 0.25 * c * h;
  kick.gravity = scene.time.gravity;
  kick.is_flat = scene.domain.dimensions == 2;
  return kick;
}

void Simulation::Parts::advance() {
  stopwatch.start(Phase::advance);
  // Velocities start at the positions, and are half a step behind them from then on.
  contacts->advance(particles, kick_of(step == 0 ? 0.5 * dt : dt), dt, travelled, n_threads, result);
  if (step == 0 && particles.has(Field::dissipated)) {  // rates are counted for half a step at the start
    double* const lost = particles.dissipated();
    for (std::ptrdiff_t i = 0; i < particles.size(); ++i) lost[4 * i] *= 0.5;
  }
  travelled += result.max_speed * dt;
}

bool Simulation::Parts::leaves_through_outlet(Vec3 position) const {
  const Box box = scene.domain.box();
  for (const Outlet& outlet : scene.outlets) {
    if (const int* face = std::get_if<int>(&outlet.where)) {
      const int axis = *face / 2;
      if (*face % 2 == 0 ? position[axis] < box.low[axis] : position[axis] >= box.high[axis]) return true;
    } else if (std::get<Box>(outlet.where).contains(position)) {
      return true;
    }
  }
  return false;
}

void Simulation::Parts::remove(std::int32_t i) {
  const double mass = 1.0 / particles.inverse_mass(i);
  ++census.n_left;
  if (world.is_alone()) n_left = census.n_left;
  census.mass_left.add(mass);
  contacts->clear_memory(particles, i);
  if (scene.output.energy) {
    census.energy_left.add(0.5 * mass * squared_length(particles.velocity(i)) -
                           mass * dot(scene.time.gravity, particles.position(i)));
    if (scene.contact.rotation)
      census.energy_left.add(0.5 / particles.inverse_inertia(i) * squared_length(particles.angular_velocity(i)));
    for (int k = 0; k < 4; ++k) census.energy_left.add(particles.dissipated()[4 * static_cast<std::ptrdiff_t>(i) + k]);
  }
  for (int c = 0; c < 3; ++c) {
    particles.set_real(Field::position, i, c, std::numeric_limits<double>::quiet_NaN());
    particles.set_real(Field::velocity, i, c, 0.0);
    if (scene.contact.rotation) particles.set_real(Field::angular_velocity, i, c, 0.0);
  }
}

void Simulation::Parts::cross_faces() {
  stopwatch.start(Phase::faces);
  const Box box = scene.domain.box();
  std::vector<std::int32_t> outside = result.outside;
  const bool has_boxes = std::any_of(scene.outlets.begin(), scene.outlets.end(),
                                     [](const Outlet& outlet) { return std::holds_alternative<Box>(outlet.where); });
  if (has_boxes)
    for (std::int32_t i = 0; i < particles.size(); ++i)
      if (particles.is_here(i) && box.contains(particles.position(i)) && leaves_through_outlet(particles.position(i)))
        outside.push_back(i);
  std::sort(outside.begin(), outside.end(),
            [&](std::int32_t x, std::int32_t y) { return particles.gid(x) < particles.gid(y); });
  for (const std::int32_t i : outside) {
    // A coordinate is wrapped in the step in which the grain crosses, because wrapping rounds.
    std::array<int, 3> steps{};
    for (int axis = 0; axis < 3; ++axis) {
      if (!scene.domain.periodic[static_cast<std::size_t>(axis)]) continue;
      const double x = particles.position(i)[axis], period = box.high[axis] - box.low[axis];
      int& by = steps[static_cast<std::size_t>(axis)];
      by = x < box.low[axis] ? 1 : x >= box.high[axis] ? -1 : 0;
      if (by == 0) continue;
      double wrapped = x + by * period;
      // rounding may put a grain just outside one face onto, or just outside, the other
      if (wrapped >= box.high[axis] || wrapped < box.low[axis]) wrapped = box.low[axis];
      particles.set_real(Field::position, i, axis, wrapped);
      place_at_rebuild[static_cast<std::size_t>(i)][axis] += by * period;
    }
    if (steps[0] || steps[1] || steps[2]) contacts->shift_images(i, steps);
    const Vec3 position = particles.position(i);
    if (leaves_through_outlet(position))
      remove(i);
    else if (!box.contains(position))
      throw RunError(explain_outside(guard_view(), i));
  }
}

/// What is wrong with positions and velocities that come from outside; empty where nothing is.
std::string Simulation::Parts::fault_of_grains() const {
  const Box box = scene.domain.box();
  const auto is_finite = [](Vec3 v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); };
  std::uint64_t n_away = 0;
  for (std::int32_t i = 0; i < particles.size(); ++i) {
    if (!particles.is_here(i)) {
      ++n_away;
      continue;
    }
    const bool is_sound = is_finite(particles.position(i)) && is_finite(particles.velocity(i)) &&
                          is_finite(particles.angular_velocity(i));
    if (is_sound && box.contains(particles.position(i))) continue;
    return "the grain with gid " + std::to_string(particles.gid(i)) +
           (is_sound ? " has been put outside the domain"
                     : " has been given a position or velocity that is not finite");
  }
  if (n_away != census.n_left - n_left_at_rebuild) return "a grain has been given a position that is not a number";
  return {};
}

void Simulation::Parts::guard() {
  stopwatch.start(Phase::guard);
  if (result.is_any_not_finite) throw RunError(explain_not_finite(guard_view()));
  if (result.has_large_overlap) throw RunError(explain_overlap(guard_view()));
  if (result.max_speed * dt > max_travel * kind.smallest_radius) {
    const std::int32_t fastest = fastest_grain(particles);
    if (fastest >= 0 && length(particles.velocity(fastest)) * dt > max_travel * particles.radius(fastest))
      throw RunError(explain_speed(guard_view(), fastest));
  }
}

void Simulation::Parts::tick() {
  ++step;
  ++steps_since_rebuild;
  stopwatch.start(Phase::observe);
}

void Simulation::Parts::check_start() {
  std::string worst;
  std::uint64_t n_deep = 0, first = ~std::uint64_t{0};
  contacts->for_each_contact(particles, dt, [&](const ContactReport& c) {
    if (!c.is_ours || !(c.overlap > checks::max_start_overlap * c.smaller_radius)) return;
    ++n_deep;
    if (particles.gid(c.grain) >= first) return;
    first = particles.gid(c.grain);
    worst = explain_start_overlap(guard_view(), c);
  });
  world.sum(std::span(&n_deep, 1));
  if (n_deep == 0) return;
  const std::vector<std::uint64_t> firsts = world.gather(first);
  world.broadcast(worst, static_cast<int>(std::min_element(firsts.begin(), firsts.end()) - firsts.begin()));
  if (n_deep > 1) worst += " (" + std::to_string(n_deep) + " such contacts)";
  throw SceneError({{"particles", worst, false}});
}

/// What contacts remember, for an image. Alone, as the image weighs as much as the list, the list goes meanwhile: the next rebuild
/// takes what pairs remember back from it.
void Simulation::Parts::take_memory(Image& image) {
  if (!world.is_alone()) {
    gather_memory(particles, *contacts, image);
    return;
  }
  is_list_old = true;
  std::vector<Vec3>().swap(place_at_rebuild);
  contacts->release_index();
  trim_heap();
  gather_memory(particles, *contacts, image);
  contacts->set_aside();
  contacts->give_back(carry_by_place(particles, image.pairs));
  trim_heap();
}

/// Makes list and ghosts good for the present positions, for those who look at contacts between steps.
void Simulation::Parts::renew_list() {
  if (decide().rebuild) rebuild();
  contacts->refresh(particles);
}

/// What all ranks have counted, with the energy that springs took along.
CensusTaker Simulation::Parts::full_census() const {
  CensusTaker own = census;
  own.energy_left.add(contacts->energy_left());
  return own.total(world);
}

EnergyLedger Simulation::Parts::energy() {
  renew_list();
  apply_body_force();
  const double h = step == 0 ? 0.0 : 0.5 * dt;  // how late the velocities are
  const double c = scene.time.damping;
  Kick half_kick = kick_of(h);
  half_kick.keep = 1.0 / (1.0 + c * h);
  half_kick.gain = h / (1.0 + c * h);
  half_kick.drift = 0.0;
  const Contacts::Velocities now = contacts->velocities_now(particles, half_kick, dt, n_threads);
  EnergyLedger ledger = take_ledger(world, particles, *contacts, now, scene.time.gravity, c, 2.0 * h);
  ledger.left = full_census().energy_left.value();
  if (!has_energy_initial) {
    energy_initial = ledger.total();
    has_energy_initial = true;
  }
  ledger.initial = energy_initial;
  return ledger;
}

/// Where the ranks share lists, each gives birth to its rows of them; else the first rank to all grains. The first
/// rebuild hands them over to those that they belong to.
void Simulation::Parts::bear_grains() {
  std::string problem;
  try {
    if (is_scattered(scene))
      put_grains(scene, make_grains(scene, n_threads, nullptr, world), listed_gids(scene), particles);
    else if (world.is_root())
      put_grains(scene, make_grains(scene, n_threads), particles);
  } catch (const SceneError& error) {
    if (world.is_alone()) throw;
    problem = error.what();
  }
  const std::vector<std::uint64_t> has_problem = world.gather(std::uint64_t{!problem.empty()});
  const auto first = std::find(has_problem.begin(), has_problem.end(), 1);
  if (first != has_problem.end()) {
    world.broadcast(problem, static_cast<int>(first - has_problem.begin()));
    throw SceneError({{"", problem, false}});
  }
  census.n_born = static_cast<std::uint64_t>(particles.size());
  for (std::int32_t i = 0; i < particles.size(); ++i) census.mass_born.add(1.0 / particles.inverse_mass(i));
  count();
  if (is_scattered(scene) && n_born != plan.n_grains)
    throw std::logic_error("the lists of the scene were read by other ranks than those that run it");
}

Image Simulation::Parts::image_head() const {
  Image image;
  image.step = step;
  image.time = time();
  image.time_step = dt;
  image.domain = scene.domain.box();
  image.periodic = scene.domain.periodic;
  return image;
}

Simulation::Simulation(const Scene& scene, int n_threads, const World& world) {
  check(scene, world);
  parts_ = std::make_unique<Parts>(scene, n_threads, world);
  Parts& p = *parts_;
  p.bear_grains();
  if (scene.gas) p.gas.emplace(scene, p.plan, world, n_threads);
  p.make_contacts();
  forget_lists(p.scene);
  p.rebuild();
  p.check_start();
  if (scene.output.energy) p.energy();
  p.stopwatch.start(Phase::observe);
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
  p.step = p.last_surprise = image.step;
  const CensusTaker census = CensusTaker::from(image.accumulators);
  if (world.is_root()) p.census = census;  // once over all ranks
  p.n_born = census.n_born;
  p.n_left = census.n_left;
  p.energy_initial = kept_number(image.accumulators, "energy_initial");
  p.has_energy_initial = scene.output.energy;
  for (std::size_t k = 0; k < p.probe_memory.size(); ++k)
    if (const auto found = image.accumulators.find("probe_" + scene.output.probes[k].name);
        found != image.accumulators.end())
      p.probe_memory[k] = found->second;
  PairCarry pairs;
  WallCarry wall_memory;
  put_rows(world, image, p.particles, pairs, wall_memory);
  if (scene.gas) {
    p.gas.emplace(scene, p.plan, world, n_threads);
    p.gas->restore(image);
  }
  p.make_contacts();
  forget_lists(p.scene);
  p.contacts->restore(p.particles, std::move(pairs), std::move(wall_memory), p.skin, p.time(), n_threads);
  p.after_rebuild();
  p.stopwatch.start(Phase::observe);
}

Simulation::~Simulation() = default;
Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;

void Simulation::step() {
  Parts& p = *parts_;
  p.advance_gas();
  const StepPlan todo = p.decide();
  if (todo.rebuild) p.rebuild();
  p.apply_body_force();
  p.advance();
  p.guard();
  p.cross_faces();
  p.tick();
}

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
  p.next_look = p.step;
  p.push.clear();
  p.contacts->set_push(nullptr);
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
  std::string fault = p.fault_of_grains();
  const std::vector<std::uint64_t> has_fault = p.world.gather(std::uint64_t{!fault.empty()});
  const auto first = std::find(has_fault.begin(), has_fault.end(), 1);
  if (first != has_fault.end()) {
    p.world.broadcast(fault, static_cast<int>(first - has_fault.begin()));
    throw std::invalid_argument(fault);
  }
  p.is_list_old = true;
  p.contacts->grains_changed();
}
const Scene& Simulation::scene() const { return parts_->scene; }
const Plan& Simulation::plan() const { return parts_->plan; }
std::uint64_t Simulation::step_number() const { return parts_->step; }
double Simulation::time() const { return parts_->time(); }
double Simulation::time_step() const { return parts_->dt; }
std::uint64_t Simulation::n_born() const { return parts_->n_born; }
std::uint64_t Simulation::n_left() const { return parts_->n_left; }
std::uint64_t Simulation::n_grains() const { return n_born() - n_left(); }
std::uint64_t Simulation::n_rebuilds() const { return parts_->n_rebuilds; }
std::uint64_t Simulation::n_looks() const { return parts_->n_looks; }
double Simulation::memory() const {
  const Parts& p = *parts_;
  return static_cast<double>(p.particles.memory() + p.contacts->memory() +
                             p.place_at_rebuild.capacity() * sizeof(Vec3) + (p.gas ? p.gas->memory() : 0));
}
std::vector<PhaseTime> Simulation::phases() const {
  std::vector<PhaseTime> rows = parts_->stopwatch.table();
  if (parts_->world.is_alone()) return rows;
  const double waited = parts_->contacts->ghosts().halo().waited();
  const auto advance = rows.begin() + static_cast<std::ptrdiff_t>(Phase::advance);
  advance->seconds -= waited;
  rows.insert(advance + 1, {"waiting for ghosts", waited});
  return rows;
}

HaloCounts Simulation::halo_counts() const { return parts_->contacts->ghosts().counts(); }
std::uint64_t Simulation::n_migrated() const { return parts_->contacts->n_migrated(); }
std::uint64_t Simulation::n_cuts() const { return parts_->n_cuts; }
std::int64_t Simulation::n_own_pairs() const { return parts_->contacts->n_pairs(); }
std::uint64_t Simulation::n_own_grains() const { return static_cast<std::uint64_t>(parts_->particles.size()); }

Hash128 Simulation::state_hash() const {
  // A wall that vanishes in this very step takes what its contacts remember along.
  if (parts_->contacts->are_set_aside() || parts_->time() >= parts_->next_wall_change) parts_->rebuild();
  parts_->contacts->refresh(parts_->particles);  // so that ghosts' contacts know who has left or crossed a face
  return moraine::state_hash(parts_->world, parts_->particles, *parts_->contacts, parts_->step,
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
  p.count();
  share_out_rows(p.world, p.n_born, image);
  if (p.gas) p.gas->gather_shown(image);
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
  p.count();
  share_out_rows(p.world, p.n_born, image);
  if (p.gas) p.gas->gather_kept(image);
  p.full_census().keep(image.accumulators);
  image.accumulators["energy_initial"] = {p.energy_initial};
  for (std::size_t k = 0; k < p.probe_memory.size(); ++k)
    if (!p.probe_memory[k].empty()) image.accumulators["probe_" + p.scene.output.probes[k].name] = p.probe_memory[k];
  return image;
}

EnergyLedger Simulation::energy() const {
  if (!parts_->scene.output.energy)
    throw std::logic_error("the scene keeps no energy ledger: set output.energy = true");
  parts_->count();
  return parts_->energy();
}

std::vector<std::string> Simulation::probe_columns(std::size_t probe) const {
  return moraine::probe_columns(parts_->scene, parts_->scene.output.probes.at(probe));
}

std::vector<double> Simulation::probe_row(std::size_t probe) {
  Parts& p = *parts_;
  const Probe& wanted = p.scene.output.probes.at(probe);
  p.renew_list();
  std::optional<EnergyLedger> ledger;
  if (p.scene.output.energy && wanted.kind == Probe::Kind::energy) ledger = p.energy();
  const CensusTaker all = p.full_census();
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
                       p.time(),
                       gas ? &*gas : nullptr};
  return moraine::probe_row(view, wanted, p.probe_memory[probe]);
}

}  // namespace moraine
