// What is wrong with a triangle mesh, and which of its triangles can be used.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/scene/scene.hpp"

namespace moraine {

/// What is wrong with a mesh, with counts and the place of the first of each kind.
struct MeshReport {
  std::int32_t wall = -1;  // index of the wall in the scene; -1: a mesh by itself
  std::int64_t n_triangles = 0;
  std::int64_t n_degenerate = 0;     // area next to nothing: left out
  std::int64_t n_duplicate = 0;      // same three corners as an earlier one: left out
  std::int64_t n_open_edges = 0;     // edges of one triangle only
  std::int64_t n_crowded_edges = 0;  // edges of more than two triangles
  std::int64_t n_not_finite = 0;     // triangles with a corner that is not a number, or that does not exist
  std::string text;                  // one line for each kind found, with place [m]; empty: a closed, sound mesh

  std::int64_t n_usable() const { return n_triangles - n_degenerate - n_duplicate - n_not_finite; }
};

/// Looks at a mesh without building anything.
MeshReport inspect(const TriangleMesh& mesh);

/// Number of a vertex by its place; vertices at exactly the same place have the same number.
using VertexNumber = std::int32_t;

/// A mesh with its vertices told apart by place (files such as STL list each corner anew).
struct MeshSurvey {
  enum class Triangle : std::uint8_t { usable, degenerate, duplicate, not_finite };
  std::vector<Triangle> triangles;                          // one per triangle
  std::vector<std::array<VertexNumber, 3>> vertex_numbers;  // one per triangle; -1 where not finite
  MeshReport report;
};

MeshSurvey survey(const TriangleMesh& mesh);

}  // namespace moraine
