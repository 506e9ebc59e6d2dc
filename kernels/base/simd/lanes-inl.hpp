// Lanes: a vector of doubles with arithmetic, and records of four doubles in and out of lanes. The only place that knows
// Highway. Included once per instruction set (see Highway's foreach_target.h), hence the unusual guard.
//
// Rounding: + - * / sqrt and fma are IEEE operations of each lane, so that the result of a lane depends neither on its place
// nor on the number of lanes. The compiler may not contract (-ffp-contract=off): what is fused says so.
#if defined(MORAINE_KERNELS_BASE_SIMD_LANES_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef MORAINE_KERNELS_BASE_SIMD_LANES_INL_HPP
#undef MORAINE_KERNELS_BASE_SIMD_LANES_INL_HPP
#else
#define MORAINE_KERNELS_BASE_SIMD_LANES_INL_HPP
#endif

#include <hwy/highway.h>

#include <cstdint>

HWY_BEFORE_NAMESPACE();
namespace moraine {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::CappedTag<double, 8>;
inline constexpr int n_lanes = HWY_MAX_BYTES >= 64 ? 8 : HWY_MAX_BYTES >= 8 ? static_cast<int>(HWY_MAX_BYTES / 8) : 1;

struct Lanes {
  hn::Vec<Tag> v;
  Lanes() = default;
  HWY_INLINE Lanes(hn::Vec<Tag> value) : v(value) {}
  HWY_INLINE Lanes(double value) : v(hn::Set(Tag(), value)) {}
};
struct LaneMask {
  hn::Mask<Tag> m;
};

HWY_INLINE Lanes operator+(Lanes a, Lanes b) { return hn::Add(a.v, b.v); }
HWY_INLINE Lanes operator-(Lanes a, Lanes b) { return hn::Sub(a.v, b.v); }
HWY_INLINE Lanes operator*(Lanes a, Lanes b) { return hn::Mul(a.v, b.v); }
HWY_INLINE Lanes operator/(Lanes a, Lanes b) { return hn::Div(a.v, b.v); }
HWY_INLINE Lanes operator-(Lanes a) { return hn::Neg(a.v); }
/// a b + c, rounded once.
HWY_INLINE Lanes fma(Lanes a, Lanes b, Lanes c) { return hn::MulAdd(a.v, b.v, c.v); }
/// c - a b, rounded once.
HWY_INLINE Lanes fnma(Lanes a, Lanes b, Lanes c) { return hn::NegMulAdd(a.v, b.v, c.v); }
HWY_INLINE Lanes abs(Lanes a) { return hn::Abs(a.v); }
HWY_INLINE Lanes sqrt(Lanes a) { return hn::Sqrt(a.v); }
HWY_INLINE Lanes max(Lanes a, Lanes b) { return hn::Max(a.v, b.v); }
HWY_INLINE Lanes min(Lanes a, Lanes b) { return hn::Min(a.v, b.v); }
HWY_INLINE LaneMask operator<(Lanes a, Lanes b) { return {hn::Lt(a.v, b.v)}; }
HWY_INLINE LaneMask operator>(Lanes a, Lanes b) { return {hn::Gt(a.v, b.v)}; }
HWY_INLINE LaneMask operator&(LaneMask a, LaneMask b) { return {hn::And(a.m, b.m)}; }
HWY_INLINE bool any(LaneMask a) { return !hn::AllFalse(Tag(), a.m); }
HWY_INLINE bool none(LaneMask a) { return hn::AllFalse(Tag(), a.m); }
HWY_INLINE Lanes select(LaneMask m, Lanes yes, Lanes no) { return hn::IfThenElse(m.m, yes.v, no.v); }
HWY_INLINE Lanes keep_if(LaneMask m, Lanes yes) { return hn::IfThenElseZero(m.m, yes.v); }
HWY_INLINE Lanes load(const double* p) { return hn::LoadU(Tag(), p); }
HWY_INLINE void store(double* p, Lanes a) { hn::StoreU(a.v, Tag(), p); }
HWY_INLINE double sum_of(Lanes a) { return hn::GetLane(hn::SumOfLanes(Tag(), a.v)); }
HWY_INLINE double max_of(Lanes a) { return hn::GetLane(hn::MaxOfLanes(Tag(), a.v)); }
HWY_INLINE int count(LaneMask m) { return static_cast<int>(hn::CountTrue(Tag(), m.m)); }
/// Cube root of a positive number, to round-off but not rounded exactly; zero for zero.
HWY_INLINE Lanes cbrt(Lanes a) {
  // A third of the bits is a third of the exponent and a start within 6 %; each of Newton's steps squares the error.
  const hn::Repartition<std::uint64_t, Tag> d;
  const auto bits = hn::BitCast(d, a.v);
  auto third = hn::Add(hn::ShiftRight<2>(bits), hn::ShiftRight<4>(bits));  // 1/3 = 1/4 + 1/16 + 1/64 ...
  third = hn::Add(third, hn::ShiftRight<4>(third));
  third = hn::Add(third, hn::ShiftRight<8>(third));
  third = hn::Add(third, hn::ShiftRight<16>(third));
  Lanes x = hn::BitCast(Tag(), hn::Add(third, hn::Set(d, 0x2A9F789300000000ull)));
  for (int i = 0; i < 4; ++i) x = (x + x + a / (x * x)) * Lanes(1.0 / 3.0);
  return keep_if(a > Lanes(0.0), x);
}
/// One bit a lane, lane 0 lowest.
HWY_INLINE unsigned bits(LaneMask m) {
  std::uint8_t bytes[8] = {0};
  hn::StoreMaskBits(Tag(), m.m, bytes);
  return bytes[0];
}
/// table[index[lane]] for each lane.
HWY_INLINE Lanes gather(const double* table, const std::uint8_t* index) {
  alignas(64) double values[n_lanes];
  for (int lane = 0; lane < n_lanes; ++lane) values[lane] = table[index[lane]];
  return hn::Load(Tag(), values);
}

struct Lanes3 {
  Lanes x, y, z;
};
HWY_INLINE Lanes3 operator+(Lanes3 a, Lanes3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
HWY_INLINE Lanes3 operator-(Lanes3 a, Lanes3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
HWY_INLINE Lanes3 operator*(Lanes s, Lanes3 a) { return {s * a.x, s * a.y, s * a.z}; }
HWY_INLINE Lanes dot(Lanes3 a, Lanes3 b) { return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z)); }
HWY_INLINE Lanes3 fma(Lanes s, Lanes3 a, Lanes3 b) { return {fma(s, a.x, b.x), fma(s, a.y, b.y), fma(s, a.z, b.z)}; }
HWY_INLINE Lanes3 fnma(Lanes s, Lanes3 a, Lanes3 b) {
  return {fnma(s, a.x, b.x), fnma(s, a.y, b.y), fnma(s, a.z, b.z)};
}
HWY_INLINE Lanes3 cross(Lanes3 a, Lanes3 b) {
  return {fnma(a.z, b.y, a.y * b.z), fnma(a.x, b.z, a.z * b.x), fnma(a.y, b.x, a.x * b.y)};
}
HWY_INLINE Lanes3 select(LaneMask m, Lanes3 yes, Lanes3 no) {
  return {select(m, yes.x, no.x), select(m, yes.y, no.y), select(m, yes.z, no.z)};
}
HWY_INLINE Lanes3 keep_if(LaneMask m, Lanes3 yes) { return {keep_if(m, yes.x), keep_if(m, yes.y), keep_if(m, yes.z)}; }

/// Four lanes vectors: component c of n_lanes records of four doubles.
struct Lanes4 {
  Lanes a, b, c, d;
  HWY_INLINE Lanes3 xyz() const { return {a, b, c}; }
};

#if HWY_MAX_BYTES >= 32 && !defined(MORAINE_SIMD_PORTABLE)

using QuadTag = hn::FixedTag<double, 4>;
/// One record of four doubles.
struct Quad {
  hn::Vec<QuadTag> v;
};
HWY_INLINE Quad load_quad(const double* p) { return {hn::Load(QuadTag(), p)}; }
/// Three doubles, aligned or not, and zero.
HWY_INLINE Quad load_three(const double* p) { return {hn::MaskedLoad(hn::FirstN(QuadTag(), 3), QuadTag(), p)}; }
HWY_INLINE void store_quad(double* p, Quad a) { hn::Store(a.v, QuadTag(), p); }
HWY_INLINE Quad set_quad(double s) { return {hn::Set(QuadTag(), s)}; }
HWY_INLINE Quad operator+(Quad a, Quad b) { return {hn::Add(a.v, b.v)}; }
HWY_INLINE Quad operator-(Quad a, Quad b) { return {hn::Sub(a.v, b.v)}; }
HWY_INLINE Quad operator*(Quad a, Quad b) { return {hn::Mul(a.v, b.v)}; }
HWY_INLINE Quad fma(Quad a, Quad b, Quad c) { return {hn::MulAdd(a.v, b.v, c.v)}; }
HWY_INLINE Quad max(Quad a, Quad b) { return {hn::Max(a.v, b.v)}; }
/// The last double in all four places.
HWY_INLINE Quad last_of(Quad a) {
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
  return {hn::Vec<QuadTag>{_mm256_permute4x64_pd(a.v.raw, 0xff)}};
#else
  return {hn::Set(QuadTag(), hn::ExtractLane(a.v, 3))};
#endif
}
/// x y z of a, and the last of b.
HWY_INLINE Quad with_last(Quad a, Quad b) { return {hn::IfThenElse(hn::FirstN(QuadTag(), 3), a.v, b.v)}; }
/// -a where flip is the sign bit in all four places, a where it is zero.
HWY_INLINE Quad flip_sign(Quad a, std::uint64_t flip) {
  const auto bits64 = hn::Set(hn::FixedTag<std::uint64_t, 4>(), flip);
  return {hn::Xor(a.v, hn::BitCast(QuadTag(), bits64))};
}
HWY_INLINE Quad or_outside(Quad seen, Quad x, Quad low, Quad high) {
  const auto outside = hn::Or(hn::Lt(x.v, low.v), hn::Ge(x.v, high.v));
  return {hn::Or(seen.v, hn::VecFromMask(QuadTag(), outside))};
}
/// a where x is a number, zero where it is not.
HWY_INLINE Quad where_number(Quad x, Quad a) { return {hn::IfThenElseZero(hn::Eq(x.v, x.v), a.v)}; }
HWY_INLINE bool any_set(Quad seen) { return !hn::AllFalse(QuadTag(), hn::MaskFromVec(seen.v)); }

// Four records to four vectors and back. Each 128-bit block holds two doubles; blocks are paired by interleaving, then the
// odd and even blocks are put together. With eight lanes, lanes 0-3 and 4-7 are two such groups side by side.
HWY_INLINE void transpose(Lanes4& r) {
  const auto u0 = hn::InterleaveLower(Tag(), r.a.v, r.b.v);  // x0x1 z0z1
  const auto u1 = hn::InterleaveLower(Tag(), r.c.v, r.d.v);  // x2x3 z2z3
  const auto w0 = hn::InterleaveUpper(Tag(), r.a.v, r.b.v);  // y0y1 r0r1
  const auto w1 = hn::InterleaveUpper(Tag(), r.c.v, r.d.v);
  r.a = hn::OddEvenBlocks(hn::SwapAdjacentBlocks(u1), u0);
  r.c = hn::OddEvenBlocks(u1, hn::SwapAdjacentBlocks(u0));
  r.b = hn::OddEvenBlocks(hn::SwapAdjacentBlocks(w1), w0);
  r.d = hn::OddEvenBlocks(w1, hn::SwapAdjacentBlocks(w0));
}

template <typename Pointer>
HWY_INLINE Lanes4 load_rows(Pointer record) {
#if HWY_MAX_BYTES >= 64
  const QuadTag q;
  const auto row = [&](int k)
                       HWY_ATTR { return hn::Combine(Tag(), hn::Load(q, record(k + 4)), hn::Load(q, record(k))); };
#else
  const auto row = [&](int k) HWY_ATTR { return hn::Load(Tag(), record(k)); };
#endif
  return {row(0), row(1), row(2), row(3)};
}

template <typename Pointer>
HWY_INLINE void store_rows(Pointer record, const Lanes4& r) {
  const Lanes rows[4] = {r.a, r.b, r.c, r.d};
  for (int k = 0; k < 4; ++k) {
#if HWY_MAX_BYTES >= 64
    const QuadTag q;
    hn::Store(hn::LowerHalf(rows[k].v), q, record(k));
    hn::Store(hn::UpperHalf(q, rows[k].v), q, record(k + 4));
#else
    hn::Store(rows[k].v, Tag(), record(k));
#endif
  }
}

/// Records at record(lane), four doubles each, as four vectors.
template <typename Pointer>
HWY_INLINE Lanes4 load_records(Pointer record) {
  Lanes4 r = load_rows(record);
  transpose(r);
  return r;
}
template <typename Pointer>
HWY_INLINE void store_records(Pointer record, Lanes4 r) {
  transpose(r);
  store_rows(record, r);
}
/// Difference of the records at a(lane) and b(lane).
template <typename PointerA, typename PointerB>
HWY_INLINE Lanes4 load_difference(PointerA a, PointerB b) {
  const Lanes4 ra = load_rows(a), rb = load_rows(b);
  Lanes4 r{ra.a - rb.a, ra.b - rb.b, ra.c - rb.c, ra.d - rb.d};
  transpose(r);
  return r;
}

#else  // narrow or unknown vectors: the same results by plain code

struct Quad {
  double v[4];
};
HWY_INLINE Quad load_quad(const double* p) { return {{p[0], p[1], p[2], p[3]}}; }
HWY_INLINE Quad load_three(const double* p) { return {{p[0], p[1], p[2], 0.0}}; }
HWY_INLINE void store_quad(double* p, Quad a) {
  for (int k = 0; k < 4; ++k) p[k] = a.v[k];
}
HWY_INLINE Quad set_quad(double s) { return {{s, s, s, s}}; }
template <typename Operation>
HWY_INLINE Quad each(Operation f) {
  Quad r;
  for (int k = 0; k < 4; ++k) r.v[k] = f(k);
  return r;
}
HWY_INLINE Quad operator+(Quad a, Quad b) {
  return each([&](int k) { return a.v[k] + b.v[k]; });
}
HWY_INLINE Quad operator-(Quad a, Quad b) {
  return each([&](int k) { return a.v[k] - b.v[k]; });
}
HWY_INLINE Quad operator*(Quad a, Quad b) {
  return each([&](int k) { return a.v[k] * b.v[k]; });
}
HWY_INLINE Quad fma(Quad a, Quad b, Quad c) {
  return each([&](int k) { return __builtin_fma(a.v[k], b.v[k], c.v[k]); });
}
HWY_INLINE Quad max(Quad a, Quad b) {
  return each([&](int k) { return a.v[k] > b.v[k] ? a.v[k] : b.v[k]; });
}
HWY_INLINE Quad last_of(Quad a) { return set_quad(a.v[3]); }
HWY_INLINE Quad with_last(Quad a, Quad b) { return {{a.v[0], a.v[1], a.v[2], b.v[3]}}; }
HWY_INLINE Quad flip_sign(Quad a, std::uint64_t flip) {
  return flip ? each([&](int k) { return -a.v[k]; }) : a;
}
HWY_INLINE Quad or_outside(Quad seen, Quad x, Quad low, Quad high) {
  return each([&](int k) { return x.v[k] < low.v[k] || x.v[k] >= high.v[k] ? 1.0 : seen.v[k]; });
}
HWY_INLINE Quad where_number(Quad x, Quad a) {
  return each([&](int k) { return x.v[k] == x.v[k] ? a.v[k] : 0.0; });
}
HWY_INLINE bool any_set(Quad seen) { return seen.v[0] != 0 || seen.v[1] != 0 || seen.v[2] != 0 || seen.v[3] != 0; }

template <typename Pointer>
HWY_INLINE Lanes4 load_records(Pointer record) {
  alignas(64) double t[4][n_lanes];
  for (int lane = 0; lane < n_lanes; ++lane)
    for (int k = 0; k < 4; ++k) t[k][lane] = record(lane)[k];
  return {load(t[0]), load(t[1]), load(t[2]), load(t[3])};
}
template <typename Pointer>
HWY_INLINE void store_records(Pointer record, Lanes4 r) {
  alignas(64) double t[4][n_lanes];
  store(t[0], r.a), store(t[1], r.b), store(t[2], r.c), store(t[3], r.d);
  for (int lane = 0; lane < n_lanes; ++lane)
    for (int k = 0; k < 4; ++k) record(lane)[k] = t[k][lane];
}
template <typename PointerA, typename PointerB>
HWY_INLINE Lanes4 load_difference(PointerA a, PointerB b) {
  const Lanes4 ra = load_records(a), rb = load_records(b);
  return {ra.a - rb.a, ra.b - rb.b, ra.c - rb.c, ra.d - rb.d};
}

#endif

}  // namespace HWY_NAMESPACE
}  // namespace moraine
HWY_AFTER_NAMESPACE();

#endif
