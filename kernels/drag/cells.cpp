#include "kernels/drag/cells.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace moraine {

namespace {

constexpr double four_thirds_pi = 4.188790204786390985;

/// Four numbers at once: as many as a cell has, or half of them. Any compiler makes of it what the processor has.
using Four = double __attribute__((vector_size(32)));
using FourIntegers = std::int64_t __attribute__((vector_size(32)));
using FourPlaces = std::int32_t __attribute__((vector_size(16)));

inline Four all(double x) { return Four{x, x, x, x}; }
template <typename Vector, typename Number>
inline Vector load(const Number* from) {
  Vector v;
  std::memcpy(&v, from, sizeof v);
  return v;
}
template <typename Vector, typename Number>
inline void store(const Vector& v, Number* to) {
  std::memcpy(to, &v, sizeof v);
}

/// Rounds |x| < 2^50 to integers: adding 1.5 * 2^52 leaves them in the lowest bits of the sum.
constexpr double rounding = 6755399441055744.0;
inline std::int64_t to_integer(double x) {
  return std::bit_cast<std::int64_t>(x + rounding) - std::bit_cast<std::int64_t>(rounding);
}
inline FourIntegers to_integers(Four x) {
  return std::bit_cast<FourIntegers>(x + all(rounding)) - std::bit_cast<FourIntegers>(all(rounding));
}

/// Where a grain's first cell lies in a window, and the weights of the second ones.
struct Stencil {
  std::int64_t cell;
  double x, y, z;
};

/// The stencils of grains in a window.
class Stencils {
 public:
  Stencils(const CellWeights& weights, const CellWindow& window)
      : origin_(window.line(0, 0) - window.low[0]),
        line_{window.size(0), std::int64_t{window.size(0)} * window.size(1)},
        step_{weights.axes[0].pair, weights.axes[1].pair * line_[0], weights.axes[2].pair * line_[1]} {
    for (std::size_t a = 0; a < 3; ++a) {
      const CellWeights::Axis& axis = weights.axes[a];
      low_[a] = axis.low;
      inverse_spacing_[a] = axis.inverse_spacing;
      shift_[a] = axis.shift;
      least_[a] = axis.least;
      most_[a] = axis.most;
      last_[a] = axis.last;
      pair_[a] = axis.pair;
    }
  }
  /// As CellWeights::Axis::first() along each axis; `place` has a fourth number, whatever it is.
  Stencil of(const double* place) const {
    Four p = (load<Four>(place) - low_) * inverse_spacing_ - shift_;
    p = least_ < p ? p : least_;
    p = p < most_ ? p : most_;
    FourPlaces cell = __builtin_convertvector(p + all(1.0), FourPlaces) - 1;
    cell = cell < last_ ? cell : last_;
    const Four weight = pair_ * (p - __builtin_convertvector(cell, Four));
    return {origin_ + cell[0] + cell[1] * line_[0] + cell[2] * line_[1], weight[0], weight[1], weight[2]};
  }
  /// From a grain's first cells to the second ones.
  std::int64_t step(std::size_t axis) const { return step_[axis]; }
  bool has_one_cell() const { return (step_[0] | step_[1] | step_[2]) == 0; }
  int n_layers() const { return step_[2] == 0 ? 1 : 2; }

 private:
  Four low_{}, inverse_spacing_{}, shift_{}, least_{}, most_{}, pair_{};
  FourPlaces last_{};
  std::int64_t origin_;
  std::array<std::int64_t, 2> line_;  // cells from a line to the next, and from a layer
  std::array<std::int64_t, 3> step_;
};

/// Calls add(cell, weight) for the cells of a stencil.
template <typename Add>
inline void spread(const Stencils& stencils, const Stencil& s, Add add) {
  if (stencils.has_one_cell()) return add(s.cell, 1.0);
  const std::int64_t dx = stencils.step(0), dy = stencils.step(1);
  const double x0 = 1.0 - s.x, y0 = 1.0 - s.y;
  const double w00 = x0 * y0, w10 = s.x * y0, w01 = x0 * s.y, w11 = s.x * s.y;
  std::int64_t at = s.cell;
  for (int layer = 0; layer < stencils.n_layers(); ++layer, at += stencils.step(2)) {
    const double z = layer == 0 ? 1.0 - s.z : s.z;
    add(at, w00 * z);
    add(at + dx, w10 * z);
    add(at + dy, w01 * z);
    add(at + dx + dy, w11 * z);
  }
}

inline Four mix(Four a, Four b, double weight) { return a + all(weight) * (b - a); }

/// Interpolates numbers [4 part, 4 part + 4) of the `width` that each cell has by steps between two, so that constants stay what they are.
template <int width>
inline Four interpolate(const Stencils& stencils, const Stencil& s, const double* cells, int part = 0) {
  const std::int64_t dx = stencils.step(0) * width, dy = stencils.step(1) * width;
  const double* at = cells + s.cell * width + 4 * part;
  if (stencils.has_one_cell()) return load<Four>(at);
  Four layers[2];
  const int n_layers = stencils.n_layers();
  for (int layer = 0; layer < n_layers; ++layer, at += stencils.step(2) * width)
    layers[layer] = mix(mix(load<Four>(at), load<Four>(at + dx), s.x),
                        mix(load<Four>(at + dy), load<Four>(at + dx + dy), s.x), s.y);
  return mix(layers[0], layers[n_layers - 1], s.z);
}

/// Record i, and asks for one that comes later: loops over grains wait for memory more than they compute.
inline const double* record_and_ask_ahead(const GrainView& grains, std::int64_t i) {
  constexpr std::int64_t ahead = 24;
  const double* const later = grains.record(i + ahead);
  __builtin_prefetch(later);
  __builtin_prefetch(later + 8);  // a line further
  return grains.record(i);
}

inline bool is_here(const double* record) { return record[0] == record[0]; }

inline double volume(double radius) { return four_thirds_pi * radius * radius * radius; }

}  // namespace

int CellWeights::Axis::first(double x, double& weight) const {
  // in this order NaN counts as the least place
  const double place = std::min(most, std::max(least, (x - low) * inverse_spacing - shift));
  const int cell = std::min(static_cast<int>(place + 1.0) - 1, last);  // places are not below -1
  weight = pair * (place - cell);
  return cell;
}

CellWeights::CellWeights(GasWeights kind, std::array<int, 3> n, Vec3 low, Vec3 spacing, std::array<bool, 3> periodic) {
  const std::array<double, 3> lows = {low.x, low.y, low.z}, spacings = {spacing.x, spacing.y, spacing.z};
  for (std::size_t a = 0; a < 3; ++a) {
    const bool has_pairs = kind != GasWeights::cell && n[a] > 1;
    axes[a] = {lows[a], 1.0 / spacings[a], 0.0, 0.0, static_cast<double>(n[a]), n[a] - 1, 0};
    if (!has_pairs) continue;
    axes[a].shift = 0.5;
    axes[a].pair = 1;
    axes[a].least = periodic[a] ? -0.5 : 0.0;
    axes[a].most = n[a] - (periodic[a] ? 0.5 : 1.0);
    axes[a].last = n[a] - (periodic[a] ? 1 : 2);
  }
}

CellWindow CellWeights::around(Vec3 low, Vec3 high) const {
  const std::array<double, 3> lows = {low.x, low.y, low.z}, highs = {high.x, high.y, high.z};
  CellWindow window;
  double weight = 0.0;
  for (std::size_t a = 0; a < 3; ++a) {
    window.low[a] = axes[a].first(lows[a], weight);
    window.high[a] = axes[a].first(highs[a], weight) + axes[a].pair + 1;
  }
  return window;
}

void GrainExtent::add(const GrainExtent& other) {
  low = {std::min(low.x, other.low.x), std::min(low.y, other.low.y), std::min(low.z, other.low.z)};
  high = {std::max(high.x, other.high.x), std::max(high.y, other.high.y), std::max(high.z, other.high.z)};
  largest_radius = std::max(largest_radius, other.largest_radius);
  n += other.n;
}

GrainExtent extent(const GrainView& grains) {
  GrainExtent all;
  double low[4] = {1e300, 1e300, 1e300, 0.0}, high[4] = {-1e300, -1e300, -1e300, 0.0};
  for (std::int64_t i = grains.range.begin; i < grains.range.end; ++i) {
    const double* const record = record_and_ask_ahead(grains, i);
    if (!is_here(record)) continue;
    for (int c = 0; c < 4; ++c) {
      low[c] = std::min(low[c], record[c]);
      high[c] = std::max(high[c], record[c]);
    }
    ++all.n;
  }
  all.low = {low[0], low[1], low[2]};
  all.high = {high[0], high[1], high[2]};
  all.largest_radius = high[3];
  return all;
}

void deposit_volume(const GrainView& grains, const CellWeights& weights, const CellWindow& window, double scale,
                    std::int64_t* cells) {
  const Stencils stencils(weights, window);
  for (std::int64_t i = grains.range.begin; i < grains.range.end; ++i) {
    const double* const record = record_and_ask_ahead(grains, i);
    if (!is_here(record)) continue;
    const double scaled = volume(record[3]) * scale;
    spread(stencils, stencils.of(record),
           [&](std::int64_t cell, double weight) { cells[cell] += to_integer(scaled * weight); });
  }
}

void gather_slip(const GrainView& grains, const CellWeights& weights, const CellWindow& window, const double* cells,
                 bool is_flat, SlipTile& tile) {
  const Stencils stencils(weights, window);
  for (std::int64_t i = grains.range.begin; i < grains.range.end; ++i) {
    const std::int64_t t = i - grains.range.begin;
    const double* const record = record_and_ask_ahead(grains, i);
    Four gas{1.0, 0.0, 0.0, 0.0};
    const bool takes_part = is_here(record);
    if (takes_part) gas = interpolate<4>(stencils, stencils.of(record), cells);
    const double dx = gas[1] - record[4], dy = gas[2] - record[5], dz = is_flat ? 0.0 : gas[3] - record[6];
    tile.void_fraction[t] = gas[0];
    tile.slip[t] = takes_part ? std::sqrt(dx * dx + dy * dy + dz * dz) : 0.0;
    tile.radius[t] = takes_part ? record[3] : 0.0;
    tile.inverse_mass[t] = takes_part ? record[7] : 0.0;
    tile.speed[t] = takes_part ? std::max({std::abs(record[4]), std::abs(record[5]), std::abs(record[6])}) : 0.0;
  }
}

void deposit_exchange(const GrainView& grains, const CellWeights& weights, const CellWindow& window,
                      const double* coefficient, double scale, double momentum_scale, bool is_flat,
                      std::int64_t* cells) {
  const Stencils stencils(weights, window);
  const double z_scale = is_flat ? 0.0 : momentum_scale;
  for (std::int64_t i = grains.range.begin; i < grains.range.end; ++i) {
    const double* const record = record_and_ask_ahead(grains, i);
    if (!is_here(record)) continue;
    const double c = coefficient[i];
    const Four values = {c * scale, c * record[4] * momentum_scale, c * record[5] * momentum_scale,
                         c * record[6] * z_scale};
    spread(stencils, stencils.of(record), [&](std::int64_t cell, double weight) {
      std::int64_t* const sums = cells + 4 * cell;
      store(load<FourIntegers>(sums) + to_integers(values * all(weight)), sums);
    });
  }
}

void feel(const GrainView& grains, const CellWeights& weights, const CellWindow& window, const double* cells,
          const double* coefficient, const Feel& how, double* acceleration, ForceSums& sums) {
  const Stencils stencils(weights, window);
  const double of_gradient = how.has_gradient ? 1.0 : 0.0, of_z = how.is_flat ? 0.0 : 1.0;
  const Four buoyancy = {how.buoyancy.x, how.buoyancy.y, how.buoyancy.z, 0.0}, along = {1.0, 1.0, of_z, 0.0};
  FourIntegers drags{};
  for (std::int64_t i = grains.range.begin; i < grains.range.end; ++i) {
    const double* const record = record_and_ask_ahead(grains, i);
    double* const a = acceleration + 3 * i;
    if (!is_here(record)) {
      a[0] = a[1] = a[2] = 0.0;
      continue;
    }
    const Stencil place = stencils.of(record);
    const Four gas = interpolate<8>(stencils, place, cells), gradient = interpolate<8>(stencils, place, cells, 1);
    const double c = coefficient[i], v = volume(record[3]), inverse_mass = record[7];
    const Four drag = all(c) * (gas - load<Four>(record + 4)) * along;
    const Four push = (drag + all(v) * (buoyancy - all(of_gradient) * gradient)) * all(inverse_mass) * along;
    const double share =
        how.fluid_density > 0.0 ? share_at_once(carried_mass(how.fluid_density, gas[3], v, inverse_mass)) : 1.0;
    if (share < 1.0 && a[0] == 0.0 && a[1] == 0.0 && a[2] == 0.0)  // born since: it has been in the fluid at rest
      for (int axis = 0; axis < 3; ++axis) a[axis] = v * buoyancy[axis] * inverse_mass * along[axis];
    for (int axis = 0; axis < 3; ++axis) a[axis] = share < 1.0 ? a[axis] + share * (push[axis] - a[axis]) : push[axis];
    const double largest = std::max({std::abs(drag[0]), std::abs(drag[1]), std::abs(drag[2])});
    drags += to_integers(Four{drag[0], drag[1], drag[2], largest} * all(how.sum_scale));
  }
  for (std::size_t axis = 0; axis < 4; ++axis) sums.drag[axis] += drags[axis];
}

}  // namespace moraine
