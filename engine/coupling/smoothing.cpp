#include "engine/coupling/smoothing.hpp"

#include <algorithm>
#include <cstring>

#include "engine/threads.hpp"

namespace moraine {

namespace {

/// Implicit steps of the diffusion: one has a cusp and long tails, three are close to a bell.
constexpr int n_steps = 3;
constexpr std::int64_t lines_along_x = 8;  // at a time: as many as fill the lanes and the waits of a recurrence

}  // namespace

Smoothing::Smoothing(const GasGrid& grid, const GasRanks& ranks, double deviation)
    : ranks_(ranks), block_(ranks.block()) {
  for (std::size_t a = 0; a < 3; ++a) {
    const double cells = deviation / grid.spacing[static_cast<int>(a)];
    pivots_[a].resize(static_cast<std::size_t>(grid.n[a]));
    closings_[a].resize(static_cast<std::size_t>(grid.n[a]));
    const double strength = grid.n[a] > 1 ? 0.5 * cells * cells / n_steps : 0.0;
    factors_[a] = smoothing_factors(grid.n[a], grid.periodic[a] && grid.n[a] > 1, strength, pivots_[a], closings_[a]);
  }
}

void Smoothing::apply(std::span<double* const> fields) {
  if (factors_[0].a > 0.0) along_x(fields);
  for (std::size_t axis = 1; axis < 3; ++axis) {
    if (factors_[axis].a <= 0.0) continue;
    const int n_parts = axis == 1 ? ranks_.share.parts_y() : ranks_.share.parts_z();
    if (n_parts == 1)
      along(axis, fields);
    else
      across_ranks(axis, fields);
  }
}

void Smoothing::solve(std::size_t axis, double* values, std::int64_t along, std::int64_t across,
                      std::int64_t n_lines) const {
  for (int step = 0; step < n_steps; ++step) smooth_lines(factors_[axis], values, along, across, n_lines);
}

void Smoothing::along_x(std::span<double* const> fields) const {
  const std::int64_t n = block_.size(0), n_lines = std::int64_t{block_.size(1)} * block_.size(2);
  parallel(ranks_.n_threads, [&](int thread) {
    const Range lines = share_of(n_lines, thread, ranks_.n_threads);
    for (double* const field : fields)
      for (std::int64_t line = lines.begin; line < lines.end; line += lines_along_x)
        solve(0, field + line * n, 1, n, std::min(lines_along_x, lines.end - line));
  });
}

void Smoothing::along(std::size_t axis, std::span<double* const> fields) {
  const std::int64_t nx = block_.size(0), layer = nx * block_.size(1);
  const std::int64_t step = axis == 1 ? nx : layer, across = axis == 1 ? layer : nx;
  const std::int64_t n_across = block_.size(axis == 1 ? 2 : 1);
  parallel(ranks_.n_threads, [&](int thread) {
    const Range columns = share_of(n_across, thread, ranks_.n_threads);
    for (double* const field : fields)
      for (std::int64_t c = columns.begin; c < columns.end; ++c) solve(axis, field + c * across, step, 1, nx);
  });
}

/// The ranks of a row of blocks along the axis share out the columns (a field, and a place across the axis and x) between them; each gets
/// all cells along the axis of its columns, solves, and gives them back.
void Smoothing::across_ranks(std::size_t axis, std::span<double* const> fields) {
  const GridShare& share = ranks_.share;
  const int part_y = ranks_.world.rank() % share.parts_y(), part_z = ranks_.world.rank() / share.parts_y();
  const int n_parts = axis == 1 ? share.parts_y() : share.parts_z(), part = axis == 1 ? part_y : part_z;
  const std::vector<int>& cuts = axis == 1 ? share.cuts_y : share.cuts_z;
  const auto rank_of = [&](int p) { return axis == 1 ? share.rank_of(p, part_z) : share.rank_of(part_y, p); };
  const auto part_of = [&](int rank) { return axis == 1 ? rank % share.parts_y() : rank / share.parts_y(); };
  const std::int64_t nx = block_.size(0), layer = nx * block_.size(1);
  const std::int64_t step = axis == 1 ? nx : layer, across = axis == 1 ? layer : nx;
  const std::int64_t n_across = block_.size(axis == 1 ? 2 : 1), n_along = block_.size(static_cast<int>(axis));
  const std::int64_t n_columns = n_across * static_cast<std::int64_t>(fields.size()), n = factors_[axis].n;
  const std::size_t row = static_cast<std::size_t>(nx) * sizeof(double);
  const auto place = [&](std::int64_t column, std::int64_t m) {
    return fields[static_cast<std::size_t>(column / n_across)] + column % n_across * across + m * step;
  };

  std::vector<Parcel> parcels;
  for (int p = 0; p < n_parts; ++p) {
    const Range columns = share_of(n_columns, p, n_parts);
    Parcel parcel{rank_of(p), std::vector<std::byte>(static_cast<std::size_t>(columns.size() * n_along) * row)};
    std::byte* to = parcel.bytes.data();
    for (std::int64_t c = columns.begin; c < columns.end; ++c)
      for (std::int64_t m = 0; m < n_along; ++m, to += row) std::memcpy(to, place(c, m), row);
    parcels.push_back(std::move(parcel));
  }
  const Range own = share_of(n_columns, part, n_parts);
  gathered_.resize_discarding(static_cast<std::size_t>(own.size() * n * nx));
  const auto first_of = [&](int p) { return cuts[static_cast<std::size_t>(p)]; };
  for (const Parcel& parcel : ranks_.world.exchange(std::move(parcels))) {
    const int p = part_of(parcel.rank);
    const std::byte* from = parcel.bytes.data();
    for (std::int64_t c = 0; c < own.size(); ++c)
      for (int m = first_of(p); m < first_of(p + 1); ++m, from += row)
        std::memcpy(gathered_.data() + (c * n + m) * nx, from, row);
  }
  parallel(ranks_.n_threads, [&](int thread) {
    const Range columns = share_of(own.size(), thread, ranks_.n_threads);
    for (std::int64_t c = columns.begin; c < columns.end; ++c) solve(axis, gathered_.data() + c * n * nx, nx, 1, nx);
  });
  parcels.clear();
  for (int p = 0; p < n_parts; ++p) {
    const std::int64_t width = first_of(p + 1) - first_of(p);
    Parcel parcel{rank_of(p), std::vector<std::byte>(static_cast<std::size_t>(own.size() * width) * row)};
    std::byte* to = parcel.bytes.data();
    for (std::int64_t c = 0; c < own.size(); ++c)
      for (int m = first_of(p); m < first_of(p + 1); ++m, to += row)
        std::memcpy(to, gathered_.data() + (c * n + m) * nx, row);
    parcels.push_back(std::move(parcel));
  }
  for (const Parcel& parcel : ranks_.world.exchange(std::move(parcels))) {
    const Range columns = share_of(n_columns, part_of(parcel.rank), n_parts);
    const std::byte* from = parcel.bytes.data();
    for (std::int64_t c = columns.begin; c < columns.end; ++c)
      for (std::int64_t m = 0; m < n_along; ++m, from += row) std::memcpy(place(c, m), from, row);
  }
}

}  // namespace moraine
