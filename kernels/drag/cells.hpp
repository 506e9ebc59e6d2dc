// Grains and the cells around them: what grains give to cells (deposit) and what they feel of them (interpolate), with the same weights.
//
// Sums over grains are integers, so that they do not depend on the order of the grains: a contribution is multiplied by a power of two,
// the scale, and rounded; it must stay below 2^50.
#pragma once

#include <array>
#include <cstdint>

#include "kernels/base/range.hpp"
#include "kernels/base/vec3.hpp"
#include "kernels/drag/kinds.hpp"

namespace moraine {

/// A box of cells; where the grid is periodic its indices may go beyond the grid, and stand for the cells a period away.
struct CellWindow {
  std::array<int, 3> low{};
  std::array<int, 3> high{};  // exclusive
  int size(int axis) const { return high[static_cast<std::size_t>(axis)] - low[static_cast<std::size_t>(axis)]; }
  bool is_empty() const { return size(0) <= 0 || size(1) <= 0 || size(2) <= 0; }
  std::int64_t n_cells() const { return is_empty() ? 0 : std::int64_t{size(0)} * size(1) * size(2); }
  /// Of the window's first cell in line (j, k) along x.
  std::int64_t line(int j, int k) const { return (std::int64_t{k - low[2]} * size(1) + (j - low[1])) * size(0); }
  bool contains(const CellWindow& other) const {
    for (std::size_t a = 0; a < 3; ++a)
      if (other.low[a] < low[a] || other.high[a] > high[a]) return false;
    return true;
  }
  bool operator==(const CellWindow&) const = default;
};

/// The cells that a grain is spread over: the one it lies in, or the two along each direction between whose centres it lies, linearly.
/// Beyond the centre of the last cell of a bounded direction all goes to that cell; so it does where there is only one.
struct CellWeights {
  struct Axis {
    double low = 0.0;                // [m] of the grid
    double inverse_spacing = 0.0;    // [1/m]
    double shift = 0.0;              // place of a cell's weight in it, in cells
    double least = 0.0, most = 0.0;  // places are taken to lie in these, in cells
    int last = 0;                    // first of the pair of cells at most
    int pair = 0;                    // from the first cell of the pair to the second: 1, or 0 where all goes to one
    /// First cell of the pair, and the weight of the second.
    int first(double x, double& weight) const;
  };
  std::array<Axis, 3> axes;
  CellWeights() = default;
  CellWeights(GasWeights kind, std::array<int, 3> n, Vec3 low, Vec3 spacing, std::array<bool, 3> periodic);
  /// The cells of all grains between two corners.
  CellWindow around(Vec3 low, Vec3 high) const;
};

/// Some grains, as the particles hold them: hot records and their width. Those that have left lie at NaN and take no part.
struct GrainView {
  const double* records = nullptr;
  std::int64_t stride = 0;
  Range range;
  const double* record(std::int64_t i) const { return records + i * stride; }
};

/// What has to be known of grains before they give anything to cells; nothing where there are none.
struct GrainExtent {
  Vec3 low{1e300, 1e300, 1e300}, high{-1e300, -1e300, -1e300};  // [m] of centres
  double largest_radius = 0.0;                                  // [m]
  std::int64_t n = 0;
  void add(const GrainExtent& other);
};
GrainExtent extent(const GrainView& grains);

/// Adds the volume of each grain times scale to cells of the window, one value each.
void deposit_volume(const GrainView& grains, const CellWeights& weights, const CellWindow& window, double scale,
                    std::int64_t* cells);

/// What drag needs of one gas step. Cells have four values each: void fraction, gas velocity.
struct SlipTile {
  static constexpr int size = 256;
  double void_fraction[size], slip[size], radius[size], inverse_mass[size], speed[size], coefficient[size];
};
/// Of up to SlipTile::size grains; those that have left get no slip and no radius. `speed`: the largest component of the grain's velocity.
void gather_slip(const GrainView& grains, const CellWeights& weights, const CellWindow& window, const double* cells,
                 bool is_flat, SlipTile& tile);

/// Adds c and c v of each grain, times the scales, to cells of the window, four values each; coefficient[0] belongs to grain 0.
void deposit_exchange(const GrainView& grains, const CellWeights& weights, const CellWindow& window,
                      const double* coefficient, double scale, double momentum_scale, bool is_flat,
                      std::int64_t* cells);

/// Mass of the gas that a grain's motion carries along, over its own: rho_g (1 - eps)/(rho_p eps). engine/coupling/README.md, "Dense fluids".
inline double carried_mass(double fluid_density, double void_fraction, double volume, double inverse_mass) {
  return fluid_density * volume * inverse_mass * (1.0 - void_fraction) / void_fraction;
}
/// Share of a push that a grain gets at once; the rest of it follows over the next gas steps. 1 in all gases.
inline double share_at_once(double carried_mass) {
  constexpr double harmless = 0.1;
  return carried_mass > harmless ? (1.0 + harmless) / (1.0 + carried_mass) : 1.0;
}

/// What grains feel in a gas step. Cells have eight values each: gas velocity, void fraction, pressure gradient, 0.
struct Feel {
  Vec3 buoyancy;               // [N/m3] force per volume of grain: -rho_g g
  bool has_gradient = true;    // model A: -V grad p too
  bool is_flat = false;        // nothing along z
  double sum_scale = 0.0;      // of the sums of forces below
  double fluid_density = 0.0;  // [kg/m3] of a fluid that grains carry along; 0: pushes are given at once
};
/// Sums over grains of c (u - v) by component and of its largest component, times sum_scale.
struct ForceSums {
  std::array<std::int64_t, 4> drag{};
};
/// Sets the acceleration of each grain by drag, pressure gradient and buoyancy [m/s2], three doubles, which hold that of the gas step
/// before.
void feel(const GrainView& grains, const CellWeights& weights, const CellWindow& window, const double* cells,
          const double* coefficient, const Feel& how, double* acceleration, ForceSums& sums);

}  // namespace moraine
