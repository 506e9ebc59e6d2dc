#include "comm/grid_share.hpp"

#include <algorithm>
#include <cmath>

namespace moraine {

namespace {

std::vector<int> cuts(int n, int parts, int alignment) {
  std::vector<int> firsts;
  for (int p = 0; p < parts; ++p) {
    const std::int64_t even = std::int64_t{n} * p / parts;
    firsts.push_back(static_cast<int>((even + alignment / 2) / alignment * alignment));
  }
  firsts.push_back(n);
  return firsts;
}

}  // namespace

CellBlock GridShare::block(int rank) const {
  if (rank >= n_ranks()) return {};
  const auto py = static_cast<std::size_t>(rank % parts_y()), pz = static_cast<std::size_t>(rank / parts_y());
  return {{0, cuts_y[py], cuts_z[pz]}, {n[0], cuts_y[py + 1], cuts_z[pz + 1]}};
}

int GridShare::owner(int j, int k) const {
  const auto part = [](const std::vector<int>& firsts, int cell) {
    return static_cast<int>(std::upper_bound(firsts.begin(), firsts.end() - 1, cell) - firsts.begin()) - 1;
  };
  return rank_of(part(cuts_y, j), part(cuts_z, k));
}

GridShare share_out(std::array<int, 3> n, std::array<bool, 3> periodic, int max_ranks, std::int64_t least_cells,
                    int alignment) {
  const std::int64_t n_cells = std::int64_t{n[0]} * n[1] * n[2];
  const std::int64_t wanted = std::clamp<std::int64_t>(n_cells / std::max<std::int64_t>(least_cells, 1), 1, max_ranks);
  // A part is thinner than two ghost layers nowhere.
  const int most_y = std::max(1, n[1] / std::max(alignment, 2)), most_z = std::max(1, n[2] / std::max(alignment, 2));
  int best_y = 1, best_z = 1;
  double least = 0.0;
  for (int py = 1; py <= std::min<std::int64_t>(most_y, wanted); ++py) {
    const int pz = static_cast<int>(std::min<std::int64_t>(most_z, wanted / py));
    const double surface = static_cast<double>(py - 1) * n[2] + static_cast<double>(pz - 1) * n[1];
    const bool has_more = py * pz > best_y * best_z;
    if (has_more || (py * pz == best_y * best_z && surface < least)) {
      best_y = py;
      best_z = pz;
      least = surface;
    }
  }
  return {n, periodic, cuts(n[1], best_y, alignment), cuts(n[2], best_z, alignment)};
}

}  // namespace moraine
