#include "engine/gas/boundaries.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>

namespace moraine {

namespace {

using Kind = GasBoundary::Kind;
constexpr const char* face_names[6] = {"x-low", "x-high", "y-low", "y-high", "z-low", "z-high"};

constexpr std::size_t index(int axis) { return static_cast<std::size_t>(axis); }

Vec3 face_centre(const GasGrid& grid, int face, std::array<int, 3> cell) {
  Vec3 centre;
  for (int a = 0; a < 3; ++a) centre[a] = grid.low[a] + (cell[index(a)] + 0.5) * grid.spacing[a];
  centre[face / 2] = grid.low[face / 2] + (face % 2 == 0 ? 0 : grid.n[index(face / 2)]) * grid.spacing[face / 2];
  return centre;
}

/// Whether the face's centre lies in the part, whatever the part says along the face's own axis by rounding.
bool is_in(const GasBoundary& entry, const GasGrid& grid, Vec3 centre) {
  if (!entry.part) return true;
  for (int a = 0; a < 3; ++a) {
    const double slack = 1e-9 * grid.spacing[a];
    if (centre[a] < entry.part->low[a] - slack || centre[a] > entry.part->high[a] + slack) return false;
  }
  return true;
}

/// The first and the last cell along an axis whose centres lie in the entry's part.
std::array<int, 2> cells_along(const GasBoundary& entry, const GasGrid& grid, int axis) {
  const int n = grid.n[index(axis)];
  if (!entry.part) return {0, n - 1};
  int first = n, last = -1;
  for (int i = 0; i < n; ++i) {
    const double centre = grid.low[axis] + (i + 0.5) * grid.spacing[axis], slack = 1e-9 * grid.spacing[axis];
    if (centre < entry.part->low[axis] - slack || centre > entry.part->high[axis] + slack) continue;
    first = std::min(first, i);
    last = i;
  }
  return {first, last};
}

/// Mean over the cell of a parabola that is zero at both ends of the part and has the mean 1; no profile along a
/// direction in which nothing varies.
double parabola(const GasBoundary& entry, const GasGrid& grid, int axis, int cell) {
  if (grid.periodic[index(axis)] || (grid.is_flat && axis == 2)) return 1.0;
  const auto [first, last] = cells_along(entry, grid, axis);
  const double n = last - first + 1, low = (cell - first) / n, high = (cell - first + 1) / n;
  const auto integral = [](double x) { return x * x * (3.0 - 2.0 * x); };  // of 6 x (1 - x)
  return (integral(high) - integral(low)) * n;
}

double interpolated(const std::vector<std::array<double, 2>>& ramp, double time) {
  if (ramp.empty()) return 1.0;
  if (time <= ramp.front()[0]) return ramp.front()[1];
  for (std::size_t k = 1; k < ramp.size(); ++k)
    if (time < ramp[k][0])
      return ramp[k - 1][1] + (ramp[k][1] - ramp[k - 1][1]) * (time - ramp[k - 1][0]) / (ramp[k][0] - ramp[k - 1][0]);
  return ramp.back()[1];
}

/// Calls visit(i, j, memory index of the cell next to the surface, step of the index outwards), for the thread's share of the rows.
template <typename Visit>
void for_each_cell(const BoundarySurface& surface, const GridLayout& layout, int around, const Team& team,
                   Visit visit) {
  const int a = surface.axis, inner = surface.is_high ? layout.size[index(a)] - 1 : 0;
  const std::int64_t outwards = surface.is_high ? layout.stride(a) : -layout.stride(a);
  const Range rows = team.share(surface.size[1] + 2 * around);
  for (int j = static_cast<int>(rows.begin) - around; j < static_cast<int>(rows.end) - around; ++j)
    for (int i = -around; i < surface.size[0] + around; ++i) {
      std::array<int, 3> cell{};
      cell[index(a)] = inner;
      cell[index(surface.along[0])] = i;
      cell[index(surface.along[1])] = j;
      visit(i, j, layout.at(cell[0], cell[1], cell[2]), outwards);
    }
}

}  // namespace

/// Calls visit(surface) for all, those along one axis before those along the next: what lies beyond an edge comes from what lies beyond a face.
template <typename Visit>
void Boundaries::axis_by_axis(const Team& team, Visit visit) const {
  for (int axis = 0; axis < 3; ++axis) {
    for (const BoundarySurface& surface : surfaces_)
      if (surface.axis == axis) visit(surface);
    team.sync();
  }
}

Boundaries::Boundaries(const Gas& gas, const GasGrid& grid, const CellBlock& block)
    : entries_(gas.boundaries), is_flat_(grid.is_flat) {
  for (int face = 0; face < 6; ++face) {
    const int axis = face / 2;
    if (grid.periodic[index(axis)] || (is_flat_ && axis == 2)) continue;
    BoundarySurface surface;
    surface.axis = axis;
    surface.is_high = face % 2 == 1;
    surface.along[0] = axis == 0 ? 1 : 0;
    surface.along[1] = axis == 2 ? 1 : 2;
    for (int k = 0; k < 2; ++k) surface.size[index(k)] = block.size(surface.along[k]);
    surface.face = surface.is_high ? block.size(axis) : 0;
    const bool is_here = surface.is_high ? block.high[index(axis)] == grid.n[index(axis)] : block.low[index(axis)] == 0;
    const auto domain_cell = [&](int axis_along, int local) {
      const int n = grid.n[index(axis_along)], cell = block.low[index(axis_along)] + local;
      return grid.periodic[index(axis_along)] ? (cell % n + n) % n : std::clamp(cell, 0, n - 1);
    };
    std::array<int, 3> cell{};
    for (int j = -gas_ghosts; is_here && j < surface.size[1] + gas_ghosts; ++j)
      for (int i = -gas_ghosts; i < surface.size[0] + gas_ghosts; ++i) {
        cell[index(surface.along[0])] = domain_cell(surface.along[0], i);
        cell[index(surface.along[1])] = domain_cell(surface.along[1], j);
        surface.faces.push_back(face_at(gas, grid, face, cell));
      }
    if (is_here) surfaces_.push_back(std::move(surface));
    // All of the face, so that all ranks know whether there is an outlet.
    for (int j = 0; j < grid.n[index(surface.along[1])] && !has_outlet_; ++j)
      for (int i = 0; i < grid.n[index(surface.along[0])] && !has_outlet_; ++i) {
        cell[index(surface.along[0])] = i;
        cell[index(surface.along[1])] = j;
        has_outlet_ = face_at(gas, grid, face, cell).kind == Kind::pressure;
      }
  }
  if (!has_outlet_) check_balance(gas, grid);
}

BoundaryFace Boundaries::face_at(const Gas& gas, const GasGrid& grid, int face, std::array<int, 3> cell) const {
  BoundaryFace found;
  const Vec3 centre = face_centre(grid, face, cell);
  for (std::size_t e = gas.boundaries.size(); e-- > 0;) {
    const GasBoundary& entry = gas.boundaries[e];
    if (entry.face != face || !is_in(entry, grid, centre)) continue;
    found.kind = entry.kind;
    found.entry = static_cast<int>(e);
    found.pressure = entry.pressure;
    found.velocity = entry.velocity;
    if (entry.profile == GasBoundary::Profile::parabolic && entry.kind == Kind::velocity)
      for (int a = 0; a < 3; ++a)
        if (a != face / 2) found.velocity = parabola(entry, grid, a, cell[index(a)]) * found.velocity;
    break;
  }
  if (is_flat_) found.velocity.z = 0.0;
  if (found.kind != Kind::velocity) found.velocity[face / 2] = 0.0;  // a wall moves along itself only
  return found;
}

void Boundaries::check_balance(const Gas& gas, const GasGrid& grid) const {
  std::vector<double> times{0.0}, inflow(gas.boundaries.size(), 0.0);
  for (int face = 0; face < 6; ++face) {
    const int axis = face / 2, a = axis == 0 ? 1 : 0, b = axis == 2 ? 1 : 2;
    if (grid.periodic[index(axis)] || (is_flat_ && axis == 2)) continue;
    const double area = grid.spacing[a] * grid.spacing[b] * (face % 2 == 0 ? 1.0 : -1.0);
    std::array<int, 3> cell{};
    for (cell[index(b)] = 0; cell[index(b)] < grid.n[index(b)]; ++cell[index(b)])
      for (cell[index(a)] = 0; cell[index(a)] < grid.n[index(a)]; ++cell[index(a)]) {
        const BoundaryFace here = face_at(gas, grid, face, cell);
        if (here.kind == Kind::velocity) inflow[static_cast<std::size_t>(here.entry)] += area * here.velocity[axis];
      }
  }
  for (const GasBoundary& entry : gas.boundaries)
    for (const auto& [time, factor] : entry.ramp) times.push_back(time);
  for (const double time : times) {
    double net = 0.0, all = 0.0;
    std::string faces;
    for (std::size_t e = 0; e < inflow.size(); ++e) {
      const double flow = inflow[e] * ramp(static_cast<int>(e), time);
      net += flow;
      all += std::abs(flow);
      if (flow != 0.0) faces += (faces.empty() ? "" : ", ") + std::string(face_names[gas.boundaries[e].face]);
    }
    if (std::abs(net) <= 1e-9 * all) continue;
    std::ostringstream message;
    message << "no face lets gas out, and what flows in through " << faces << " does not balance: " << net
            << " m3/s more than flows out at time " << time
            << " s; expected a boundary of kind \"pressure\" on some face, or velocities that add up to zero";
    throw SceneError({{"gas.boundaries", message.str(), false}});
  }
}

double Boundaries::ramp(int entry, double time) const {
  return entry < 0 ? 0.0 : interpolated(entries_[static_cast<std::size_t>(entry)].ramp, time);
}

std::vector<double> Boundaries::ramps(double time) const {
  std::vector<double> all;
  for (std::size_t e = 0; e < entries_.size(); ++e) all.push_back(ramp(static_cast<int>(e), time));
  return all;
}

void Boundaries::mirror(std::span<GridField<>* const> fields, const Team& team) const {
  axis_by_axis(team, [&](const BoundarySurface& surface) {
    for (GridField<>* const cells : fields) {
      double* const values = cells->data();
      for_each_cell(surface, cells->layout(), gas_ghosts, team, [&](int, int, std::int64_t at, std::int64_t outwards) {
        values[at + outwards] = values[at + 2 * outwards] = values[at];
      });
    }
  });
}

void Boundaries::set_given(const GridField<>& void_fraction, double time, std::array<GridField<>, 3>& velocity,
                           const Team& team) const {
  const std::vector<double> factors = ramps(time);
  for (const BoundarySurface& surface : surfaces_) {
    double* const u = velocity[index(surface.axis)].data();
    const std::int64_t to_face = surface.is_high ? void_fraction.layout().stride(surface.axis) : 0;
    for_each_cell(surface, void_fraction.layout(), gas_ghosts, team, [&](int i, int j, std::int64_t at, std::int64_t) {
      const BoundaryFace& face = surface.at(i, j);
      if (face.kind == Kind::velocity)
        u[at + to_face] =
            face.velocity[surface.axis] * factors[static_cast<std::size_t>(face.entry)] / void_fraction.data()[at];
      else if (face.kind != Kind::pressure)
        u[at + to_face] = 0.0;
    });
  }
}

void Boundaries::extend_along(const BoundarySurface& surface, int component, const GridField<>& void_fraction,
                              const std::vector<double>& factors, GridField<>& velocity, const Team& team) const {
  const GridLayout& layout = velocity.layout();
  const std::int64_t s = layout.stride(component);
  const bool is_first = surface.along[0] == component;
  double* const u = velocity.data();
  const double* const held = void_fraction.data();
  // What a cell's face says of the value beyond it: inner * slope + constant.
  const auto rule = [&](int i, int j, std::int64_t cell) -> std::array<double, 2> {
    const BoundaryFace& face = surface.at(i, j);
    if (face.kind == Kind::free_slip || face.kind == Kind::pressure) return {1.0, 0.0};
    if (face.entry < 0) return {-1.0, 0.0};
    const double given = face.velocity[component] * factors[static_cast<std::size_t>(face.entry)];
    return {-1.0, 2.0 * (face.kind == Kind::velocity ? given / held[cell] : given)};
  };
  for_each_cell(surface, layout, gas_ghosts, team, [&](int i, int j, std::int64_t at, std::int64_t outwards) {
    const bool has_lower = (is_first ? i : j) > -gas_ghosts;
    const auto here = rule(i, j, at);
    const auto lower = has_lower ? rule(is_first ? i - 1 : i, is_first ? j : j - 1, at - s) : here;
    const double inner = u[at];
    const double beyond = 0.5 * (here[0] + lower[0]) * inner + 0.5 * (here[1] + lower[1]);
    u[at + outwards] = beyond;
    u[at + 2 * outwards] = beyond + (beyond - inner);
  });
}

void Boundaries::extend(const GridField<>& void_fraction, double time, std::array<GridField<>, 3>& velocity,
                        const Team& team) const {
  const std::vector<double> factors = ramps(time);
  axis_by_axis(team, [&](const BoundarySurface& surface) {
    for (int c = 0; c < (is_flat_ ? 2 : 3); ++c)
      if (c != surface.axis) extend_along(surface, c, void_fraction, factors, velocity[index(c)], team);
    double* const u = velocity[index(surface.axis)].data();
    for_each_cell(surface, void_fraction.layout(), gas_ghosts, team,
                  [&](int i, int j, std::int64_t at, std::int64_t outwards) {
                    double* const face = u + at + (surface.is_high ? outwards : 0);
                    // None at an outlet, so that what enters there is upwind of what is inside.
                    const double slope = surface.at(i, j).kind == Kind::pressure ? 0.0 : face[0] - face[-outwards];
                    face[outwards] = face[0] + slope;
                    if (!surface.is_high)
                      face[2 * outwards] = face[0] + 2.0 * slope;  // on the high side that is beyond the layers
                  });
  });
}

void Boundaries::extend_pressure(GridField<>& pressure, double share, const Team& team) const {
  double* const p = pressure.data();
  for (const bool at_outlets : {true, false}) {  // a wall may need what lies beyond an outlet one cell away
    for (const BoundarySurface& surface : surfaces_)
      for_each_cell(surface, pressure.layout(), 0, team, [&](int i, int j, std::int64_t at, std::int64_t outwards) {
        const BoundaryFace& face = surface.at(i, j);
        if ((face.kind == Kind::pressure) != at_outlets) return;
        if (at_outlets) {
          p[at + outwards] = 2.0 * share * face.pressure - p[at];
          return;
        }
        const bool is_thin = pressure.layout().size[index(surface.axis)] == 1;
        const BoundarySurface* opposite = nullptr;
        for (const BoundarySurface& other : surfaces_)
          if (is_thin && other.axis == surface.axis && other.is_high != surface.is_high) opposite = &other;
        const bool is_closed = opposite && opposite->at(i, j).kind != Kind::pressure;
        p[at + outwards] = is_closed ? p[at] : p[at] + (p[at] - p[at - outwards]);
      });
    team.sync();
  }
}

}  // namespace moraine
