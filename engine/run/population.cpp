#include "engine/run/population.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <span>

#include "engine/particles/fill.hpp"
#include "engine/scene/agree.hpp"
#include "engine/threads.hpp"

namespace moraine {

Population::Population(const Scene& scene, const World& world, double dt)
    : scene_(scene),
      world_(world),
      dt_(dt),
      outlets_(scene),
      inlets_(scene, dt),
      census_(scene.materials.size(), scene.outlets.size()) {}

void Population::bear_first(Particles& particles, int n_threads) {
  agree(world_, [&] {
    const DealtGrains born = deal_grains(scene_, n_threads, world_);
    put_grains(scene_, born.seeds, born.gids, particles);
  });
  for (std::int32_t i = 0; i < particles.size(); ++i)
    census_.count_born(particles.material(i), 1.0 / particles.inverse_mass(i));
  count();
}

std::vector<Newborn> Population::bear(std::uint64_t step, const Surroundings& around) {
  std::vector<Newborn> born = inlets_.bear(step, around, n_born_);
  n_born_ += born.size();
  return born;
}

Births Population::births_of(const std::vector<Newborn>& born, const Subdomains& subdomains, Particles& particles) {
  std::vector<Newborn> own;
  for (const Newborn& grain : born)
    if (world_.is_alone() || subdomains.owner(grain.seed.position) == world_.rank()) own.push_back(grain);
  const auto n = static_cast<std::int32_t>(own.size());
  return {n, [this, &particles, own = std::move(own)](std::int32_t first) {
            std::int32_t i = first;
            for (const Newborn& grain : own) {
              put_grain(scene_, grain.seed, grain.gid, particles, i);
              census_.count_born(grain.seed.material, 1.0 / particles.inverse_mass(i));
              if (scene_.output.energy) census_.energy_left.add(-energy_of(particles, i));
              ++i;
            }
          }};
}

/// The outlet that takes the grain in this step, or -1.
int Population::outlet_of(const Crossing& step, std::int32_t i) const {
  const Vec3 now = step.particles.position(i);
  return outlets_.taking(now - dt_ * step.particles.velocity(i), now, step.begin, step.end);
}

/// Grains inside the domain that an outlet takes, ascending.
std::vector<std::int32_t> Population::leavers_inside(const Crossing& step) const {
  std::vector<std::int32_t> all;
  if (!outlets_.are_inside()) return all;
  const Particles& particles = step.particles;
  const Box box = scene_.domain.box();
  std::vector<std::vector<std::int32_t>> found(static_cast<std::size_t>(step.n_threads));
  parallel(step.n_threads, [&](int thread) {
    const Range share = share_of(particles.size(), thread, step.n_threads);
    for (std::int64_t k = share.begin; k < share.end; ++k) {
      const auto i = static_cast<std::int32_t>(k);
      if (particles.is_here(i) && box.contains(particles.position(i)) && outlet_of(step, i) >= 0)
        found[static_cast<std::size_t>(thread)].push_back(i);
    }
  });
  for (const std::vector<std::int32_t>& part : found) all.insert(all.end(), part.begin(), part.end());
  return all;
}

/// A coordinate is wrapped in the step in which the grain crosses, because wrapping rounds.
void Population::wrap(const Crossing& step, std::int32_t i) const {
  const Box box = scene_.domain.box();
  std::array<int, 3> steps{};
  for (int axis = 0; axis < 3; ++axis) {
    if (!scene_.domain.periodic[static_cast<std::size_t>(axis)]) continue;
    const double x = step.particles.position(i)[axis], period = box.high[axis] - box.low[axis];
    int& by = steps[static_cast<std::size_t>(axis)];
    by = x < box.low[axis] ? 1 : x >= box.high[axis] ? -1 : 0;
    if (by == 0) continue;
    double wrapped = x + by * period;
    // rounding may put a grain just outside one face onto, or just outside, the other
    if (wrapped >= box.high[axis] || wrapped < box.low[axis]) wrapped = box.low[axis];
    step.particles.set_real(Field::position, i, axis, wrapped);
  }
  if (steps[0] || steps[1] || steps[2]) step.contacts.shift_images(i, steps);
}

std::int32_t Population::cross_faces(std::vector<std::int32_t> outside, const Crossing& step) {
  const Particles& particles = step.particles;
  const std::vector<std::int32_t> leavers = leavers_inside(step);
  outside.insert(outside.end(), leavers.begin(), leavers.end());
  std::sort(outside.begin(), outside.end(),
            [&](std::int32_t x, std::int32_t y) { return particles.gid(x) < particles.gid(y); });
  for (const std::int32_t i : outside) {
    wrap(step, i);
    if (const int outlet = outlet_of(step, i); outlet >= 0)
      remove(step, i, static_cast<std::size_t>(outlet));
    else if (!scene_.domain.box().contains(particles.position(i)))
      return i;
  }
  return -1;
}

void Population::remove(const Crossing& step, std::int32_t i, std::size_t outlet) {
  Particles& particles = step.particles;
  census_.count_left(particles.material(i), 1.0 / particles.inverse_mass(i), outlet);
  if (world_.is_alone()) n_left_ = census_.n_left();
  if (const int inlet = inlets_.find(scene_.outlets[outlet].recycles); inlet >= 0)
    inlets_.take_back(static_cast<std::size_t>(inlet), {particles.gid(i), particles.radius(i), particles.material(i)});
  step.contacts.clear_memory(particles, i);
  if (scene_.output.energy) {
    census_.energy_left.add(energy_of(particles, i));
    for (int k = 0; k < 4; ++k) census_.energy_left.add(particles.dissipated()[4 * static_cast<std::ptrdiff_t>(i) + k]);
  }
  for (int c = 0; c < 3; ++c) {
    particles.set_real(Field::position, i, c, std::numeric_limits<double>::quiet_NaN());
    particles.set_real(Field::velocity, i, c, 0.0);
    if (scene_.contact.rotation) particles.set_real(Field::angular_velocity, i, c, 0.0);
  }
}

/// Kinetic, rotational and potential [J].
double Population::energy_of(const Particles& particles, std::int32_t i) const {
  const double mass = 1.0 / particles.inverse_mass(i);
  double energy =
      0.5 * mass * squared_length(particles.velocity(i)) - mass * dot(scene_.time.gravity, particles.position(i));
  if (scene_.contact.rotation)
    energy += 0.5 / particles.inverse_inertia(i) * squared_length(particles.angular_velocity(i));
  return energy;
}

void Population::count() {
  std::array<std::uint64_t, 2> counts = {census_.n_born(), census_.n_left()};
  world_.sum(counts);
  n_born_ = counts[0];
  n_left_ = counts[1];
}

CensusTaker Population::total(const Contacts& contacts) const {
  CensusTaker own = census_;
  own.energy_left.add(contacts.energy_left());
  own.wall_work.add(contacts.wall_sums().work);
  return own.total(world_);
}

void Population::keep(const Contacts& contacts, std::map<std::string, std::vector<double>>& accumulators) {
  total(contacts).keep(accumulators);
  accumulators.merge(inlets_.remembered(world_));
}

void Population::restore(const std::map<std::string, std::vector<double>>& accumulators, const Particles& particles) {
  CensusTaker inside = census_;
  for (std::int32_t i = 0; i < particles.size(); ++i)
    inside.count_born(particles.material(i), 1.0 / particles.inverse_mass(i));
  const CensusTaker kept = CensusTaker::from(accumulators, inside.total(world_));
  if (world_.is_root()) census_ = kept;  // once over all ranks
  n_born_ = kept.n_born();
  n_left_ = kept.n_left();
  inlets_.restore(accumulators);
}

}  // namespace moraine
