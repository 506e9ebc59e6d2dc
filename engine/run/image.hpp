// An image of a run at one moment: all that is needed to write a snapshot or a checkpoint, or to go on from one, in plain
// arrays in order of gid. It knows nothing of layout, memory order or files: input and output on one side and the engine on
// the other meet here. With several ranks each holds consecutive rows of grains, pairs and walls; those of all ranks, in order of rank,
// are the whole.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "engine/particles/fields.hpp"
#include "kernels/base/box.hpp"

namespace moraine {

/// 128-bit state hash; printed as 32 hexadecimal digits.
struct Hash128 {
  std::uint64_t high = 0;
  std::uint64_t low = 0;
  bool operator==(const Hash128&) const = default;
  std::string text() const;
  static Hash128 from_text(const std::string& hex);  // throws std::invalid_argument
};

/// One field of all grains, `components` values a grain, in order of gid. Exactly one of the vectors is used, by type.
struct FieldArray {
  Field field{};
  std::vector<double> reals;
  std::vector<std::uint64_t> gids;
  std::vector<std::uint16_t> indices;
};

/// Tangential displacement of one touching pair; gid_low < gid_high, or the same grain and its periodic image.
struct PairHistory {
  std::uint64_t gid_low = 0;
  std::uint64_t gid_high = 0;
  std::uint64_t image = 0;             // periodic image of gid_high seen from gid_low (engine's code; 0: none)
  double displacement[3] = {0, 0, 0};  // [m] of gid_low relative to gid_high
  double energy = 0.0;                 // [J] stored in the tangential spring; kept with the energy ledger only
  bool operator==(const PairHistory&) const = default;
};

/// What rolling resistance and cohesion remember of one pair; its other memory is in PairHistory.
struct FurtherHistory {
  std::uint64_t gid_low = 0, gid_high = 0, image = 0;  // as in PairHistory
  double angle[3] = {0, 0, 0};                         // [rad] rolled, of gid_low relative to gid_high
  double bond = 0.0;                                   // 1: a bond is made
  bool operator==(const FurtherHistory&) const = default;
};

/// Tangential displacement of one contact of a grain with a wall.
struct WallHistory {
  std::uint64_t gid = 0;
  std::uint64_t surface = 0;           // index of the surface (a wall may consist of several)
  double normal[3] = {0, 0, 0};        // of the contact in the last step: tells contacts with one mesh apart
  double displacement[3] = {0, 0, 0};  // [m]
  double energy = 0.0;                 // [J] as above
  double angle[3] = {0, 0, 0};         // [rad] rolled
  double bond = 0.0;                   // 1: a bond is made
  bool operator==(const WallHistory&) const = default;
};

/// One quantity of the gas on all its cells, or on faces (one more than cells where not periodic); x runs fastest. With several ranks each
/// holds consecutive values, in order of rank.
struct GridArray {
  std::string name;
  std::string unit;
  std::array<int, 3> n{};      // values along x, y, z
  std::vector<double> values;  // of this rank
};

/// What grains did to the triangles of a wall, mean over the steps since the last snapshot that was due. Degenerate and duplicate triangles of
/// the mesh are left out. The same on all ranks.
struct WallMap {
  std::string name;              // of the wall
  std::vector<double> corners;   // [m] nine a triangle, where the wall is at the time of the image
  std::vector<double> force;     // [N] three a triangle, on the wall
  std::vector<double> pressure;  // [Pa] normal force over area
  std::vector<double> shear;     // [Pa] sum of the sizes of tangential forces over area
  std::size_t n_triangles() const { return pressure.size(); }
  bool operator==(const WallMap&) const = default;
};

/// Coarse-grained fields on a grid of cells, as they are written: means over samples (Probe::Kind::fields).
struct FieldImage {
  std::string name;  // of the probe
  std::uint64_t step = 0;
  double time = 0.0;       // [s] of the last sample
  double time_step = 0.0;  // [s]
  double from = 0.0;       // [s] of the first sample
  std::uint64_t n_samples = 0;
  Box box;                        // [m] of the grid
  std::array<int, 3> n{};         // cells
  std::vector<GridArray> arrays;  // each of n values
};

/// Under which an image's accumulators hold where a moving wall is: x = R X + s for what the scene has at X; R row by row [-], then s [m].
inline std::string pose_name(const std::string& wall) { return "pose_" + wall; }

struct Image {
  std::uint64_t step = 0;
  double time = 0.0;       // [s]
  double time_step = 0.0;  // [s]
  Box domain;              // [m]
  std::array<bool, 3> periodic{};
  std::uint64_t n_grains = 0;  // of all ranks
  std::vector<FieldArray> fields;
  std::vector<PairHistory> pairs;       // in order of (gid_low, gid_high, image); empty in snapshots
  std::vector<FurtherHistory> further;  // in the same order; of pairs that have any of it
  std::vector<WallHistory> walls;       // in order of (gid, surface, normal); empty in snapshots
  std::vector<GridArray> grids;         // of the gas; empty without
  std::vector<GridArray> sums;          // what probes of kind fields add up, on grids of their own; checkpoints only
  std::vector<WallMap> maps;            // of walls that have a force map; snapshots only
  // named state of observers and counters; doubles carry it exactly; the same on all ranks
  std::map<std::string, std::vector<double>> accumulators;
  Hash128 hash;

  const FieldArray* find(Field field) const {
    for (const FieldArray& array : fields)
      if (array.field == field) return &array;
    return nullptr;
  }
};

}  // namespace moraine
