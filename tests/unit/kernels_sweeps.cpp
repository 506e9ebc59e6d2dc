// The compiled sweeps against the reference, and the same bits in every lane, variant and instruction set.
#include <catch2/catch.hpp>

#include <numeric>

#include "tests/unit/kernels_contacts.hpp"

using namespace moraine;
using namespace moraine::kernels_test;

namespace {

constexpr int n_contacts = 4003;  // not a multiple of a group

/// Sum of the sizes of what a force is made of: round-off is relative to these where they cancel, and that of the overlap to
/// the distance of the centres.
double force_scale(const LawTable& table, std::size_t species, const LawChoice& choice, const ReferenceContact& c,
                   const ReferenceForce& f, double mirror) {
  const PairParameters p = table.at(species);
  const double s = mirror * (c.a.inverse_mass + c.b.inverse_mass);
  const double k = choice.normal == NormalLaw::linear
                       ? p[Parameter::normal_stiffness]
                       : 2.0 * p[Parameter::young] *
                             std::sqrt(std::max(c.overlap, 0.0) / (mirror * (c.a.curvature + c.b.curvature)));
  const double v = length(c.a.velocity - c.b.velocity) + c.a.arm * length(c.a.angular_velocity) +
                   c.b.arm * length(c.b.angular_velocity);
  const double distance = 1.0 / c.a.curvature + (c.b.curvature > 0.0 ? 1.0 / c.b.curvature : 0.0);
  const double r = 1.0 / (mirror * (c.a.curvature + c.b.curvature));
  const double strength = p[Parameter::cohesion];
  double cohesion = 0.0;  // [N]
  if (choice.cohesion == CohesionLaw::jkr) cohesion = jkr_pull_off(p, r);
  if (choice.cohesion == CohesionLaw::sjkr) {
    cohesion = strength * (7.0 * r * std::max(c.overlap, 0.0) + 1e-2 / (c.a.curvature * c.a.curvature));
  }
  if (choice.cohesion == CohesionLaw::linear) cohesion = strength;
  if (choice.cohesion == CohesionLaw::liquid_bridge) cohesion = 13.0 * strength * r;
  return length(f.force) + cohesion + k * (std::max(c.overlap, 0.0) + 1e-3 * distance) +
         2.0 * p[Parameter::damping] * std::sqrt(k / s) * v;
}

/// Most energy that a tangential spring of the power law can hold [J]: small displacements are told from it by a difference.
double power_energy(const LawTable& table, std::size_t species, const LawChoice& choice, const ReferenceContact& c,
                    double scale, double mirror) {
  if (choice.tangential != TangentialLaw::power) return 0.0;
  const PairParameters p = table.at(species);
  const double a = std::sqrt(c.overlap / (mirror * (c.a.curvature + c.b.curvature)));
  const double k_t =
      choice.normal == NormalLaw::linear ? p[Parameter::tangential_stiffness] : 8.0 * p[Parameter::shear] * a;
  const double limit = p[Parameter::friction] * scale;
  return limit * (p[Parameter::displacement] > 0.0 ? p[Parameter::displacement] : 1.5 * limit / k_t);
}

struct Worst {
  double force = 0.0, torque = 0.0, history = 0.0, energy = 0.0;
};

/// Sum of the sizes of what a rolling torque is made of [N m], of the angles that its spring is a difference of where it yields [rad], and of the
/// energy in it [J].
struct RollingScale {
  double torque = 0.0, angle = 0.0, energy = 0.0;
};
RollingScale rolling_scale(const LawTable& table, std::size_t species, const LawChoice& choice,
                           const ReferenceContact& c, double scale, double mirror) {
  RollingScale size;
  if (choice.rolling == RollingLaw::none) return size;
  const PairParameters p = table.at(species);
  const double r = 1.0 / (mirror * (c.a.curvature + c.b.curvature));
  const double spin = mirror * length(c.a.angular_velocity) + length(c.b.angular_velocity);
  const double limit = p[Parameter::rolling_friction] * r * scale;
  const double angle = length(c.angle) + dt * spin;
  const double k_n =
      choice.normal == NormalLaw::linear ? p[Parameter::normal_stiffness] : 2.0 * p[Parameter::young] * r;
  const double k_r = rolling_stiffness(p, k_n, r);
  size.torque = limit + k_r * angle;
  if (k_r > 0.0 && c.a.inverse_inertia > 0.0) {  // where it yields it is what the limit leaves beside the dashpot
    const double inertia = 1.0 / c.a.inverse_inertia + 1.0 / (c.a.curvature * c.a.curvature * c.a.inverse_mass);
    size.angle = limit / k_r + 2.0 * p[Parameter::rolling_damping] * std::sqrt(inertia / k_r) * spin;
  }
  size.energy = size.torque * (angle + dt * spin);
  return size;
}

/// Compares a slot and a row of history with the reference; relative errors are gathered in `worst`.
void compare(const LawChoice& choice, const double* slot, const double* history, const double* arms,
             const ReferenceContact& c, const ReferenceForce& f, double scale, double most_energy,
             const RollingScale& rolling, double share, Worst& worst) {
  const auto note = [](double& most, double error, double size) {
    most = std::max(most, size > 0.0 ? error / size : error);
  };
  note(worst.force, length(Vec3{slot[0], slot[1], slot[2]} - f.force), scale);
  if (choice.has_rotation) {
    const Vec3 moment{slot[4], slot[5], slot[6]};
    const Vec3 torque = choice.has_further() ? Vec3{slot[8], slot[9], slot[10]} : Vec3{};
    note(worst.torque, length(torque - arms[0] * moment - f.torque_a), scale * c.a.arm + rolling.torque);
    if (c.b.arm > 0.0)
      note(worst.torque, length(-torque - arms[1] * moment - f.torque_b), scale * c.b.arm + rolling.torque);
  }
  const bool remembers = has_history(choice);
  const double v = length(c.a.velocity - c.b.velocity) + c.a.arm * length(c.a.angular_velocity) +
                   c.b.arm * length(c.b.angular_velocity);
  if (remembers) {
    const double size = length(f.displacement) + length(c.displacement) + v * dt;
    note(worst.history, length(Vec3{history[0], history[1], history[2]} - f.displacement), size + scale * 1e-4 / 1e3);
  }
  if (choice.rolling == RollingLaw::spring) {
    const double size =
        length(f.angle) + length(c.angle) + dt * (length(c.a.angular_velocity) + length(c.b.angular_velocity));
    note(worst.history, length(Vec3{history[4], history[5], history[6]} - f.angle),
         f.yields ? size + rolling.angle : size);
  }
  if (has_bond(choice.cohesion)) note(worst.history, std::abs(history[7] - (f.acts ? 1.0 : 0.0)), 1.0);
  if (choice.has_ledger) {
    const double* const lost = slot + slot_size(choice.has_rotation, true, choice.has_further()) - 4;
    const double size = scale * v * dt + c.stored + f.energy_tangential + most_energy + rolling.energy;
    if (remembers) note(worst.energy, std::abs(history[3] - f.energy_tangential), size);
    // dashpots take the velocity in the middle of the kick
    const double kick = scale * scale * dt * dt * (c.a.inverse_mass + c.b.inverse_mass);
    for (int k = 0; k < 3; ++k) {
      const double expected[3] = {f.lost_normal, f.lost_tangential, f.lost_friction};
      note(worst.energy, std::abs(lost[k] - share * expected[k]), size + kick);
    }
  }
}

double rounded(const LawChoice& choice, double x) { return choice.is_mixed ? static_cast<float>(x) : x; }

/// Round-off of the arithmetic that there is, some tens of times; where a JKR contact tears off its force has an infinite slope, so that
/// it is known to the root of that only.
void check(const LawChoice& choice, const Worst& worst) {
  const double tolerance = !choice.is_mixed ? 1e-12 : choice.cohesion == CohesionLaw::jkr ? 1e-3 : 1e-5;
  CHECK(worst.force < tolerance);
  CHECK(worst.torque < tolerance);
  // losses are differences of energies, what a spring holds that slides is one of forces (in double clang's are up to 3.4 times as far off)
  const double of_differences = (choice.is_mixed ? 10.0 : 4.0) * tolerance;
  CHECK(worst.history < of_differences);
  CHECK(worst.energy < of_differences);
}

}  // namespace

TEST_CASE("every compiled pair sweep gives the forces, moments, memory and losses of the reference") {
  for (const LawChoice& choice : all_choices()) {
    INFO(name_of(choice));
    Pairs pairs = random_pairs(choice, n_contacts, 11);
    std::vector<Expected> expected;
    for (int k = 0; k < pairs.n; ++k) expected.push_back(expected_of(pairs, k));
    std::vector<std::array<double, 8>> before;
    for (int k = 0; k < pairs.n; ++k) before.push_back(pairs.memory(k));
    const SweepResult result = pairs.run();
    const bool remembers = has_history(choice);
    Worst worst;
    int n_touching = 0, n_sliding = 0, n_separating = 0, n_afar = 0, n_broken = 0;
    for (int k = 0; k < pairs.n; ++k) {
      const Expected& e = expected[static_cast<std::size_t>(k)];
      const double* const slot = pairs.slots.data() + std::int64_t{k} * pairs.slot_doubles();
      const std::array<double, 8> history = pairs.memory(k);
      if (!e.force.acts) {
        for (int q = 0; q < pairs.slot_doubles(); ++q) {
          const bool is_friction = choice.has_ledger && remembers && q == pairs.slot_doubles() - 2;
          const bool is_break = choice.has_ledger && has_bond(choice.cohesion) && q == pairs.slot_doubles() - 4;
          if (is_break)
            REQUIRE(slot[q] == Approx(e.force.lost_normal).epsilon(choice.is_mixed ? 1e-5 : 1e-12));
          else
            REQUIRE(slot[q] == (is_friction ? rounded(choice, before[static_cast<std::size_t>(k)][3]) : 0.0));
        }
        n_broken += e.contact.is_bound;
        if (remembers) REQUIRE(std::all_of(history.begin(), history.end(), [](double x) { return x == 0.0; }));
        continue;
      }
      n_touching += e.contact.overlap > 0.0;
      n_afar += e.contact.overlap < 0.0;
      n_sliding += e.force.slides;
      n_separating += dot(e.contact.a.velocity - e.contact.b.velocity, e.contact.normal) > 0.0;
      const double arms[2] = {slot[3], choice.has_rotation ? slot[7] : 0.0};
      const std::size_t species = pairs.species[static_cast<std::size_t>(k)];
      const double scale = force_scale(pairs.table, species, choice, e.contact, e.force, 1.0);
      compare(choice, slot, history.data(), arms, e.contact, e.force, scale,
              power_energy(pairs.table, species, choice, e.contact, scale, 1.0),
              rolling_scale(pairs.table, species, choice, e.contact, scale, 1.0), 1.0, worst);
    }
    const bool reaches_beyond = choice.cohesion == CohesionLaw::linear || has_bond(choice.cohesion);
    CHECK((n_afar > pairs.n / 200) == reaches_beyond);
    if (has_bond(choice.cohesion)) CHECK(n_broken > pairs.n / 50);
    CHECK(result.n_touching == n_touching);
    CHECK(n_touching > pairs.n / 2);
    CHECK(n_separating > pairs.n / 5);
    if (choice.tangential != TangentialLaw::none) {
      CHECK(n_sliding > pairs.n / 20);
      CHECK(n_touching - n_sliding > pairs.n / 20);
    }
    check(choice, worst);
  }
}

TEST_CASE("the law is run over pairs that are near or were so, their grains are told, and other slots are left alone") {
  for (const LawChoice& choice : all_choices()) {
    if (choice.is_mixed) continue;
    INFO(name_of(choice));
    Pairs all = random_pairs(choice, n_contacts, 18), some = random_pairs(choice, n_contacts, 18);
    std::vector<std::uint32_t> marks;
    for (std::uint32_t k = 0; k < some.a.size(); ++k) {
      marks.push_back(2 * k);
      marks.push_back(2 * k + 1);
    }
    std::vector<std::uint64_t> acting(2 * some.a.size() / 64 + 1, 0);
    for (std::size_t group = 0; group < some.was_near.size(); ++group)
      some.was_near[group] = static_cast<std::uint16_t>(0x8421u << group % 4);
    const std::vector<std::uint16_t> before = some.was_near;
    PairSweep sweep = some.sweep();
    sweep.marks = marks.data();
    sweep.acting = acting.data();
    const SweepResult result = contact_kernels(choice).pairs(sweep, some.range(), some.slots.data());
    CHECK(result.n_touching == all.run().n_touching);
    const auto size = static_cast<std::size_t>(some.slot_doubles());
    int n_left_alone = 0;
    for (std::size_t k = 0; k < some.a.size(); ++k) {
      const bool is_near = some.was_near[k / 16] >> k % 16 & 1, was_near = before[k / 16] >> k % 16 & 1;
      const bool is_taken = is_near || was_near;
      REQUIRE(is_near == (all.was_near[k / 16] >> k % 16 & 1));
      for (const std::uint32_t mark : {marks[2 * k], marks[2 * k + 1]})
        REQUIRE((acting[mark / 64] >> mark % 64 & 1) == is_taken);
      const double* const slot = some.slots.data() + k * size;
      if (is_taken)
        REQUIRE(same_bits(slot, all.slots.data() + k * size, size));
      else
        REQUIRE(std::all_of(slot, slot + size, [](double x) { return x == 1e300; }));
      if (static_cast<int>(k) < some.n && !is_near && expected_of(all, static_cast<int>(k)).force.acts) FAIL();
      n_left_alone += !is_taken;
    }
    if (choice.cohesion == CohesionLaw::none) CHECK(n_left_alone > some.n / 10);
  }
}

TEST_CASE("pairs of the dummy grain give zeros beside pairs that touch") {
  for (const LawChoice& choice : all_choices()) {
    INFO(name_of(choice));
    Pairs pairs = random_pairs(choice, n_contacts, 12);
    pairs.run();
    for (std::int64_t k = pairs.n; k < pairs.range().end; ++k)
      for (int q = 0; q < pairs.slot_doubles(); ++q)
        REQUIRE(pairs.slots[static_cast<std::size_t>(k * pairs.slot_doubles() + q)] == 0.0);
  }
}

TEST_CASE("a pair gives the same bits in any lane and beside any others") {
  for (const LawChoice& choice : all_choices()) {
    INFO(name_of(choice));
    Pairs plain = random_pairs(choice, n_contacts, 13), shuffled = random_pairs(choice, n_contacts, 13);
    std::vector<std::size_t> order(static_cast<std::size_t>(plain.n));
    std::iota(order.begin(), order.end(), std::size_t{0});
    shapes::Dice dice(3);
    for (std::size_t i = order.size(); i > 1; --i)
      std::swap(order[i - 1], order[static_cast<std::size_t>(dice.index(static_cast<int>(i)))]);
    for (std::size_t k = 0; k < order.size(); ++k) {
      shuffled.a[k] = plain.a[order[k]];
      shuffled.b[k] = plain.b[order[k]];
      shuffled.image[k] = plain.image[order[k]];
      shuffled.species[k] = plain.species[order[k]];
      shuffled.set_memory(static_cast<std::int64_t>(k), plain.memory(static_cast<std::int64_t>(order[k])));
    }
    plain.run();
    shuffled.run();
    const auto size = static_cast<std::size_t>(plain.slot_doubles());
    for (std::size_t k = 0; k < order.size(); ++k) {
      REQUIRE(same_bits(shuffled.slots.data() + size * k, plain.slots.data() + size * order[k], size));
      REQUIRE(same_bits(shuffled.memory(static_cast<std::int64_t>(k)).data(),
                        plain.memory(static_cast<std::int64_t>(order[k])).data(), 8));
    }
  }
}

TEST_CASE("uniform and general sweeps give the same bits for grains that are all alike") {
  for (const LawChoice& choice : all_choices()) {
    if (!choice.is_uniform) continue;
    INFO(name_of(choice));
    for (const double radius : {0.004, 0.0037, 0.011}) {
      Pairs uniform = random_pairs(choice, n_contacts, 14);
      uniform.radius = radius;
      for (std::int32_t i = 0; i < 2 * uniform.n; ++i) uniform.record(i)[3] = radius;
      Pairs general = random_pairs(choice, n_contacts, 14);
      for (std::int32_t i = 0; i < 2 * uniform.n; ++i) general.record(i)[3] = radius;
      general.choice.is_uniform = false;
      uniform.run();
      general.run();
      CHECK(same_bits(uniform.slots.data(), general.slots.data(), uniform.slots.size()));
      CHECK(same_bits(uniform.history.data(), general.history.data(), uniform.history.size()));
    }
  }
}

TEST_CASE("sweeps with and without the ledger give the same bits of force, moment and memory") {
  for (const LawChoice& choice : all_choices()) {
    if (!choice.has_ledger) continue;
    INFO(name_of(choice));
    Pairs with = random_pairs(choice, n_contacts, 15);
    LawChoice plain = choice;
    plain.has_ledger = false;
    Pairs without = random_pairs(plain, n_contacts, 15);
    with.run();
    without.run();
    for (int k = 0; k < with.n; ++k) {
      REQUIRE(same_bits(with.slots.data() + k * with.slot_doubles(), without.slots.data() + k * without.slot_doubles(),
                        static_cast<std::size_t>(without.slot_doubles())));
      const bool remembers = has_history(choice);
      if (remembers) {  // all but the energy
        REQUIRE(same_bits(with.memory(k).data(), without.memory(k).data(), 3));
        REQUIRE(same_bits(with.memory(k).data() + 4, without.memory(k).data() + 4, 4));
      }
    }
  }
}

TEST_CASE("every instruction set gives the same bits for pairs") {
  if (targets().size() < 2) {
    WARN("this machine has one instruction set only");
    return;
  }
  for (const LawChoice& choice : all_choices()) {
    INFO(name_of(choice));
    std::vector<Pairs> all;
    std::vector<SweepResult> results;
    std::vector<PairKernel> kernels;
    for (const std::int64_t target : targets()) {
      const OnTarget on(target);
      kernels.push_back(contact_kernels(choice).pairs);
      all.push_back(random_pairs(choice, n_contacts, 16));
      results.push_back(all.back().run());
    }
    CHECK(kernels[0] != kernels[1]);
    CHECK(results[0].n_touching == results[1].n_touching);
    CHECK(same_bits(all[0].slots.data(), all[1].slots.data(), all[0].slots.size()));
    CHECK(same_bits(all[0].history.data(), all[1].history.data(), all[0].history.size()));
  }
}

TEST_CASE("an overlap beyond the limit is reported, one below is not") {
  for (const LawChoice& choice : all_choices()) {
    if (choice.is_uniform) continue;
    INFO(name_of(choice));
    Pairs pairs = random_pairs(choice, 203, 17);
    CHECK_FALSE(pairs.run().has_large_overlap);
    CHECK(pairs.run(0.3).has_large_overlap);  // random overlaps reach 0.4
  }
}

namespace {

/// Touches of grains with walls and mirrors, one grain each.
struct Walls {
  LawChoice choice;
  LawTable table;
  int n = 0;
  AlignedArray<double> records, columns, history, slots;
  std::vector<std::int32_t> grain;
  std::vector<std::uint8_t> species;
  std::size_t filled = 0;

  double* column(std::size_t c) { return columns.data() + c * filled; }
  WallSweep sweep() {
    return {records.data(),
            {grain.data(), column(0), column(1), column(2), column(3), column(4), column(5), column(6), column(7),
             species.data(), history.data(), slots.data()},
            &table,
            dt,
            0.5,
            choice.rolling,
            choice.cohesion};
  }
  int memory_doubles() const { return memory_size(choice.has_further()); }
  SweepResult run() {
    WallSweep s = sweep();
    if (choice.is_mixed) s.mass_unit = mass_unit_for(1e-3);
    const LawTable scaled = in_units_of_mass(table, s.mass_unit);
    s.table = &scaled;
    return contact_kernels(choice).walls(s, {0, static_cast<std::int64_t>(filled)});
  }
  int slot_doubles() const { return slot_size(choice.has_rotation, choice.has_ledger, choice.has_further()); }
};

Walls random_walls(const LawChoice& choice, int n, std::uint64_t seed) {
  shapes::Dice dice(seed);
  Walls w;
  w.choice = choice;
  w.table = random_table(dice, choice.cohesion);
  w.n = n;
  w.filled = static_cast<std::size_t>((n + pair_group - 1) / pair_group * pair_group);
  w.grain.assign(w.filled, n);
  w.species.assign(w.filled, 0);
  w.columns.resize_discarding(8 * w.filled);
  w.history.resize_discarding(static_cast<std::size_t>(w.memory_doubles()) * w.filled);
  w.slots.resize_discarding(w.filled * static_cast<std::size_t>(w.slot_doubles()));
  const int stride = record_size(choice.has_rotation);
  w.records.resize_discarding(static_cast<std::size_t>((n + 1) * stride));
  std::fill(w.columns.begin(), w.columns.end(), 0.0);
  std::fill(w.history.begin(), w.history.end(), 0.0);
  std::fill(w.slots.begin(), w.slots.end(), 1e300);
  put_dummy(w.records.data() + std::int64_t{n} * stride, choice.has_rotation);
  for (std::size_t k = static_cast<std::size_t>(n); k < w.filled; ++k) {
    w.column(0)[k] = 1.0;
    w.column(3)[k] = infinity;
    w.column(7)[k] = 1.0;
  }
  for (int k = 0; k < n; ++k) {
    const auto p = static_cast<std::size_t>(k);
    w.grain[p] = k;
    w.species[p] = static_cast<std::uint8_t>(dice.index(n_species));
    const double radius = 0.01 * std::pow(10.0, dice.uniform(-1.0, 0.0));
    const double overlap =
        radius * (dice.index(4) == 0 ? -dice.uniform(0.0, 0.3) : std::pow(10.0, dice.uniform(-3.0, -0.4)));
    const Vec3 normal = dice.direction(), x = dice.point({-1, -1, -1}, {1, 1, 1});
    const double speed = std::pow(10.0, dice.uniform(-4.0, 0.5));
    const Vec3 v = speed * dice.direction(), spin = speed / radius * dice.direction();
    const double mass = 2500.0 * 4.0 / 3.0 * std::numbers::pi * radius * radius * radius;
    const double values[12] = {x.x, x.y,        x.z,    radius, v.x,    v.y,
                               v.z, 1.0 / mass, spin.x, spin.y, spin.z, 1.0 / (0.4 * mass * radius * radius)};
    std::copy_n(values, stride, w.records.data() + std::int64_t{k} * stride);
    const double mirror = dice.index(3) == 0 ? 2.0 : 1.0;
    const Vec3 wall = mirror == 2.0 ? Vec3{} : 0.3 * speed * dice.direction();
    const double row[8] = {normal.x, normal.y, normal.z, radius - overlap, wall.x, wall.y, wall.z, mirror};
    for (std::size_t c = 0; c < 8; ++c) w.column(c)[p] = row[c];
    const Vec3 h = tangent(dice, normalized(normal + 0.01 * dice.direction()), random_size(dice));
    const double stored = squared_length(h) > 0.0 ? 1e-6 * dice.uniform(0.0, 1.0) : 0.0;
    const Vec3 angle = tangent(dice, normalized(normal + 0.01 * dice.direction()), 1e3 * random_size(dice));
    const bool remembers_angle = choice.rolling == RollingLaw::spring;
    const double memory[8] = {h.x,
                              h.y,
                              h.z,
                              stored,
                              remembers_angle ? angle.x : 0.0,
                              remembers_angle ? angle.y : 0.0,
                              remembers_angle ? angle.z : 0.0,
                              has_bond(choice.cohesion) ? static_cast<double>(dice.index(2)) : 0.0};
    if (has_history(choice))
      std::copy_n(memory, w.memory_doubles(), w.history.data() + std::int64_t{k} * w.memory_doubles());
  }
  return w;
}

}  // namespace

TEST_CASE("every compiled wall sweep gives what the reference gives, at walls and at mirrors") {
  for (const LawChoice& choice : all_choices()) {
    INFO(name_of(choice));
    Walls walls = random_walls(choice, n_contacts, 21);
    const int stride = record_size(choice.has_rotation);
    const std::vector<double> before(walls.history.begin(), walls.history.end());
    walls.run();
    Worst worst;
    int n_touching = 0;
    for (int k = 0; k < walls.n; ++k) {
      const auto p = static_cast<std::size_t>(k);
      const double* const r = walls.records.data() + std::int64_t{k} * stride;
      const double distance = walls.column(3)[p], mirror = walls.column(7)[p];
      const double* const slot = walls.slots.data() + std::int64_t{k} * walls.slot_doubles();
      ReferenceContact c;
      c.overlap = mirror * (r[3] - distance);
      c.normal = {walls.column(0)[p], walls.column(1)[p], walls.column(2)[p]};
      c.a = body_of(r, choice.has_rotation, distance);
      c.b.velocity = {walls.column(4)[p], walls.column(5)[p], walls.column(6)[p]};
      const double* const memory = before.data() + std::int64_t{k} * walls.memory_doubles();
      c.displacement = {memory[0], memory[1], memory[2]};
      c.stored = memory[3];
      if (choice.has_further()) {
        c.angle = {memory[4], memory[5], memory[6]};
        c.is_bound = memory[7] != 0.0;
      }
      const ReferenceForce f = reference_contact(choice, walls.table.at(walls.species[p]), c, dt, mirror);
      if (!f.acts) {
        for (int q = 0; q < 3; ++q) REQUIRE(slot[q] == 0.0);
        for (int q = 4; choice.has_rotation && q < (choice.has_further() ? 11 : 7); ++q)
          if (q != 7) REQUIRE(slot[q] == 0.0);
        if (choice.has_ledger)
          REQUIRE(slot[walls.slot_doubles() - 4] ==
                  Approx(f.lost_normal / mirror).epsilon(choice.is_mixed ? 1e-5 : 1e-12));
        continue;
      }
      ++n_touching;
      const double arms[2] = {slot[3], 0.0};
      const double scale = force_scale(walls.table, walls.species[p], choice, c, f, mirror);
      compare(choice, slot, walls.history.data() + std::int64_t{k} * walls.memory_doubles(), arms, c, f, scale,
              power_energy(walls.table, walls.species[p], choice, c, scale, mirror),
              rolling_scale(walls.table, walls.species[p], choice, c, scale, mirror), 1.0 / mirror, worst);
    }
    CHECK(n_touching > walls.n / 2);
    check(choice, worst);
  }
}

TEST_CASE("every instruction set gives the same bits at walls") {
  if (targets().size() < 2) {
    WARN("this machine has one instruction set only");
    return;
  }
  for (const LawChoice& choice : all_choices()) {
    INFO(name_of(choice));
    std::vector<Walls> all;
    for (const std::int64_t target : targets()) {
      const OnTarget on(target);
      all.push_back(random_walls(choice, n_contacts, 22));
      all.back().run();
    }
    CHECK(same_bits(all[0].slots.data(), all[1].slots.data(),
                    static_cast<std::size_t>(all[0].n * all[0].slot_doubles())));
    CHECK(same_bits(all[0].history.data(), all[1].history.data(), all[0].history.size()));
  }
}

TEST_CASE("a combination that is not compiled has no kernels") {
  const ContactKernels kernels = contact_kernels({NormalLaw::linear, TangentialLaw::mindlin, true, false, false});
  CHECK(kernels.pairs == nullptr);
  CHECK(kernels.walls == nullptr);
  for (const LawChoice& choice : all_choices()) CHECK(contact_kernels(choice).pairs != nullptr);
}
