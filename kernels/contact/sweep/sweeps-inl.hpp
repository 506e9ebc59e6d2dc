// The sweeps: gather, law, scatter. Compiled once per instruction set and combination of laws, in double and in mixed precision: there
// differences of positions, velocities and spins are taken in double, all that follows is done in float, and forces go to
// slots of floats.
#if defined(MORAINE_KERNELS_CONTACT_SWEEPS_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MORAINE_KERNELS_CONTACT_SWEEPS_INL_HPP
#undef MORAINE_KERNELS_CONTACT_SWEEPS_INL_HPP
#else
#define MORAINE_KERNELS_CONTACT_SWEEPS_INL_HPP
#endif

#include <algorithm>

#include "kernels/contact/laws/further-inl.hpp"
#include "kernels/contact/laws/laws-inl.hpp"
#include "kernels/contact/sweep.hpp"

HWY_BEFORE_NAMESPACE();
namespace moraine {
namespace HWY_NAMESPACE {

/// Separation from the periodic image that each lane's pair is about; most groups have none.
HWY_INLINE Lanes3<double> add_image_shift(const PairSweep& sweep, std::int64_t k, Lanes3<double> d) {
  constexpr int n = n_lanes<double>;
  std::uint8_t seen = 0;
  for (int lane = 0; lane < n; ++lane) seen = static_cast<std::uint8_t>(seen | sweep.image[k + lane]);
  if (seen == 0) return d;
  alignas(64) double shift[3][n];
  alignas(64) double has_shift[n];
  for (int lane = 0; lane < n; ++lane) {
    const std::uint8_t code = sweep.image[k + lane];
    has_shift[lane] = code != 0 ? 1.0 : 0.0;
    for (int axis = 0; axis < 3; ++axis) shift[axis][lane] = sweep.image_shift[code][axis];
  }
  const LaneMask<double> shifted = load(has_shift) > 0.0;
  return select(shifted, Lanes3<double>{d.x + load(shift[0]), d.y + load(shift[1]), d.z + load(shift[2])}, d);
}

/// Mobility of rolling about the contact point: of the inertia I + m r^2.
template <typename Real>
HWY_INLINE Lanes<Real> rolling_mobility(Lanes<Real> radius, Lanes<Real> inverse_mass, Lanes<Real> inverse_inertia) {
  return inverse_mass * inverse_inertia / fma(inverse_inertia, radius * radius, inverse_mass);
}

/// Lanes in which there is a force: in contact, or not further apart than the attraction reaches; where a contact must be made
/// first, only if it was.
template <typename Real>
HWY_INLINE LaneMask<Real> acting(bool has_bonds, LaneMask<Real> touches, LaneMask<Real> was_bound, Lanes<Real> overlap,
                                 const Cohesion<Real>& c) {
  LaneMask<Real> near = overlap > -c.range;
  if (has_bonds) near = near & was_bound;
  return touches | near;
}

/// Adds what bonds take along that have broken in this step.
template <typename Real>
HWY_INLINE Lanes<Real> with_breaks(CohesionLaw law, const Cohesion<Real>& c, LaneMask<Real> was_bound,
                                   LaneMask<Real> acts, Lanes<Real> lost) {
  const LaneMask<Real> breaks = and_not(acts, was_bound);
  return any(breaks) ? select(breaks, energy_of_break(law, c), lost) : lost;
}

/// f(first lane) in double, for as many lanes as there are; in mixed precision two halves, rounded to float when they are done.
template <typename Real, typename Function>
HWY_INLINE auto in_double(Function f) {
  if constexpr (sizeof(Real) == 8)
    return f(0);
  else
    return narrowed(f(0), f(n_lanes<double>));
}

/// Where the grains of each lane's pair are to each other.
template <typename Real>
struct Gap {
  Lanes3<Real> d;  // x_a - x_b [m]
  Lanes<Real> square, reach, radius_a, radius_b;
  Lanes<Real> excess;  // reach^2 - d^2 (mixed precision)
  LaneMask<Real> touches;

  /// The overlap is a small difference: in float it comes from one that was taken in double, of the squares.
  HWY_INLINE Lanes<Real> overlap(Lanes<Real> distance) const {
    if constexpr (sizeof(Real) == 8)
      return reach - distance;
    else
      return excess / (reach + distance);
  }
};

HWY_INLINE Gap<double> with_square(Gap<double> gap) {
  gap.square = dot(gap.d, gap.d);
  gap.touches = gap.square < gap.reach * gap.reach;
  return gap;
}

/// Of the pairs from k on, one a lane. Where all radii are the same, they are not read.
template <bool has_rotation, bool is_uniform>
HWY_INLINE Gap<double> gap_of_pairs(const PairSweep& sweep, std::int64_t k) {
  constexpr int stride = record_size(has_rotation);
  const auto at_a = [&](int lane)
                        HWY_ATTR { return sweep.records + static_cast<std::int64_t>(sweep.a[k + lane]) * stride; };
  const auto at_b = [&](int lane)
                        HWY_ATTR { return sweep.records + static_cast<std::int64_t>(sweep.b[k + lane]) * stride; };
  Gap<double> gap;
  if constexpr (is_uniform) {
    const Lanes4<double> apart = load_apart(at_a, at_b);
    gap.d = apart.xyz();
    gap.reach = sweep.radius + sweep.radius;
  } else {
    const Lanes4<double> a = load_records(at_a), b = load_records(at_b);
    gap.d = a.xyz() - b.xyz();
    gap.reach = a.d + b.d;
    gap.radius_a = a.d;
    gap.radius_b = b.d;
  }
  if (sweep.image) gap.d = add_image_shift(sweep, k, gap.d);
  return with_square(gap);
}

/// Pairs that are looked at before the law is run over those that are near: what is known of these stays in L1.
inline constexpr int chunk_size = 256;

/// The pairs of a chunk over which the law is run, one behind the other.
struct NearPairs {
  static constexpr int capacity = chunk_size + pair_group;
  int n = 0;
  std::int32_t pair[capacity];
  alignas(64) double x[capacity], y[capacity], z[capacity];  // of their gaps
  double radius_a[capacity], radius_b[capacity];             // not where all radii are the same

  /// Fills the last group of lanes up with the last pair.
  void fill_up(int n_in_group) {
    for (int m = n; m % n_in_group != 0; ++m) for_each_column([&](auto* column) { column[m] = column[n - 1]; });
  }

 private:
  template <typename Function>
  void for_each_column(Function f) {
    f(pair), f(x), f(y), f(z), f(radius_a), f(radius_b);
  }
};

/// Loads the marks of a group ahead of mark(), which has nothing else to do meanwhile.
inline void ask_for_marks(const PairSweep& sweep, std::int64_t k) {
  constexpr std::int64_t of_line = 64 / (2 * sizeof(std::uint32_t));
  for (std::int64_t pair = k; pair < k + pair_group; pair += of_line) __builtin_prefetch(sweep.marks + 2 * pair);
}

/// Those that may have a force: that touch, or, with the further laws, are within reach of anything; and those that were so in their last sweep.
template <bool has_rotation, bool is_uniform, bool has_further>
HWY_INLINE void find_near(const PairSweep& sweep, Range chunk, NearPairs& found) {
  constexpr int n = n_lanes<double>;
  constexpr double beyond_rounding = 1.0 + 1e-5;  // what floats find to be within reach is so here
  found.n = 0;
  for (std::int64_t k = chunk.begin; k < chunk.end; k += pair_group) {
    std::uint16_t& was_near = sweep.was_near[k / pair_group];
    const unsigned anyway = sweep.takes_all ? 0xffffu : was_near;
    unsigned near = 0;
    int end = found.n;
    if (sweep.acting) ask_for_marks(sweep, k);
    for (int first = 0; first < pair_group; first += n) {
      const Gap<double> gap = gap_of_pairs<has_rotation, is_uniform>(sweep, k + first);
      LaneMask<double> reached = gap.touches;
      if constexpr (has_further) {
        const Lanes<double> widest = beyond_rounding * (gap.reach + sweep.range);
        reached = reached | (gap.square < widest * widest);
      }
      near |= bits(reached) << first;
      const LaneMask<double> taken = reached | lanes_of<double>(anyway >> first);
      store_together(found.x + end, gap.d.x, taken);
      store_together(found.y + end, gap.d.y, taken);
      const int n_taken = store_together(found.z + end, gap.d.z, taken);
      if constexpr (!is_uniform) {
        store_together(found.radius_a + end, gap.radius_a, taken);
        store_together(found.radius_b + end, gap.radius_b, taken);
      }
      end += n_taken;
    }
    was_near = static_cast<std::uint16_t>(near);
    alignas(64) std::int32_t pair[pair_group];
    for (int lane = 0; lane < pair_group; ++lane) pair[lane] = static_cast<std::int32_t>(k) + lane;
    store_marked(found.pair + found.n, pair, near | anyway);
    found.n = end;
  }
}

template <typename Real, bool is_uniform>
HWY_INLINE Gap<Real> gap_of_near(const PairSweep& sweep, const NearPairs& near, int first) {
  const auto gap_from = [&](int m) HWY_ATTR {
    Gap<double> gap;
    gap.d = {load(near.x + m), load(near.y + m), load(near.z + m)};
    gap.radius_a = is_uniform ? Lanes<double>(sweep.radius) : load(near.radius_a + m);
    gap.radius_b = is_uniform ? Lanes<double>(sweep.radius) : load(near.radius_b + m);
    gap.reach = gap.radius_a + gap.radius_b;
    return with_square(gap);
  };
  if constexpr (sizeof(Real) == 8) {
    return gap_from(first);
  } else {
    const Gap<double> one = gap_from(first), two = gap_from(first + n_lanes<double>);
    const auto excess = [](const Gap<double>& half) HWY_ATTR { return half.reach * half.reach - half.square; };
    Gap<Real> gap;
    gap.d = narrowed(one.d, two.d);
    gap.square = narrowed(one.square, two.square);
    gap.reach = narrowed(one.reach, two.reach);
    gap.radius_a = narrowed(one.radius_a, two.radius_a);
    gap.radius_b = narrowed(one.radius_b, two.radius_b);
    gap.excess = narrowed(excess(one), excess(two));
    gap.touches = gap.excess > 0.0;
    return gap;
  }
}

/// Tells the grains of these pairs that there is something to sum.
inline void mark(const PairSweep& sweep, const NearPairs& near) {
  for (int m = 0; m < near.n; ++m) {
    const std::uint32_t* const of_pair = sweep.marks + 2 * std::int64_t{near.pair[m]};
    for (const std::uint32_t mark : {of_pair[0], of_pair[1]})
      sweep.acting[mark / bits_of_word] |= std::uint64_t{1} << mark % bits_of_word;
  }
}

template <NormalLaw normal, TangentialLaw tangential, bool has_rotation, bool is_uniform, bool has_ledger,
          bool has_further, typename Real>
SweepResult sweep_pairs(const PairSweep& sweep, Range pairs, void* slots_of_pairs) {
  constexpr bool is_mixed = sizeof(Real) < 8;
  constexpr int stride = record_size(has_rotation);
  constexpr int slot = slot_size(has_rotation, has_ledger, has_further);
  constexpr bool remembers = has_history(tangential);
  const MemoryColumns columns{remembers, has_ledger, has_further && sweep.rolling == RollingLaw::spring,
                              has_further && has_bond(sweep.cohesion)};
  const int n_memory = memory_size(columns);
  constexpr bool is_spinning = has_rotation && tangential != TangentialLaw::none;
  constexpr bool has_spin_difference = has_further || !is_uniform;
  const double* const records = sweep.records;
  // Masses, and with them forces and energies, in units that keep their squares within what a float can be; memory is in SI.
  const Lanes<Real> unit(sweep.mass_unit), in_units(1.0 / sweep.mass_unit);
  const auto scaled = [&](Lanes<Real> inverse_mass) HWY_ATTR { return is_mixed ? inverse_mass * unit : inverse_mass; };
  Real* const slots = static_cast<Real*>(slots_of_pairs);
  Real* const memory = static_cast<Real*>(sweep.history);
  SweepResult result;
  LaneMask<Real> too_deep = Lanes<Real>(0.0) > 1.0;
  Constants<Real> c{};
  if constexpr (is_uniform) {
    const Lanes<Real> radius(sweep.radius);
    c = make_constants<normal, tangential, has_rotation>(
        RowOf<Real>{sweep.table, nullptr}, scaled(2.0 * sweep.inverse_mass),
        Lanes<Real>(sweep.radius + sweep.radius) / (radius * radius), sweep.dt);
  }
  NearPairs near;
  const auto run_law = [&](int first) HWY_ATTR {
    const std::int32_t* const pair = near.pair + first;
    const LaneMask<Real> are_pairs = first_lanes<Real>(near.n - first);
    std::uint8_t species[n_lanes<Real>];
    for (int lane = 0; !is_uniform && sweep.species && lane < n_lanes<Real>; ++lane)
      species[lane] = sweep.species[pair[lane]];
    const auto at_a = [&](int lane)
                          HWY_ATTR { return records + static_cast<std::int64_t>(sweep.a[pair[lane]]) * stride; };
    const auto at_b = [&](int lane)
                          HWY_ATTR { return records + static_cast<std::int64_t>(sweep.b[pair[lane]]) * stride; };
    const auto a_plus = [&](int offset) HWY_ATTR { return [=](int lane) HWY_ATTR { return at_a(lane) + offset; }; };
    const auto b_plus = [&](int offset) HWY_ATTR { return [=](int lane) HWY_ATTR { return at_b(lane) + offset; }; };
    const auto number_at = [&](auto record, int offset) HWY_ATTR {  // one over mass or inertia
      alignas(64) Real values[n_lanes<Real>];
      for (int lane = 0; lane < n_lanes<Real>; ++lane) values[lane] = static_cast<Real>(record(lane)[offset]);
      return scaled(load(values));
    };

    const Gap<Real> gap = gap_of_near<Real, is_uniform>(sweep, near, first);
    const LaneMask<Real> touches = gap.touches;
    const auto at_memory = [&](int offset) HWY_ATTR {
      return [=](int lane) HWY_ATTR { return memory + std::int64_t{pair[lane]} * n_memory + offset; };
    };
    LaneMask<Real> reached = touches, was_bound = touches;
    Lanes4<Real> rolled{Real{0}, Real{0}, Real{0}, Real{0}};  // rolling angle, bond
    if constexpr (has_further) {
      if (columns.has_further()) rolled = load_records<Real>(at_memory(angle_in_memory));
      if (columns.has_bond) was_bound = rolled.d > 0.0;
      const Lanes<Real> widest = gap.reach + sweep.range;
      reached = reached | (gap.square < widest * widest);
      if (columns.has_bond) reached = reached | was_bound;
    }
    const Lanes<Real> distance = sqrt(gap.square);
    const Lanes<Real> inverse = 1.0 / distance;
    Motion<Real> m;
    m.normal = inverse * gap.d;
    m.overlap = gap.overlap(distance);
    too_deep = too_deep | (touches & (m.overlap > sweep.max_overlap * min(gap.radius_a, gap.radius_b)));
    result.n_touching += count(touches & are_pairs);
    const RowOf<Real> row{sweep.table, !is_uniform && sweep.species ? species : nullptr};
    Bodies<Real> bodies;
    Cohesion<Real> cohesion;
    LaneMask<Real> acts = touches;
    if constexpr (has_further) {
      bodies.radius_a = gap.radius_a;
      bodies.curvature_b = 1.0 / gap.radius_b;
      bodies.reduced_radius = gap.radius_a * gap.radius_b / gap.reach;
      cohesion = make_cohesion(sweep.cohesion, row, bodies);
      // round-off must not decide by what else is in the group
      acts = acting(columns.has_bond, touches, was_bound, m.overlap, cohesion) & reached;
    }

    Lanes4<Real> v;  // and the sum of inverse masses
    if constexpr (is_mixed)
      v = load_narrowed_apart(a_plus(4), b_plus(4));
    else
      v = load_apart(a_plus(4), b_plus(4));
    m.v_n = dot(v.xyz(), m.normal);
    const Lanes<Real> half_overlap = 0.5 * m.overlap;
    const Lanes<Real> arm_a = gap.radius_a - half_overlap, arm_b = gap.radius_b - half_overlap;
    m.v_t = fnma(m.v_n, m.normal, v.xyz());
    if constexpr (is_spinning) {
      Lanes3<Real> turning, relative;
      Lanes<Real> mobility;
      if constexpr (is_mixed) {
        const Lanes4<Real> sum = load_narrowed_sum(a_plus(8), b_plus(8));
        turning = (0.5 * (gap.reach - m.overlap)) * sum.xyz();
        if constexpr (has_spin_difference) {
          relative = load_narrowed_apart(a_plus(8), b_plus(8)).xyz();
          turning = fma(0.5 * (gap.radius_a - gap.radius_b), relative, turning);
        }
        mobility = scaled(sum.d);
      } else {
        const Lanes4<Real> wa = load_records(a_plus(8)), wb = load_records(b_plus(8));
        turning = fma(arm_a, wa.xyz(), arm_b * wb.xyz());
        if constexpr (has_further) relative = wa.xyz() - wb.xyz();
        mobility = wa.d + wb.d;
      }
      m.v_t = m.v_t - cross(turning, m.normal);
      if constexpr (has_further) {
        bodies.spin = relative;
        bodies.spin_mobility = mobility;
        bodies.rolling_mobility = rolling_mobility(gap.radius_a, number_at(at_a, 7), number_at(at_a, 11)) +
                                  rolling_mobility(gap.radius_b, number_at(at_b, 7), number_at(at_b, 11));
      }
    }
    if constexpr (!is_uniform) {
      const Lanes<Real> kappa = normal == NormalLaw::hertz ? gap.reach / (gap.radius_a * gap.radius_b) : 0.0;
      c = make_constants<normal, tangential, has_rotation>(row, scaled(v.d), kappa, sweep.dt);
    }
    Lanes4<Real> h{};
    if constexpr (remembers) {
      h = load_records<Real>(at_memory(0));
      if constexpr (has_ledger && is_mixed) h.d = h.d * in_units;
    }
    ContactForce<Real> f;
    Lanes3<Real> torque;
    if constexpr (has_further) {
      const FurtherForce<Real> further = further_force<normal, tangential, has_rotation, has_ledger>(
          sweep.cohesion, sweep.rolling, c, cohesion, bodies, row, touches, m, h.xyz(), rolled.xyz(), h.d, sweep.dt);
      f = further.contact;
      torque = keep_if(acts, further.rolling.torque);
      if (columns.has_further()) {
        const Lanes3<Real> angle = columns.has_rolling ? keep_if(acts, further.rolling.angle) : rolled.xyz();
        const Lanes<Real> bond = columns.has_bond ? keep_if(acts, Lanes<Real>(1.0)) : rolled.d;
        store_records(at_memory(angle_in_memory), Lanes4<Real>{angle.x, angle.y, angle.z, bond});
      }
    } else {
      f = contact_force<normal, tangential, has_ledger>(c, m, h.xyz(), h.d, sweep.dt);
    }

    if constexpr (remembers) {
      const Lanes3<Real> kept = keep_if(acts, f.h);
      const Lanes<Real> energy = keep_if(acts, is_mixed ? f.energy * unit : f.energy);
      if constexpr (has_ledger)
        store_records(at_memory(0), Lanes4<Real>{kept.x, kept.y, kept.z, energy});
      else
        store_threes(at_memory(0), kept);
    }
    const Lanes3<Real> force = keep_if(acts, fma(f.normal, m.normal, f.tangential));
    const auto at_slot = [&](int offset) HWY_ATTR {
      return [=](int lane) HWY_ATTR { return slots + (pair[lane] - pairs.begin) * slot + offset; };
    };
    if constexpr (has_rotation) {
      const Lanes3<Real> moment = keep_if(acts, cross(m.normal, f.tangential));
      // a grain that has left lies nowhere, and its arm is not a number
      const Lanes4<Real> front{force.x, force.y, force.z, keep_if(acts, arm_a)};
      const Lanes4<Real> back{moment.x, moment.y, moment.z, keep_if(acts, arm_b)};
      if constexpr (is_mixed) {
        store_records(at_slot(0), front, back);
      } else {
        store_records(at_slot(0), front);
        store_records(at_slot(4), back);
      }
      if constexpr (has_further) store_records(at_slot(8), Lanes4<Real>{torque.x, torque.y, torque.z, 0.0});
    } else {
      store_records(at_slot(0), Lanes4<Real>{force.x, force.y, force.z, 0.0});
    }
    if constexpr (has_ledger) {
      Lanes<Real> friction = f.lost_friction;
      if constexpr (remembers)
        friction = select(acts, friction, h.d);
      else
        friction = keep_if(acts, friction);
      Lanes<Real> lost_normal = keep_if(acts, f.lost_normal);
      if constexpr (has_further)
        if (columns.has_bond) lost_normal = with_breaks(sweep.cohesion, cohesion, was_bound, acts, lost_normal);
      store_records(at_slot(slot - 4), Lanes4<Real>{lost_normal, keep_if(acts, f.lost_tangential), friction, 0.0});
    }
  };
  for (std::int64_t begin = pairs.begin; begin < pairs.end; begin += chunk_size) {
    find_near<has_rotation, is_uniform, has_further>(sweep, {begin, std::min(begin + chunk_size, pairs.end)}, near);
    near.fill_up(n_lanes<Real>);
    if (sweep.acting) mark(sweep, near);
    for (int m = 0; m < near.n; m += n_lanes<Real>) run_law(m);
  }
  result.has_large_overlap = any(too_deep);
  return result;
}

/// Records of four doubles at record(lane), and back.
template <typename Real, typename Pointer>
HWY_INLINE Lanes4<Real> load_wide(Pointer record) {
  return in_double<Real>(
      [&](int first) HWY_ATTR { return load_records([&](int lane) HWY_ATTR { return record(first + lane); }); });
}
template <typename Pointer>
HWY_INLINE void store_wide(Pointer record, const Lanes4<double>& r) {
  store_records(record, r);
}
template <typename Pointer>
HWY_INLINE void store_wide(Pointer record, const Lanes4<float>& r) {
  store_records(record, Lanes4<double>{widened_first(r.a), widened_first(r.b), widened_first(r.c), widened_first(r.d)});
  store_records([&](int lane) HWY_ATTR { return record(n_lanes<double> + lane); },
                Lanes4<double>{widened_second(r.a), widened_second(r.b), widened_second(r.c), widened_second(r.d)});
}

/// In mixed precision what goes in and out stays in double, as there are few touches: only the law is in float.
template <NormalLaw normal, TangentialLaw tangential, bool has_rotation, bool has_ledger, bool has_further,
          typename Real>
SweepResult sweep_walls(const WallSweep& sweep, Range touches_range) {
  constexpr bool is_mixed = sizeof(Real) < 8;
  constexpr int stride = record_size(has_rotation);
  constexpr int slot = slot_size(has_rotation, has_ledger, has_further);
  constexpr int n_memory = memory_size(has_further);
  constexpr bool remembers = has_history(tangential);
  constexpr bool is_spinning = has_rotation && tangential != TangentialLaw::none;
  const WallTouches& t = sweep.touches;
  const Lanes<Real> unit(sweep.mass_unit), in_units(1.0 / sweep.mass_unit);
  const auto scaled = [&](Lanes<Real> inverse_mass) HWY_ATTR { return is_mixed ? inverse_mass * unit : inverse_mass; };
  const auto in_si = [&](Lanes<Real> force) HWY_ATTR { return is_mixed ? force * unit : force; };
  SweepResult result;
  LaneMask<Real> too_deep = Lanes<Real>(0.0) > 1.0;
  for (std::int64_t k = touches_range.begin; k < touches_range.end; k += n_lanes<Real>) {
    const std::int32_t* const ia = t.grain + k;
    const auto a_plus = [&](int offset) HWY_ATTR {
      return [=, records = sweep.records](int lane)
                 HWY_ATTR { return records + static_cast<std::int64_t>(ia[lane]) * stride + offset; };
    };
    const auto column = [&](const double* values) HWY_ATTR {
      return in_double<Real>([&](int first) HWY_ATTR { return load(values + k + first); });
    };
    const Lanes<Real> radius = load_wide<Real>(a_plus(0)).d, inverse_mass = scaled(load_wide<Real>(a_plus(4)).d);
    const Lanes<Real> mirror = column(t.mirror), distance = column(t.distance);
    const Lanes<Real> depth = in_double<Real>([&](int first) HWY_ATTR {
      return load_records([&](int lane) HWY_ATTR { return a_plus(0)(first + lane); }).d - load(t.distance + k + first);
    });
    Motion<Real> m;
    m.normal = {column(t.normal_x), column(t.normal_y), column(t.normal_z)};
    m.overlap = mirror * depth;
    const LaneMask<Real> touches = depth > 0.0;
    too_deep = too_deep | (touches & (depth > sweep.max_overlap * radius));
    result.n_touching += count(touches);
    const Lanes3<Real> v = in_double<Real>([&](int first) HWY_ATTR {
      const std::int64_t at = k + first;
      const Lanes3<double> wall{load(t.velocity_x + at), load(t.velocity_y + at), load(t.velocity_z + at)};
      return load_records([&](int lane) HWY_ATTR { return a_plus(4)(first + lane); }).xyz() - wall;
    });
    const Lanes<Real> v_n = dot(v, m.normal);
    m.v_n = mirror * v_n;
    // The arm ends at the wall; a mirror image has the same arm, its friction is zero.
    const Lanes<Real> arm = distance;
    m.v_t = fnma(v_n, m.normal, v);
    Lanes4<Real> spin{};
    if constexpr (is_spinning) {
      spin = load_wide<Real>(a_plus(8));
      spin.d = scaled(spin.d);
      m.v_t = m.v_t - cross(arm * spin.xyz(), m.normal);
    }
    const RowOf<Real> row{sweep.table, t.species + k};
    const Constants<Real> c =
        make_constants<normal, tangential, has_rotation>(row, mirror * inverse_mass, mirror / radius, sweep.dt);
    double* const history = t.history + n_memory * k;
    const auto at_history = [&](int lane) HWY_ATTR { return history + n_memory * lane; };
    Lanes4<Real> h{};
    if constexpr (remembers) h = load_wide<Real>(at_history);
    if constexpr (is_mixed) h.d = h.d * in_units;
    ContactForce<Real> f;
    Lanes3<Real> torque;
    Cohesion<Real> cohesion;
    LaneMask<Real> acts = touches, was_bound = touches;
    if constexpr (has_further) {
      const auto at_angle = [&](int lane) HWY_ATTR { return history + n_memory * lane + 4; };
      const Lanes4<Real> memory = load_wide<Real>(at_angle);  // rolling angle, bond
      was_bound = memory.d > 0.0;
      Bodies<Real> bodies;
      bodies.radius_a = radius;
      bodies.curvature_b = (mirror - 1.0) / radius;
      bodies.reduced_radius = radius / mirror;
      if constexpr (has_rotation) {  // the image spins the other way round
        bodies.spin = mirror * spin.xyz();
        bodies.spin_mobility = mirror * spin.d;
        bodies.rolling_mobility = mirror * rolling_mobility(radius, inverse_mass, spin.d);
      }
      cohesion = make_cohesion(sweep.cohesion, row, bodies);
      acts = acting(has_bond(sweep.cohesion), touches, was_bound, m.overlap, cohesion);
      const FurtherForce<Real> further = further_force<normal, tangential, has_rotation, has_ledger>(
          sweep.cohesion, sweep.rolling, c, cohesion, bodies, row, touches, m, h.xyz(), memory.xyz(), h.d, sweep.dt);
      f = further.contact;
      torque = keep_if(acts, further.rolling.torque);
      const Lanes3<Real> angle = keep_if(acts, further.rolling.angle);
      const Lanes<Real> bond = has_bond(sweep.cohesion) ? keep_if(acts, Lanes<Real>(1.0)) : 0.0;
      store_wide(at_angle, Lanes4<Real>{angle.x, angle.y, angle.z, bond});
    } else {
      f = contact_force<normal, tangential, has_ledger>(c, m, h.xyz(), h.d, sweep.dt);
    }
    if constexpr (remembers) {
      const Lanes3<Real> kept = keep_if(acts, f.h);
      const Lanes<Real> energy = has_ledger ? keep_if(acts, in_si(f.energy)) : 0.0;
      store_wide(at_history, Lanes4<Real>{kept.x, kept.y, kept.z, energy});
    }
    double* const slots = t.slots + slot * k;
    const auto at_slot = [&](int offset)
                             HWY_ATTR { return [=](int lane) HWY_ATTR { return slots + lane * slot + offset; }; };
    const auto put = [&](int offset, Lanes3<Real> value, Lanes<Real> last) HWY_ATTR {
      store_wide(at_slot(offset), Lanes4<Real>{in_si(value.x), in_si(value.y), in_si(value.z), last});
    };
    const Lanes3<Real> force = keep_if(acts, fma(f.normal, m.normal, f.tangential));
    if constexpr (has_rotation) {
      put(0, force, arm);
      put(4, keep_if(acts, cross(m.normal, f.tangential)), 0.0);
      if constexpr (has_further) put(8, torque, 0.0);
    } else {
      put(0, force, 0.0);
    }
    if constexpr (has_ledger) {
      // Half of what is lost between a grain and its image is lost in the scene.
      const Lanes<Real> share = 1.0 / mirror;
      Lanes<Real> friction = f.lost_friction;
      if constexpr (remembers)
        friction = select(acts, friction, h.d);
      else
        friction = keep_if(acts, friction);
      Lanes<Real> lost_normal = keep_if(acts, f.lost_normal);
      if constexpr (has_further)
        if (has_bond(sweep.cohesion)) lost_normal = with_breaks(sweep.cohesion, cohesion, was_bound, acts, lost_normal);
      put(slot - 4, Lanes3<Real>{share * lost_normal, keep_if(acts, share * f.lost_tangential), share * friction}, 0.0);
    }
  }
  result.has_large_overlap = any(too_deep);
  return result;
}

template <typename Real, NormalLaw normal, TangentialLaw tangential, bool has_rotation, bool has_ledger>
ContactKernels choose_uniform(const LawChoice& choice) {
  return {choice.is_uniform ? &sweep_pairs<normal, tangential, has_rotation, true, has_ledger, false, Real>
                            : &sweep_pairs<normal, tangential, has_rotation, false, has_ledger, false, Real>,
          &sweep_walls<normal, tangential, has_rotation, has_ledger, false, Real>};
}

template <typename Real, NormalLaw normal, TangentialLaw tangential>
ContactKernels choose(const LawChoice& choice) {
  if (choice.has_rotation)
    return choice.has_ledger ? choose_uniform<Real, normal, tangential, true, true>(choice)
                             : choose_uniform<Real, normal, tangential, true, false>(choice);
  return choice.has_ledger ? choose_uniform<Real, normal, tangential, false, true>(choice)
                           : choose_uniform<Real, normal, tangential, false, false>(choice);
}

template <typename Real>
ContactKernels choose_linear_law(const LawChoice& choice) {
  constexpr NormalLaw linear = NormalLaw::linear;
  switch (choice.tangential) {
    case TangentialLaw::none: return choose<Real, linear, TangentialLaw::none>(choice);
    case TangentialLaw::viscous: return choose<Real, linear, TangentialLaw::viscous>(choice);
    case TangentialLaw::spring: return choose<Real, linear, TangentialLaw::spring>(choice);
    case TangentialLaw::power: return choose<Real, linear, TangentialLaw::power>(choice);
    case TangentialLaw::mindlin: break;
  }
  return {};
}

template <typename Real>
ContactKernels choose_hertz_law(const LawChoice& choice) {
  constexpr NormalLaw hertz = NormalLaw::hertz;
  switch (choice.tangential) {
    case TangentialLaw::none: return choose<Real, hertz, TangentialLaw::none>(choice);
    case TangentialLaw::viscous: return choose<Real, hertz, TangentialLaw::viscous>(choice);
    case TangentialLaw::spring: return choose<Real, hertz, TangentialLaw::spring>(choice);
    case TangentialLaw::mindlin: return choose<Real, hertz, TangentialLaw::mindlin>(choice);
    case TangentialLaw::power: return choose<Real, hertz, TangentialLaw::power>(choice);
  }
  return {};
}

template <typename Real, NormalLaw normal, TangentialLaw tangential, bool has_rotation, bool has_ledger>
ContactKernels further_variant() {
  return {&sweep_pairs<normal, tangential, has_rotation, false, has_ledger, true, Real>,
          &sweep_walls<normal, tangential, has_rotation, has_ledger, true, Real>};
}

template <typename Real, NormalLaw normal, TangentialLaw tangential>
ContactKernels further_of(const LawChoice& choice) {
  if (choice.has_rotation)
    return choice.has_ledger ? further_variant<Real, normal, tangential, true, true>()
                             : further_variant<Real, normal, tangential, true, false>();
  return choice.has_ledger ? further_variant<Real, normal, tangential, false, true>()
                           : further_variant<Real, normal, tangential, false, false>();
}

template <typename Real>
ContactKernels choose_further_law(const LawChoice& choice) {
  return choice.normal == NormalLaw::linear ? further_of<Real, NormalLaw::linear, TangentialLaw::spring>(choice)
                                            : further_of<Real, NormalLaw::hertz, TangentialLaw::mindlin>(choice);
}

}  // namespace HWY_NAMESPACE
}  // namespace moraine
HWY_AFTER_NAMESPACE();

#endif
