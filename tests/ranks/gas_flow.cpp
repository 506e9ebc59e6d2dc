// The gas on several ranks: the same bits as alone, also where it goes on from what another layout has left.
#include <catch2/catch.hpp>
#include <cstring>
#include <string>

#include "engine/gas/gas_flow.hpp"
#include "tests/ranks/ranks.hpp"
#include "tests/support/gas_scenes.hpp"

using namespace moraine;
using scenes::BusyGas;

namespace {

constexpr double step = 2e-3;

struct Run {
  const BusyGas& scene;
  GasRanks ranks;
  GasFlow flow;
  GasLoad load;
  int n_done = 0;
  Run(const BusyGas& of, GasRanks on)
      : scene(of), ranks(std::move(on)), flow(of.gas, {}, of.grid, ranks), load(flow.empty_load()) {}
  void advance(int n) {
    for (int s = 0; s < n; ++s, ++n_done) {
      scene.load(ranks.block(), n_done * step, load);
      flow.advance(n_done * step, step, load);
    }
  }
};

/// visit(value in the whole grid's array, value in the block's) of the cells or faces of kept array f.
template <typename Visit>
void for_each_kept(Run& alone, Run& shared, Visit visit) {
  const CellBlock block = shared.ranks.block();
  const auto whole = alone.flow.kept(), part = shared.flow.kept();
  for (std::size_t f = 0; f < whole.size(); ++f) {
    std::array<int, 3> n{block.size(0), block.size(1), block.size(2)};
    const int axis = whole[f].face_axis;
    const auto a = static_cast<std::size_t>(std::max(axis, 0));
    if (axis >= 0 && !alone.scene.grid.periodic[a] && block.high[a] == alone.scene.grid.n[a]) ++n[a];
    for (int k = 0; k < n[2]; ++k)
      for (int j = 0; j < n[1]; ++j)
        for (int i = 0; i < n[0]; ++i)
          visit((*whole[f].values)(i, j + block.low[1], k + block.low[2]), (*part[f].values)(i, j, k));
  }
}

std::int64_t n_different(Run& alone, Run& shared) {
  std::int64_t n = 0;
  for_each_kept(alone, shared, [&](double& a, double& b) { n += std::memcmp(&a, &b, sizeof a) != 0; });
  return n;
}

void check_layouts(const BusyGas& scene) {
  Run alone(scene, {World{}, share_out(scene.grid.n, scene.grid.periodic, 1, 1), 1});
  Run later(scene, alone.ranks);
  alone.advance(4);
  later.advance(7);
  const GasFlow::Budget expected = alone.flow.budget();
  for (int n_ranks = 2; n_ranks <= ranks::world().size(); ++n_ranks) {
    const std::optional<World> world = ranks::world().first(n_ranks);
    const GridShare share = share_out(scene.grid.n, scene.grid.periodic, n_ranks, 1);
    INFO(n_ranks << " ranks, " << share.n_ranks() << " blocks");
    REQUIRE(share.n_ranks() == n_ranks);
    if (!world) continue;
    const GasRanks on{*world, share, n_ranks == 3 ? 2 : 1};
    Run shared(scene, on);
    shared.advance(4);
    CHECK(n_different(alone, shared) == 0);
    const GasFlow::Budget budget = shared.flow.budget();
    CHECK(budget.inflow == expected.inflow);
    CHECK(budget.momentum == expected.momentum);
    CHECK(budget.boundary_force == expected.boundary_force);
    CHECK(budget.drag == expected.drag);
    Run restarted(scene, on);
    for_each_kept(alone, restarted, [](double& from, double& to) { to = from; });
    restarted.flow.restore(alone.flow.kept_numbers());
    restarted.n_done = alone.n_done;
    restarted.advance(3);
    CHECK(n_different(later, restarted) == 0);
  }
}

}  // namespace

TEST_CASE("gas has the same bits on any number of ranks, and goes on from one to another") {
  check_layouts(BusyGas({8, 10, 22}, false));
  check_layouts(BusyGas({8, 12, 20}, false, true));
  check_layouts(BusyGas({15, 24, 1}, true));
}
