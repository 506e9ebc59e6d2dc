#include "engine/particles/particles.hpp"

#include <algorithm>
#include <limits>

#include "engine/threads.hpp"
#include "kernels/base/sphere.hpp"

namespace moraine {

Particles::Particles(FieldNeeds needs)
    : needs_(needs), stride_(needs.rotation ? record_size_rotating : record_size_plain) {
  resize(0);
}

bool Particles::has(Field field) const {
  switch (info(field).need) {
    case Need::always: return true;
    case Need::rotation: return needs_.rotation;
    case Need::energy: return needs_.energy;
    case Need::gas: return needs_.gas;
    case Need::requested: return field == Field::force ? needs_.force : needs_.torque;
  }
  return false;
}

void Particles::resize(std::int32_t n) {
  const auto count = static_cast<std::size_t>(n);
  size_ = n;
  n_ghosts_ = 0;
  records_.resize_discarding((count + 1) * static_cast<std::size_t>(stride_));
  gid_.resize_discarding(count);
  material_.resize_discarding(count);
  if (needs_.energy) dissipated_.resize_discarding(4 * count);
  if (needs_.force) force_.resize_discarding(3 * count);
  if (needs_.torque) torque_.resize_discarding(3 * count);
  if (needs_.gas) gas_acceleration_.resize_discarding(3 * count);
  std::fill(dissipated_.begin(), dissipated_.end(), 0.0);
  std::fill(force_.begin(), force_.end(), 0.0);
  std::fill(torque_.begin(), torque_.end(), 0.0);
  std::fill(gas_acceleration_.begin(), gas_acceleration_.end(), 0.0);
  set_dummy();
}

void Particles::set_dummy() {
  double* const r = record(dummy());
  std::fill(r, r + stride_, 0.0);
  for (int k = 0; k < 3; ++k) r[k] = std::numeric_limits<double>::quiet_NaN();
  r[3] = 1.0;  // finite radius and mass keep the arithmetic of unused lanes free of exceptions
  r[7] = 1.0;
}

const AlignedArray<double>& Particles::own_array(Field field) const {
  switch (field) {
    case Field::dissipated: return dissipated_;
    case Field::force: return force_;
    case Field::torque: return torque_;
    default: return gas_acceleration_;
  }
}

double Particles::real(Field field, std::int64_t i, int c) const {
  const FieldInfo& row = info(field);
  if (row.record_slot >= 0) return record(i)[row.record_slot + c];
  return own_array(field)[static_cast<std::size_t>(i * row.components + c)];
}

void Particles::set_real(Field field, std::int64_t i, int c, double value) {
  const FieldInfo& row = info(field);
  if (row.record_slot >= 0)
    record(i)[row.record_slot + c] = value;
  else
    const_cast<AlignedArray<double>&>(own_array(field))[static_cast<std::size_t>(i * row.components + c)] = value;
}

FieldView Particles::view(Field field) {
  FieldView view;
  view.info = &info(field);
  view.n = size_;
  const auto show = [&](auto& array, std::int64_t first, std::int64_t width) {
    view.values = array.data() + first;
    view.stride = width * static_cast<std::int64_t>(sizeof(*array.data()));
    view.keeper = array.keeper();
  };
  if (view.info->record_slot >= 0)
    show(records_, view.info->record_slot, stride_);
  else if (field == Field::gid)
    show(gid_, 0, 1);
  else if (field == Field::material)
    show(material_, 0, 1);
  else
    show(const_cast<AlignedArray<double>&>(own_array(field)), 0, view.info->components);
  return view;
}

template <typename T>
void Particles::gather(AlignedArray<T>& values, std::int64_t width, std::span<const std::int32_t> order,
                       std::size_t n_rows, int n_threads) {
  AlignedArray<T> sorted;
  sorted.resize_discarding(n_rows * static_cast<std::size_t>(width));
  parallel(n_threads, [&](int thread) {
    const Range share = share_of(static_cast<std::int64_t>(order.size()), thread, n_threads);
    for (std::int64_t i = share.begin; i < share.end; ++i)
      std::copy_n(values.data() + order[static_cast<std::size_t>(i)] * width, width, sorted.data() + i * width);
  });
  values = std::move(sorted);
}

void Particles::reorder(std::span<const std::int32_t> order, int n_threads, std::int32_t n_more) {
  const std::size_t n_old = order.size(), n = n_old + static_cast<std::size_t>(n_more);
  const std::size_t with_ghosts = n + ghost_room_ + 1;
  gather(records_, stride_, order, with_ghosts, n_threads);
  gather(gid_, 1, order, with_ghosts, n_threads);
  gather(material_, 1, order, with_ghosts, n_threads);
  const auto gather_own = [&](AlignedArray<double>& values, bool is_needed, std::int64_t width) {
    if (!is_needed) return;
    gather(values, width, order, n, n_threads);
    std::fill(values.begin() + n_old * static_cast<std::size_t>(width), values.end(), 0.0);
  };
  gather_own(dissipated_, needs_.energy, 4);
  gather_own(force_, needs_.force, 3);
  gather_own(torque_, needs_.torque, 3);
  gather_own(gas_acceleration_, needs_.gas, 3);
  size_ = static_cast<std::int32_t>(n);
  n_ghosts_ = 0;
  set_dummy();
}

void Particles::set_ghosts(std::int32_t n) {
  const auto total = static_cast<std::size_t>(size_ + n);
  records_.resize_keeping((total + 1) * static_cast<std::size_t>(stride_));
  gid_.resize_keeping(total + 1);
  material_.resize_keeping(total + 1);
  n_ghosts_ = n;
  ghost_room_ = static_cast<std::size_t>(n + n / 16);
  set_dummy();
}

std::size_t Particles::memory() const {
  return records_.capacity_bytes() + gid_.capacity_bytes() + material_.capacity_bytes() + dissipated_.capacity_bytes() +
         force_.capacity_bytes() + torque_.capacity_bytes() + gas_acceleration_.capacity_bytes();
}

void put_grain(const Scene& scene, const GrainSeed& seed, std::uint64_t gid, Particles& particles, std::int32_t i) {
  const bool has_rotation = particles.has(Field::angular_velocity);
  const double mass = scene.materials[seed.material].density * sphere_volume(seed.radius);
  for (int c = 0; c < 3; ++c) {
    particles.set_real(Field::position, i, c, seed.position[c]);
    particles.set_real(Field::velocity, i, c, seed.velocity[c]);
    if (has_rotation) particles.set_real(Field::angular_velocity, i, c, seed.angular_velocity[c]);
  }
  particles.set_real(Field::radius, i, 0, seed.radius);
  particles.set_real(Field::inverse_mass, i, 0, 1.0 / mass);
  if (has_rotation) particles.set_real(Field::inverse_inertia, i, 0, 1.0 / sphere_inertia(mass, seed.radius));
  if (scene.domain.dimensions == 2) particles.set_real(Field::velocity, i, 2, 0.0);
  particles.set_gid(i, gid);
  particles.set_material(i, seed.material);
}

void put_grains(const Scene& scene, const std::vector<GrainSeed>& seeds, Particles& particles) {
  if (seeds.size() >= (std::size_t{1} << 30))
    throw SceneError({{"particles", "more than 2^30 grains in one rank; use more ranks", false}});
  particles.resize(static_cast<std::int32_t>(seeds.size()));
  for (std::int32_t i = 0; i < particles.size(); ++i)
    put_grain(scene, seeds[static_cast<std::size_t>(i)], static_cast<std::uint64_t>(i), particles, i);
}

void put_grains(const Scene& scene, const std::vector<GrainSeed>& seeds, std::span<const std::uint64_t> gids,
                Particles& particles) {
  put_grains(scene, seeds, particles);
  for (std::int32_t i = 0; i < particles.size(); ++i) particles.set_gid(i, gids[static_cast<std::size_t>(i)]);
}

}  // namespace moraine
