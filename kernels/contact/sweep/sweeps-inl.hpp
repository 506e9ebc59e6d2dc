// The sweeps: gather, law, scatter. Compiled once per instruction set and combination of laws.
#if defined(MORAINE_KERNELS_CONTACT_SWEEPS_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MORAINE_KERNELS_CONTACT_SWEEPS_INL_HPP
#undef MORAINE_KERNELS_CONTACT_SWEEPS_INL_HPP
#else
#define MORAINE_KERNELS_CONTACT_SWEEPS_INL_HPP
#endif

#include "kernels/contact/laws/laws-inl.hpp"
#include "kernels/contact/sweep.hpp"

HWY_BEFORE_NAMESPACE();
namespace moraine {
namespace HWY_NAMESPACE {

template <bool has_rotation, bool has_ledger>
HWY_INLINE void clear_slots(double* slots) {
  const Lanes zero(0.0);
  for (int k = 0; k < slot_size(has_rotation, has_ledger); ++k) store(slots + k * n_lanes, zero);
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

template <NormalLaw normal, TangentialLaw tangential, bool has_rotation, bool is_uniform, bool has_ledger>
SweepResult sweep_pairs(const PairSweep& sweep, Range pairs, double* slots) {
  constexpr int stride = record_size(has_rotation);
  constexpr int slot = slot_size(has_rotation, has_ledger);
  constexpr bool remembers = has_history(tangential);
  constexpr int n_columns = memory_columns(has_ledger);
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

    const Lanes4 pa = load_records(at_a), pb = load_records(at_b);
    Lanes3 d = pa.xyz() - pb.xyz();
    if (sweep.image) d = add_image_shift(sweep, k, d);
    const Lanes square = dot(d, d), reach = pa.d + pb.d;
    const LaneMask touches = square < reach * reach;
    double* const history = remembers ? sweep.history + memory_at(k, 0, n_columns) : nullptr;
    if (none(touches)) {
      clear_slots<has_rotation, has_ledger>(slots);
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

    const Lanes4 v = load_difference(a_plus(4), b_plus(4));
    m.v_n = dot(v.xyz(), m.normal);
    const Lanes half_overlap = Lanes(0.5) * m.overlap;
    const Lanes arm_a = pa.d - half_overlap, arm_b = pb.d - half_overlap;
    m.v_t = fnma(m.v_n, m.normal, v.xyz());
    if constexpr (is_spinning) {
      const Lanes4 wa = load_records(a_plus(8)), wb = load_records(b_plus(8));
      m.v_t = m.v_t - cross(fma(arm_a, wa.xyz(), arm_b * wb.xyz()), m.normal);
    }
    if constexpr (!is_uniform) {
      const auto mass_at = [&](const std::int32_t* i) HWY_ATTR {
        alignas(64) double values[n_lanes];
        for (int lane = 0; lane < n_lanes; ++lane)
          values[lane] = records[static_cast<std::int64_t>(i[lane]) * stride + 7];
        return load(values);
      };
      const Lanes kappa = normal == NormalLaw::hertz ? (pa.d + pb.d) / (pa.d * pb.d) : Lanes(0.0);
      c = make_constants<normal, tangential, has_rotation>({sweep.table, sweep.species ? sweep.species + k : nullptr},
                                                           mass_at(ia) + mass_at(ib), kappa, sweep.dt);
    }
    Lanes4 h{};
    if constexpr (remembers)
      h = {load(history), load(history + pair_group), load(history + 2 * pair_group),
           has_ledger ? load(history + 3 * pair_group) : Lanes(0.0)};
    const ContactForce f = contact_force<normal, tangential, has_ledger>(c, m, h.xyz(), h.d, sweep.dt);

    if constexpr (remembers) {
      const Lanes3 kept = keep_if(touches, f.h);
      store(history, kept.x);
      store(history + pair_group, kept.y);
      store(history + 2 * pair_group, kept.z);
      if constexpr (has_ledger) store(history + 3 * pair_group, keep_if(touches, f.energy));
    }
    const Lanes3 force = keep_if(touches, fma(f.normal, m.normal, f.tangential));
    const auto at_slot = [&](int offset)
                             HWY_ATTR { return [=](int lane) HWY_ATTR { return slots + lane * slot + offset; }; };
    if constexpr (has_rotation) {
      const Lanes3 moment = keep_if(touches, cross(m.normal, f.tangential));
      // a grain that has left lies nowhere, and its arm is not a number
      store_records(at_slot(0), Lanes4{force.x, force.y, force.z, keep_if(touches, arm_a)});
      store_records(at_slot(4), Lanes4{moment.x, moment.y, moment.z, keep_if(touches, arm_b)});
    } else {
      store_records(at_slot(0), Lanes4{force.x, force.y, force.z, Lanes(0.0)});
    }
    if constexpr (has_ledger) {
      Lanes friction = f.lost_friction;
      if constexpr (remembers)
        friction = select(touches, friction, h.d);
      else
        friction = keep_if(touches, friction);
      store_records(at_slot(slot - 4),
                    Lanes4{keep_if(touches, f.lost_normal), keep_if(touches, f.lost_tangential), friction, Lanes(0.0)});
    }
  }
  result.has_large_overlap = any(too_deep);
  return result;
}

template <NormalLaw normal, TangentialLaw tangential, bool has_rotation, bool has_ledger>
SweepResult sweep_walls(const WallSweep& sweep, Range touches_range) {
  constexpr int stride = record_size(has_rotation);
  constexpr int slot = slot_size(has_rotation, has_ledger);
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
    if constexpr (is_spinning) m.v_t = m.v_t - cross(arm * load_records(a_plus(8)).xyz(), m.normal);
    const Constants c = make_constants<normal, tangential, has_rotation>({sweep.table, t.species + k}, mirror * v4.d,
                                                                         mirror / p.d, sweep.dt);
    double* const history = t.history + 4 * k;
    const auto at_history = [&](int lane) HWY_ATTR { return history + 4 * lane; };
    Lanes4 h{};
    if constexpr (remembers) h = load_records(at_history);
    const ContactForce f = contact_force<normal, tangential, has_ledger>(c, m, h.xyz(), h.d, sweep.dt);
    if constexpr (remembers) {
      const Lanes3 kept = keep_if(touches, f.h);
      store_records(at_history, Lanes4{kept.x, kept.y, kept.z, has_ledger ? keep_if(touches, f.energy) : Lanes(0.0)});
    }
    double* const slots = t.slots + slot * k;
    const auto at_slot = [&](int offset)
                             HWY_ATTR { return [=](int lane) HWY_ATTR { return slots + lane * slot + offset; }; };
    const Lanes3 force = keep_if(touches, fma(f.normal, m.normal, f.tangential));
    if constexpr (has_rotation) {
      const Lanes3 moment = keep_if(touches, cross(m.normal, f.tangential));
      store_records(at_slot(0), Lanes4{force.x, force.y, force.z, arm});
      store_records(at_slot(4), Lanes4{moment.x, moment.y, moment.z, Lanes(0.0)});
    } else {
      store_records(at_slot(0), Lanes4{force.x, force.y, force.z, Lanes(0.0)});
    }
    if constexpr (has_ledger) {
      // Half of what is lost between a grain and its image is lost in the scene.
      const Lanes share = Lanes(1.0) / mirror;
      Lanes friction = f.lost_friction;
      if constexpr (remembers)
        friction = select(touches, friction, h.d);
      else
        friction = keep_if(touches, friction);
      store_records(at_slot(slot - 4),
                    Lanes4{keep_if(touches, share * f.lost_normal), keep_if(touches, share * f.lost_tangential),
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
