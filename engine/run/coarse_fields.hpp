// Coarse-grained fields on a user's grid (Probe::Kind::fields): density, momentum, stress and granular temperature of the grains, such
// that mass and momentum balance. See README.md, "Coarse-grained fields".
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "comm/grid_share.hpp"
#include "comm/world.hpp"
#include "engine/contacts/contacts.hpp"
#include "engine/gas/grid_field.hpp"
#include "engine/run/cell_weights.hpp"
#include "engine/run/image.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

/// The grains at a moment, list and ghosts good for their places.
struct FieldSample {
  const Particles& particles;
  const Contacts& contacts;
  std::span<const Vec3> velocities;  // [m/s] of each grain, at the time of the positions
  const double* push = nullptr;      // [m/s2] of gas and others, three a grain, or nothing
  double time = 0.0;                 // [s]
  double dt = 0.0;                   // [s]
  int n_threads = 1;
};

/// The grid of a probe: cells of its region, and those of the margin.
WeightGrid field_grid(const Scene& scene, const Probe& probe);

/// What such a probe holds on all ranks together while it takes a sample, rather more than less [bytes].
double memory_of_fields(const Scene& scene, const Probe& probe);

class CoarseFields {
 public:
  CoarseFields(const Scene& scene, const Probe& probe, const World& world);

  /// Adds up the grains as they are; before Probe::from they are looked at only. Returns a row of the time series. All ranks.
  std::vector<double> add(const FieldSample& sample);
  static std::vector<std::string> columns();

  std::uint64_t n_samples() const { return n_samples_; }
  /// Means over the samples so far; every rank has consecutive values of each array. All ranks.
  FieldImage image() const;
  /// Forgets the samples.
  void begin();

  /// To and from a checkpoint, so that averages go on where they were. Where it has none, or of another grid, they begin anew. All ranks.
  void keep(Image& image) const;
  void restore(const Image& image);

  std::size_t memory() const;

 private:
  struct Branch;
  class Sums;
  using Values = std::vector<double>;
  std::vector<Branch> branches_of(const FieldSample& sample) const;
  std::vector<double> scales_for(const FieldSample& sample, const std::vector<Branch>& branches) const;
  std::vector<Vec3> images_of(Vec3 begin, Vec3 way) const;
  void set_grain(const FieldSample& sample, std::int32_t i, Values& values) const;
  void make_room(const FieldSample& sample, const std::vector<Branch>& branches, Range grains, Range lines,
                 Sums& sums) const;
  void add_grains(const FieldSample& sample, const std::vector<double>& scales, Range grains, Sums& sums) const;
  void add_branches(const std::vector<Branch>& branches, const std::vector<double>& scales, Range lines,
                    Sums& sums) const;
  std::vector<Parcel> deposit(const FieldSample& sample, const std::vector<Branch>& branches,
                              const std::vector<double>& scales) const;
  std::vector<std::int64_t> collected(const std::vector<Parcel>& parcels) const;
  std::vector<double> row_of(const FieldSample& sample, const std::vector<double>& totals) const;
  std::size_t first_of_all() const;  // number of the first quantity that is of all grains together
  double cell_volume() const;        // [m3]
  std::string sum_name(std::size_t quantity) const;
  std::string counts_name() const;

  World world_;
  std::string name_;
  std::vector<std::string> species_;     // names of materials; one without name: all together
  std::vector<std::size_t> species_of_;  // of each material of the scene
  Vec3 gravity_;                         // [m/s2]
  double damping_ = 0.0, from_ = 0.0;    // [1/s], [s]
  double dimensions_ = 3.0;
  WeightGrid grid_;
  std::array<double, 3> image_period_{};  // [m] of axes along which the grid has a part of the period only; else 0
  Box box_;
  GridShare share_;
  CellBlock block_;  // of this rank
  std::uint64_t n_samples_ = 0;
  double first_time_ = 0.0, last_time_ = 0.0;  // [s] of samples
  std::vector<GridField<>> sums_;              // of each quantity, over samples
};

}  // namespace moraine
