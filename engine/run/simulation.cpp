#include "engine/run/simulation.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "engine/contacts/contacts.hpp"
#include "engine/particles/fill.hpp"
#include "engine/particles/particles.hpp"
#include "engine/run/guard.hpp"
#include "engine/run/probes.hpp"
#include "engine/run/state_hash.hpp"
#include "engine/threads.hpp"
#include "engine/walls/walls.hpp"

namespace moraine {

namespace {

/// A grain that moves further than this part of its radius in a step misses contacts.
constexpr double max_travel = 0.2;
/// Grains or walls may overlap by this part of the smaller radius at the start.
constexpr double max_start_overlap = 0.2;

FieldNeeds needs_of(const Scene& scene) {
  FieldNeeds needs;
  needs.rotation = scene.contact.rotation;
  needs.energy = scene.output.energy;
  const auto wants = [&](const char* name) {
    return std::find(scene.output.fields.begin(), scene.output.fields.end(), name) != scene.output.fields.end();
  };
  needs.force = wants("force");
  needs.torque = wants("torque") && scene.contact.rotation;
  return needs;
}

void check(const Scene& scene) {
  std::vector<Problem> problems = validate(scene);
  std::erase_if(problems, [](const Problem& problem) { return problem.is_warning; });
  if (!problems.empty()) throw SceneError(std::move(problems));
}

GrainKind kind_of(const Particles& particles) {
  GrainKind kind;
  for (std::int32_t i = 0; i < particles.size(); ++i) {
    const double r = particles.radius(i), m = particles.inverse_mass(i);
    if (i == 0) kind.inverse_mass = m;
    kind.smallest_radius = std::min(kind.smallest_radius, r);
    kind.largest_radius = std::max(kind.largest_radius, r);
    kind.is_uniform = kind.is_uniform && m == kind.inverse_mass && r == particles.radius(0) &&
                      particles.material(i) == particles.material(0);
  }
  return kind;
}

void put_image(const Image& image, Particles& particles) {
  particles.resize(static_cast<std::int32_t>(image.n_grains));
  for (const FieldInfo& row : field_table) {
    if (!particles.has(row.field) || row.travel == Travel::never) continue;
    const FieldArray* const array = image.find(row.field);
    if (!array)
      throw SceneError(
          {{"", "the checkpoint holds no field \"" + std::string(row.name) + "\", which the scene needs", false}});
    for (std::int32_t i = 0; i < particles.size(); ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (row.type == FieldType::gid)
        particles.set_gid(i, array->gids[k]);
      else if (row.type == FieldType::index)
        particles.set_material(i, array->indices[k]);
      else
        for (int c = 0; c < row.components; ++c)
          particles.set_real(row.field, i, c,
                             array->reals[k * static_cast<std::size_t>(row.components) + static_cast<std::size_t>(c)]);
    }
  }
}

/// Lists of start positions have done their work once the grains are born; they weigh as much as the grains.
void forget_lists(Scene& scene) {
  for (ParticleGroup& group : scene.particles)
    if (auto* listed = std::get_if<ListedGrains>(&group.fill)) std::vector<GrainSeed>().swap(listed->grains);
}

/// Places of gids in the image's order.
class PlaceOf {
 public:
  explicit PlaceOf(const Particles& particles) : gids_(particles.gids(), particles.gids() + particles.size()) {}
  std::int32_t operator()(std::uint64_t gid) const {
    const auto found = std::lower_bound(gids_.begin(), gids_.end(), gid);
    if (found == gids_.end() || *found != gid)
      throw SceneError(
          {{"", "the checkpoint remembers a contact of grain " + std::to_string(gid) + ", which it does not hold",
            false}});
    return static_cast<std::int32_t>(found - gids_.begin());
  }

 private:
  std::span<const std::uint64_t> gids_;
};

PairCarry carry_of(const std::vector<PairHistory>& pairs, const Particles& particles) {
  const PlaceOf place(particles);
  PairCarry carry;
  carry.begin.assign(static_cast<std::size_t>(particles.size()) + 1, 0);
  for (const PairHistory& pair : pairs) {  // in order of gid_low, which is the order of the places
    ++carry.begin[static_cast<std::size_t>(place(pair.gid_low)) + 1];
    carry.items.push_back({{pair.displacement[0], pair.displacement[1], pair.displacement[2]},
                           place(pair.gid_high),
                           static_cast<std::uint8_t>(pair.image)});
    if (particles.has(Field::dissipated)) carry.energy.push_back(pair.energy);
  }
  for (std::size_t i = 1; i < carry.begin.size(); ++i) carry.begin[i] += carry.begin[i - 1];
  return carry;
}

WallCarry carry_of(const std::vector<WallHistory>& walls, const Particles& particles) {
  const PlaceOf place(particles);
  WallCarry carry;
  for (const WallHistory& wall : walls) {
    WallCarry::Item item;
    item.grain = place(wall.gid);
    item.surface = static_cast<std::int32_t>(wall.surface);
    std::copy_n(wall.displacement, 3, item.memory.memory.displacement);
    item.memory.memory.energy = wall.energy;
    item.memory.normal = {wall.normal[0], wall.normal[1], wall.normal[2]};
    carry.items.push_back(item);
  }
  std::stable_sort(carry.items.begin(), carry.items.end(),
                   [](const auto& x, const auto& y) { return x.grain < y.grain; });
  return carry;
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
  GrainKind kind;
  Stopwatch stopwatch;

  std::uint64_t step = 0;
  double dt = 0.0;
  Census census;
  double energy_left = 0.0;  // [J] carried out through outlets
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

  World world;
  bool is_stop_wanted = false, is_stop_agreed = false;

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
  GuardView guard_view() const {
    return {scene, particles, *contacts, walls, time(), dt, step, plan.time_step.steps_per_contact};
  }

  void make_contacts();
  void choose_skin();
  double widest_skin() const;
  StepPlan decide();
  double largest_travel() const;
  void rebuild();
  Kick kick_of(double h) const;
  void advance();
  void cross_faces();
  void guard();
  void tick();

  void after_rebuild();
  bool leaves_through_outlet(Vec3 position) const;
  void remove(std::int32_t i);
  void check_start();
  void renew_list();
  EnergyLedger energy();
  FieldArray gather(const FieldInfo& row, const std::vector<std::int32_t>& order) const;
  std::vector<std::int32_t> order_by_gid() const;
  Image image_head() const;
};

void Simulation::Parts::make_contacts() {
  kind = kind_of(particles);
  contacts.emplace(scene, walls, kind);
  skin = plan.skin;
  choose_skin();
}

double Simulation::Parts::widest_skin() const {
  double widest = infinity;
  for (int axis = 0; axis < 3; ++axis)
    if (scene.domain.periodic[static_cast<std::size_t>(axis)])
      widest = std::min(widest, scene.domain.box().size()[axis] - 2.0 * kind.largest_radius);
  return widest;
}

/// The skin is a matter of speed only. A rebuild costs about as much as seven steps, and a wider skin s adds about 1.8 s/d to the
/// pairs (d the mean diameter); with N steps between rebuilds, N in proportion to s, the sum 7/N + 1.8 s/d is least at
/// N s/d = 4, which each rebuild moves towards.
void Simulation::Parts::choose_skin() {
  if (scene.run.skin <= 0.0 && n_rebuilds > 1 && steps_since_rebuild > 0) {
    const double diameter = 10.0 * plan.skin;
    const double wanted = std::sqrt(4.0 * diameter / (static_cast<double>(steps_since_rebuild) * skin));
    skin = std::clamp(skin * std::clamp(wanted, 0.7, 1.4), 0.01 * diameter, 0.5 * diameter);
  }
  const double widest = widest_skin();
  if (!(widest > 1e-6 * kind.largest_radius) && particles.size() > 0)
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

StepPlan Simulation::Parts::decide() {
  StepPlan todo;
  todo.rebuild = is_list_old || time() >= next_wall_change;
  // The bound adds up the fastest grain of every step; where it is used up, look how far the grains have really come.
  const double allowed = 0.5 * skin * (1.0 - 1e-9);
  if (!todo.rebuild && travelled > allowed) {
    travelled = largest_travel();
    todo.rebuild = travelled > 0.95 * allowed;
  }
  return todo;
}

void Simulation::Parts::rebuild() {
  stopwatch.start(Phase::rebuild);
  ++n_rebuilds;
  choose_skin();
  place_at_rebuild = {};
  contacts->rebuild(particles, skin, time(), n_threads);
  after_rebuild();
}

void Simulation::Parts::after_rebuild() {
  is_list_old = false;
  travelled = 0.0;
  steps_since_rebuild = 0;
  next_wall_change = walls.next_change(time());
  place_at_rebuild.resize(static_cast<std::size_t>(particles.size()));
  parallel(n_threads, [&](int thread) {
    const Range share = share_of(particles.size(), thread, n_threads);
    for (std::int64_t i = share.begin; i < share.end; ++i)
      place_at_rebuild[static_cast<std::size_t>(i)] = particles.position(i);
  });
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
  contacts->advance(particles, kick_of(step == 0 ? 0.5 * dt : dt), dt, n_threads, result);
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
  census.n_left += 1.0;
  census.mass_left += mass;
  energy_left += contacts->clear_memory(i);
  if (scene.output.energy) {
    energy_left +=
        0.5 * mass * squared_length(particles.velocity(i)) - mass * dot(scene.time.gravity, particles.position(i));
    if (scene.contact.rotation)
      energy_left += 0.5 / particles.inverse_inertia(i) * squared_length(particles.angular_velocity(i));
    for (int k = 0; k < 4; ++k) energy_left += particles.dissipated()[4 * static_cast<std::ptrdiff_t>(i) + k];
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
  std::vector<Problem> problems;
  std::int64_t n_deep = 0;
  std::uint64_t first = ~std::uint64_t{0};
  contacts->for_each_contact(particles, dt, [&](const ContactReport& c) {
    if (!(c.overlap > max_start_overlap * c.smaller_radius)) return;
    ++n_deep;
    if (particles.gid(c.grain) >= first) return;
    first = particles.gid(c.grain);
    const Vec3 p = particles.position(c.grain);
    const std::string other =
        c.other >= 0
            ? "grain " + std::to_string(particles.gid(c.other))
            : "wall \"" +
                  scene.walls[static_cast<std::size_t>(walls.surfaces()[static_cast<std::size_t>(c.surface)].wall)]
                      .name +
                  "\"";
    char where[160];
    std::snprintf(where, sizeof(where), "at (%.6g, %.6g, %.6g) m overlaps %s by %.3g of the smaller radius", p.x, p.y,
                  p.z, other.c_str(), c.overlap / c.smaller_radius);
    problems = {{"particles",
                 "at the start grain " + std::to_string(particles.gid(c.grain)) + " " + where +
                     "; at most 0.2 is allowed: move the grains apart or away from the wall",
                 false}};
  });
  if (n_deep == 0) return;
  if (n_deep > 1) problems[0].message += " (" + std::to_string(n_deep) + " such contacts)";
  throw SceneError(std::move(problems));
}

/// Makes the list good for the present positions, for those who look at contacts between steps.
void Simulation::Parts::renew_list() {
  if (decide().rebuild) rebuild();
}

EnergyLedger Simulation::Parts::energy() {
  renew_list();
  const double h = step == 0 ? 0.0 : 0.5 * dt;  // how late the velocities are
  const double c = scene.time.damping;
  Kick half_kick = kick_of(h);
  half_kick.keep = 1.0 / (1.0 + c * h);
  half_kick.gain = h / (1.0 + c * h);
  half_kick.drift = 0.0;
  const Contacts::Velocities now = contacts->velocities_now(particles, half_kick, dt, n_threads);
  EnergyLedger ledger = take_ledger(particles, *contacts, now, scene.time.gravity, c, 2.0 * h);
  ledger.left = energy_left;
  if (!has_energy_initial) {
    energy_initial = ledger.total();
    has_energy_initial = true;
  }
  ledger.initial = energy_initial;
  return ledger;
}

std::vector<std::int32_t> Simulation::Parts::order_by_gid() const {
  std::vector<std::int32_t> order;
  order.reserve(static_cast<std::size_t>(particles.size()));
  for (std::int32_t i = 0; i < particles.size(); ++i)
    if (particles.is_here(i)) order.push_back(i);
  std::sort(order.begin(), order.end(),
            [&](std::int32_t x, std::int32_t y) { return particles.gid(x) < particles.gid(y); });
  return order;
}

FieldArray Simulation::Parts::gather(const FieldInfo& row, const std::vector<std::int32_t>& order) const {
  FieldArray array;
  array.field = row.field;
  const std::size_t n = order.size() * static_cast<std::size_t>(row.components);
  if (row.type == FieldType::gid)
    array.gids.reserve(n);
  else if (row.type == FieldType::index)
    array.indices.reserve(n);
  else
    array.reals.reserve(n);
  for (const std::int32_t i : order) {
    if (row.type == FieldType::gid)
      array.gids.push_back(particles.gid(i));
    else if (row.type == FieldType::index)
      array.indices.push_back(particles.material(i));
    else
      for (int c = 0; c < row.components; ++c) array.reals.push_back(particles.real(row.field, i, c));
  }
  return array;
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
  check(scene);
  parts_ = std::make_unique<Parts>(scene, n_threads, world);
  Parts& p = *parts_;
  put_grains(scene, make_grains(scene, n_threads), p.particles);
  p.census.n_born = p.particles.size();
  for (std::int32_t i = 0; i < p.particles.size(); ++i) p.census.mass_born += 1.0 / p.particles.inverse_mass(i);
  p.make_contacts();
  forget_lists(p.scene);
  p.rebuild();
  p.check_start();
  if (scene.output.energy) p.energy();
  p.stopwatch.start(Phase::observe);
}

Simulation::Simulation(const Scene& scene, int n_threads, const Image& image, const World& world) {
  check(scene);
  parts_ = std::make_unique<Parts>(scene, n_threads, world);
  Parts& p = *parts_;
  if (image.time_step != p.dt)
    throw SceneError({{"time.step",
                       "is " + std::to_string(p.dt) + " s, but the checkpoint was written with " +
                           std::to_string(image.time_step) + " s; a run goes on with the step it had",
                       false}});
  if (!(image.domain == scene.domain.box()) || image.periodic != scene.domain.periodic)
    throw SceneError({{"domain", "is not the one that the checkpoint was written with", false}});
  put_image(image, p.particles);
  p.step = image.step;
  const auto number = [&](const char* name) {
    const auto found = image.accumulators.find(name);
    if (found == image.accumulators.end() || found->second.size() != 1)
      throw SceneError({{"", "the checkpoint holds no \"" + std::string(name) + "\"", false}});
    return found->second[0];
  };
  p.census = {number("born"), number("left"), number("mass_born"), number("mass_left")};
  p.energy_left = number("energy_left");
  p.energy_initial = number("energy_initial");
  p.has_energy_initial = scene.output.energy;
  for (std::size_t k = 0; k < p.probe_memory.size(); ++k)
    if (const auto found = image.accumulators.find("probe_" + scene.output.probes[k].name);
        found != image.accumulators.end())
      p.probe_memory[k] = found->second;
  p.make_contacts();
  forget_lists(p.scene);
  p.contacts->restore(p.particles, carry_of(image.pairs, p.particles), carry_of(image.walls, p.particles), p.skin,
                      p.time(), n_threads);
  p.after_rebuild();
  p.stopwatch.start(Phase::observe);
}

Simulation::~Simulation() = default;
Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;

void Simulation::step() {
  Parts& p = *parts_;
  const StepPlan todo = p.decide();
  if (todo.rebuild) p.rebuild();
  p.advance();
  p.guard();
  p.cross_faces();
  p.tick();
}

const World& Simulation::world() const { return parts_->world; }
void Simulation::ask_to_stop() {
  parts_->is_stop_wanted = true;
  if (parts_->world.is_alone()) parts_->is_stop_agreed = true;
}
bool Simulation::is_stop_agreed() const { return parts_->is_stop_agreed; }
const Scene& Simulation::scene() const { return parts_->scene; }
const Plan& Simulation::plan() const { return parts_->plan; }
std::uint64_t Simulation::step_number() const { return parts_->step; }
double Simulation::time() const { return parts_->time(); }
double Simulation::time_step() const { return parts_->dt; }
std::uint64_t Simulation::n_born() const { return static_cast<std::uint64_t>(parts_->census.n_born); }
std::uint64_t Simulation::n_left() const { return static_cast<std::uint64_t>(parts_->census.n_left); }
std::uint64_t Simulation::n_grains() const { return n_born() - n_left(); }
std::uint64_t Simulation::n_rebuilds() const { return parts_->n_rebuilds; }
double Simulation::memory() const {
  const Parts& p = *parts_;
  return static_cast<double>(p.particles.memory() + p.contacts->memory() +
                             p.place_at_rebuild.capacity() * sizeof(Vec3));
}
std::vector<PhaseTime> Simulation::phases() const { return parts_->stopwatch.table(); }
Hash128 Simulation::state_hash() const {
  return moraine::state_hash(parts_->particles, *parts_->contacts, parts_->step);
}

Image Simulation::snapshot(const std::vector<std::string>& fields) const {
  const Parts& p = *parts_;
  Image image = p.image_head();
  const std::vector<std::int32_t> order = p.order_by_gid();
  image.n_grains = order.size();
  for (const FieldInfo& row : field_table) {
    const bool is_asked = fields.empty()
                              ? row.travel != Travel::never || p.particles.has(row.field)
                              : row.field == Field::gid || row.field == Field::position || row.field == Field::radius ||
                                    std::find(fields.begin(), fields.end(), row.name) != fields.end();
    if (is_asked && p.particles.has(row.field)) image.fields.push_back(p.gather(row, order));
  }
  image.hash = state_hash();
  return image;
}

Image Simulation::checkpoint() const {
  const Parts& p = *parts_;
  Image image = p.image_head();
  const std::vector<std::int32_t> order = p.order_by_gid();
  image.n_grains = order.size();
  for (const FieldInfo& row : field_table)
    if (row.travel != Travel::never && p.particles.has(row.field)) image.fields.push_back(p.gather(row, order));
  std::size_t n_pairs = 0;
  p.contacts->for_each_memory(p.particles, [&](auto&&...) { ++n_pairs; });
  image.pairs.reserve(n_pairs);
  p.contacts->for_each_memory(p.particles, [&](std::int32_t a, std::int32_t b, std::uint8_t code, const PairMemory& m) {
    image.pairs.push_back({p.particles.gid(a),
                           p.particles.gid(b),
                           code,
                           {m.displacement[0], m.displacement[1], m.displacement[2]},
                           m.energy});
  });
  std::sort(image.pairs.begin(), image.pairs.end(), [](const PairHistory& x, const PairHistory& y) {
    return std::tuple(x.gid_low, x.gid_high, x.image) < std::tuple(y.gid_low, y.gid_high, y.image);
  });
  for (const WallCarry::Item& item : p.contacts->wall_carry().items) {
    const PairMemory& m = item.memory.memory;
    const Vec3 n = item.memory.normal;
    image.walls.push_back({p.particles.gid(item.grain),
                           static_cast<std::uint64_t>(item.surface),
                           {n.x, n.y, n.z},
                           {m.displacement[0], m.displacement[1], m.displacement[2]},
                           m.energy});
  }
  std::sort(image.walls.begin(), image.walls.end(), [](const WallHistory& x, const WallHistory& y) {
    return std::tuple(x.gid, x.surface, x.normal[0], x.normal[1], x.normal[2]) <
           std::tuple(y.gid, y.surface, y.normal[0], y.normal[1], y.normal[2]);
  });
  image.accumulators = {{"born", {p.census.n_born}},         {"left", {p.census.n_left}},
                        {"mass_born", {p.census.mass_born}}, {"mass_left", {p.census.mass_left}},
                        {"energy_left", {p.energy_left}},    {"energy_initial", {p.energy_initial}}};
  for (std::size_t k = 0; k < p.probe_memory.size(); ++k)
    if (!p.probe_memory[k].empty()) image.accumulators["probe_" + p.scene.output.probes[k].name] = p.probe_memory[k];
  image.hash = state_hash();
  return image;
}

EnergyLedger Simulation::energy() const {
  if (!parts_->scene.output.energy)
    throw std::logic_error("the scene keeps no energy ledger: set output.energy = true");
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
  const ProbeView view{p.scene,  p.walls, p.particles, *p.contacts, p.dt, ledger ? &*ledger : nullptr,
                       p.census, p.time()};
  return moraine::probe_row(view, wanted, p.probe_memory[probe]);
}

}  // namespace moraine
