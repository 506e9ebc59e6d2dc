// The pressure solver, and the grid's halo and shares, between real ranks.
#include <bit>
#include <catch2/catch.hpp>
#include <vector>

#include "comm/grid_gather.hpp"
#include "comm/grid_halo.hpp"
#include "tests/ranks/ranks.hpp"
#include "tests/support/pressure_problems.hpp"

using namespace moraine;
using namespace moraine::pressure;

namespace {

GridShare cut(const PressureProblem& p, std::vector<int> cuts_y, std::vector<int> cuts_z) {
  cuts_y.push_back(p.n[1]);
  cuts_z.push_back(p.n[2]);
  return {p.n, p.periodic, cuts_y, cuts_z};
}

/// All values of a rank's solution that another division, of one rank, does not have the same.
std::int64_t differences(const GridField<double>& p, const CellBlock& block, const GridField<double>& whole) {
  std::int64_t n = 0;
  for (int k = block.low[2]; k < block.high[2]; ++k)
    for (int j = block.low[1]; j < block.high[1]; ++j)
      for (int i = block.low[0]; i < block.high[0]; ++i)
        n += std::bit_cast<std::uint64_t>(p(i, j - block.low[1], k - block.low[2])) !=
             std::bit_cast<std::uint64_t>(whole(i, j, k));
  return n;
}

struct Division {
  std::vector<int> cuts_y, cuts_z;
};

void check_divisions(const PressureProblem& problem, const std::vector<Division>& divisions) {
  const Outcome alone = solve_rough(problem, problem.alone(1), 1e-9);
  for (const Division& division : divisions) {
    const GridShare share = cut(problem, division.cuts_y, division.cuts_z);
    if (share.n_ranks() > ranks::world().size()) continue;
    for (const int n_threads : {1, 2}) {
      const std::optional<World> world = ranks::world().first(share.n_ranks());
      if (!world) continue;
      const GasRanks gas{*world, share, n_threads};
      const Outcome outcome = solve_rough(problem, gas, 1e-9);
      INFO(name(problem) << ", parts " << share.parts_y() << " x " << share.parts_z() << ", threads " << n_threads);
      CHECK(outcome.report.is_converged);
      CHECK(outcome.report.iterations == alone.report.iterations);
      CHECK(std::bit_cast<std::uint64_t>(outcome.report.residual) ==
            std::bit_cast<std::uint64_t>(alone.report.residual));
      CHECK(differences(outcome.p, gas.block(), alone.p) == 0);
    }
  }
}

}  // namespace

TEST_CASE("pressure has the same bits on any ranks and threads") {
  const PressureProblem rough_bed{{12, 40, 52}, {}, PressureOutlet::top, 1e-4, PressureNoise::white};
  check_divisions(rough_bed, {{{0}, {0, 26}},
                              {{0, 17}, {0}},
                              {{0, 13, 29}, {0, 11}},
                              {{0, 2}, {0, 3, 5}},
                              {{0, 16}, {0, 16, 32}},
                              {{0, 3, 5, 7, 38}, {0}}});
  PressureProblem around = rough_bed;
  around.n = {11, 23, 37};
  around.periodic = {true, true, true};
  around.outlet = PressureOutlet::none;
  around.closed = 0.05;
  check_divisions(around, {{{0, 11}, {0, 18}}, {{0}, {0, 7, 35}}, {{0, 2, 5}, {0, 19}}});
  const PressureProblem flat{{31, 90, 1}, {true, false, false}, PressureOutlet::top, 1e-3, PressureNoise::white};
  check_divisions(flat, {{{0, 45}, {0}}, {{0, 31, 63, 66}, {0}}});
  // large enough for several levels on the ranks, with cells of three spacings
  const PressureProblem large{{40, 64, 66}, {false, true, false}, PressureOutlet::top, 1e-4, PressureNoise::white,
                              0.0,          {1.0, 1.2, 4.0}};
  check_divisions(large, {{{0, 31}, {0, 33}}, {{0}, {0, 22, 44}}, {{0, 16, 32, 48}, {0}}});
}

namespace {

/// What the ghosts of a divided grid must hold, on divisions with one, two and more parts around.
void check_halo(const GridShare& share, int layers) {
  const std::optional<World> world = ranks::world().first(share.n_ranks());
  if (!world) return;
  const CellBlock block = share.block(world->rank());
  const GridLayout layout(block, layers);
  const auto value = [&](int i, int j, int k) { return static_cast<float>(1 + i + 50 * j + 2500 * k); };
  const auto at = [&](int i, int j, int k) { return static_cast<std::size_t>(layout.at(i, j, k)); };
  std::vector<float> a(static_cast<std::size_t>(layout.n_values()), -1.0F), b = a;
  for (int k = 0; k < layout.size[2]; ++k)
    for (int j = 0; j < layout.size[1]; ++j)
      for (int i = 0; i < layout.size[0]; ++i) {
        a[at(i, j, k)] = value(i, j + block.low[1], k + block.low[2]);
        b[at(i, j, k)] = -2.0F * a[at(i, j, k)];
      }
  GridHalo halo(*world, share, layers, 2, sizeof(float));
  for (int repeat = 0; repeat < 2; ++repeat) halo.exchange({a.data(), b.data()});
  int n_wrong = 0;
  for (int k = -layers; k < layout.size[2] + layers; ++k)
    for (int j = -layers; j < layout.size[1] + layers; ++j)
      for (int i = -layers; i < layout.size[0] + layers; ++i) {
        std::array<int, 3> cell{i, j + block.low[1], k + block.low[2]};
        bool is_inside = true;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const bool is_beyond = cell[axis] < 0 || cell[axis] >= share.n[axis];
          is_inside = is_inside && (!is_beyond || share.periodic[axis]);
          cell[axis] = wrapped(cell[axis], share.n[axis]);
        }
        const float expected = is_inside ? value(cell[0], cell[1], cell[2]) : -1.0F;
        n_wrong += a[at(i, j, k)] != expected || b[at(i, j, k)] != (is_inside ? -2.0F * expected : -1.0F);
      }
  INFO(share.parts_y() << " x " << share.parts_z() << " parts, layers " << layers);
  CHECK(n_wrong == 0);
}

}  // namespace

TEST_CASE("ghosts of a divided grid are the owners' values, edges and corners too") {
  for (int kind = 0; kind < 8; ++kind) {
    PressureProblem grid{{3, 13, 17}, {(kind & 1) != 0, (kind & 2) != 0, (kind & 4) != 0}};
    for (const int layers : {1, 2})
      for (const Division& division :
           {Division{{0}, {0}}, Division{{0, 5}, {0}}, Division{{0}, {0, 9}}, Division{{0, 7}, {0, 2}},
            Division{{0, 2, 11}, {0, 15}}, Division{{0}, {0, 2, 4, 9}}})
        check_halo(cut(grid, division.cuts_y, division.cuts_z), layers);
  }
}

TEST_CASE("a grid comes whole to the root and back") {
  const GridShare share = cut(PressureProblem{{3, 13, 17}}, {0, 2, 11}, {0, 15});
  const std::optional<World> world = ranks::world().first(share.n_ranks());
  if (!world) return;
  const CellBlock block = share.block(world->rank());
  const GridLayout own(block, 1), all({{0, 0, 0}, share.n}, 1);
  const auto value = [&](int i, int j, int k) { return 1.0 + i + 50 * j + 2500 * k; };
  // own cells, and ghosts beyond the ends of the grid; other ghosts are nobody's business
  const auto is_given = [&](int j, int k) {
    const bool has_j = (j >= 0 || block.low[1] == 0) && (j < own.size[1] || block.high[1] == share.n[1]);
    return has_j && (k >= 0 || block.low[2] == 0) && (k < own.size[2] || block.high[2] == share.n[2]);
  };
  std::vector<double> part(static_cast<std::size_t>(own.n_values()), -7.0);
  std::vector<double> whole(static_cast<std::size_t>(world->is_root() ? all.n_values() : 0), 0.0);
  const auto for_own = [&](auto work) {
    for (int k = -1; k <= own.size[2]; ++k)
      for (int j = -1; j <= own.size[1]; ++j)
        for (int i = -1; i <= own.size[0]; ++i)
          work(part[static_cast<std::size_t>(own.at(i, j, k))], is_given(j, k),
               value(i, j + block.low[1], k + block.low[2]));
  };
  for_own([](double& at, bool is_own, double number) { at = is_own ? number : -7.0; });
  GridGather gather(*world, share, 1, sizeof(double));
  gather.to_root(part.data(), whole.data());
  int n_wrong = 0;
  if (world->is_root())
    for (int k = -1; k <= share.n[2]; ++k)
      for (int j = -1; j <= share.n[1]; ++j)
        for (int i = -1; i <= share.n[0]; ++i) {
          double& at = whole[static_cast<std::size_t>(all.at(i, j, k))];
          n_wrong += at != value(i, j, k);
          at = -3.0 * at;
        }
  gather.from_root(whole.data(), part.data());
  for_own([&](double at, bool is_own, double number) { n_wrong += at != (is_own ? -3.0 * number : -7.0); });
  CHECK(n_wrong == 0);
}
