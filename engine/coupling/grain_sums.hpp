// What the grains of one rank give to cells and feel of them, on its threads: deposits, drag coefficients, accelerations.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/coupling/cell_exchange.hpp"
#include "engine/particles/aligned_array.hpp"
#include "engine/particles/particles.hpp"
#include "kernels/drag/cells.hpp"
#include "kernels/drag/laws.hpp"

namespace moraine {

/// The largest of what grains give to cells, of some grains.
struct ExchangeExtent {
  double coefficient = 0.0;  // [kg/s]
  double momentum = 0.0;     // [N] coefficient times the largest component of the velocity
  double rate = 0.0;  // [1/s] at which a grain, and the others with it, come to rest against the gas between them
};

class GrainSums {
 public:
  GrainSums(CellWeights weights, bool is_flat, int n_threads);

  /// From the next look on.
  void set_threads(int n_threads);
  /// Looks at the grains as they are; to be called before all else when they have changed.
  GrainExtent look(const Particles& particles);
  /// The cells that they touch; empty without grains.
  CellWindow needed() const;

  /// Sums of the grains' volumes times scale, in the window of the rank, one value each cell; then of c and c v, four values each.
  const std::int64_t* volumes(const CellWindow& window, double scale);
  const std::int64_t* exchanges(const CellWindow& window, double scale, double momentum_scale);

  /// Drag coefficients [kg/s] for cells of void fraction and gas velocity, four values each; they stay until the next call.
  /// `carried_density`: as Feel::fluid_density.
  ExchangeExtent set_coefficients(DragLaw law, GasModel model, const GasProperties& gas, double carried_density,
                                  const CellWindow& window, const double* cells);
  /// Sets accelerations from cells of gas velocity and pressure gradient, eight values each.
  ForceSums feel(const CellWindow& window, const double* cells, const Feel& how, double* acceleration);

  std::size_t memory() const;

 private:
  struct Share {
    Range range;
    GrainExtent extent;
    CellWindow window;
    AlignedArray<std::int64_t> sums;
  };
  GrainView view(Range range) const { return {records_, stride_, range}; }
  template <int width, typename Deposit>
  const std::int64_t* sums(const CellWindow& window, Deposit deposit);
  template <int width>
  void collect(const CellWindow& window, int thread);

  CellWeights weights_;
  bool is_flat_ = false;
  int n_threads_ = 1;
  const double* records_ = nullptr;
  std::int64_t stride_ = 0;
  std::vector<Share> shares_;
  AlignedArray<std::int64_t> sums_;
  AlignedArray<double> coefficients_;
};

}  // namespace moraine
