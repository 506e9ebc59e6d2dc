// What the gas meets on the faces of the domain that are not periodic.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/gas/grid.hpp"
#include "engine/gas/grid_field.hpp"
#include "engine/gas/team.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

/// The face of one cell that lies on a face of the domain.
struct BoundaryFace {
  GasBoundary::Kind kind = GasBoundary::Kind::no_slip;
  int entry = -1;         // of the scene's list; -1: the wall that is there where nothing is given
  Vec3 velocity;          // [m/s] of the gas (superficial) or of the wall, at full ramp, with the profile
  double pressure = 0.0;  // [Pa]
};

/// One face of the domain, as far as it touches a rank's block and its ghost layers.
struct BoundarySurface {
  int axis = 0;
  bool is_high = false;
  int face = 0;                     // local index of the faces along the axis
  int along[2] = {1, 2};            // the other axes, first runs fastest
  std::array<int, 2> size{};        // cells of the block along them
  std::vector<BoundaryFace> faces;  // with gas_ghosts more around; beyond the domain those at its edge again
  const BoundaryFace& at(int i, int j) const {
    return faces[static_cast<std::size_t>((j + gas_ghosts) * (size[0] + 2 * gas_ghosts) + i + gas_ghosts)];
  }
};

class Boundaries {
 public:
  /// Throws SceneError where nothing lets gas out and what flows in does not balance.
  Boundaries(const Gas& gas, const GasGrid& grid, const CellBlock& block);

  const std::vector<BoundarySurface>& surfaces() const { return surfaces_; }
  bool has_outlet() const { return has_outlet_; }
  /// Factor of an entry's velocity at a time [s].
  double ramp(int entry, double time) const;

  // All threads of a team call these together; when one returns to them, all that it does is done.

  /// Values beyond the domain as the nearest ones inside.
  void mirror(std::span<GridField<>* const> fields, const Team& team) const;
  /// Velocities on the faces of the domain where they are given, at `time`; those at pressure outlets stay. Each thread sees only what it
  /// has done itself.
  void set_given(const GridField<>& void_fraction, double time, std::array<GridField<>, 3>& velocity,
                 const Team& team) const;
  /// Velocities beyond the domain, from those inside and on its faces.
  void extend(const GridField<>& void_fraction, double time, std::array<GridField<>, 3>& velocity,
              const Team& team) const;
  /// Pressures beyond the domain: such that a pressure outlet has its pressure (`share` of it) on the face, and at
  /// walls the gradient is that of the next faces inside.
  void extend_pressure(GridField<>& pressure, double share, const Team& team) const;

 private:
  template <typename Visit>
  void axis_by_axis(const Team& team, Visit visit) const;
  void check_balance(const Gas& gas, const GasGrid& grid) const;
  BoundaryFace face_at(const Gas& gas, const GasGrid& grid, int face, std::array<int, 3> cell) const;
  void extend_along(const BoundarySurface& surface, int component, const GridField<>& void_fraction,
                    const std::vector<double>& ramps, GridField<>& velocity, const Team& team) const;
  std::vector<double> ramps(double time) const;

  std::vector<GasBoundary> entries_;
  std::vector<BoundarySurface> surfaces_;
  bool is_flat_ = false, has_outlet_ = false;
};

}  // namespace moraine
