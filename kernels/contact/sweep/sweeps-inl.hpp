// The sweeps: gather, law, scatter. Compiled once per instruction set and combination of laws.
#if defined(MORAINE_KERNELS_CONTACT_SWEEPS_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MORAINE_KERNELS_CONTACT_SWEEPS_INL_HPP
#undef MORAINE_KERNELS_CONTACT_SWEEPS_INL_HPP
#else
#define MORAINE_KERNELS_CONTACT_SWEEPS_INL_HPP
#endif

#include "kernels/contact/laws/further-inl.hpp"
#include "kernels/contact/laws/laws-inl.hpp"
#include "kernels/contact/sweep.hpp"

HWY_BEFORE_NAMESPACE();
namespace moraine {
namespace HWY_NAMESPACE {

template <bool has_rotation, bool has_ledger, bool has_further>
HWY_INLINE void clear_slots(double* slots) {
  const Lanes zero(0.0);
  for (int k = 0; k < slot_size(has_rotation, has_ledger, has_further); ++k) store(slots + k * n_lanes, zero);
}

/// Separation from the periodic image that each lane's pair is about; most groups have none.
HWY_INLINE Lanes3 add_image_shift(const PairSweep& sweep, std::int64_t k, Lanes3 d) {
  std::uint8_t seen = 0;
  for (int lane = 0; lane < n_lanes; ++lane) seen = static_cast<std::uint8_t>(seen | sweep.image[k + lane]);
  if (seen == 0) return d;
  alignas(64) double shift[3][n_lanes];
  alignas(64) double has_shift[n_lanes];
  for (int lane = 0; lane < n_lanes; ++lane) {
    const std::uint8_t code = sweep.image[k + lane];
    has_shift[lane] = code != 0 ? 1.0 : 0.0;
    for (int axis = 0; axis < 3; ++axis) shift[axis][lane] = sweep.image_shift[code][axis];
  }
  const LaneMask shifted = load(has_shift) > Lanes(0.0);
  return select(shifted, Lanes3{d.x + load(shift[0]), d.y + load(shift[1]), d.z + load(shift[2])}, d);
}

/// Mobility of rolling about the contact point: of the inertia I + m r^2.
HWY_INLINE Lanes rolling_mobility(Lanes radius, Lanes inverse_mass, Lanes inverse_inertia) {
  return inverse_mass * inverse_inertia / fma(inverse_inertia, radius * radius, inverse_mass);
}

/// Lanes in which there is a force: in contact, or not further apart than the attraction reaches; where a contact must be made
/// first, only if it was.
HWY_INLINE LaneMask acting(bool has_bonds, LaneMask touches, LaneMask was_bound, Lanes overlap, const Cohesion& c) {
  LaneMask near = overlap > -c.range;
  if (has_bonds) near = near & was_bound;
  return {hn::Or(touches.m, near.m)};
}

/// Adds what bonds take along that have broken in this step.
HWY_INLINE Lanes with_breaks(CohesionLaw law, const Cohesion& c, LaneMask was_bound, LaneMask acts, Lanes lost) {
  const LaneMask breaks{hn::AndNot(acts.m, was_bound.m)};
  return any(breaks) ? select(breaks, energy_of_break(law, c), lost) : lost;
}

template <NormalLaw normal, TangentialLaw tangential, bool has_rotation, bool is_uniform, bool has_ledger,
          bool has_further = false>
SweepResult sweep_pairs(const PairSweep& sweep, Range pairs, double* slots) {
  constexpr int stride = record_size(has_rotation);
  constexpr int slot = slot_size(has_rotation, has_ledger, has_further);
  constexpr bool remembers = has_history(tangential);
  const MemoryColumns columns{remembers, has_ledger, has_further && sweep.rolling == RollingLaw::spring,
                              has_further && has_bond(sweep.cohesion)};
  const int n_columns = has_further ? columns.count() : memory_columns(has_ledger);
  constexpr bool is_spinning = has_rotation && tangential != TangentialLaw::none;
  const double* const records = sweep.records;
  SweepResult result;
  LaneMask too_deep = Lanes(0.0) > Lanes(1.0);
  Constants c{};
  if constexpr (is_uniform)
    c = make_constants<normal, tangential, has_rotation>(
        {sweep.table, nullptr}, Lanes(2.0 * sweep.inverse_mass),
        Lanes((sweep.radius + sweep.radius) / (sweep.radius * sweep.radius)), sweep.dt);
  for (std::int64_t k = pairs.begin; k < pairs.end; k += n_lanes, slots += slot * n_lanes) {
    const std::int32_t* const ia = sweep.a + k;
    const std::int32_t* const ib = sweep.b + k;
    const auto at_a = [&](int lane) HWY_ATTR { return records + static_cast<std::int64_t>(ia[lane]) * stride; };
    const auto at_b = [&](int lane) HWY_ATTR { return records + static_cast<std::int64_t>(ib[lane]) * stride; };
    const auto a_plus = [&](int offset) HWY_ATTR { return [=](int lane) HWY_ATTR { return at_a(lane) + offset; }; };
    const auto b_plus = [&](int offset) HWY_ATTR { return [=](int lane) HWY_ATTR { return at_b(lane) + offset; }; };

    const auto mass_at = [&](const std::int32_t* i) HWY_ATTR {  // one over it
      alignas(64) double values[n_lanes];
      for (int lane = 0; lane < n_lanes; ++lane)
        values[lane] = records[static_cast<std::int64_t>(i[lane]) * stride + 7];
      return load(values);
    };

    const Lanes4 pa = load_records(at_a), pb = load_records(at_b);
    Lanes3 d = pa.xyz() - pb.xyz();
    if (sweep.image) d = add_image_shift(sweep, k, d);
    const Lanes square = dot(d, d), reach = pa.d + pb.d;
    const LaneMask touches = square < reach * reach;
    double* const history = remembers ? sweep.history + memory_at(k, 0, n_columns) : nullptr;
    bool is_empty = none(touches);
    LaneMask was_bound = touches;
    if constexpr (has_further) {
      if (columns.has_bond) was_bound = load(history + columns.bond() * pair_group) > Lanes(0.0);
      const Lanes widest = reach + Lanes(sweep.range);
      is_empty = none({hn::Or((square < widest * widest).m, (columns.has_bond ? was_bound : touches).m)});
    }
    if (is_empty) {
      clear_slots<has_rotation, has_ledger, has_further>(slots);
      if constexpr (remembers) {
        if constexpr (has_ledger) {
          // what a spring still held when its contact ended counts as friction
          for (int lane = 0; lane < n_lanes; ++lane) slots[lane * slot + slot - 2] = history[3 * pair_group + lane];
        }
        for (int i = 0; i < n_columns; ++i) store(history + i * pair_group, Lanes(0.0));
      }
      continue;
    }
    const Lanes distance = sqrt(square);
    const Lanes inverse = Lanes(1.0) / distance;
    Motion m;
    m.normal = inverse * d;
    m.overlap = reach - distance;
    too_deep.m = hn::Or(too_deep.m, (touches & (m.overlap > Lanes(sweep.max_overlap) * min(pa.d, pb.d))).m);
    result.n_touching += count(touches);
    const RowOf row{sweep.table, !is_uniform && sweep.species ? sweep.species + k : nullptr};
    Bodies bodies;
    Cohesion cohesion;
    LaneMask acts = touches;
    if constexpr (has_further) {
      bodies.radius_a = pa.d;
      bodies.curvature_b = Lanes(1.0) / pb.d;
      bodies.reduced_radius = pa.d * pb.d / reach;
      cohesion = make_cohesion(sweep.cohesion, row, bodies);
      acts = acting(columns.has_bond, touches, was_bound, m.overlap, cohesion);
    }

    const Lanes4 v = load_difference(a_plus(4), b_plus(4));
    m.v_n = dot(v.xyz(), m.normal);
    const Lanes half_overlap = Lanes(0.5) * m.overlap;
    const Lanes arm_a = pa.d - half_overlap, arm_b = pb.d - half_overlap;
    m.v_t = fnma(m.v_n, m.normal, v.xyz());
    if constexpr (is_spinning) {
      const Lanes4 wa = load_records(a_plus(8)), wb = load_records(b_plus(8));
      m.v_t = m.v_t - cross(fma(arm_a, wa.xyz(), arm_b * wb.xyz()), m.normal);
      if constexpr (has_further) {
        bodies.spin = wa.xyz() - wb.xyz();
        bodies.spin_mobility = wa.d + wb.d;
        bodies.rolling_mobility = rolling_mobility(pa.d, mass_at(ia), wa.d) + rolling_mobility(pb.d, mass_at(ib), wb.d);
      }
    }
    if constexpr (!is_uniform) {
      const Lanes kappa = normal == NormalLaw::hertz ? (pa.d + pb.d) / (pa.d * pb.d) : Lanes(0.0);
      c = make_constants<normal, tangential, has_rotation>(row, mass_at(ia) + mass_at(ib), kappa, sweep.dt);
    }
    Lanes4 h{};
    if constexpr (remembers)
      h = {load(history), load(history + pair_group), load(history + 2 * pair_group),
           has_ledger ? load(history + 3 * pair_group) : Lanes(0.0)};
    ContactForce f;
    Lanes3 torque;
    if constexpr (has_further) {
      double* const angle = history + columns.rolling() * pair_group;
      Lanes3 before{Lanes(0.0), Lanes(0.0), Lanes(0.0)};
      if (columns.has_rolling) before = {load(angle), load(angle + pair_group), load(angle + 2 * pair_group)};
      const FurtherForce further = further_force<normal, tangential, has_rotation, has_ledger>(
          sweep.cohesion, sweep.rolling, c, cohesion, bodies, row, touches, m, h.xyz(), before, h.d, sweep.dt);
      f = further.contact;
      torque = keep_if(acts, further.rolling.torque);
      if (columns.has_rolling) {
        const Lanes3 after = keep_if(acts, further.rolling.angle);
        store(angle, after.x);
        store(angle + pair_group, after.y);
        store(angle + 2 * pair_group, after.z);
      }
      if (columns.has_bond) store(history + columns.bond() * pair_group, keep_if(acts, Lanes(1.0)));
    } else {
      f = contact_force<normal, tangential, has_ledger>(c, m, h.xyz(), h.d, sweep.dt);
    }

    if constexpr (remembers) {
      const Lanes3 kept = keep_if(acts, f.h);
      store(history, kept.x);
      store(history + pair_group, kept.y);
      store(history + 2 * pair_group, kept.z);
      if constexpr (has_ledger) store(history + 3 * pair_group, keep_if(acts, f.energy));
    }
    const Lanes3 force = keep_if(acts, fma(f.normal, m.normal, f.tangential));
    const auto at_slot = [&](int offset)
                             HWY_ATTR { return [=](int lane) HWY_ATTR { return slots + lane * slot + offset; }; };
    if constexpr (has_rotation) {
      const Lanes3 moment = keep_if(acts, cross(m.normal, f.tangential));
      // a grain that has left lies nowhere, and its arm is not a number
      store_records(at_slot(0), Lanes4{force.x, force.y, force.z, keep_if(acts, arm_a)});
      store_records(at_slot(4), Lanes4{moment.x, moment.y, moment.z, keep_if(acts, arm_b)});
      if constexpr (has_further) store_records(at_slot(8), Lanes4{torque.x, torque.y, torque.z, Lanes(0.0)});
    } else {
      store_records(at_slot(0), Lanes4{force.x, force.y, force.z, Lanes(0.0)});
    }
    if constexpr (has_ledger) {
      Lanes friction = f.lost_friction;
      if constexpr (remembers)
        friction = select(acts, friction, h.d);
      else
        friction = keep_if(acts, friction);
      Lanes lost_normal = keep_if(acts, f.lost_normal);
      if constexpr (has_further)
        if (columns.has_bond) lost_normal = with_breaks(sweep.cohesion, cohesion, was_bound, acts, lost_normal);
      store_records(at_slot(slot - 4), Lanes4{lost_normal, keep_if(acts, f.lost_tangential), friction, Lanes(0.0)});
    }
  }
  result.has_large_overlap = any(too_deep);
  return result;
}

template <NormalLaw normal, TangentialLaw tangential, bool has_rotation, bool has_ledger, bool has_further = false>
SweepResult sweep_walls(const WallSweep& sweep, Range touches_range) {
  constexpr int stride = record_size(has_rotation);
  constexpr int slot = slot_size(has_rotation, has_ledger, has_further);
  constexpr int n_memory = wall_memory_size(has_further);
  constexpr bool remembers = has_history(tangential);
  constexpr bool is_spinning = has_rotation && tangential != TangentialLaw::none;
  const WallTouches& t = sweep.touches;
  SweepResult result;
  LaneMask too_deep = Lanes(0.0) > Lanes(1.0);
  for (std::int64_t k = touches_range.begin; k < touches_range.end; k += n_lanes) {
    const std::int32_t* const ia = t.grain + k;
    const auto a_plus = [&](int offset) HWY_ATTR {
      return [=, records = sweep.records](int lane)
                 HWY_ATTR { return records + static_cast<std::int64_t>(ia[lane]) * stride + offset; };
    };
    const Lanes4 p = load_records(a_plus(0)), v4 = load_records(a_plus(4));
    const Lanes mirror = load(t.mirror + k), distance = load(t.distance + k);
    Motion m;
    m.normal = {load(t.normal_x + k), load(t.normal_y + k), load(t.normal_z + k)};
    m.overlap = mirror * (p.d - distance);
    const LaneMask touches = distance < p.d;
    too_deep.m = hn::Or(too_deep.m, (touches & (p.d - distance > Lanes(sweep.max_overlap) * p.d)).m);
    result.n_touching += count(touches);
    const Lanes3 v = v4.xyz() - Lanes3{load(t.velocity_x + k), load(t.velocity_y + k), load(t.velocity_z + k)};
    const Lanes v_n = dot(v, m.normal);
    m.v_n = mirror * v_n;
    // The arm ends at the wall; a mirror image has the same arm, its friction is zero.
    const Lanes arm = distance;
    m.v_t = fnma(v_n, m.normal, v);
    Lanes4 spin{};
    if constexpr (is_spinning) {
      spin = load_records(a_plus(8));
      m.v_t = m.v_t - cross(arm * spin.xyz(), m.normal);
    }
    const RowOf row{sweep.table, t.species + k};
    const Constants c = make_constants<normal, tangential, has_rotation>(row, mirror * v4.d, mirror / p.d, sweep.dt);
    double* const history = t.history + n_memory * k;
    const auto at_history = [&](int lane) HWY_ATTR { return history + n_memory * lane; };
    Lanes4 h{};
    if constexpr (remembers) h = load_records(at_history);
    ContactForce f;
    Lanes3 torque;
    Cohesion cohesion;
    LaneMask acts = touches, was_bound = touches;
    if constexpr (has_further) {
      const auto at_angle = [&](int lane) HWY_ATTR { return history + n_memory * lane + 4; };
      const Lanes4 memory = load_records(at_angle);  // rolling angle, bond
      was_bound = memory.d > Lanes(0.0);
      Bodies bodies;
      bodies.radius_a = p.d;
      bodies.curvature_b = (mirror - Lanes(1.0)) / p.d;
      bodies.reduced_radius = p.d / mirror;
      if constexpr (has_rotation) {  // the image spins the other way round
        bodies.spin = mirror * spin.xyz();
        bodies.spin_mobility = mirror * spin.d;
        bodies.rolling_mobility = mirror * rolling_mobility(p.d, v4.d, spin.d);
      }
      cohesion = make_cohesion(sweep.cohesion, row, bodies);
      acts = acting(has_bond(sweep.cohesion), touches, was_bound, m.overlap, cohesion);
      const FurtherForce further = further_force<normal, tangential, has_rotation, has_ledger>(
          sweep.cohesion, sweep.rolling, c, cohesion, bodies, row, touches, m, h.xyz(), memory.xyz(), h.d, sweep.dt);
      f = further.contact;
      torque = keep_if(acts, further.rolling.torque);
      const Lanes3 angle = keep_if(acts, further.rolling.angle);
      const Lanes bond = has_bond(sweep.cohesion) ? keep_if(acts, Lanes(1.0)) : Lanes(0.0);
      store_records(at_angle, Lanes4{angle.x, angle.y, angle.z, bond});
    } else {
      f = contact_force<normal, tangential, has_ledger>(c, m, h.xyz(), h.d, sweep.dt);
    }
    if constexpr (remembers) {
      const Lanes3 kept = keep_if(acts, f.h);
      store_records(at_history, Lanes4{kept.x, kept.y, kept.z, has_ledger ? keep_if(acts, f.energy) : Lanes(0.0)});
    }
    double* const slots = t.slots + slot * k;
    const auto at_slot = [&](int offset)
                             HWY_ATTR { return [=](int lane) HWY_ATTR { return slots + lane * slot + offset; }; };
    const Lanes3 force = keep_if(acts, fma(f.normal, m.normal, f.tangential));
    if constexpr (has_rotation) {
      const Lanes3 moment = keep_if(acts, cross(m.normal, f.tangential));
      store_records(at_slot(0), Lanes4{force.x, force.y, force.z, arm});
      store_records(at_slot(4), Lanes4{moment.x, moment.y, moment.z, Lanes(0.0)});
      if constexpr (has_further) store_records(at_slot(8), Lanes4{torque.x, torque.y, torque.z, Lanes(0.0)});
    } else {
      store_records(at_slot(0), Lanes4{force.x, force.y, force.z, Lanes(0.0)});
    }
    if constexpr (has_ledger) {
      // Half of what is lost between a grain and its image is lost in the scene.
      const Lanes share = Lanes(1.0) / mirror;
      Lanes friction = f.lost_friction;
      if constexpr (remembers)
        friction = select(acts, friction, h.d);
      else
        friction = keep_if(acts, friction);
      Lanes lost_normal = keep_if(acts, f.lost_normal);
      if constexpr (has_further)
        if (has_bond(sweep.cohesion)) lost_normal = with_breaks(sweep.cohesion, cohesion, was_bound, acts, lost_normal);
      store_records(at_slot(slot - 4), Lanes4{share * lost_normal, keep_if(acts, share * f.lost_tangential),
                                              share * friction, Lanes(0.0)});
    }
  }
  result.has_large_overlap = any(too_deep);
  return result;
}

template <NormalLaw normal, TangentialLaw tangential, bool has_rotation>
ContactKernels choose_variant(const LawChoice& choice) {
  ContactKernels kernels;
  if (choice.has_ledger) {
    kernels.pairs = choice.is_uniform ? &sweep_pairs<normal, tangential, has_rotation, true, true>
                                      : &sweep_pairs<normal, tangential, has_rotation, false, true>;
    kernels.walls = &sweep_walls<normal, tangential, has_rotation, true>;
  } else {
    kernels.pairs = choice.is_uniform ? &sweep_pairs<normal, tangential, has_rotation, true, false>
                                      : &sweep_pairs<normal, tangential, has_rotation, false, false>;
    kernels.walls = &sweep_walls<normal, tangential, has_rotation, false>;
  }
  return kernels;
}

template <NormalLaw normal, TangentialLaw tangential>
ContactKernels choose(const LawChoice& choice) {
  return choice.has_rotation ? choose_variant<normal, tangential, true>(choice)
                             : choose_variant<normal, tangential, false>(choice);
}

}  // namespace HWY_NAMESPACE
}  // namespace moraine
HWY_AFTER_NAMESPACE();

#endif
