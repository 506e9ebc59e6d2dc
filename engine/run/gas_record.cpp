#include "engine/run/gas_record.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace moraine {

namespace {

using Cell = std::array<int, 3>;

/// Of a cell of this rank, local indices.
struct CellState {
  double void_fraction, pressure;
  Vec3 velocity;
  bool is_finite() const {
    return std::isfinite(void_fraction) && std::isfinite(pressure) && std::isfinite(squared_length(velocity));
  }
};

CellState state_of(const GasView& gas, int i, int j, int k) {
  const auto& u = gas.cell_velocity;
  return {
      (*gas.void_fraction)(i, j, k), (*gas.pressure)(i, j, k), {(*u[0])(i, j, k), (*u[1])(i, j, k), (*u[2])(i, j, k)}};
}

std::string name_of(std::size_t concern) {
  switch (static_cast<CellConcern>(concern)) {
    case CellConcern::not_finite: return "not finite";
    case CellConcern::imbalance: return "worst balanced";
    case CellConcern::least_void_fraction: return "densest";
    case CellConcern::fastest: return "fastest gas";
  }
  return {};
}

/// Why the cell is in the record: what it was chosen for, else that it is beside one that was.
std::string reasons(const ConcernedCells& cells, const Cell& cell) {
  std::string all;
  for (std::size_t concern = 0; concern < n_cell_concerns; ++concern)
    if (cells[concern] == cell) all += (all.empty() ? "" : " and ") + name_of(concern);
  return all.empty() ? "beside" : all;
}

/// The cells and all that touch them, in the order of the grid.
std::set<Cell> with_those_around(const ConcernedCells& cells) {
  std::set<Cell> all;
  for (const Cell& cell : cells)
    for (int n = 0; n < 27 && cell[0] >= 0; ++n)
      all.insert({cell[2] + n / 9 - 1, cell[1] + n / 3 % 3 - 1, cell[0] + n % 3 - 1});
  return all;
}

}  // namespace

void GasStepRecord::note(double time, const CouplingReport& report) {
  rows_.push_back(fmt::format("{:.9g},{},{},{:.4g},{:.4g},{:.6g},{},{:.4g},{:.4g}\n", time, report.gas.n_parts,
                              report.gas.iterations, report.gas.imbalance, report.gas.courant,
                              report.least_void_fraction, report.n_floored, report.momentum_error,
                              report.fastest_exchange));
  if (rows_.size() > n_kept) rows_.pop_front();
}

std::string GasStepRecord::text() const {
  std::string text =
      "time [s],parts,iterations,imbalance of a cell [-],courant [-],least void fraction [-],cells at the floor,"
      "momentum error [-],step over drag time [-]\n";
  for (const std::string& row : rows_) text += row;
  return text;
}

ConcernedCells find_concerned(const GasView& gas, const CellBlock& block, const OpenCell& worst) {
  ConcernedCells found = no_cells;
  if (block.is_empty() || !gas.void_fraction) return found;
  const auto take = [&](CellConcern concern, int i, int j, int k) {
    found[static_cast<std::size_t>(concern)] = {block.low[0] + i, block.low[1] + j, block.low[2] + k};
  };
  double least = infinity, most = -1.0;
  bool is_all_finite = true;
  for (int k = 0; k < block.size(2); ++k)
    for (int j = 0; j < block.size(1); ++j)
      for (int i = 0; i < block.size(0); ++i) {
        const CellState state = state_of(gas, i, j, k);
        if (is_all_finite && !state.is_finite()) take(CellConcern::not_finite, i, j, k);
        is_all_finite &= state.is_finite();
        if (state.void_fraction < least) take(CellConcern::least_void_fraction, i, j, k);
        least = std::min(least, state.void_fraction);
        const double square = squared_length(state.velocity);
        if (square > most) take(CellConcern::fastest, i, j, k);
        most = std::max(most, square);
      }
  if (worst.cell[0] >= 0) take(CellConcern::imbalance, worst.cell[0], worst.cell[1], worst.cell[2]);
  return found;
}

std::string rows_of_cells(const GasView& gas, const CellBlock& block, const ConcernedCells& cells,
                          const OpenCell& worst, double time) {
  std::string text =
      "time [s],why,i,j,k,x [m],y [m],z [m],void fraction [-],pressure [Pa],gas vx [m/s],gas vy [m/s],gas vz [m/s],"
      "imbalance [1/s]\n";
  const GasGrid& grid = gas.grid;
  for (const auto& [k, j, i] : with_those_around(cells)) {
    if (!block.contains(i, j, k)) continue;
    const Cell local{i - block.low[0], j - block.low[1], k - block.low[2]};
    const CellState state = state_of(gas, local[0], local[1], local[2]);
    const auto centre = [&](int axis, int n) { return grid.low[axis] + (n + 0.5) * grid.spacing[axis]; };
    text += fmt::format("{:.9g},{},{},{},{},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{}\n", time,
                        reasons(cells, {i, j, k}), i, j, k, centre(0, i), centre(1, j), centre(2, k),
                        state.void_fraction, state.pressure, state.velocity.x, state.velocity.y, state.velocity.z,
                        local == worst.cell ? fmt::format("{:.4g}", worst.residual) : "");
  }
  return text;
}

std::vector<std::int32_t> grains_in(const GasGrid& grid, const std::vector<ConcernedCells>& cells,
                                    const Particles& particles, int most) {
  std::map<Cell, int> room;
  for (const ConcernedCells& of_rank : cells)
    for (const Cell& cell : of_rank)
      if (cell[0] >= 0) room[cell] = most;
  std::vector<std::int32_t> found;
  for (std::int32_t i = 0; i < particles.size(); ++i) {
    if (!particles.is_here(i)) continue;
    const auto cell = room.find(cell_of(grid, particles.position(i)));
    if (cell != room.end() && cell->second-- > 0) found.push_back(i);
  }
  return found;
}

}  // namespace moraine
