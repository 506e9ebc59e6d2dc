// Shares of a grid, and its ghosts where it is not divided.
#include <catch2/catch.hpp>
#include <vector>

#include "comm/grid_halo.hpp"
#include "comm/grid_share.hpp"

using namespace moraine;

TEST_CASE("every cell of a shared grid has one owner, and no part is thinner than two cells") {
  for (const auto& n : {std::array<int, 3>{4, 40, 52}, {4, 13, 1}, {3, 7, 97}, {5, 64, 200}, {2, 3, 3}, {1, 1, 1}})
    for (const int ranks : {1, 2, 3, 4, 5, 6, 7, 12, 64})
      for (const int alignment : {1, 2, 4, 8}) {
        const GridShare share = share_out(n, {false, false, false}, ranks, 1, alignment);
        INFO(n[1] << " x " << n[2] << " on " << ranks << " by " << alignment);
        CHECK(share.n_ranks() >= 1);
        CHECK(share.n_ranks() <= ranks);
        std::int64_t n_cells = 0;
        bool is_thick = true, is_aligned = true, is_owned = true;
        for (int rank = 0; rank < share.n_ranks(); ++rank) {
          const CellBlock block = share.block(rank);
          n_cells += block.n_cells();
          for (int axis = 1; axis < 3; ++axis) {
            const auto a = static_cast<std::size_t>(axis);
            is_thick = is_thick && block.size(axis) >= std::min(2, n[a]);
            is_aligned = is_aligned && block.low[a] % alignment == 0;
          }
          for (int k = block.low[2]; k < block.high[2]; ++k)
            for (int j = block.low[1]; j < block.high[1]; ++j) is_owned = is_owned && share.owner(j, k) == rank;
        }
        CHECK(n_cells == std::int64_t{n[0]} * n[1] * n[2]);
        CHECK(is_thick);
        CHECK(is_aligned);
        CHECK(is_owned);
        CHECK(share.block(share.n_ranks()).is_empty());
      }
}

TEST_CASE("a grid is shared out evenly, and on fewer ranks where it is small") {
  const GridShare four = share_out({64, 64, 200}, {}, 4, 1, 2);
  REQUIRE(four.n_ranks() == 4);
  for (int rank = 0; rank < 4; ++rank) CHECK(four.block(rank).n_cells() == 64 * 64 * 200 / 4);
  CHECK(share_out({10, 10, 10}, {}, 64, 400).n_ranks() == 2);
  CHECK(share_out({10, 10, 10}, {}, 64, 100000).n_ranks() == 1);
}

TEST_CASE("ghosts of an undivided grid are those of the other end where it is periodic") {
  for (const auto& n : {std::array<int, 3>{4, 5, 6}, {1, 3, 1}, {2, 1, 7}})
    for (int kind = 0; kind < 8; ++kind) {
      const std::array<bool, 3> periodic{(kind & 1) != 0, (kind & 2) != 0, (kind & 4) != 0};
      const int layers = 2;
      const GridShare share = share_out(n, periodic, 1, 1);
      const GridLayout layout(share.block(0), layers);
      std::vector<double> a(static_cast<std::size_t>(layout.n_values()), -1.0);
      std::vector<double> b = a;
      const auto value = [&](int i, int j, int k) { return i + 10.0 * j + 100.0 * k; };
      const auto at = [&](int i, int j, int k) { return static_cast<std::size_t>(layout.at(i, j, k)); };
      for (int k = 0; k < n[2]; ++k)
        for (int j = 0; j < n[1]; ++j)
          for (int i = 0; i < n[0]; ++i) {
            a[at(i, j, k)] = value(i, j, k);
            b[at(i, j, k)] = 2.0 * value(i, j, k);
          }
      GridHalo halo(World(), share, layers, 2, sizeof(double));
      halo.exchange({a.data(), b.data()});
      bool is_right = true;
      for (int k = -layers; k < n[2] + layers; ++k)
        for (int j = -layers; j < n[1] + layers; ++j)
          for (int i = -layers; i < n[0] + layers; ++i) {
            std::array<int, 3> cell{i, j, k};
            bool is_inside = true;
            for (std::size_t axis = 0; axis < 3; ++axis) {
              const bool is_beyond = cell[axis] < 0 || cell[axis] >= n[axis];
              is_inside = is_inside && (!is_beyond || periodic[axis]);
              cell[axis] = ((cell[axis] % n[axis]) + n[axis]) % n[axis];
            }
            const double expected = is_inside ? value(cell[0], cell[1], cell[2]) : -1.0;
            is_right = is_right && a[at(i, j, k)] == expected && b[at(i, j, k)] == (is_inside ? 2.0 * expected : -1.0);
          }
      INFO(n[0] << " " << n[1] << " " << n[2] << " kind " << kind);
      CHECK(is_right);
    }
}
