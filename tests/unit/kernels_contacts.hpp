// Thousands of random contacts for tests of the sweeps: touching or not, sliding or sticking, closing or separating, of all
// size ratios and several materials, across periodic images, with and without something to remember.
#pragma once

#include <hwy/targets.h>

#include <cstring>
#include <numbers>
#include <string>
#include <vector>

#include "engine/contacts/cells.hpp"
#include "engine/particles/aligned_array.hpp"
#include "kernels/contact/reference/reference.hpp"
#include "kernels/contact/sweep.hpp"
#include "tests/support/surface_shapes.hpp"

namespace moraine::kernels_test {

inline constexpr int n_species = 6;
inline constexpr double dt = 1e-5;

inline std::vector<LawChoice> all_choices() {
  std::vector<LawChoice> all;
  for (const NormalLaw normal : {NormalLaw::linear, NormalLaw::hertz})
    for (const TangentialLaw tangential : {TangentialLaw::none, TangentialLaw::viscous, TangentialLaw::spring,
                                           TangentialLaw::mindlin, TangentialLaw::power})
      if (is_listed(normal, tangential))
        for (int bits = 0; bits < 8; ++bits)
          all.push_back({normal, tangential, (bits & 1) != 0, (bits & 2) != 0, (bits & 4) != 0});
  return all;
}

inline std::string name_of(const LawChoice& c) {
  static constexpr const char* tangential[] = {"none", "viscous", "spring", "mindlin", "power"};
  return std::string(c.normal == NormalLaw::linear ? "linear" : "hertz") + " " +
         tangential[static_cast<int>(c.tangential)] + (c.has_rotation ? ", rotation" : "") +
         (c.is_uniform ? ", uniform" : "") + (c.has_ledger ? ", ledger" : "");
}

inline LawTable random_table(shapes::Dice& dice) {
  LawTable table;
  for (std::size_t row = 0; row < n_species; ++row) {
    PairParameters p;
    p[Parameter::normal_stiffness] = std::exp(dice.uniform(std::log(1e3), std::log(1e5)));
    p[Parameter::young] = std::exp(dice.uniform(std::log(1e6), std::log(1e8)));
    p[Parameter::shear] = p[Parameter::young] * dice.uniform(0.2, 0.4);
    p[Parameter::damping] = row == 1 ? 0.0 : dice.uniform(0.0, 0.6);
    p[Parameter::tangential_stiffness] = p[Parameter::normal_stiffness] * dice.uniform(0.1, 1.0);
    p[Parameter::tangential_damping] = row == 2 ? 0.0 : dice.uniform(0.0, 1.0);
    p[Parameter::friction] = row == 3 ? 0.0 : dice.uniform(0.1, 1.0);
    p[Parameter::viscosity] = dice.uniform(0.1, 50.0);
    p[Parameter::displacement] = row % 2 ? 0.0 : dice.uniform(1e-6, 1e-4);
    table.set(row, p);
  }
  return table;
}

/// True where the tangential law remembers a displacement.
inline bool has_history(const LawChoice& c) {
  return c.tangential != TangentialLaw::none && c.tangential != TangentialLaw::viscous;
}

/// A vector across `normal` of random direction.
inline Vec3 tangent(shapes::Dice& dice, Vec3 normal, double size) {
  return size * normalized(cross(normal, dice.direction()));
}

/// Sizes of history from nothing to far beyond what friction holds.
inline double random_size(shapes::Dice& dice) {
  return dice.index(4) == 0 ? 0.0 : std::pow(10.0, dice.uniform(-8.0, -3.5));
}

/// Pairs of two grains each, filled up with the dummy; grain 2k and 2k + 1 belong to pair k.
struct Pairs {
  LawChoice choice;
  LawTable table;
  int n = 0;  // without filling
  AlignedArray<double> records, history, slots;
  std::vector<std::int32_t> a, b;
  std::vector<std::uint8_t> image, species;
  std::vector<Vec3> shifts;
  double inverse_mass = 0.0, radius = 0.0;

  double* record(std::int32_t i) { return records.data() + std::int64_t{i} * record_size(choice.has_rotation); }
  const double* record(std::int32_t i) const {
    return records.data() + std::int64_t{i} * record_size(choice.has_rotation);
  }
  int columns() const { return memory_columns(choice.has_ledger); }
  /// Displacement and stored energy of pair k.
  std::array<double, 4> memory(std::int64_t k) const {
    std::array<double, 4> row{};
    for (int c = 0; c < columns(); ++c)
      row[static_cast<std::size_t>(c)] = history[static_cast<std::size_t>(memory_at(k, c, columns()))];
    return row;
  }
  void set_memory(std::int64_t k, const std::array<double, 4>& row) {
    for (int c = 0; c < columns(); ++c)
      history[static_cast<std::size_t>(memory_at(k, c, columns()))] = row[static_cast<std::size_t>(c)];
  }
  int slot_doubles() const { return slot_size(choice.has_rotation, choice.has_ledger); }
  Range range() const { return {0, static_cast<std::int64_t>(a.size())}; }
  PairSweep sweep() {
    return {records.data(),
            a.data(),
            b.data(),
            image.data(),
            shifts.data(),
            choice.is_uniform ? nullptr : species.data(),
            history.data(),
            &table,
            inverse_mass,
            radius,
            dt,
            0.5};
  }
  SweepResult run() { return contact_kernels(choice).pairs(sweep(), range(), slots.data()); }
};

inline void put_dummy(double* r, bool has_rotation) {
  std::fill_n(r, record_size(has_rotation), 0.0);
  r[0] = r[1] = r[2] = std::nan("");
  r[3] = r[7] = 1.0;
}

inline Pairs random_pairs(const LawChoice& choice, int n, std::uint64_t seed) {
  shapes::Dice dice(seed);
  Pairs pairs;
  pairs.choice = choice;
  pairs.table = random_table(dice);
  pairs.n = n;
  const auto filled = static_cast<std::size_t>((n + pair_group - 1) / pair_group * pair_group);
  const std::int32_t dummy = 2 * n;
  pairs.a.assign(filled, dummy);
  pairs.b.assign(filled, dummy);
  pairs.image.assign(filled, 0);
  pairs.species.assign(filled, 0);
  pairs.history.resize_discarding(static_cast<std::size_t>(pairs.columns()) * filled);
  pairs.slots.resize_discarding(filled * static_cast<std::size_t>(pairs.slot_doubles()));
  pairs.records.resize_discarding(static_cast<std::size_t>((2 * n + 1) * record_size(choice.has_rotation)));
  std::fill(pairs.history.begin(), pairs.history.end(), 0.0);
  std::fill(pairs.slots.begin(), pairs.slots.end(), 1e300);
  put_dummy(pairs.record(dummy), choice.has_rotation);
  const Vec3 period{1.3, 1.7, 2.1};
  for (int code = 0; code < static_cast<int>(image::n_codes); ++code) {
    const auto steps = image::steps(static_cast<std::uint8_t>(code));
    pairs.shifts.push_back({steps[0] * period.x, steps[1] * period.y, steps[2] * period.z});
  }
  pairs.radius = 0.004;
  pairs.inverse_mass = 1.0 / (2500.0 * 4.0 / 3.0 * std::numbers::pi * std::pow(pairs.radius, 3));
  for (int k = 0; k < n; ++k) {
    const auto p = static_cast<std::size_t>(k);
    const std::int32_t i = 2 * k, j = 2 * k + 1;
    pairs.a[p] = dice.index(2) ? i : j;
    pairs.b[p] = pairs.a[p] == i ? j : i;
    if (dice.index(5) == 0) pairs.image[p] = static_cast<std::uint8_t>(dice.index(image::n_codes));
    if (!choice.is_uniform) pairs.species[p] = static_cast<std::uint8_t>(dice.index(n_species));
    double radii[2] = {pairs.radius, pairs.radius};
    if (!choice.is_uniform) {
      radii[0] = 0.01 * std::pow(10.0, dice.uniform(-1.0, 0.0));
      radii[1] = radii[0] * std::pow(10.0, dice.uniform(-1.3, 0.0));
    }
    const double smaller = std::min(radii[0], radii[1]);
    // a third part or so only near each other
    const double overlap =
        smaller * (dice.index(3) == 0 ? -dice.uniform(0.0, 0.3) : std::pow(10.0, dice.uniform(-3.0, -0.4)));
    const Vec3 normal = dice.direction();
    const Vec3 separation = (radii[0] + radii[1] - overlap) * normal;
    const Vec3 at_b = dice.point({0, 0, 0}, period);
    const Vec3 at_a = at_b + separation - pairs.shifts[pairs.image[p]];
    const double speed = std::pow(10.0, dice.uniform(-4.0, 0.5));
    for (int side = 0; side < 2; ++side) {
      double* const r = pairs.record(side ? pairs.b[p] : pairs.a[p]);
      const Vec3 x = side ? at_b : at_a, v = speed * dice.direction(), w = speed / smaller * dice.direction();
      const double mass = 2500.0 * 4.0 / 3.0 * std::numbers::pi * std::pow(radii[side], 3);
      const double values[12] = {x.x, x.y, x.z, radii[side],
                                 v.x, v.y, v.z, choice.is_uniform ? pairs.inverse_mass : 1.0 / mass,
                                 w.x, w.y, w.z, 1.0 / (0.4 * mass * radii[side] * radii[side])};
      std::copy_n(values, record_size(choice.has_rotation), r);
    }
    const Vec3 h = tangent(dice, normalized(normal + 0.01 * dice.direction()), random_size(dice));
    const double stored = squared_length(h) > 0.0 ? 1e-6 * dice.uniform(0.0, 1.0) : 0.0;
    if (has_history(choice)) pairs.set_memory(k, {h.x, h.y, h.z, stored});
  }
  return pairs;
}

/// What the reference makes of pair k, as it is before the sweep.
struct Expected {
  bool touches = false;
  ReferenceContact contact;
  ReferenceForce force;
  double normal_scale = 0.0;      // [N] of the terms that add up to the force
  double tangential_scale = 0.0;  // [N]
};

inline ContactBody body_of(const double* r, bool has_rotation, double arm) {
  return {{r[4], r[5], r[6]}, has_rotation ? Vec3{r[8], r[9], r[10]} : Vec3{}, r[7], 1.0 / r[3], arm};
}

inline Expected expected_of(const Pairs& pairs, int k) {
  const auto p = static_cast<std::size_t>(k);
  const double* const a = pairs.record(pairs.a[p]);
  const double* const b = pairs.record(pairs.b[p]);
  Expected expected;
  const Vec3 separation = Vec3{a[0] - b[0], a[1] - b[1], a[2] - b[2]} + pairs.shifts[pairs.image[p]];
  const double distance = length(separation);
  expected.contact.overlap = a[3] + b[3] - distance;
  expected.touches = expected.contact.overlap > 0.0;
  if (!expected.touches) return expected;
  expected.contact.normal = separation / distance;
  expected.contact.a = body_of(a, pairs.choice.has_rotation, a[3] - 0.5 * expected.contact.overlap);
  expected.contact.b = body_of(b, pairs.choice.has_rotation, b[3] - 0.5 * expected.contact.overlap);
  const std::array<double, 4> h = pairs.memory(k);
  expected.contact.displacement = {h[0], h[1], h[2]};
  expected.contact.stored = h[3];
  expected.force = reference_contact(pairs.choice.normal, pairs.choice.tangential, pairs.choice.has_rotation,
                                     pairs.table.at(pairs.species[p]), expected.contact, dt);
  return expected;
}

/// The instruction sets that kernels have been compiled for and this machine has.
inline std::vector<std::int64_t> targets() {
  std::vector<std::int64_t> all;
  for (const std::int64_t target : {std::int64_t{HWY_AVX2}, std::int64_t{HWY_AVX3}})
    if (hwy::SupportedTargets() & target) all.push_back(target);
  return all;
}

/// Has kernels chosen for one instruction set while it lives.
class OnTarget {
 public:
  explicit OnTarget(std::int64_t target) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(target);
  }
  ~OnTarget() {
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  }
  OnTarget(const OnTarget&) = delete;
  OnTarget& operator=(const OnTarget&) = delete;
};

inline bool same_bits(const double* x, const double* y, std::size_t n) {
  return std::memcmp(x, y, n * sizeof(double)) == 0;
}

}  // namespace moraine::kernels_test
