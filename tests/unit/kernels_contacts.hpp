// Thousands of random contacts for tests of the sweeps: touching or not, sliding or sticking, closing or separating, of all
// size ratios and several materials, across periodic images, with and without something to remember.
#pragma once

#include <hwy/targets.h>

#include <algorithm>
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

/// Combinations with rolling resistance or cohesion. (For them a uniform sweep is the general one.)
inline std::vector<LawChoice> further_choices() {
  std::vector<LawChoice> all;
  for (const auto& [normal, tangential] :
       {std::pair{NormalLaw::linear, TangentialLaw::spring}, std::pair{NormalLaw::hertz, TangentialLaw::mindlin}})
    for (const RollingLaw rolling : {RollingLaw::none, RollingLaw::constant, RollingLaw::spring})
      for (const CohesionLaw cohesion :
           {CohesionLaw::none, CohesionLaw::jkr, CohesionLaw::sjkr, CohesionLaw::linear, CohesionLaw::liquid_bridge})
        for (int bits = 0; bits < 4; ++bits) {
          const LawChoice choice{normal, tangential, (bits & 1) != 0, false, (bits & 2) != 0, rolling, cohesion};
          if (choice.has_further() && is_listed(choice)) all.push_back(choice);
        }
  return all;
}

inline std::vector<LawChoice> choices_in_double() {
  std::vector<LawChoice> all = further_choices();
  for (const NormalLaw normal : {NormalLaw::linear, NormalLaw::hertz})
    for (const TangentialLaw tangential : {TangentialLaw::none, TangentialLaw::viscous, TangentialLaw::spring,
                                           TangentialLaw::mindlin, TangentialLaw::power})
      if (is_listed({normal, tangential}))
        for (int bits = 0; bits < 8; ++bits)
          all.push_back({normal, tangential, (bits & 1) != 0, (bits & 2) != 0, (bits & 4) != 0});
  return all;
}

inline std::vector<LawChoice> all_choices() {
  std::vector<LawChoice> all = choices_in_double();
  const std::size_t n = all.size();
  for (std::size_t k = 0; k < n; ++k) {
    all.push_back(all[k]);
    all.back().is_mixed = true;
  }
  return all;
}

inline std::string name_of(const LawChoice& c) {
  static constexpr const char* tangential[] = {"none", "viscous", "spring", "mindlin", "power"};
  return std::string(c.normal == NormalLaw::linear ? "linear" : "hertz") + " " +
         tangential[static_cast<int>(c.tangential)] +
         (c.has_further() ? ", rolling " + std::string(moraine::name_of(c.rolling)) + ", cohesion " +
                                std::string(moraine::name_of(c.cohesion))
                          : "") +
         (c.has_rotation ? ", rotation" : "") + (c.is_uniform ? ", uniform" : "") + (c.has_ledger ? ", ledger" : "") +
         (c.is_mixed ? ", mixed precision" : "");
}

inline LawTable random_table(shapes::Dice& dice, CohesionLaw cohesion = CohesionLaw::none) {
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
    p[Parameter::rolling_friction] = row == 4 ? 0.0 : dice.uniform(0.05, 0.5);
    p[Parameter::rolling_stiffness] = row == 5 ? std::exp(dice.uniform(std::log(1e-2), std::log(1.0))) : 0.0;
    p[Parameter::rolling_damping] = row == 2 ? 0.0 : dice.uniform(0.0, 1.0);
    constexpr double most[] = {0.0, 30.0, 1e6, 5.0, 2.0};  // J/m2, J/m3, N, N/m
    p[Parameter::cohesion] = row == 0 ? 0.0 : most[static_cast<int>(cohesion)] * dice.uniform(0.1, 1.0);
    p[Parameter::cohesion_range] = row == 1 ? 0.0 : std::exp(dice.uniform(std::log(1e-4), std::log(1e-3)));
    p[Parameter::liquid_volume] = std::pow(p[Parameter::cohesion_range], 3);
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
  std::vector<std::uint16_t> was_near;
  std::vector<std::int32_t> a, b;
  std::vector<std::uint8_t> image, species;
  std::vector<Vec3> shifts;
  double inverse_mass = 0.0, radius = 0.0;

  double* record(std::int32_t i) { return records.data() + std::int64_t{i} * record_size(choice.has_rotation); }
  const double* record(std::int32_t i) const {
    return records.data() + std::int64_t{i} * record_size(choice.has_rotation);
  }
  /// Numbers a pair; some also where nothing is remembered, and no one asks.
  int columns() const { return std::max(3, memory_size(memory_of(choice))); }
  /// Displacement, stored energy, rolling angle and bond of pair k.
  std::array<double, 8> memory(std::int64_t k) const {
    std::array<double, 8> row{};
    each_column([&](std::size_t place, int c) { row[place] = history[at_column(k, c)]; });
    return row;
  }
  void set_memory(std::int64_t k, const std::array<double, 8>& row) {
    each_column([&](std::size_t place, int c) { history[at_column(k, c)] = row[place]; });
  }
  std::size_t at_column(std::int64_t k, int c) const { return static_cast<std::size_t>(k * columns() + c); }
  /// Calls f(place in a row, column) for what the choice of laws remembers.
  template <typename Function>
  void each_column(Function f) const {
    const MemoryColumns layout = memory_of(choice);
    for (int c = 0; c < (choice.has_ledger ? 4 : 3); ++c) f(static_cast<std::size_t>(c), c);
    for (int c = angle_in_memory; layout.has_rolling && c < bond_in_memory; ++c) f(static_cast<std::size_t>(c), c);
    if (layout.has_bond) f(7, bond_in_memory);
  }
  int slot_doubles() const { return slot_size(choice.has_rotation, choice.has_ledger, choice.has_further()); }
  Range range() const { return {0, static_cast<std::int64_t>(a.size())}; }
  PairSweep sweep() {
    return {records.data(),
            a.data(),
            b.data(),
            image.data(),
            shifts.data(),
            choice.is_uniform ? nullptr : species.data(),
            history.data(),
            was_near.data(),
            nullptr,
            nullptr,
            false,
            &table,
            inverse_mass,
            radius,
            dt,
            0.5,
            choice.rolling,
            choice.cohesion,
            largest_range()};
  }
  double largest_range() const {
    double most = 0.0;
    for (std::size_t row = 0; row < n_species; ++row)
      most = std::max(most, attraction_range(choice.cohesion, table.at(row), 0.01));
    return most;
  }
  /// In mixed precision memory is rounded to float before, and slots come back in SI.
  SweepResult run(double max_overlap = 0.5) {
    PairSweep s = sweep();
    s.max_overlap = max_overlap;
    if (!choice.is_mixed) return contact_kernels(choice).pairs(s, range(), slots.data());
    AlignedArray<float> memory, results;
    memory.resize_discarding(history.size());
    results.resize_discarding(slots.size());
    std::transform(history.begin(), history.end(), memory.begin(), [](double x) { return static_cast<float>(x); });
    s.mass_unit = mass_unit_for(mass_unit);
    const LawTable scaled = in_units_of_mass(table, s.mass_unit);
    s.table = &scaled;
    s.history = memory.data();
    const SweepResult result = contact_kernels(choice).pairs(s, range(), results.data());
    std::copy(memory.begin(), memory.end(), history.begin());
    for (std::size_t i = 0; i < slots.size(); ++i) {
      const std::size_t place = i % static_cast<std::size_t>(slot_doubles());
      const bool is_arm = place == 3 || (place == 7 && choice.has_rotation);
      slots[i] = results[i] * (is_arm ? 1.0 : s.mass_unit);
    }
    return result;
  }
  double mass_unit = 1e-3;  // [kg] about that, with mixed precision
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
  pairs.table = random_table(dice, choice.cohesion);
  pairs.n = n;
  const auto filled = static_cast<std::size_t>((n + pair_group - 1) / pair_group * pair_group);
  const std::int32_t dummy = 2 * n;
  pairs.a.assign(filled, dummy);
  pairs.b.assign(filled, dummy);
  pairs.image.assign(filled, 0);
  pairs.was_near.assign(filled / pair_group, 0xffff);
  pairs.species.assign(filled, 0);
  pairs.history.resize_discarding(static_cast<std::size_t>(pairs.columns()) * filled + beyond_memory);
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
    const Vec3 angle = tangent(dice, normalized(normal + 0.01 * dice.direction()), 1e3 * random_size(dice));
    const double bond = dice.index(2);
    if (has_history(choice)) pairs.set_memory(k, {h.x, h.y, h.z, stored, angle.x, angle.y, angle.z, bond});
  }
  return pairs;
}

/// What the reference makes of pair k, as it is before the sweep.
struct Expected {
  ReferenceContact contact;
  ReferenceForce force;
  double normal_scale = 0.0;      // [N] of the terms that add up to the force
  double tangential_scale = 0.0;  // [N]
};

inline ContactBody body_of(const double* r, bool has_rotation, double arm) {
  return {{r[4], r[5], r[6]},        has_rotation ? Vec3{r[8], r[9], r[10]} : Vec3{}, r[7], 1.0 / r[3], arm,
          has_rotation ? r[11] : 0.0};
}

inline Expected expected_of(const Pairs& pairs, int k) {
  const auto p = static_cast<std::size_t>(k);
  const double* const a = pairs.record(pairs.a[p]);
  const double* const b = pairs.record(pairs.b[p]);
  Expected expected;
  const Vec3 separation = Vec3{a[0] - b[0], a[1] - b[1], a[2] - b[2]} + pairs.shifts[pairs.image[p]];
  const double distance = length(separation);
  expected.contact.overlap = a[3] + b[3] - distance;
  expected.contact.normal = separation / distance;
  expected.contact.a = body_of(a, pairs.choice.has_rotation, a[3] - 0.5 * expected.contact.overlap);
  expected.contact.b = body_of(b, pairs.choice.has_rotation, b[3] - 0.5 * expected.contact.overlap);
  const std::array<double, 8> h = pairs.memory(k);
  expected.contact.displacement = {h[0], h[1], h[2]};
  expected.contact.stored = h[3];
  expected.contact.angle = {h[4], h[5], h[6]};
  expected.contact.is_bound = h[7] != 0.0;
  expected.force = reference_contact(pairs.choice, pairs.table.at(pairs.species[p]), expected.contact, dt);
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
