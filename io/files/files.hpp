// Files that a scene names: triangle meshes and lists of grains.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "comm/world.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

/// A file that cannot be used: which, where in it, what is wrong, what was expected.
struct FileError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Reads a mesh (STL, ascii or binary; OBJ) in the order of the file. Vertices are multiplied by `scale`, then moved by
/// `translate` [m]. Vertices that differ by no more than the rounding of single precision become one, so that triangles
/// know their neighbours. Throws FileError where the file is missing, empty, damaged or of another kind.
TriangleMesh load_mesh(const std::filesystem::path& file, double scale = 1.0, Vec3 translate = {});

/// What a list of grains needs to know of the scene around it.
struct GrainFileContext {
  std::vector<std::string> materials;  // names, in the order of Scene::materials
  std::optional<std::uint16_t>
      material;             // of all grains, whatever the file says; none: from the file, 0 where it has none
  Vec3 velocity;            // [m/s] of grains of a file that gives spins only
  Vec3 angular_velocity;    // [rad/s] of grains whose spin the file does not give
  std::optional<double> z;  // [m] of grains of a file without z; none: z is required
  ListShare share = {};     // the rows to keep; by ranks of HDF5 files each keeps consecutive ones
};

/// Reads a list of grains. By the ending of the file:
///   .csv, .txt, .dat, each also with .gz: a header, then one grain a line, separated by commas, semicolons, tabs or
///     spaces. Columns in any order: x, y, z [m], then optionally r or d [m], vx, vy, vz [m/s], wx, wy, wz [rad/s],
///     material (name). Lines that start with # are comments.
///   .h5, .hdf5: datasets /particles/position (N, 3) and optionally radius (N), velocity (N, 3), angular_velocity
///     (N, 3), material (N; number of the material in the scene), as in snapshots.
/// Material and angular velocity of every seed are set, from the file or from the context.
/// Throws FileError with line and column, or with the dataset.
/// Where the ranks of `world` share the list, all of them call it; each keeps the rows of its share and learns what
/// they hold together, and no rank holds the file whole at any time. They all throw the same error, which is the one of
/// a rank alone.
ListedGrains load_grains(const std::filesystem::path& file, const GrainFileContext& context = {},
                         const World& world = {});

namespace files {

/// What is wrong with rows of a list; those of several ranks come together as one rank would have found them.
class RowProblems {
 public:
  /// `most`: how many are told; what follows them is counted.
  explicit RowProblems(std::size_t most) : most_(most) {}
  /// Row, or line: what they are told in order of.
  void add(std::uint64_t row, const std::string& text);
  bool empty() const { return count_ == 0; }
  /// All ranks call it; the same on all.
  std::string text(const World& world) const;

 private:
  std::size_t most_;
  std::uint64_t count_ = 0;
  std::vector<std::string> told_;  // each begins with its row, in so many digits that texts are in the order of rows
};

/// What is read of a file by one rank: the rows of context.share, and the problems of these rows.
struct ShareOfList {
  ListedGrains list;
  RowProblems problems;
};
ShareOfList load_grain_table(const std::filesystem::path& file, const GrainFileContext& context);
ShareOfList load_grain_hdf5(const std::filesystem::path& file, const GrainFileContext& context);

/// Throws FileError unless the file exists, is a file, can be read and is not empty.
void expect_readable(const std::filesystem::path& file);
/// Ending of the name in lower case, with its dot; ".csv.gz" counts as one.
std::string ending_of(const std::filesystem::path& file);

}  // namespace files

}  // namespace moraine
