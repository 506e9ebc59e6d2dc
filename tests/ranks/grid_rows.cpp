// Gas arrays between the blocks of ranks and the rows of an image.
#include <catch2/catch.hpp>

#include "engine/run/grid_rows.hpp"
#include "engine/scene/scene.hpp"
#include "tests/ranks/ranks.hpp"

using namespace moraine;

namespace {

/// Grid, how many ranks may have cells, which directions are periodic.
struct Case {
  std::array<int, 3> n;
  int n_ranks;
  std::array<bool, 3> periodic;
};

double value_at(int i, int j, int k) { return 1.0 + i + 1e3 * j + 1e6 * k; }

std::optional<GridField<>> field_on(const GridPlaces& places, const World& world) {
  const CellBlock block = places.share.block(world.rank());
  if (block.is_empty()) return std::nullopt;
  return GridField<>(GridLayout(block, 2), -1.0);
}

}  // namespace

TEST_CASE("gas values go from blocks to rows in order and back, cells and faces, on any ranks") {
  const World& all = ranks::world();
  const Case cases[] = {{{5, 7, 11}, 3, {false, false, false}},
                        {{4, 1, 9}, 8, {true, false, true}},
                        {{1, 16, 1}, 4, {false, true, false}},
                        {{3, 2, 2}, 1, {false, false, false}},
                        {{6, 13, 8}, 6, {false, false, true}}};
  for (const Case& c : cases)
    for (int face_axis = -1; face_axis < 3; ++face_axis) {
      INFO(c.n[0] << " x " << c.n[1] << " x " << c.n[2] << ", faces " << face_axis << ", " << all.size() << " ranks");
      const GridPlaces places{share_out(c.n, c.periodic, std::min(c.n_ranks, all.size()), 1), face_axis};
      std::optional<GridField<>> field = field_on(places, all);
      const CellBlock block = places.block(all.rank());
      if (field)
        for (int k = 0; k < block.size(2); ++k)
          for (int j = 0; j < block.size(1); ++j)
            for (int i = 0; i < block.size(0); ++i)
              (*field)(i, j, k) = value_at(i + block.low[0], j + block.low[1], k + block.low[2]);
      GridArray array;
      gather_grid(all, places, field ? &*field : nullptr, array);
      const std::array<int, 3> n = places.n_values();
      const auto begin = static_cast<std::int64_t>(all.sum_before(array.values.size()));
      std::uint64_t n_all = array.values.size();
      all.sum(std::span(&n_all, 1));
      CHECK(n_all == static_cast<std::uint64_t>(n[0]) * static_cast<std::uint64_t>(n[1] * n[2]));
      bool is_in_order = true;
      for (std::size_t q = 0; q < array.values.size(); ++q) {
        const std::int64_t at = begin + static_cast<std::int64_t>(q);
        is_in_order =
            is_in_order && array.values[q] == value_at(static_cast<int>(at % n[0]), static_cast<int>(at / n[0] % n[1]),
                                                       static_cast<int>(at / n[0] / n[1]));
      }
      CHECK(is_in_order);

      // Back onto other blocks, from rows that are shared out unevenly: all of them at the last rank.
      Image image;
      image.grids = {array};
      Image whole = ranks::whole(image, all);
      if (all.rank() != all.size() - 1) whole.grids[0].values.clear();
      const GridPlaces others{share_out(c.n, c.periodic, std::max(1, all.size() - 1), 1), face_axis};
      std::optional<GridField<>> restored = field_on(others, all);
      put_grid(all, others, whole.grids[0], restored ? &*restored : nullptr);
      const CellBlock other = others.block(all.rank());
      bool is_restored = true;
      if (restored)
        for (int k = 0; k < other.size(2); ++k)
          for (int j = 0; j < other.size(1); ++j)
            for (int i = 0; i < other.size(0); ++i)
              is_restored = is_restored && (*restored)(i, j, k) == value_at(i, j + other.low[1], k + other.low[2]);
      CHECK(is_restored);
    }
}

TEST_CASE("a grid of other cells is refused by name") {
  GridArray array;
  array.name = "pressure";
  array.n = {4, 4, 4};
  const GridPlaces places{share_out({4, 5, 4}, {false, false, false}, 1, 1), -1};
  CHECK_THROWS_WITH(
      put_grid(World(), places, array, nullptr),
      "gas.cells: are not those that the checkpoint was written with: its \"pressure\" has 4 x 4 x 4 values, "
      "expected 4 x 5 x 4");
}
