// Lanes: a vector of doubles, or of twice as many floats, with arithmetic, and records of four doubles in and out of lanes. The only
// place that knows Highway. Included once per instruction set (see Highway's foreach_target.h), hence the unusual guard.
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
#include <type_traits>

HWY_BEFORE_NAMESPACE();
namespace moraine {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <typename Real>
using TagOf = hn::CappedTag<Real, 64 / sizeof(Real)>;
template <typename Real>
inline constexpr int n_lanes = HWY_MAX_BYTES >= 64             ? static_cast<int>(64 / sizeof(Real))
                               : HWY_MAX_BYTES >= sizeof(Real) ? static_cast<int>(HWY_MAX_BYTES / sizeof(Real))
                                                               : 1;

template <typename Real>
struct LaneMask {
  hn::Mask<TagOf<Real>> m;
  friend HWY_INLINE LaneMask operator&(LaneMask a, LaneMask b) { return {hn::And(a.m, b.m)}; }
  friend HWY_INLINE LaneMask operator|(LaneMask a, LaneMask b) { return {hn::Or(a.m, b.m)}; }
  /// b without a.
  friend HWY_INLINE LaneMask and_not(LaneMask a, LaneMask b) { return {hn::AndNot(a.m, b.m)}; }
  friend HWY_INLINE bool any(LaneMask a) { return !hn::AllFalse(TagOf<Real>(), a.m); }
  friend HWY_INLINE bool none(LaneMask a) { return hn::AllFalse(TagOf<Real>(), a.m); }
  friend HWY_INLINE int count(LaneMask a) { return static_cast<int>(hn::CountTrue(TagOf<Real>(), a.m)); }
};

/// A number stands for all lanes: 2.0 * x.
template <typename Real>
struct Lanes {
  using Tag = TagOf<Real>;
  hn::Vec<Tag> v;
  Lanes() = default;
  HWY_INLINE Lanes(hn::Vec<Tag> value) : v(value) {}
  HWY_INLINE Lanes(double value) : v(hn::Set(Tag(), static_cast<Real>(value))) {}

  friend HWY_INLINE Lanes operator+(Lanes a, Lanes b) { return hn::Add(a.v, b.v); }
  friend HWY_INLINE Lanes operator-(Lanes a, Lanes b) { return hn::Sub(a.v, b.v); }
  friend HWY_INLINE Lanes operator*(Lanes a, Lanes b) { return hn::Mul(a.v, b.v); }
  friend HWY_INLINE Lanes operator/(Lanes a, Lanes b) { return hn::Div(a.v, b.v); }
  friend HWY_INLINE Lanes operator-(Lanes a) { return hn::Neg(a.v); }
  /// a b + c, rounded once.
  friend HWY_INLINE Lanes fma(Lanes a, Lanes b, Lanes c) { return hn::MulAdd(a.v, b.v, c.v); }
  /// c - a b, rounded once.
  friend HWY_INLINE Lanes fnma(Lanes a, Lanes b, Lanes c) { return hn::NegMulAdd(a.v, b.v, c.v); }
  friend HWY_INLINE Lanes abs(Lanes a) { return hn::Abs(a.v); }
  friend HWY_INLINE Lanes sqrt(Lanes a) { return hn::Sqrt(a.v); }
  friend HWY_INLINE Lanes max(Lanes a, Lanes b) { return hn::Max(a.v, b.v); }
  friend HWY_INLINE Lanes min(Lanes a, Lanes b) { return hn::Min(a.v, b.v); }
  friend HWY_INLINE LaneMask<Real> operator<(Lanes a, Lanes b) { return {hn::Lt(a.v, b.v)}; }
  friend HWY_INLINE LaneMask<Real> operator>(Lanes a, Lanes b) { return {hn::Gt(a.v, b.v)}; }
  friend HWY_INLINE Lanes select(LaneMask<Real> m, Lanes yes, Lanes no) { return hn::IfThenElse(m.m, yes.v, no.v); }
  friend HWY_INLINE Lanes keep_if(LaneMask<Real> m, Lanes yes) { return hn::IfThenElseZero(m.m, yes.v); }
};
/// To keep a divisor from being zero: smaller than all that occurs, and one over it is still a number.
template <typename Real>
inline constexpr double tiny = sizeof(Real) == 8 ? 1e-300 : 1e-36;

template <typename Real>
HWY_INLINE Lanes<Real> load(const Real* p) {
  return hn::LoadU(TagOf<Real>(), p);
}
template <typename Real>
HWY_INLINE void store(Real* p, Lanes<Real> a) {
  hn::StoreU(a.v, TagOf<Real>(), p);
}
/// Cube root of a positive number, to round-off but not rounded exactly; zero for zero.
template <typename Real>
HWY_INLINE Lanes<Real> cbrt(Lanes<Real> a) {
  // A third of the bits is a third of the exponent and a start within 6 %; each of Newton's steps squares the error.
  using Bits = std::conditional_t<sizeof(Real) == 8, std::uint64_t, std::uint32_t>;
  constexpr Bits start = sizeof(Real) == 8 ? static_cast<Bits>(0x2A9F789300000000ull) : Bits{0x2A5119F2u};
  const hn::Repartition<Bits, TagOf<Real>> d;
  const auto bits = hn::BitCast(d, a.v);
  auto third =
      hn::Add(hn::template ShiftRight<2>(bits), hn::template ShiftRight<4>(bits));  // 1/3 = 1/4 + 1/16 + 1/64 ...
  third = hn::Add(third, hn::template ShiftRight<4>(third));
  third = hn::Add(third, hn::template ShiftRight<8>(third));
  third = hn::Add(third, hn::template ShiftRight<16>(third));
  Lanes<Real> x = hn::BitCast(TagOf<Real>(), hn::Add(third, hn::Set(d, start)));
  for (int i = 0; i < 4; ++i) x = (x + x + a / (x * x)) * (1.0 / 3.0);
  return keep_if(a > 0.0, x);
}
/// One bit a lane, lane 0 lowest.
template <typename Real>
HWY_INLINE unsigned bits(LaneMask<Real> m) {
  std::uint8_t bytes[8] = {0};
  hn::StoreMaskBits(TagOf<Real>(), m.m, bytes);
  return bytes[0] | static_cast<unsigned>(bytes[1]) << 8;
}
/// Of a vector of up to 16 numbers those whose bits are set, the lowest for the first; further bits do not matter.
template <typename Tag>
HWY_INLINE hn::Mask<Tag> mask_of_bits(Tag tag, unsigned bits) {
  const unsigned own = bits & ((1u << hn::Lanes(tag)) - 1u);
  const std::uint8_t bytes[8] = {static_cast<std::uint8_t>(own), static_cast<std::uint8_t>(own >> 8)};
  return hn::LoadMaskBits(tag, bytes);
}
template <typename Real>
HWY_INLINE LaneMask<Real> lanes_of(unsigned bits) {
  return {mask_of_bits(TagOf<Real>(), bits)};
}
/// first, first + 1, ... in the lanes.
template <typename Real>
HWY_INLINE Lanes<Real> counting_from(double first) {
  return Lanes<Real>(first) + hn::Iota(TagOf<Real>(), Real{0});
}
/// The first n lanes, or all where there are no more.
template <typename Real>
HWY_INLINE LaneMask<Real> first_lanes(std::int64_t n) {
  return {hn::FirstN(TagOf<Real>(), static_cast<std::size_t>(n < n_lanes<Real> ? n : n_lanes<Real>))};
}
/// Writes the marked lanes of a vector one behind the other, and may write anything to the lanes behind them.
template <typename Tag>
HWY_INLINE void compress_to(hn::TFromD<Tag>* p, hn::Vec<Tag> v, hn::Mask<Tag> m, Tag tag) {
#if HWY_TARGET <= HWY_AVX3 && HWY_ARCH_X86
  // Put together in a register and then stored: some processors take a hundred cycles and more to store what is being put together. (Highway does
  // it by a table for numbers of 64 bits.)
  if constexpr (sizeof(v.raw) == 64) {
    if constexpr (std::is_same_v<hn::TFromD<Tag>, double>)
      _mm512_storeu_pd(p, _mm512_maskz_compress_pd(m.raw, v.raw));
    else
      _mm512_storeu_si512(p, _mm512_maskz_compress_epi32(m.raw, v.raw));
    return;
  }
#endif
  hn::CompressStore(v, m, tag, p);
}
/// Writes the lanes of m one behind the other, and may write anything to the lanes behind them; returns how many they are.
HWY_INLINE int store_together(double* p, Lanes<double> a, LaneMask<double> m) {
  compress_to(p, a.v, m.m, TagOf<double>());
  return count(m);
}
/// Writes those of 16 whole numbers whose bits are set, bit 0 for the first, one behind the other, and may write anything to the rest of 16
/// places.
HWY_INLINE void store_marked(std::int32_t* p, const std::int32_t* numbers, unsigned bits) {
  const hn::CappedTag<std::int32_t, 16> tag;
  const int n = static_cast<int>(hn::Lanes(tag));
  for (int first = 0; first < 16; first += n) {
    const auto mask = mask_of_bits(tag, bits >> first);
    compress_to(p, hn::LoadU(tag, numbers + first), mask, tag);
    p += hn::CountTrue(tag, mask);
  }
}
/// Which of n_lanes<double> whole numbers are below another: one bit each.
HWY_INLINE unsigned bits_below(const std::int64_t* numbers, std::int64_t other) {
  const hn::RebindToSigned<TagOf<double>> tag;
  std::uint8_t bytes[8] = {0};
  hn::StoreMaskBits(tag, hn::Lt(hn::LoadU(tag, numbers), hn::Set(tag, other)), bytes);
  return bytes[0];
}
/// table[index[lane]] for each lane.
template <typename Real>
HWY_INLINE Lanes<Real> gather(const double* table, const std::uint8_t* index) {
  alignas(64) Real values[n_lanes<Real>];
  for (int lane = 0; lane < n_lanes<Real>; ++lane) values[lane] = static_cast<Real>(table[index[lane]]);
  return hn::Load(TagOf<Real>(), values);
}
/// Two vectors of doubles, one behind the other, rounded to one of floats.
HWY_INLINE Lanes<float> narrowed(Lanes<double> first, Lanes<double> second) {
  const hn::Half<TagOf<float>> half;
  return hn::Combine(TagOf<float>(), hn::DemoteTo(half, second.v), hn::DemoteTo(half, first.v));
}

template <typename Real>
struct Lanes3 {
  Lanes<Real> x, y, z;

  friend HWY_INLINE Lanes3 operator+(Lanes3 a, Lanes3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend HWY_INLINE Lanes3 operator-(Lanes3 a, Lanes3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend HWY_INLINE Lanes3 operator*(Lanes<Real> s, Lanes3 a) { return {s * a.x, s * a.y, s * a.z}; }
  friend HWY_INLINE Lanes<Real> dot(Lanes3 a, Lanes3 b) { return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z)); }
  friend HWY_INLINE Lanes3 fma(Lanes<Real> s, Lanes3 a, Lanes3 b) {
    return {fma(s, a.x, b.x), fma(s, a.y, b.y), fma(s, a.z, b.z)};
  }
  friend HWY_INLINE Lanes3 fnma(Lanes<Real> s, Lanes3 a, Lanes3 b) {
    return {fnma(s, a.x, b.x), fnma(s, a.y, b.y), fnma(s, a.z, b.z)};
  }
  friend HWY_INLINE Lanes3 cross(Lanes3 a, Lanes3 b) {
    return {fnma(a.z, b.y, a.y * b.z), fnma(a.x, b.z, a.z * b.x), fnma(a.y, b.x, a.x * b.y)};
  }
  friend HWY_INLINE Lanes3 select(LaneMask<Real> m, Lanes3 yes, Lanes3 no) {
    return {select(m, yes.x, no.x), select(m, yes.y, no.y), select(m, yes.z, no.z)};
  }
  friend HWY_INLINE Lanes3 keep_if(LaneMask<Real> m, Lanes3 yes) {
    return {keep_if(m, yes.x), keep_if(m, yes.y), keep_if(m, yes.z)};
  }
};
template <typename Real>
Lanes3(Lanes<Real>, Lanes<Real>, Lanes<Real>) -> Lanes3<Real>;
HWY_INLINE Lanes3<float> narrowed(Lanes3<double> first, Lanes3<double> second) {
  return {narrowed(first.x, second.x), narrowed(first.y, second.y), narrowed(first.z, second.z)};
}

/// Four lanes vectors: component c of n_lanes records of four numbers.
template <typename Real>
struct Lanes4 {
  Lanes<Real> a, b, c, d;
  HWY_INLINE Lanes3<Real> xyz() const { return {a, b, c}; }
};
template <typename Real>
Lanes4(Lanes<Real>, Lanes<Real>, Lanes<Real>, Lanes<Real>) -> Lanes4<Real>;
HWY_INLINE Lanes4<float> narrowed(Lanes4<double> first, Lanes4<double> second) {
  return {narrowed(first.a, second.a), narrowed(first.b, second.b), narrowed(first.c, second.c),
          narrowed(first.d, second.d)};
}
/// The first and the second half of a vector of floats as doubles.
HWY_INLINE Lanes<double> widened_first(Lanes<float> a) { return hn::PromoteTo(TagOf<double>(), hn::LowerHalf(a.v)); }
HWY_INLINE Lanes<double> widened_second(Lanes<float> a) {
  return hn::PromoteTo(TagOf<double>(), hn::UpperHalf(hn::Half<TagOf<float>>(), a.v));
}

#if HWY_MAX_BYTES >= 32 && !defined(MORAINE_SIMD_PORTABLE)

using QuadTag = hn::FixedTag<double, 4>;
/// One record of four doubles.
struct Quad {
  hn::Vec<QuadTag> v;
};
HWY_INLINE Quad load_quad(const double* p) { return {hn::Load(QuadTag(), p)}; }
/// Three doubles, aligned or not, and zero.
HWY_INLINE Quad load_three(const double* p) { return {hn::MaskedLoad(hn::FirstN(QuadTag(), 3), QuadTag(), p)}; }
/// Four floats, as doubles.
HWY_INLINE Quad load_quad(const float* p) { return {hn::PromoteTo(QuadTag(), hn::Load(hn::FixedTag<float, 4>(), p))}; }
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
/// -a where flips is one, a where it is zero.
HWY_INLINE Quad flip_sign_if(std::uint64_t flips, Quad a) {
  alignas(32) static constexpr double signs[2][4] = {{0.0, 0.0, 0.0, 0.0}, {-0.0, -0.0, -0.0, -0.0}};
  return {hn::Xor(a.v, hn::Load(QuadTag(), signs[flips]))};
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
HWY_INLINE void transpose(Lanes4<double>& r) {
  const TagOf<double> tag;
  const auto u0 = hn::InterleaveLower(tag, r.a.v, r.b.v);  // x0x1 z0z1
  const auto u1 = hn::InterleaveLower(tag, r.c.v, r.d.v);  // x2x3 z2z3
  const auto w0 = hn::InterleaveUpper(tag, r.a.v, r.b.v);  // y0y1 r0r1
  const auto w1 = hn::InterleaveUpper(tag, r.c.v, r.d.v);
  r.a = hn::OddEvenBlocks(hn::SwapAdjacentBlocks(u1), u0);
  r.c = hn::OddEvenBlocks(u1, hn::SwapAdjacentBlocks(u0));
  r.b = hn::OddEvenBlocks(hn::SwapAdjacentBlocks(w1), w0);
  r.d = hn::OddEvenBlocks(w1, hn::SwapAdjacentBlocks(w0));
}
// A 128-bit block holds a whole record of four floats: four blocks side by side, of lanes 4 b to 4 b + 3.
HWY_INLINE void transpose(Lanes4<float>& r) {
  const TagOf<float> tag;
  const hn::Repartition<double, TagOf<float>> pairs;
  const auto u0 = hn::BitCast(pairs, hn::InterleaveLower(tag, r.a.v, r.b.v));  // x0x1 y0y1
  const auto u1 = hn::BitCast(pairs, hn::InterleaveLower(tag, r.c.v, r.d.v));  // x2x3 y2y3
  const auto w0 = hn::BitCast(pairs, hn::InterleaveUpper(tag, r.a.v, r.b.v));  // z0z1 r0r1
  const auto w1 = hn::BitCast(pairs, hn::InterleaveUpper(tag, r.c.v, r.d.v));
  r.a = hn::BitCast(tag, hn::InterleaveLower(pairs, u0, u1));
  r.b = hn::BitCast(tag, hn::InterleaveUpper(pairs, u0, u1));
  r.c = hn::BitCast(tag, hn::InterleaveLower(pairs, w0, w1));
  r.d = hn::BitCast(tag, hn::InterleaveUpper(pairs, w0, w1));
}

/// The record of lane k, and in vectors of eight that of lane k + 4 behind it: four such rows and a transposition make lanes.
template <typename Pointer>
HWY_INLINE Lanes<double> load_row(Pointer record, int k) {
#if HWY_MAX_BYTES >= 64
  const QuadTag q;
  return hn::Combine(TagOf<double>(), hn::LoadU(q, record(k + 4)), hn::LoadU(q, record(k)));
#else
  return hn::LoadU(TagOf<double>(), record(k));
#endif
}
/// The same of floats: the record of lane k, those of k + 4, and in vectors of sixteen k + 8 and k + 12.
template <typename Pointer>
HWY_INLINE Lanes<float> load_float_row(Pointer record, int k) {
  const hn::FixedTag<float, 4> q;
  const hn::FixedTag<float, 8> half;
  const auto first = hn::Combine(half, hn::LoadU(q, record(k + 4)), hn::LoadU(q, record(k)));
#if HWY_MAX_BYTES >= 64
  const auto second = hn::Combine(half, hn::LoadU(q, record(k + 12)), hn::LoadU(q, record(k + 8)));
  return hn::Combine(TagOf<float>(), second, first);
#else
  return first;
#endif
}

/// Calls put(four numbers, where) for every row.
template <typename Pointer, typename Function>
HWY_INLINE void each_row(Pointer record, Lanes4<double> r, Function put) {
  transpose(r);
  const Lanes<double> rows[4] = {r.a, r.b, r.c, r.d};
  for (int k = 0; k < 4; ++k) {
#if HWY_MAX_BYTES >= 64
    put(hn::LowerHalf(rows[k].v), record(k));
    put(hn::UpperHalf(QuadTag(), rows[k].v), record(k + 4));
#else
    put(rows[k].v, record(k));
#endif
  }
}
template <typename Pointer, typename Function>
HWY_INLINE void each_row(Pointer record, Lanes4<float> r, Function put) {
  transpose(r);
  const Lanes<float> rows[4] = {r.a, r.b, r.c, r.d};
  const hn::FixedTag<float, 4> q;
  for (int k = 0; k < 4; ++k) {
#if HWY_MAX_BYTES >= 64
    const hn::FixedTag<float, 8> half;
    const auto first = hn::LowerHalf(half, rows[k].v), second = hn::UpperHalf(half, rows[k].v);
    put(hn::LowerHalf(q, first), record(k));
    put(hn::UpperHalf(q, first), record(k + 4));
    put(hn::LowerHalf(q, second), record(k + 8));
    put(hn::UpperHalf(q, second), record(k + 12));
#else
    put(hn::LowerHalf(q, rows[k].v), record(k));
    put(hn::UpperHalf(q, rows[k].v), record(k + 4));
#endif
  }
}

/// Records at record(lane), four numbers each, as four vectors.
template <typename Real = double, typename Pointer>
HWY_INLINE Lanes4<Real> load_records(Pointer record) {
  const auto row = [&](int k) HWY_ATTR {
    if constexpr (sizeof(Real) == 8)
      return load_row(record, k);
    else
      return load_float_row(record, k);
  };
  Lanes4<Real> r{row(0), row(1), row(2), row(3)};
  transpose(r);
  return r;
}
/// And back, to records that begin at multiples of their size.
template <typename Real, typename Pointer>
HWY_INLINE void store_records(Pointer record, const Lanes4<Real>& r) {
  const hn::FixedTag<Real, 4> q;
  each_row(record, r, [&](auto row, Real* p) HWY_ATTR { hn::Store(row, q, p); });
}
/// Writes the first three numbers of each record.
template <typename Real, typename Pointer>
HWY_INLINE void store_threes(Pointer record, const Lanes3<Real>& r) {
  const hn::FixedTag<Real, 4> q;
  const auto three = hn::FirstN(q, 3);
  each_row(record, Lanes4<Real>{r.x, r.y, r.z, r.z},
           [&](auto row, Real* p) HWY_ATTR { hn::BlendedStore(row, three, q, p); });
}
/// Of the rows k of a and b: the difference of the first three numbers, the sum of the last.
template <typename PointerA, typename PointerB>
HWY_INLINE Lanes<double> row_apart(PointerA a, PointerB b, int k) {
  alignas(64) static constexpr double signs[8] = {-0.0, -0.0, -0.0, 0.0, -0.0, -0.0, -0.0, 0.0};
  const Lanes<double> turned = hn::Xor(load_row(b, k).v, hn::Load(TagOf<double>(), signs));
  return load_row(a, k) + turned;
}
/// Of the records at a(lane) and b(lane): the difference of the first three numbers, the sum of the last.
template <typename PointerA, typename PointerB>
HWY_INLINE Lanes4<double> load_apart(PointerA a, PointerB b) {
  Lanes4<double> r{row_apart(a, b, 0), row_apart(a, b, 1), row_apart(a, b, 2), row_apart(a, b, 3)};
  transpose(r);
  return r;
}

/// The same for twice as many rows, rounded to float when all else is done.
template <typename Row>
HWY_INLINE Lanes4<float> narrowed_rows(Row row) {
  constexpr int n = n_lanes<double>;
  Lanes4<float> r{narrowed(row(0), row(n)), narrowed(row(1), row(n + 1)), narrowed(row(2), row(n + 2)),
                  narrowed(row(3), row(n + 3))};
  transpose(r);
  return r;
}
template <typename PointerA, typename PointerB>
HWY_INLINE Lanes4<float> load_narrowed_apart(PointerA a, PointerB b) {
  return narrowed_rows([&](int k) HWY_ATTR { return row_apart(a, b, k); });
}
template <typename PointerA, typename PointerB>
HWY_INLINE Lanes4<float> load_narrowed_sum(PointerA a, PointerB b) {
  return narrowed_rows([&](int k) HWY_ATTR { return load_row(a, k) + load_row(b, k); });
}
/// Records of eight floats: those of both.
template <typename Pointer>
HWY_INLINE void store_records(Pointer record, Lanes4<float> front, Lanes4<float> back) {
  transpose(front);
  transpose(back);
  const Lanes<float> f[4] = {front.a, front.b, front.c, front.d}, b[4] = {back.a, back.b, back.c, back.d};
  for (int k = 0; k < 4; ++k) {
    const auto even = hn::OddEvenBlocks(hn::SwapAdjacentBlocks(b[k].v), f[k].v);
    const auto odd = hn::OddEvenBlocks(b[k].v, hn::SwapAdjacentBlocks(f[k].v));
#if HWY_MAX_BYTES >= 64
    const hn::FixedTag<float, 8> half;
    hn::StoreU(hn::LowerHalf(half, even), half, record(k));
    hn::StoreU(hn::LowerHalf(half, odd), half, record(k + 4));
    hn::StoreU(hn::UpperHalf(half, even), half, record(k + 8));
    hn::StoreU(hn::UpperHalf(half, odd), half, record(k + 12));
#else
    hn::StoreU(even, TagOf<float>(), record(k));
    hn::StoreU(odd, TagOf<float>(), record(k + 4));
#endif
  }
}

#else  // narrow or unknown vectors: the same results by plain code

struct Quad {
  double v[4];
};
HWY_INLINE Quad load_quad(const double* p) { return {{p[0], p[1], p[2], p[3]}}; }
HWY_INLINE Quad load_three(const double* p) { return {{p[0], p[1], p[2], 0.0}}; }
HWY_INLINE Quad load_quad(const float* p) { return {{p[0], p[1], p[2], p[3]}}; }
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
HWY_INLINE Quad flip_sign_if(std::uint64_t flips, Quad a) {
  return flips ? each([&](int k) { return -a.v[k]; }) : a;
}
HWY_INLINE Quad or_outside(Quad seen, Quad x, Quad low, Quad high) {
  return each([&](int k) { return x.v[k] < low.v[k] || x.v[k] >= high.v[k] ? 1.0 : seen.v[k]; });
}
HWY_INLINE Quad where_number(Quad x, Quad a) {
  return each([&](int k) { return x.v[k] == x.v[k] ? a.v[k] : 0.0; });
}
HWY_INLINE bool any_set(Quad seen) { return seen.v[0] != 0 || seen.v[1] != 0 || seen.v[2] != 0 || seen.v[3] != 0; }

template <typename Real = double, typename Pointer>
HWY_INLINE Lanes4<Real> load_records(Pointer record) {
  alignas(64) Real t[4][n_lanes<Real>];
  for (int lane = 0; lane < n_lanes<Real>; ++lane)
    for (int k = 0; k < 4; ++k) t[k][lane] = record(lane)[k];
  return {load(t[0]), load(t[1]), load(t[2]), load(t[3])};
}
template <int n_numbers, typename Real, typename Pointer>
HWY_INLINE void store_plainly(Pointer record, const Lanes4<Real>& r) {
  alignas(64) Real t[4][n_lanes<Real>];
  store(t[0], r.a), store(t[1], r.b), store(t[2], r.c), store(t[3], r.d);
  for (int lane = 0; lane < n_lanes<Real>; ++lane)
    for (int k = 0; k < n_numbers; ++k) record(lane)[k] = t[k][lane];
}
template <typename Real, typename Pointer>
HWY_INLINE void store_records(Pointer record, const Lanes4<Real>& r) {
  store_plainly<4>(record, r);
}
template <typename Real, typename Pointer>
HWY_INLINE void store_threes(Pointer record, const Lanes3<Real>& r) {
  store_plainly<3>(record, Lanes4<Real>{r.x, r.y, r.z, r.z});
}
template <typename PointerA, typename PointerB>
HWY_INLINE Lanes4<double> load_apart(PointerA a, PointerB b) {
  const Lanes4<double> ra = load_records(a), rb = load_records(b);
  return {ra.a - rb.a, ra.b - rb.b, ra.c - rb.c, ra.d + rb.d};
}
template <typename Pointer>
HWY_INLINE void store_records(Pointer record, Lanes4<float> front, Lanes4<float> back) {
  store_plainly<4>(record, front);
  store_plainly<4>([&](int lane) HWY_ATTR { return record(lane) + 4; }, back);
}
/// The same for twice as many records, rounded to float when all else is done; and sums of all four numbers.
template <typename Pointer>
HWY_INLINE auto from_second_half(Pointer record) {
  return [=](int lane) HWY_ATTR { return record(lane + n_lanes<double>); };
}
template <typename PointerA, typename PointerB>
HWY_INLINE Lanes4<float> load_narrowed_apart(PointerA a, PointerB b) {
  return narrowed(load_apart(a, b), load_apart(from_second_half(a), from_second_half(b)));
}
template <typename PointerA, typename PointerB>
HWY_INLINE Lanes4<double> load_sum(PointerA a, PointerB b) {
  const Lanes4<double> ra = load_records(a), rb = load_records(b);
  return {ra.a + rb.a, ra.b + rb.b, ra.c + rb.c, ra.d + rb.d};
}
template <typename PointerA, typename PointerB>
HWY_INLINE Lanes4<float> load_narrowed_sum(PointerA a, PointerB b) {
  return narrowed(load_sum(a, b), load_sum(from_second_half(a), from_second_half(b)));
}

#endif

}  // namespace HWY_NAMESPACE
}  // namespace moraine
HWY_AFTER_NAMESPACE();

#endif
