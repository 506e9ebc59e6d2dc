// The grains of a rank: storage by the field table. Those that it owns come first, then its ghosts: copies of grains that other
// ranks own and that touch, or may soon touch, its own.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/particles/aligned_array.hpp"
#include "engine/particles/fields.hpp"
#include "engine/scene/scene.hpp"
#include "kernels/base/vec3.hpp"

namespace moraine {

/// Which optional fields a scene needs.
struct FieldNeeds {
  bool rotation = true;
  bool energy = false;
  bool force = false;  // contact force of each grain, for output
  bool torque = false;
  bool gas = false;  // grains feel a gas
};

/// Where the values of one field of all grains of a rank lie, one row a grain.
struct FieldView {
  const FieldInfo* info = nullptr;
  void* values = nullptr;              // of the first grain; of the type in `info`
  std::int64_t n = 0;                  // grains
  std::int64_t stride = 0;             // [bytes] from grain to grain
  std::shared_ptr<const void> keeper;  // keeps the memory there; after the next rebuild the grains lie elsewhere
};

class Particles {
 public:
  explicit Particles(FieldNeeds needs);

  bool has(Field field) const;
  const FieldNeeds& needs() const { return needs_; }
  /// Grains that this rank owns.
  std::int32_t size() const { return size_; }
  std::int32_t n_ghosts() const { return n_ghosts_; }
  bool is_owned(std::int32_t i) const { return i < size_; }
  /// Index of the dummy record behind the last grain or ghost: it lies nowhere and touches nothing.
  std::int32_t dummy() const { return size_ + n_ghosts_; }
  /// Doubles from one hot record to the next.
  std::int64_t stride() const { return stride_; }

  /// Makes room for n grains; all values are lost, and there are no ghosts.
  void resize(std::int32_t n);
  /// Makes room for n ghosts behind the grains, which stay. Ghosts have the fields that travel with them, not yet set.
  void set_ghosts(std::int32_t n);

  double* records() { return records_.data(); }
  const double* records() const { return records_.data(); }
  double* record(std::int64_t i) { return records_.data() + i * stride_; }
  const double* record(std::int64_t i) const { return records_.data() + i * stride_; }

  Vec3 position(std::int64_t i) const { return vector(info(Field::position).record_slot, i); }
  Vec3 velocity(std::int64_t i) const { return vector(info(Field::velocity).record_slot, i); }
  Vec3 angular_velocity(std::int64_t i) const {
    return needs_.rotation ? vector(info(Field::angular_velocity).record_slot, i) : Vec3{};
  }
  double radius(std::int64_t i) const { return record(i)[3]; }
  double inverse_mass(std::int64_t i) const { return record(i)[7]; }
  double inverse_inertia(std::int64_t i) const { return needs_.rotation ? record(i)[11] : 0.0; }
  std::uint64_t gid(std::int64_t i) const { return gid_[static_cast<std::size_t>(i)]; }
  std::uint16_t material(std::int64_t i) const { return material_[static_cast<std::size_t>(i)]; }
  const std::uint64_t* gids() const { return gid_.data(); }
  const std::uint16_t* materials() const { return material_.data(); }
  double* dissipated() { return needs_.energy ? dissipated_.data() : nullptr; }
  const double* dissipated() const { return needs_.energy ? dissipated_.data() : nullptr; }
  double* force() { return needs_.force ? force_.data() : nullptr; }
  double* torque() { return needs_.torque ? torque_.data() : nullptr; }
  Vec3 gas_acceleration(std::int64_t i) const {
    const double* const a = gas_acceleration_.data() + 3 * i;
    return {a[0], a[1], a[2]};
  }
  double* gas_acceleration() { return needs_.gas ? gas_acceleration_.data() : nullptr; }
  /// False for a grain that has left the scene and waits to be removed.
  bool is_here(std::int64_t i) const { return record(i)[0] == record(i)[0]; }

  /// Reads and writes any real field by the table; component c of grain i.
  double real(Field field, std::int64_t i, int c) const;
  void set_real(Field field, std::int64_t i, int c, double value);
  /// The field must be there (has()).
  FieldView view(Field field);
  void set_gid(std::int64_t i, std::uint64_t gid) { gid_[static_cast<std::size_t>(i)] = gid; }
  void set_material(std::int64_t i, std::uint16_t m) { material_[static_cast<std::size_t>(i)] = m; }

  /// Puts grain order[i] at place i, for all fields; order may leave grains out. Behind them comes room for n_more grains that are
  /// not yet set. Ghosts are gone.
  void reorder(std::span<const std::int32_t> order, int n_threads, std::int32_t n_more = 0);

  /// Bytes held.
  std::size_t memory() const;

 private:
  Vec3 vector(int slot, std::int64_t i) const {
    const double* const v = record(i) + slot;
    return {v[0], v[1], v[2]};
  }
  const AlignedArray<double>& own_array(Field field) const;
  template <typename T>
  void gather(AlignedArray<T>& values, std::int64_t width, std::span<const std::int32_t> order, std::size_t n_rows,
              int n_threads);
  void set_dummy();

  FieldNeeds needs_;
  std::int64_t stride_;
  std::int32_t size_ = 0, n_ghosts_ = 0;
  std::size_t ghost_room_ = 0;  // ghosts to expect, so that they find room without a copy
  AlignedArray<double> records_;
  AlignedArray<std::uint64_t> gid_;
  AlignedArray<std::uint16_t> material_;
  AlignedArray<double> dissipated_, force_, torque_, gas_acceleration_;
};

/// Puts a grain at birth into storage, at place i.
void put_grain(const Scene& scene, const GrainSeed& seed, std::uint64_t gid, Particles& particles, std::int32_t i);
/// Puts grains at birth into storage, in the order of their gids, which count from 0. Throws SceneError where they are too many.
void put_grains(const Scene& scene, const std::vector<GrainSeed>& seeds, Particles& particles);
/// The same with these gids, one for each grain.
void put_grains(const Scene& scene, const std::vector<GrainSeed>& seeds, std::span<const std::uint64_t> gids,
                Particles& particles);

}  // namespace moraine
