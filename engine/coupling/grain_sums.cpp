#include "engine/coupling/grain_sums.hpp"

#include <algorithm>

#include "engine/threads.hpp"
#include "kernels/base/sphere.hpp"

namespace moraine {

GrainSums::GrainSums(CellWeights weights, bool is_flat, int n_threads)
    : weights_(weights), is_flat_(is_flat), n_threads_(n_threads), shares_(static_cast<std::size_t>(n_threads)) {}

void GrainSums::set_threads(int n_threads) {
  n_threads_ = n_threads;
  shares_.resize(static_cast<std::size_t>(n_threads));
}

GrainExtent GrainSums::look(const Particles& particles) {
  records_ = particles.records();
  stride_ = particles.stride();
  coefficients_.resize_discarding(static_cast<std::size_t>(particles.size()));
  parallel(n_threads_, [&](int thread) {
    Share& share = shares_[static_cast<std::size_t>(thread)];
    share.range = share_of(particles.size(), thread, n_threads_);
    share.extent = extent(view(share.range));
    share.window = share.extent.n > 0 ? weights_.around(share.extent.low, share.extent.high) : CellWindow{};
  });
  GrainExtent all;
  for (const Share& share : shares_) all.add(share.extent);
  return all;
}

CellWindow GrainSums::needed() const {
  GrainExtent all;
  for (const Share& share : shares_) all.add(share.extent);
  return all.n > 0 ? weights_.around(all.low, all.high) : CellWindow{};
}

/// Each thread adds up its own grains in a window of its own, as grains lie in memory along cells; then each adds up a share of the lines.
template <int width, typename Deposit>
const std::int64_t* GrainSums::sums(const CellWindow& window, Deposit deposit) {
  sums_.resize_discarding(static_cast<std::size_t>(window.n_cells() * width));
  if (n_threads_ == 1) {
    std::fill(sums_.begin(), sums_.end(), 0);
    deposit(shares_[0].range, window, sums_.data());
    return sums_.data();
  }
  parallel(n_threads_, [&](int thread) {
    Share& share = shares_[static_cast<std::size_t>(thread)];
    share.sums.resize_discarding(static_cast<std::size_t>(share.window.n_cells() * width));
    std::fill(share.sums.begin(), share.sums.end(), 0);
    deposit(share.range, share.window, share.sums.data());
    barrier();
    collect<width>(window, thread);
  });
  return sums_.data();
}

template <int width>
void GrainSums::collect(const CellWindow& window, int thread) {
  const Range lines = share_of(std::int64_t{window.size(1)} * window.size(2), thread, n_threads_);
  for (std::int64_t line = lines.begin; line < lines.end; ++line) {
    const int j = window.low[1] + static_cast<int>(line % window.size(1));
    const int k = window.low[2] + static_cast<int>(line / window.size(1));
    std::int64_t* const sum = sums_.data() + line * window.size(0) * width;
    std::fill(sum, sum + std::int64_t{window.size(0)} * width, 0);
    for (const Share& share : shares_) {
      const CellWindow& part = share.window;
      if (part.is_empty() || j < part.low[1] || j >= part.high[1] || k < part.low[2] || k >= part.high[2]) continue;
      const std::int64_t* const from = share.sums.data() + part.line(j, k) * width;
      std::int64_t* const to = sum + std::int64_t{part.low[0] - window.low[0]} * width;
      for (std::int64_t c = 0; c < std::int64_t{part.size(0)} * width; ++c) to[c] += from[c];
    }
  }
}

const std::int64_t* GrainSums::volumes(const CellWindow& window, double scale) {
  return sums<1>(window, [&](Range range, const CellWindow& part, std::int64_t* cells) {
    deposit_volume(view(range), weights_, part, scale, cells);
  });
}

const std::int64_t* GrainSums::exchanges(const CellWindow& window, double scale, double momentum_scale) {
  return sums<4>(window, [&](Range range, const CellWindow& part, std::int64_t* cells) {
    deposit_exchange(view(range), weights_, part, coefficients_.data(), scale, momentum_scale, is_flat_, cells);
  });
}

namespace {

/// [1/s] of which a gas step may be `longest_push` at most: coupling/README.md, "Long gas steps".
double rate_of(GasModel model, double coefficient, double void_fraction, double radius, double inverse_mass,
               double carried_density) {
  const double carried = carried_mass(carried_density, void_fraction, sphere_volume(radius), inverse_mass);
  const double of_grain = coefficient * inverse_mass / (model == GasModel::a ? void_fraction : 1.0);
  return of_grain * std::max(1.0, (1.0 - void_fraction) / void_fraction) / std::max(1.0, carried / 6.0);
}

}  // namespace

ExchangeExtent GrainSums::set_coefficients(DragLaw law, GasModel model, const GasProperties& gas,
                                           double carried_density, const CellWindow& window, const double* cells) {
  std::vector<ExchangeExtent> extents(shares_.size());
  parallel(n_threads_, [&](int thread) {
    const Range range = shares_[static_cast<std::size_t>(thread)].range;
    ExchangeExtent largest;
    SlipTile tile;
    for (std::int64_t begin = range.begin; begin < range.end; begin += SlipTile::size) {
      const Range part{begin, std::min(begin + SlipTile::size, range.end)};
      gather_slip(view(part), weights_, window, cells, is_flat_, tile);
      double* const coefficient = coefficients_.data() + begin;
      drag_coefficients(law, model, gas, part.size(), tile.void_fraction, tile.slip, tile.radius, coefficient);
      for (std::int64_t t = 0; t < part.size(); ++t) {
        largest.coefficient = std::max(largest.coefficient, coefficient[t]);
        largest.momentum = std::max(largest.momentum, coefficient[t] * tile.speed[t]);
        largest.rate = std::max(largest.rate, rate_of(model, coefficient[t], tile.void_fraction[t], tile.radius[t],
                                                      tile.inverse_mass[t], carried_density));
      }
    }
    extents[static_cast<std::size_t>(thread)] = largest;
  });
  ExchangeExtent all;
  for (const ExchangeExtent& e : extents)
    all = {std::max(all.coefficient, e.coefficient), std::max(all.momentum, e.momentum), std::max(all.rate, e.rate)};
  return all;
}

ForceSums GrainSums::feel(const CellWindow& window, const double* cells, const Feel& how, double* acceleration) {
  std::vector<ForceSums> sums(shares_.size());
  parallel(n_threads_, [&](int thread) {
    ForceSums own;
    moraine::feel(view(shares_[static_cast<std::size_t>(thread)].range), weights_, window, cells, coefficients_.data(),
                  how, acceleration, own);
    sums[static_cast<std::size_t>(thread)] = own;
  });
  ForceSums all;
  for (const ForceSums& part : sums)
    for (std::size_t c = 0; c < 4; ++c) all.drag[c] += part.drag[c];
  return all;
}

std::size_t GrainSums::memory() const {
  std::size_t bytes = sums_.capacity_bytes() + coefficients_.capacity_bytes();
  for (const Share& share : shares_) bytes += share.sums.capacity_bytes();
  return bytes;
}

}  // namespace moraine
