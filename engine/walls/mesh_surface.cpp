#include "engine/walls/mesh_surface.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "engine/walls/wall_extent.hpp"

namespace moraine {

namespace {

constexpr std::int32_t max_leaf = 4;  // triangles; more make leaves dearer than the nodes they save

/// A corner or an edge with the vertices that say which others it shares its place with.
struct Member {
  VertexNumber low, high;
  std::int32_t number;
};

/// Links members of the same place into rings, in ascending order of their numbers.
std::vector<std::int32_t> rings(std::vector<Member> members) {
  std::sort(members.begin(), members.end(), [](const Member& a, const Member& b) {
    return std::tie(a.low, a.high, a.number) < std::tie(b.low, b.high, b.number);
  });
  std::vector<std::int32_t> next(members.size());
  for (std::size_t begin = 0, end = 0; begin < members.size(); begin = end) {
    while (end < members.size() && members[end].low == members[begin].low && members[end].high == members[begin].high)
      ++end;
    for (std::size_t n = begin; n < end; ++n)
      next[static_cast<std::size_t>(members[n].number)] = members[n + 1 < end ? n + 1 : begin].number;
  }
  return next;
}

double outside(double x, double low, double high) { return std::max({low - x, 0.0, x - high}); }

double squared_distance(const Box& box, Vec3 p) {
  return squared_length(
      {outside(p.x, box.low.x, box.high.x), outside(p.y, box.low.y, box.high.y), outside(p.z, box.low.z, box.high.z)});
}

int longest_axis(Vec3 size) { return size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2; }

}  // namespace

MeshSurface::MeshSurface(const TriangleMesh& mesh, const MeshSurvey& survey) {
  take_triangles(mesh, survey);
  link(survey);
  build_tree();
}

void MeshSurface::take_triangles(const TriangleMesh& mesh, const MeshSurvey& survey) {
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (survey.triangles[t] != MeshSurvey::Triangle::usable) continue;
    // By vertex number, so that corners at one place are the same to the bit (0.0 and -0.0 are one place).
    const auto& v = survey.vertex_numbers[t];
    const Vec3 a = mesh.vertices[static_cast<std::size_t>(v[0])], b = mesh.vertices[static_cast<std::size_t>(v[1])],
               c = mesh.vertices[static_cast<std::size_t>(v[2])];
    corners_.insert(corners_.end(), {a, b, c});
    normals_.push_back(triangle_normal(a, b, c));
    for (const Vec3 p : {a, b, c}) extent_.include(p);
  }
}

void MeshSurface::link(const MeshSurvey& survey) {
  std::vector<Member> corners, edges;
  std::int32_t number = 0;
  for (std::size_t t = 0; t < survey.triangles.size(); ++t) {
    if (survey.triangles[t] != MeshSurvey::Triangle::usable) continue;
    const auto& v = survey.vertex_numbers[t];
    for (std::size_t k = 0; k < 3; ++k, ++number) {
      const auto [low, high] = std::minmax(v[k], v[(k + 1) % 3]);
      corners.push_back({v[k], v[k], number});
      edges.push_back({low, high, number});
    }
  }
  corner_ring_ = rings(std::move(corners));
  edge_ring_ = rings(std::move(edges));
}

void MeshSurface::build_tree() {
  std::vector<Box> boxes(normals_.size(), Box::empty());
  for (std::size_t i = 0; i < corners_.size(); ++i) boxes[i / 3].include(corners_[i]);
  leaf_triangles_.resize(normals_.size());
  std::iota(leaf_triangles_.begin(), leaf_triangles_.end(), 0);
  nodes_.reserve(normals_.size());
  if (!boxes.empty()) build_node(boxes, 0, n_triangles());
}

void MeshSurface::build_node(const std::vector<Box>& boxes, std::int32_t begin, std::int32_t end) {
  const auto box_of = [&](std::int32_t triangle) -> const Box& { return boxes[static_cast<std::size_t>(triangle)]; };
  Node node{Box::empty(), 0, 0, 0};
  Box middles = Box::empty();  // twice the middles of the boxes
  for (std::int32_t i = begin; i < end; ++i) {
    const Box& box = box_of(leaf_triangles_[static_cast<std::size_t>(i)]);
    node.box.include(box.low);
    node.box.include(box.high);
    middles.include(box.low + box.high);
  }
  const std::size_t place = nodes_.size();
  nodes_.push_back(node);
  if (end - begin <= max_leaf) {
    nodes_[place].first = begin;
    nodes_[place].n_triangles = end - begin;
  } else {
    const int axis = longest_axis(middles.size());
    const std::int32_t half = begin + (end - begin) / 2;
    std::nth_element(leaf_triangles_.begin() + begin, leaf_triangles_.begin() + half, leaf_triangles_.begin() + end,
                     [&](std::int32_t i, std::int32_t j) {
                       const double a = box_of(i).low[axis] + box_of(i).high[axis];
                       const double b = box_of(j).low[axis] + box_of(j).high[axis];
                       return a < b || (a == b && i < j);
                     });
    build_node(boxes, begin, half);
    build_node(boxes, half, end);
  }
  nodes_[place].next = static_cast<std::int32_t>(nodes_.size());
}

double MeshSurface::area(const Box& clip) const {
  double area = 0.0;
  for (std::size_t t = 0; t < corners_.size(); t += 3) {
    Box box = Box::empty();
    for (std::size_t k = 0; k < 3; ++k) box.include(corners_[t + k]);
    if (common_part(box, clip) == Box::empty()) continue;
    area += common_part(box, clip) == box
                ? 0.5 * length(cross(corners_[t + 1] - corners_[t], corners_[t + 2] - corners_[t]))
                : area_of({corners_[t], corners_[t + 1], corners_[t + 2]}, clip);
  }
  return area;
}

void MeshSurface::find(Vec3 centre, double reach, std::vector<std::int32_t>& found) const {
  const std::size_t n_before = found.size();
  const double squared_reach = reach * reach;
  for (std::size_t n = 0; n < nodes_.size();) {
    const Node& node = nodes_[n];
    if (!(squared_distance(node.box, centre) < squared_reach)) {
      n = static_cast<std::size_t>(node.next);
      continue;
    }
    for (std::int32_t i = node.first; i < node.first + node.n_triangles; ++i) {
      const std::int32_t triangle = leaf_triangles_[static_cast<std::size_t>(i)];
      const Vec3* c = corners_.data() + 3 * static_cast<std::size_t>(triangle);
      const Vec3 normal = normals_[static_cast<std::size_t>(triangle)];
      if (!(std::abs(dot(normal, centre - c[0])) < reach)) continue;
      if (squared_distance_to_triangle(centre, c, normal) < squared_reach) found.push_back(triangle);
    }
    ++n;
  }
  std::sort(found.begin() + static_cast<std::ptrdiff_t>(n_before), found.end());
}

}  // namespace moraine
