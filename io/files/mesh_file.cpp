#include <fmt/format.h>

#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <assimp/Importer.hpp>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <unordered_map>

#include "io/files/files.hpp"

namespace moraine {

namespace files {

void expect_readable(const std::filesystem::path& file) {
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (!std::filesystem::exists(status)) throw FileError(fmt::format("no such file: {}", file.string()));
  if (std::filesystem::is_directory(status))
    throw FileError(fmt::format("is a directory, not a file: {}", file.string()));
  if (!std::ifstream(file))
    throw FileError(fmt::format("cannot be read ({}): {}", std::strerror(errno), file.string()));
  if (std::filesystem::is_regular_file(status) && std::filesystem::file_size(file, error) == 0)
    throw FileError(fmt::format("the file is empty: {}", file.string()));
}

std::string ending_of(const std::filesystem::path& file) {
  std::string name = file.filename().string();
  std::transform(name.begin(), name.end(), name.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  std::size_t dot = name.rfind('.');
  if (dot == std::string::npos) return "";
  if (name.substr(dot) == ".gz" && dot > 0) dot = std::min(dot, name.rfind('.', dot - 1));
  return name.substr(dot);
}

}  // namespace files

namespace {

/// Joins vertices that are one: exactly equal, or nearer than the rounding of single precision, which STL files have.
class Welder {
 public:
  explicit Welder(double tolerance) : tolerance_(tolerance) {}

  std::int32_t add(Vec3 v) {
    const Cell cell{to_cell(v.x), to_cell(v.y), to_cell(v.z)};
    for (std::int64_t dz = -1; dz <= 1; ++dz)
      for (std::int64_t dy = -1; dy <= 1; ++dy)
        for (std::int64_t dx = -1; dx <= 1; ++dx)
          if (const std::int32_t found = find({cell.x + dx, cell.y + dy, cell.z + dz}, v); found >= 0) return found;
    const auto index = static_cast<std::int32_t>(vertices.size());
    vertices.push_back(v);
    next_.push_back(-1);
    const auto [entry, is_new] = cells_.try_emplace(cell, index);
    if (!is_new) next_.back() = entry->second, entry->second = index;
    return index;
  }

  std::vector<Vec3> vertices;

 private:
  struct Cell {
    std::int64_t x, y, z;
    bool operator==(const Cell&) const = default;
  };
  struct Hash {
    std::size_t operator()(const Cell& c) const {
      std::uint64_t h = static_cast<std::uint64_t>(c.x) * 0x9e3779b97f4a7c15ULL;
      h = (h ^ static_cast<std::uint64_t>(c.y)) * 0xbf58476d1ce4e5b9ULL;
      h = (h ^ static_cast<std::uint64_t>(c.z)) * 0x94d049bb133111ebULL;
      return static_cast<std::size_t>(h ^ (h >> 31));
    }
  };

  std::int64_t to_cell(double x) const { return static_cast<std::int64_t>(std::floor(x / tolerance_)); }

  std::int32_t find(const Cell& cell, Vec3 v) const {
    const auto entry = cells_.find(cell);
    if (entry == cells_.end()) return -1;
    for (std::int32_t i = entry->second; i >= 0; i = next_[static_cast<std::size_t>(i)])
      if (squared_length(vertices[static_cast<std::size_t>(i)] - v) <= tolerance_ * tolerance_) return i;
    return -1;
  }

  double tolerance_;
  std::unordered_map<Cell, std::int32_t, Hash> cells_;  // last vertex of each cell; the others are chained
  std::vector<std::int32_t> next_;
};

Vec3 to_vec3(const aiVector3D& v) {
  return {static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)};
}

double largest_coordinate(const aiScene& scene) {
  double largest = 0.0;
  for (unsigned m = 0; m < scene.mNumMeshes; ++m)
    for (unsigned i = 0; i < scene.mMeshes[m]->mNumVertices; ++i) {
      const Vec3 v = to_vec3(scene.mMeshes[m]->mVertices[i]);
      for (int axis = 0; axis < 3; ++axis)
        if (std::isfinite(v[axis])) largest = std::max(largest, std::abs(v[axis]));
    }
  return largest;
}

void expect_finite(const aiScene& scene, const std::filesystem::path& file) {
  for (unsigned m = 0; m < scene.mNumMeshes; ++m)
    for (unsigned i = 0; i < scene.mMeshes[m]->mNumVertices; ++i) {
      const Vec3 v = to_vec3(scene.mMeshes[m]->mVertices[i]);
      if (!std::isfinite(v.x) || !std::isfinite(v.y) || !std::isfinite(v.z))
        throw FileError(fmt::format("vertex {} is not finite: [{}, {}, {}]: {}", i, v.x, v.y, v.z, file.string()));
    }
}

/// A binary STL says how many triangles follow; a file that was cut short, or padded, gives itself away.
void check_binary_stl(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  char header[84] = {};
  in.read(header, sizeof header);
  const auto size = static_cast<std::uint64_t>(std::filesystem::file_size(file));
  const bool looks_ascii = std::string(header, header + 5) == "solid";
  if (in.gcount() < 84) {
    if (!looks_ascii)
      throw FileError(fmt::format("is not an STL file: {} bytes, too few for any triangle: {}", size, file.string()));
    return;
  }
  std::uint32_t count = 0;
  std::memcpy(&count, header + 80, sizeof count);  // little-endian in the file
  const std::uint64_t expected = 84 + 50ULL * count;
  if (looks_ascii || size == expected) return;
  if (size < expected)
    throw FileError(fmt::format("the file was cut short: {} triangles need {} bytes, it has {}: {}", count, expected,
                                size, file.string()));
}

/// The message of the importer, without its own markers.
std::string reason(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ' || text.back() == '.')) text.pop_back();
  return text.empty() ? "it holds no mesh" : text;
}

}  // namespace

TriangleMesh load_mesh(const std::filesystem::path& file, double scale, Vec3 translate) {
  files::expect_readable(file);
  const std::string ending = files::ending_of(file);
  if (ending != ".stl" && ending != ".obj")
    throw FileError(fmt::format("\"{}\" is not a kind of mesh file that can be read; expected .stl or .obj: {}", ending,
                                file.string()));
  if (ending == ".stl") check_binary_stl(file);

  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile(file.string(), aiProcess_Triangulate);
  if (!scene)
    throw FileError(
        fmt::format("cannot be understood as a mesh: {}: {}", reason(importer.GetErrorString()), file.string()));
  expect_finite(*scene, file);

  const double tolerance = std::max(largest_coordinate(*scene) * 0x1p-21, std::numeric_limits<double>::min() * 1e20);
  Welder welder(tolerance);
  TriangleMesh mesh;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
    const aiMesh& part = *scene->mMeshes[m];
    for (unsigned f = 0; f < part.mNumFaces; ++f) {
      if (part.mFaces[f].mNumIndices != 3) continue;  // points and lines have no surface
      std::array<std::int32_t, 3> triangle{};
      for (unsigned c = 0; c < 3; ++c) triangle[c] = welder.add(to_vec3(part.mVertices[part.mFaces[f].mIndices[c]]));
      mesh.triangles.push_back(triangle);
    }
  }
  if (mesh.triangles.empty()) throw FileError(fmt::format("holds no triangles: {}", file.string()));
  mesh.vertices = std::move(welder.vertices);
  for (Vec3& vertex : mesh.vertices) vertex = scale * vertex + translate;
  return mesh;
}

}  // namespace moraine
