#include "engine/walls/mesh_report.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <tuple>

#include "kernels/search/surface.hpp"

namespace moraine {

namespace {

using State = MeshSurvey::Triangle;

std::string place(Vec3 p) {
  char text[96];
  std::snprintf(text, sizeof text, "(%.6g, %.6g, %.6g)", p.x, p.y, p.z);
  return text;
}

Vec3 corner(const TriangleMesh& mesh, std::size_t triangle, std::size_t k) {
  return mesh.vertices[static_cast<std::size_t>(mesh.triangles[triangle][k])];
}

bool has_usable_corners(const TriangleMesh& mesh, std::size_t triangle) {
  for (const std::int32_t index : mesh.triangles[triangle]) {
    if (index < 0 || static_cast<std::size_t>(index) >= mesh.vertices.size()) return false;
    const Vec3 p = mesh.vertices[static_cast<std::size_t>(index)];
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) return false;
  }
  return true;
}

/// For each vertex the lowest index of those at the same place; vertices that are not finite are left alone.
std::vector<VertexNumber> weld(const std::vector<Vec3>& vertices) {
  std::vector<VertexNumber> numbers(vertices.size());
  std::iota(numbers.begin(), numbers.end(), 0);
  std::vector<VertexNumber> order;
  for (const VertexNumber i : numbers) {
    const Vec3 p = vertices[static_cast<std::size_t>(i)];
    if (std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z)) order.push_back(i);
  }
  const auto at = [&](VertexNumber i) { return vertices[static_cast<std::size_t>(i)]; };
  std::sort(order.begin(), order.end(), [&](VertexNumber i, VertexNumber j) {
    const Vec3 p = at(i), q = at(j);
    return std::tie(p.x, p.y, p.z, i) < std::tie(q.x, q.y, q.z, j);
  });
  for (std::size_t n = 1; n < order.size(); ++n)
    if (at(order[n]) == at(order[n - 1]))
      numbers[static_cast<std::size_t>(order[n])] = numbers[static_cast<std::size_t>(order[n - 1])];
  return numbers;
}

void mark_unusable(const TriangleMesh& mesh, MeshSurvey& found) {
  const std::vector<VertexNumber> numbers = weld(mesh.vertices);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (!has_usable_corners(mesh, t)) {
      found.triangles[t] = State::not_finite;
      continue;
    }
    for (std::size_t k = 0; k < 3; ++k)
      found.vertex_numbers[t][k] = numbers[static_cast<std::size_t>(mesh.triangles[t][k])];
    if (triangle_normal(corner(mesh, t, 0), corner(mesh, t, 1), corner(mesh, t, 2)) == Vec3{})
      found.triangles[t] = State::degenerate;
  }
}

/// Of triangles with the same corners, whichever way round, the first is kept.
void mark_duplicates(MeshSurvey& found) {
  std::vector<std::pair<std::array<VertexNumber, 3>, std::size_t>> keys;
  for (std::size_t t = 0; t < found.triangles.size(); ++t) {
    if (found.triangles[t] != State::usable) continue;
    std::array<VertexNumber, 3> key = found.vertex_numbers[t];
    std::sort(key.begin(), key.end());
    keys.emplace_back(key, t);
  }
  std::sort(keys.begin(), keys.end());
  for (std::size_t n = 1; n < keys.size(); ++n)
    if (keys[n].first == keys[n - 1].first) found.triangles[keys[n].second] = State::duplicate;
}

void add_line(MeshReport& report, const std::string& line) {
  if (!report.text.empty()) report.text += '\n';
  report.text += line;
}

std::string counted(std::int64_t n, const char* one, const char* many) {
  return std::to_string(n) + ' ' + (n == 1 ? one : many);
}

/// Counts the triangles of one kind and says where the first of them is.
std::int64_t report_kind(const TriangleMesh& mesh, const MeshSurvey& found, State kind, const char* what,
                         MeshReport& report) {
  const auto first = std::find(found.triangles.begin(), found.triangles.end(), kind);
  const auto n = std::count(first, found.triangles.end(), kind);
  if (n == 0) return 0;
  const auto t = static_cast<std::size_t>(first - found.triangles.begin());
  std::string line =
      counted(n, "triangle ", "triangles ") + what + ", the first is number " + std::to_string(t) + " (counted from 0)";
  if (kind != State::not_finite) line += " at " + place(corner(mesh, t, 0)) + " m";
  add_line(report, line);
  return n;
}

/// An edge by its two vertices and one of its triangles. Degenerate triangles with three corners at different places count:
/// they leave no hole.
struct Edge {
  VertexNumber low, high;
  std::size_t triangle;
};

std::vector<Edge> sorted_edges(const MeshSurvey& found) {
  std::vector<Edge> edges;
  for (std::size_t t = 0; t < found.triangles.size(); ++t) {
    const auto& v = found.vertex_numbers[t];
    const bool is_whole = v[0] != v[1] && v[1] != v[2] && v[2] != v[0];
    if (!is_whole || found.triangles[t] == State::duplicate || found.triangles[t] == State::not_finite) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax(v[k], v[(k + 1) % 3]);
      edges.push_back({low, high, t});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
    return std::tie(a.low, a.high, a.triangle) < std::tie(b.low, b.high, b.triangle);
  });
  return edges;
}

void report_edges(const TriangleMesh& mesh, const MeshSurvey& found, MeshReport& report) {
  const std::vector<Edge> edges = sorted_edges(found);
  const Edge* open = nullptr;
  const Edge* crowded = nullptr;
  for (std::size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
    const Edge& edge = edges[begin];
    while (end < edges.size() && edges[end].low == edge.low && edges[end].high == edge.high) ++end;
    if (end - begin == 1) {
      ++report.n_open_edges;
      if (open == nullptr || edge.triangle < open->triangle) open = &edge;
    } else if (end - begin > 2) {
      ++report.n_crowded_edges;
      if (crowded == nullptr || edge.triangle < crowded->triangle) crowded = &edge;
    }
  }
  const auto ends = [&](const Edge& edge) {
    return "the first from " + place(mesh.vertices[static_cast<std::size_t>(edge.low)]) + " to " +
           place(mesh.vertices[static_cast<std::size_t>(edge.high)]) + " m";
  };
  if (open != nullptr)
    add_line(report, counted(report.n_open_edges, "open edge", "open edges") +
                         " (of one triangle only: a rim or a hole), " + ends(*open));
  if (crowded != nullptr)
    add_line(report,
             counted(report.n_crowded_edges, "edge", "edges") + " of more than two triangles, " + ends(*crowded));
}

}  // namespace

MeshSurvey survey(const TriangleMesh& mesh) {
  MeshSurvey found;
  found.triangles.assign(mesh.triangles.size(), State::usable);
  found.vertex_numbers.assign(mesh.triangles.size(), {-1, -1, -1});
  mark_unusable(mesh, found);
  mark_duplicates(found);
  MeshReport& report = found.report;
  report.n_triangles = static_cast<std::int64_t>(mesh.triangles.size());
  report.n_not_finite = report_kind(mesh, found, State::not_finite, "with a corner that is not a number", report);
  report.n_degenerate = report_kind(mesh, found, State::degenerate, "without area (left out)", report);
  report.n_duplicate = report_kind(mesh, found, State::duplicate, "given twice (left out)", report);
  report_edges(mesh, found, report);
  return found;
}

MeshReport inspect(const TriangleMesh& mesh) { return survey(mesh).report; }

}  // namespace moraine
