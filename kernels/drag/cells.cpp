#include "kernels/drag/cells.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace moraine {

namespace {

constexpr double four_thirds_pi = 4.188790204786390985;

/// Rounds |x| < 2^50 to an integer: adding 1.5 * 2^52 leaves it in the lowest bits of the sum. Runs in lanes, as no conversion of AVX2 does.
inline std::int64_t to_integer(double x) {
  constexpr double round = 6755399441055744.0;
  return std::bit_cast<std::int64_t>(x + round) - std::bit_cast<std::int64_t>(round);
}

/// Where a grain's first cell lies in a window, the steps to the second ones, and their weights.
struct Stencil {
  std::int64_t cell, step_x, step_y, step_z;
  double x, y, z;
  Stencil(const CellWeights& weights, const CellWindow& window, const double* place) {
    const int i = weights.axes[0].first(place[0], x), j = weights.axes[1].first(place[1], y),
              k = weights.axes[2].first(place[2], z);
    cell = window.line(j, k) + (i - window.low[0]);
    step_x = weights.axes[0].pair;
    step_y = std::int64_t{weights.axes[1].pair} * window.size(0);
    step_z = std::int64_t{weights.axes[2].pair} * window.size(0) * window.size(1);
  }
  bool is_one_cell() const { return (step_x | step_y | step_z) == 0; }
};

template <int width>
inline void add_to(std::int64_t* cell, const double* values, double weight) {
  for (int c = 0; c < width; ++c) cell[c] += to_integer(values[c] * weight);
}

/// Adds `width` scaled values to the cells of a stencil.
template <int width>
inline void spread(const Stencil& s, const double* values, std::int64_t* cells) {
  const std::int64_t dx = s.step_x * width, dy = s.step_y * width, dz = s.step_z * width;
  std::int64_t* at = cells + s.cell * width;
  if (s.is_one_cell()) return add_to<width>(at, values, 1.0);
  const double x0 = 1.0 - s.x, y0 = 1.0 - s.y;
  const double w00 = x0 * y0, w10 = s.x * y0, w01 = x0 * s.y, w11 = s.x * s.y;
  const int n_layers = dz == 0 ? 1 : 2;
  for (int layer = 0; layer < n_layers; ++layer, at += dz) {
    const double z = layer == 0 ? 1.0 - s.z : s.z;
    add_to<width>(at, values, w00 * z);
    add_to<width>(at + dx, values, w10 * z);
    add_to<width>(at + dy, values, w01 * z);
    add_to<width>(at + dx + dy, values, w11 * z);
  }
}

template <int width>
inline void mix(const double* a, const double* b, double weight, double* result) {
  for (int c = 0; c < width; ++c) result[c] = a[c] + weight * (b[c] - a[c]);
}

/// Interpolates `width` values by steps between two, so that constants stay what they are.
template <int width>
inline void interpolate(const Stencil& s, const double* cells, double* result) {
  const std::int64_t dx = s.step_x * width, dy = s.step_y * width, dz = s.step_z * width;
  const double* at = cells + s.cell * width;
  if (s.is_one_cell()) {
    for (int c = 0; c < width; ++c) result[c] = at[c];
    return;
  }
  double low[width], high[width], layers[2][width];
  const int n_layers = dz == 0 ? 1 : 2;
  for (int layer = 0; layer < n_layers; ++layer, at += dz) {
    mix<width>(at, at + dx, s.x, low);
    mix<width>(at + dy, at + dx + dy, s.x, high);
    mix<width>(low, high, s.y, layers[layer]);
  }
  mix<width>(layers[0], layers[n_layers - 1], s.z, result);
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
    const double* const record = grains.record(i);
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
  for (std::int64_t i = grains.range.begin; i < grains.range.end; ++i) {
    const double* const record = grains.record(i);
    if (!is_here(record)) continue;
    const double scaled = volume(record[3]) * scale;
    spread<1>(Stencil(weights, window, record), &scaled, cells);
  }
}

void gather_slip(const GrainView& grains, const CellWeights& weights, const CellWindow& window, const double* cells,
                 bool is_flat, SlipTile& tile) {
  for (std::int64_t i = grains.range.begin; i < grains.range.end; ++i) {
    const std::int64_t t = i - grains.range.begin;
    const double* const record = grains.record(i);
    double gas[4] = {1.0, 0.0, 0.0, 0.0};
    const bool takes_part = is_here(record);
    if (takes_part) interpolate<4>(Stencil(weights, window, record), cells, gas);
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
  const double z_scale = is_flat ? 0.0 : momentum_scale;
  for (std::int64_t i = grains.range.begin; i < grains.range.end; ++i) {
    const double* const record = grains.record(i);
    if (!is_here(record)) continue;
    const double c = coefficient[i];
    const double values[4] = {c * scale, c * record[4] * momentum_scale, c * record[5] * momentum_scale,
                              c * record[6] * z_scale};
    spread<4>(Stencil(weights, window, record), values, cells);
  }
}

void feel(const GrainView& grains, const CellWeights& weights, const CellWindow& window, const double* cells,
          const double* coefficient, const Feel& how, double* acceleration, ForceSums& sums) {
  const double of_gradient = how.has_gradient ? 1.0 : 0.0, of_z = how.is_flat ? 0.0 : 1.0;
  for (std::int64_t i = grains.range.begin; i < grains.range.end; ++i) {
    const double* const record = grains.record(i);
    double* const a = acceleration + 3 * i;
    if (!is_here(record)) {
      a[0] = a[1] = a[2] = 0.0;
      continue;
    }
    double gas[8];
    interpolate<8>(Stencil(weights, window, record), cells, gas);
    const double c = coefficient[i], v = volume(record[3]), inverse_mass = record[7];
    const double drag[3] = {c * (gas[0] - record[4]), c * (gas[1] - record[5]), c * (gas[2] - record[6]) * of_z};
    const double now[3] = {(drag[0] + v * (how.buoyancy.x - of_gradient * gas[4])) * inverse_mass,
                           (drag[1] + v * (how.buoyancy.y - of_gradient * gas[5])) * inverse_mass,
                           (drag[2] + v * (how.buoyancy.z - of_gradient * gas[6])) * inverse_mass * of_z};
    const double share =
        how.fluid_density > 0.0 ? share_at_once(carried_mass(how.fluid_density, gas[3], v, inverse_mass)) : 1.0;
    if (share < 1.0 && a[0] == 0.0 && a[1] == 0.0 && a[2] == 0.0) {  // born since: it has been in the fluid at rest
      a[0] = v * how.buoyancy.x * inverse_mass;
      a[1] = v * how.buoyancy.y * inverse_mass;
      a[2] = v * how.buoyancy.z * inverse_mass * of_z;
    }
    for (int axis = 0; axis < 3; ++axis) a[axis] = share < 1.0 ? a[axis] + share * (now[axis] - a[axis]) : now[axis];
    const double largest = std::max({std::abs(drag[0]), std::abs(drag[1]), std::abs(drag[2])});
    sums.drag[0] += to_integer(drag[0] * how.sum_scale);
    sums.drag[1] += to_integer(drag[1] * how.sum_scale);
    sums.drag[2] += to_integer(drag[2] * how.sum_scale);
    sums.drag[3] += to_integer(largest * how.sum_scale);
  }
}

}  // namespace moraine
