#include "kernels/motion/motion.hpp"

#include <algorithm>

#include "kernels/contact/sweep.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/motion/motion.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include "kernels/base/simd/lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace moraine {
namespace HWY_NAMESPACE {

/// x x + y y + z z.
HWY_INLINE double square_of(Quad a) {
  alignas(32) double c[4];
  store_quad(c, a);
  return c[0] * c[0] + c[1] * c[1] + c[2] * c[2];
}

struct Sum {
  Quad force, moment, lost;
};

template <bool has_rotation, bool has_ledger, bool has_further, typename Real>
HWY_INLINE Sum sum_of_contacts(const GrainSums& sums, std::int32_t i, std::int64_t& w) {
  constexpr int slot = slot_size(has_rotation, has_ledger, has_further);
  const Real* const slots = static_cast<const Real*>(sums.slots);
  Sum sum{set_quad(0.0), set_quad(0.0), set_quad(0.0)};
  const auto add = [&](Entry entry) HWY_ATTR {
    const std::uint64_t is_b = entry & entry_is_b;  // no processor foresees it: addresses instead of branches
    const Real* const s = slots + std::int64_t{entry >> 1} * slot;
    sum.force = sum.force + flip_sign_if(is_b, load_quad(s));
    if constexpr (has_rotation) {
      const Quad m = load_quad(s + 4);
      sum.moment = sum.moment - set_quad(static_cast<double>(s[3 + 4 * is_b])) * m;
      if constexpr (has_further) sum.moment = sum.moment + flip_sign_if(is_b, load_quad(s + 8));
    }
    if constexpr (has_ledger)
      if (!is_b) sum.lost = sum.lost + load_quad(s + slot - 4);
  };
  const std::int32_t row = i - sums.first_grain;
  if (sums.acting) {
    const Entry* entries = sums.entries + sums.offsets[row];
    const std::uint32_t begin = sums.first_word ? sums.first_word[row] : static_cast<std::uint32_t>(row);
    const std::uint32_t end = sums.first_word ? sums.first_word[row + 1] : begin + 1;
    for (std::uint32_t word = begin; word < end; ++word, entries += bits_of_word) {
      for (std::uint64_t rest = sums.acting[word]; rest != 0; rest &= rest - 1) add(entries[__builtin_ctzll(rest)]);
      sums.acting[word] = 0;
    }
  } else {
    for (std::uint32_t q = sums.offsets[row]; q < sums.offsets[row + 1]; ++q) add(sums.entries[q]);
  }
  if constexpr (sizeof(Real) < 8) {
    const Quad unit = set_quad(sums.mass_unit);
    sum = {sum.force * unit, sum.moment * unit, sum.lost * unit};
  }
  for (; w < sums.n_wall && sums.wall_grain[w] == i; ++w) {
    const double* s = sums.wall_slots + w * slot;
    const Quad f = load_quad(s);
    sum.force = sum.force + f;
    if constexpr (has_rotation) {
      sum.moment = sum.moment - last_of(f) * load_quad(s + 4);
      if constexpr (has_further) sum.moment = sum.moment + load_quad(s + 8);
    }
    if constexpr (has_ledger) sum.lost = sum.lost + load_quad(s + slot - 4);
  }
  return sum;
}

template <bool has_rotation, bool has_ledger, bool has_further, typename Real>
MotionResult advance_grains(const GrainSums& sums, const std::int32_t* list, Range range) {
  constexpr int stride = record_size(has_rotation);
  const Kick& kick = sums.kick;
  alignas(32) const double g4[4] = {kick.gravity.x, kick.gravity.y, kick.gravity.z, 0.0};
  alignas(32) const double low4[4] = {sums.inside.low.x, sums.inside.low.y, sums.inside.low.z, 0.0};
  alignas(32) const double high4[4] = {sums.inside.high.x, sums.inside.high.y, sums.inside.high.z, 1e300};
  alignas(32) const double moves4[4] = {1.0, 1.0, kick.is_flat ? 0.0 : 1.0, 1.0};
  alignas(32) const double spins4[4] = {kick.is_flat ? 0.0 : 1.0, kick.is_flat ? 0.0 : 1.0, 1.0, 1.0};
  const Quad gravity = load_quad(g4), low = load_quad(low4), high = load_quad(high4);
  const Quad moves = load_quad(moves4), spins = load_quad(spins4);
  const Quad keep = set_quad(kick.keep), gain = set_quad(kick.gain), drift = set_quad(kick.drift);
  Quad outside = set_quad(0.0), fastest = set_quad(0.0), finite = set_quad(0.0);
  std::int64_t w = 0;
  for (std::int64_t n = range.begin; n < range.end; ++n) {
    const std::int32_t i = list ? list[n] : static_cast<std::int32_t>(n);
    const Sum sum = sum_of_contacts<has_rotation, has_ledger, has_further, Real>(sums, i, w);
    double* const record = sums.records + std::int64_t{i} * stride;
    const Quad v_old = load_quad(record + 4);
    Quad acceleration = fma(sum.force, last_of(v_old), gravity);
    if (sums.push) acceleration = acceleration + load_three(sums.push + 3 * std::int64_t{i});
    acceleration = acceleration * moves;
    const Quad x_old = load_quad(record);
    // a grain that has left the scene lies nowhere and does not fall on
    const Quad v_new = where_number(x_old, fma(acceleration, gain, v_old * keep));
    const Quad x_new = fma(v_new, drift, x_old);
    store_quad(record + 4, with_last(v_new, v_old));
    store_quad(record, with_last(x_new, x_old));
    const Quad squared = v_new * v_new;
    fastest = max(fastest, squared);
    finite = fma(squared, set_quad(0.0),
                 finite);  // stays zero unless something is infinite or not a number (here and below)
    outside = or_outside(outside, x_new, low, high);
    if constexpr (has_rotation) {
      const Quad w_old = load_quad(record + 8);
      const Quad w_new = fma(sum.moment * spins, last_of(w_old) * gain, w_old * keep);
      store_quad(record + 8, with_last(w_new, w_old));
      finite = fma(w_new, set_quad(0.0), finite);
      if constexpr (has_ledger)
        if (record[11] > 0.0)
          sums.dissipated[4 * std::int64_t{i} + 3] += kick.drag_loss / record[11] * square_of(w_old + w_new);
    }
    if constexpr (has_ledger) {
      double* const lost = sums.dissipated + 4 * std::int64_t{i};
      alignas(32) double contacts[4];
      store_quad(contacts, sum.lost);
      for (int k = 0; k < 3; ++k) lost[k] += contacts[k];
      if (record[7] > 0.0) lost[3] += kick.drag_loss / record[7] * square_of(v_old + v_new);
      if (sums.push && record[7] > 0.0) {
        alignas(32) double twice[4];
        store_quad(twice, v_old + v_new);
        const double* const push = sums.push + 3 * std::int64_t{i};
        const double power = push[0] * twice[0] + push[1] * twice[1] + push[2] * twice[2];
        lost[3] -= 0.5 * kick.time / record[7] * power;
      }
    }
    if (sums.force) {
      alignas(32) double values[4];
      store_quad(values, sum.force);
      for (int k = 0; k < 3; ++k) sums.force[3 * std::int64_t{i} + k] = values[k];
      if constexpr (has_rotation) {
        if (sums.torque) {
          store_quad(values, sum.moment);
          for (int k = 0; k < 3; ++k) sums.torque[3 * std::int64_t{i} + k] = values[k];
        }
      }
    }
  }
  alignas(32) double squares[4], zeros[4];
  store_quad(squares, fastest);
  store_quad(zeros, finite);
  MotionResult result;
  result.max_speed_squared = squares[0] + squares[1] + squares[2];
  result.is_any_outside = any_set(outside);
  result.is_any_not_finite = !(zeros[0] == 0.0 && zeros[1] == 0.0 && zeros[2] == 0.0);
  return result;
}

template <bool has_frames>
RoomShares most_used(const RoomUse& use, const std::int32_t* list, Range range) {
  constexpr int n = n_lanes<double>;
  const Lanes<double> age(use.age);
  Lanes<double> in_frames(0.0), at_rest(0.0);
  const auto largest = [](Lanes<double> lanes) HWY_ATTR {
    alignas(64) double values[n];
    store(values, lanes);
    return *std::max_element(values, values + n);
  };
  for (std::int64_t k = range.begin; k < range.end; k += n) {
    const auto grain = [&](int lane) HWY_ATTR {  // the last one again where there are no more
      const std::int64_t place = std::min(k + lane, range.end - 1);
      return list ? std::int64_t{list[place]} : place;
    };
    const Lanes4<double> record =
        load_records([&](int lane) HWY_ATTR { return use.records + grain(lane) * use.record_size; });
    const Lanes4<double> place = load_records([&](int lane) HWY_ATTR { return use.places + 4 * grain(lane); });
    const Lanes3<double> gone = record.xyz() - place.xyz();
    const Lanes<double> share_at_rest = sqrt(dot(gone, gone)) * place.d;
    at_rest = select(share_at_rest > at_rest, share_at_rest, at_rest);  // one that has left lies nowhere
    if constexpr (has_frames) {
      const Lanes4<double> frame =
          load_records([&](int lane) HWY_ATTR { return use.frames + 4 * std::int64_t{use.frame_of[grain(lane)]}; });
      const Lanes3<double> apart = fnma(age, frame.xyz(), gone);
      const Lanes<double> share_in_frames = fma(age, frame.d, sqrt(dot(apart, apart))) * place.d;
      in_frames = select(share_in_frames > in_frames, share_in_frames, in_frames);
    }
  }
  return {largest(has_frames ? in_frames : at_rest), largest(at_rest)};
}
RoomShares most_used_room(const RoomUse& use, const std::int32_t* list, Range range) {
  return use.frames ? most_used<true>(use, list, range) : most_used<false>(use, list, range);
}
RoomKernel choose_room() { return &most_used_room; }

template <typename Real, bool has_further>
MotionKernel choose_slots(bool has_rotation, bool has_ledger) {
  if (has_rotation)
    return has_ledger ? &advance_grains<true, true, has_further, Real>
                      : &advance_grains<true, false, has_further, Real>;
  return has_ledger ? &advance_grains<false, true, false, Real> : &advance_grains<false, false, false, Real>;
}

template <typename Real>
MotionKernel choose_further(bool has_rotation, bool has_ledger, bool has_further) {
  return has_further ? choose_slots<Real, true>(has_rotation, has_ledger)
                     : choose_slots<Real, false>(has_rotation, has_ledger);
}

MotionKernel choose_motion(bool has_rotation, bool has_ledger, bool has_further, bool is_mixed) {
  return is_mixed ? choose_further<float>(has_rotation, has_ledger, has_further)
                  : choose_further<double>(has_rotation, has_ledger, has_further);
}

}  // namespace HWY_NAMESPACE
}  // namespace moraine
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace moraine {
HWY_EXPORT(choose_motion);
HWY_EXPORT(choose_room);
RoomKernel room_kernel() { return HWY_DYNAMIC_DISPATCH(choose_room)(); }
MotionKernel motion_kernel(bool has_rotation, bool has_ledger, bool has_further, bool is_mixed) {
  return HWY_DYNAMIC_DISPATCH(choose_motion)(has_rotation, has_ledger, has_further, is_mixed);
}
}  // namespace moraine
#endif
