// Spheres against triangle meshes: one touch for one smooth surface.
#include <catch2/catch.hpp>

#include <algorithm>

#include "kernels/search/surface.hpp"
#include "tests/support/surface_shapes.hpp"

using namespace moraine;
using shapes::Dice;
using shapes::Frame;

namespace {

/// The centre of a sphere at `height` over a place of the mesh: 0 inside a triangle, 1 on an edge, 2 on a vertex.
Vec3 place_on(const TriangleMesh& mesh, int kind, Dice& dice) {
  const auto& t = mesh.triangles[static_cast<std::size_t>(dice.index(static_cast<int>(mesh.triangles.size())))];
  const auto corner = [&](std::size_t k) { return mesh.vertices[static_cast<std::size_t>(t[k])]; };
  if (kind == 2) return corner(0);
  const double u = dice.uniform(0, 1), v = kind == 1 ? 0.0 : dice.uniform(0, 1 - u);
  return corner(0) + u * (corner(1) - corner(0)) + v * (corner(2) - corner(0));
}

/// Local minima of the distance by their definition: a closest point of a triangle such that no triangle that contains it
/// comes nearer.
std::vector<Touch> minima_by_definition(const TriangleMesh& mesh, Vec3 centre, double reach) {
  struct Found {
    Vec3 point;
    double distance;
  };
  std::vector<Found> closest;
  const auto corner = [&](std::size_t t, std::size_t k) {
    return mesh.vertices[static_cast<std::size_t>(mesh.triangles[t][k])];
  };
  const auto closest_on = [&](std::size_t t, Vec3 p) {
    return closest_point_on_triangle(p, corner(t, 0), corner(t, 1), corner(t, 2));
  };
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3 p = closest_on(t, centre);
    closest.push_back({p, length(centre - p)});
  }
  std::vector<Touch> minima;
  std::vector<Vec3> places;
  for (const Found& found : closest) {
    if (found.distance >= reach) continue;
    bool is_minimum = true;
    for (std::size_t t = 0; t < closest.size() && is_minimum; ++t)
      is_minimum =
          closest[t].distance > found.distance - 1e-9 || length(closest_on(t, found.point) - found.point) > 1e-9;
    const bool is_new =
        std::none_of(places.begin(), places.end(), [&](Vec3 p) { return length(p - found.point) < 1e-7; });
    if (!is_minimum || !is_new) continue;
    places.push_back(found.point);
    minima.push_back({(centre - found.point) / found.distance, found.distance});
  }
  std::sort(minima.begin(), minima.end(), [](const Touch& a, const Touch& b) { return a.distance < b.distance; });
  return minima;
}

/// Largest change of normal and of distance between neighbouring points of a path; requires one touch all along.
struct Jumps {
  double normal = 0.0, distance = 0.0;
};
Jumps largest_jumps(const MeshSurface& mesh, double reach, int n, const std::function<Vec3(double)>& path) {
  Jumps jumps;
  Touch last;
  for (int i = 0; i <= n; ++i) {
    const std::vector<Touch> found = shapes::touches(mesh, path(static_cast<double>(i) / n), reach);
    REQUIRE(found.size() == 1);
    if (i > 0) {
      jumps.normal = std::max(jumps.normal, length(found[0].normal - last.normal));
      jumps.distance = std::max(jumps.distance, std::abs(found[0].distance - last.distance));
    }
    last = found[0];
  }
  return jumps;
}

}  // namespace

TEST_CASE("a plane of any number of triangles touches like a plane") {
  Dice dice(11);
  for (const int n : {1, 10, 100})
    for (const double jitter : {0.0, 0.9}) {
      CAPTURE(n, jitter);
      TriangleMesh mesh = shapes::plane_mesh(n, jitter, dice);
      const Frame frame = shapes::random_frame(dice);
      shapes::place(mesh, frame);
      const MeshSurface surface = shapes::make_surface(mesh);
      for (int i = 0; i < 3000; ++i) {
        const double reach = std::pow(10.0, dice.uniform(-3, -0.5));
        const double height = reach * dice.uniform(0.0, 1.05) * (i % 2 ? 1.0 : -1.0);
        Vec3 foot = place_on(mesh, i % 3, dice);
        if (std::abs(dot(foot - frame.origin, frame.x)) > 0.999 || std::abs(dot(foot - frame.origin, frame.y)) > 0.999)
          continue;
        const std::vector<Touch> found = shapes::touches(surface, foot + height * frame.z, reach);
        REQUIRE(found.size() == (std::abs(height) < reach ? 1 : 0));
        if (found.empty()) continue;
        CHECK(std::abs(found[0].distance - std::abs(height)) < 1e-12 * reach + 2e-15);
        CHECK(length(found[0].normal - (height < 0 ? -1.0 : 1.0) * frame.z) < 1e-12);
      }
    }
}

TEST_CASE("a plane whose triangles do not meet vertex to vertex touches like a plane") {
  // A fine half and a coarse half with vertices of one in the middle of edges of the other.
  Dice dice(12);
  TriangleMesh mesh = shapes::sheet(7, 13, false, [](double u, double v) { return Vec3{u - 1, 2 * v - 1, 0}; });
  const TriangleMesh coarse = shapes::sheet(1, 2, false, [](double u, double v) { return Vec3{u, 2 * v - 1, 0}; });
  const auto first = static_cast<std::int32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), coarse.vertices.begin(), coarse.vertices.end());
  for (const auto& t : coarse.triangles) mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  const Frame frame = shapes::random_frame(dice);
  shapes::place(mesh, frame);
  const MeshSurface surface = shapes::make_surface(mesh);
  for (int i = 0; i < 3000; ++i) {
    const Vec3 foot{i % 3 ? dice.uniform(-0.2, 0.2) : 0.0, dice.uniform(-0.7, 0.7), 0.0};
    const double reach = 0.2, height = dice.uniform(0.01, reach);
    const std::vector<Touch> found = shapes::touches(surface, frame.place(foot) + height * frame.z, reach);
    REQUIRE(found.size() == 1);
    CHECK(std::abs(found[0].distance - height) < 1e-12);
    CHECK(length(found[0].normal - frame.z) < 1e-12);
  }
}

TEST_CASE("a sphere in the corner of a box touches three of its walls, in an edge two, on a face one") {
  Dice dice(13);
  for (const int n : {1, 3, 40}) {
    const Vec3 size{1.0, 1.3, 0.8};
    TriangleMesh mesh = shapes::box_mesh({0, 0, 0}, size, n);
    const Frame frame = shapes::random_frame(dice);
    shapes::place(mesh, frame);
    const MeshSurface surface = shapes::make_surface(mesh);
    const double reach = 0.1;
    for (int i = 0; i < 2000; ++i) {
      Vec3 centre;
      std::vector<std::pair<double, Vec3>> expected;  // distance, normal
      for (int axis = 0; axis < 3; ++axis) {
        const bool is_near = dice.index(2) == 0;
        centre[axis] = is_near ? dice.uniform(0.05, 0.0999) : dice.uniform(0.11, 0.5) * size[axis] + 0.05;
        Vec3 normal;
        normal[axis] = 1.0;
        if (is_near)
          expected.emplace_back(centre[axis], frame.turn(normal));
        else if (centre[axis] < reach || size[axis] - centre[axis] < reach)
          centre[axis] = 0.5 * size[axis];
      }
      std::sort(expected.begin(), expected.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
      const std::vector<Touch> found = shapes::touches(surface, frame.place(centre), reach);
      REQUIRE(found.size() == expected.size());
      for (std::size_t k = 0; k < found.size(); ++k) {
        CHECK(found[k].distance == Approx(expected[k].first).epsilon(1e-12));
        CHECK(length(found[k].normal - expected[k].second) < 1e-12);
      }
    }
  }
}

TEST_CASE("a sphere outside a box touches its nearest point only: face, edge or corner") {
  Dice dice(14);
  for (const int n : {1, 5}) {
    TriangleMesh mesh = shapes::box_mesh({-1, -1, -1}, {1, 1, 1}, n);
    const Frame frame = shapes::random_frame(dice);
    shapes::place(mesh, frame);
    const MeshSurface surface = shapes::make_surface(mesh);
    int n_at[4] = {0, 0, 0, 0};
    for (int i = 0; i < 6000; ++i) {
      Vec3 nearest, centre;
      int n_outside = 0;
      for (int axis = 0; axis < 3; ++axis) {
        centre[axis] = dice.uniform(0, 1) < 0.5 ? dice.uniform(1.0, 1.2) : dice.uniform(-1, 1);
        nearest[axis] = std::min(centre[axis], 1.0);
        n_outside += centre[axis] > 1.0;
      }
      if (n_outside == 0) continue;
      ++n_at[n_outside];
      const double distance = length(centre - nearest);
      const std::vector<Touch> found = shapes::touches(surface, frame.place(centre), 0.3);
      REQUIRE(found.size() == (distance < 0.3 ? 1 : 0));
      if (found.empty()) continue;
      CHECK(found[0].distance == Approx(distance).epsilon(1e-12).margin(1e-14));
      CHECK(length(found[0].normal - frame.turn((centre - nearest) / distance)) < 1e-10);
    }
    CHECK((n_at[1] > 100 && n_at[2] > 100 && n_at[3] > 100));
  }
}

TEST_CASE("a sphere on a plate touches its near side only") {
  Dice dice(15);
  const MeshSurface plate = shapes::make_surface(shapes::box_mesh({-1, -1, -0.01}, {1, 1, 0}, 10));
  for (int i = 0; i < 1000; ++i) {
    const double height = dice.uniform(0.05, 0.1);
    const std::vector<Touch> found = shapes::touches(plate, {dice.uniform(-1, 1), dice.uniform(-1, 1), height}, 0.2);
    REQUIRE(found.size() == 1);
    CHECK(found[0].distance == Approx(height).epsilon(1e-12));
    CHECK(found[0].normal.z == Approx(1.0).epsilon(1e-12));
  }
}

TEST_CASE("touches are the local minima of the distance over the mesh, by definition") {
  Dice dice(16);
  int n_compared = 0, n_several = 0;
  for (int terrain = 0; terrain < 200; ++terrain) {
    const double roughness = dice.uniform(0.1, 0.6);
    TriangleMesh mesh = shapes::sheet(7, 7, false, [&](double u, double v) {
      return Vec3{u + dice.uniform(-0.03, 0.03), v + dice.uniform(-0.03, 0.03), roughness * dice.uniform(-0.3, 0.3)};
    });
    shapes::place(mesh, shapes::random_frame(dice));
    const MeshSurface surface = shapes::make_surface(mesh);
    for (int i = 0; i < 100; ++i) {
      const double reach = dice.uniform(0.05, 0.3);
      const Vec3 centre = place_on(mesh, 0, dice) + dice.uniform(0.87, 1.0) * reach * dice.direction();
      const std::vector<Touch> expected = minima_by_definition(mesh, centre, reach);
      bool is_merged = false;
      for (const Touch& a : expected)
        for (const Touch& b : expected) is_merged |= &a != &b && dot(a.normal, b.normal) > 0.85;
      // Deeper than an eighth of the reach a nearer minimum may hide another.
      if (is_merged || expected.size() > max_touches || (!expected.empty() && expected[0].distance < 0.87 * reach))
        continue;
      const std::vector<Touch> found = shapes::touches(surface, centre, reach);
      REQUIRE(found.size() == expected.size());
      for (std::size_t k = 0; k < found.size(); ++k) {
        CHECK(found[k].distance == Approx(expected[k].distance).epsilon(1e-10));
        CHECK(length(found[k].normal - expected[k].normal) < 1e-7);
      }
      n_compared += !found.empty();
      n_several += found.size() > 1;
    }
  }
  CHECK(n_compared > 500);
  CHECK(n_several > 50);
}

TEST_CASE("the nearest touch is as near as the nearest triangle, however the mesh is folded") {
  Dice dice(17);
  for (int i = 0; i < 300; ++i) {
    TriangleMesh mesh;
    for (int t = 0; t < 12; ++t) {
      for (int k = 0; k < 3; ++k) mesh.vertices.push_back(dice.point({-1, -1, -1}, {1, 1, 1}));
      mesh.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
    }
    const MeshSurface surface = shapes::make_surface(mesh);
    const Vec3 centre = dice.point({-1, -1, -1}, {1, 1, 1});
    double nearest = infinity;
    for (const auto& t : mesh.triangles) {
      const auto at = [&](std::size_t k) { return mesh.vertices[static_cast<std::size_t>(t[k])]; };
      nearest = std::min(nearest, length(centre - closest_point_on_triangle(centre, at(0), at(1), at(2))));
    }
    const double reach = 0.7;
    const std::vector<Touch> found = shapes::touches(surface, centre, reach);
    REQUIRE(found.empty() == (nearest >= reach));
    // A merged touch lies between its minima.
    if (!found.empty()) CHECK(found[0].distance >= nearest * (1 - 1e-12));
    if (found.size() == 1) CHECK(found[0].distance < reach);
  }
}

TEST_CASE("triangles beyond reach and their number do not change a bit of a touch") {
  Dice dice(18);
  TriangleMesh mesh = shapes::cone_mesh(40, 15, 1.0, 0.6, 1.5);
  shapes::place(mesh, shapes::random_frame(dice));
  const MeshSurface surface = shapes::make_surface(mesh);
  std::vector<std::int32_t> all;
  for (std::int32_t t = 0; t < surface.n_triangles(); ++t) all.push_back(t);
  for (int i = 0; i < 500; ++i) {
    const double reach = 0.2;
    const Vec3 centre = place_on(mesh, i % 3, dice) + reach * dice.uniform(0.9, 1.0) * dice.direction();
    const std::vector<Touch> expected = shapes::touches(surface, centre, reach);
    Touch found[max_touches];
    REQUIRE(touch_mesh(surface.view(), all, centre, reach, found) == static_cast<int>(expected.size()));
    for (std::size_t k = 0; k < expected.size(); ++k) {
      CHECK(found[k].normal == expected[k].normal);
      CHECK(found[k].distance == expected[k].distance);
    }
  }
}

TEST_CASE("meshed cylinders and cones approach the analytic ones with the square of the facet size") {
  for (const double radius_top : {1.0, 0.4})
    for (const bool is_inside : {true, false}) {
      CAPTURE(radius_top, is_inside);
      Surface cone;
      cone.kind = SurfaceKind::cone;
      cone.radius_base = 1.0;
      cone.radius_top = radius_top;
      cone.length = 1.5;
      double scaled_error[3];
      int level = 0;
      for (const int n : {24, 48, 96}) {
        const MeshSurface surface = shapes::make_surface(shapes::cone_mesh(n, n / 4, 1.0, radius_top, 1.5));
        Dice dice(19);
        double error = 0.0, normal_error = 0.0;
        for (int i = 0; i < 4000; ++i) {
          const double reach = 0.2, angle = dice.uniform(0, 6.28), z = dice.uniform(0.4, 1.1);
          const double wall = 1.0 + (radius_top - 1.0) * z / 1.5;
          const double r = wall + (is_inside ? -1 : 1) * reach * dice.uniform(0.8, 0.95);
          const Vec3 centre{r * std::cos(angle), r * std::sin(angle), z};
          Touch expected;
          REQUIRE(touch_analytic(cone, centre, reach, expected));
          const std::vector<Touch> found = shapes::touches(surface, centre, reach);
          REQUIRE(found.size() == 1);
          error = std::max(error, std::abs(found[0].distance - expected.distance));
          normal_error = std::max(normal_error, length(found[0].normal - expected.normal));
        }
        scaled_error[level++] = error * n * n;
        CHECK(normal_error < 1.1 * std::numbers::pi / n);  // half the angle between facets
      }
      // Sagitta of a facet: pi^2 / 2 / n^2.
      CHECK(scaled_error[0] < 5.5);
      CHECK(scaled_error[1] == Approx(scaled_error[0]).epsilon(0.1));
      CHECK(scaled_error[2] == Approx(scaled_error[1]).epsilon(0.1));
    }
}

TEST_CASE("a sphere rolls over hollow and bulging facets without a jump of force") {
  const double reach = 0.3;
  for (const int n : {12, 16, 60, 300}) {
    CAPTURE(n);
    const MeshSurface tube = shapes::make_surface(shapes::cone_mesh(n, 5, 1.0, 1.0, 2.0));
    for (const double r : {0.71, 0.75, 1.25}) {
      CAPTURE(r);
      const auto path = [&](double s) {
        return Vec3{r * std::cos(0.1 + 2 * s), r * std::sin(0.1 + 2 * s), 1.0 + 0.3 * std::sin(5 * s)};
      };
      const Jumps coarse = largest_jumps(tube, reach, 20000, path), fine = largest_jumps(tube, reach, 80000, path);
      // A continuous change shrinks with the step, a jump stays.
      CHECK(fine.normal < 0.35 * coarse.normal);
      CHECK(fine.distance < 0.35 * coarse.distance);
    }
  }
}

TEST_CASE("a sphere rolls over an irregularly meshed bowl with next to no jumps") {
  // Curved both ways, vertices displaced at random. Where more than two triangles meet and the one in between is not touched
  // itself, small jumps remain; with weights by overlap alone nearly all change of the normal is in jumps.
  Dice dice(20);
  TriangleMesh mesh = shapes::sheet(24, 24, false, [&](double u, double v) {
    const double x = 2 * u - 1 + dice.uniform(-0.02, 0.02), y = 2 * v - 1 + dice.uniform(-0.02, 0.02);
    return Vec3{x, y, 0.25 * x * x + 0.15 * y * y + dice.uniform(-0.001, 0.001)};
  });
  const MeshSurface bowl = shapes::make_surface(mesh);
  double all = 0.0, in_jumps = 0.0;
  Vec3 last;
  constexpr int n = 400000;
  for (int i = 0; i <= n; ++i) {
    const double s = 6.0 * i / n, x = 0.6 * std::sin(3 * s), y = 0.5 * std::cos(4 * s);
    const std::vector<Touch> found = shapes::touches(bowl, {x, y, 0.25 * x * x + 0.15 * y * y + 0.245}, 0.25);
    REQUIRE(found.size() == 1);
    const double change = i > 0 ? length(found[0].normal - last) : 0.0;
    all += change;
    if (change > 1e-3) in_jumps += change;  // some ten times what the path explains
    last = found[0].normal;
  }
  CHECK(all > 5.0);
  CHECK(in_jumps < 0.04 * all);
}

TEST_CASE("a sphere that fits a finely meshed hollow has few touches, all valid") {
  // Every facet is a minimum: far more than are told apart.
  const MeshSurface tube = shapes::make_surface(shapes::cone_mesh(400, 3, 1.0, 1.0, 3.0));
  const std::vector<Touch> found = shapes::touches(tube, {1e-5, 0, 1.5}, 1.01);
  REQUIRE(found.size() >= 1);
  CHECK(found[0].normal.x == Approx(-1.0).epsilon(0.2));
  for (const Touch& touch : found) {
    CHECK(length(touch.normal) == Approx(1.0).epsilon(1e-12));
    CHECK((touch.distance > 0.99 && touch.distance < 1.01));
  }
}
