// What is said about meshes with planted flaws.
#include <catch2/catch.hpp>

#include <limits>

#include "engine/walls/walls.hpp"
#include "tests/support/surface_shapes.hpp"

using namespace moraine;
using Catch::Contains;

namespace {

Scene scene_with(const TriangleMesh& mesh) {
  Scene scene;
  WallDefinition wall;
  wall.name = "hopper";
  wall.shape = MeshShape{"hopper.stl", mesh};
  scene.walls.push_back(wall);
  return scene;
}

}  // namespace

TEST_CASE("a closed mesh has nothing to report, even with every corner listed anew") {
  const MeshReport report = inspect(shapes::box_mesh({0, 0, -0.0}, {1, 2, 3}, 4));
  CHECK(report.n_triangles == 6 * 2 * 16);
  CHECK(report.n_usable() == report.n_triangles);
  CHECK(report.n_open_edges == 0);
  CHECK(report.text.empty());
}

TEST_CASE("a hole is reported by its open edges and the place of the first") {
  TriangleMesh mesh = shapes::box_mesh({0, 0, 0}, {1, 1, 1});
  mesh.triangles.pop_back();
  const MeshReport report = inspect(mesh);
  CHECK(report.n_open_edges == 3);
  CHECK(report.n_crowded_edges == 0);
  CHECK_THAT(report.text, Contains("3 open edges") && Contains("from (") && Contains(") m"));
  CHECK(Walls(scene_with(mesh)).reports().at(0).n_open_edges == 3);
}

TEST_CASE("a hopper open at both ends is no error; its rims are reported") {
  const Walls walls(scene_with(shapes::cone_mesh(20, 3, 1.0, 0.2, 1.0)));
  REQUIRE(walls.reports().size() == 1);
  CHECK(walls.reports()[0].wall == 0);
  CHECK(walls.reports()[0].n_open_edges == 40);
}

TEST_CASE("an edge of three triangles is reported as crowded") {
  TriangleMesh mesh = shapes::box_mesh({0, 0, 0}, {1, 1, 1});
  mesh.vertices.insert(mesh.vertices.end(), {{0, 0, 0}, {1, 0, 0}, {0.5, -1, -1}});
  const auto n = static_cast<std::int32_t>(mesh.vertices.size());
  mesh.triangles.push_back({n - 3, n - 2, n - 1});
  const MeshReport report = inspect(mesh);
  CHECK(report.n_crowded_edges == 1);
  CHECK(report.n_open_edges == 2);
  CHECK_THAT(report.text, Contains("1 edge of more than two triangles, the first from (0, 0, 0) to (1, 0, 0) m"));
}

TEST_CASE("degenerate and duplicate triangles are counted, located and left out") {
  TriangleMesh mesh = shapes::box_mesh({0, 0, 0}, {1, 1, 1});
  const auto [a, b, c] = mesh.triangles[3];
  mesh.triangles.push_back({b, a, c});  // the same, the other way round
  mesh.triangles.push_back({b, c, a});
  mesh.triangles.push_back({a, a, b});
  mesh.vertices.insert(mesh.vertices.end(), {{5, 6, 7}, {6, 6, 7}, {7, 6, 7}});
  const auto n = static_cast<std::int32_t>(mesh.vertices.size());
  mesh.triangles.push_back({n - 3, n - 2, n - 1});
  const MeshReport report = inspect(mesh);
  CHECK(report.n_duplicate == 2);
  CHECK(report.n_degenerate == 2);
  CHECK(report.n_usable() == 12);
  CHECK_THAT(report.text,
             Contains("2 triangles given twice (left out), the first is number 12 (counted from 0) at (") &&
                 Contains("2 triangles without area (left out), the first is number 14"));
  const Walls walls(scene_with(mesh));
  CHECK(walls.area(0, Box{{0, 0, 0}, {9, 9, 9}}) == Approx(6.0));
}

TEST_CASE("a flat triangle that fills a gap between others leaves no open edge") {
  // A vertex in the middle of an edge, mended by a triangle without area.
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {2, 0, 0}, {1, 1, 0}, {1, 0, 0}, {1, -1, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 4, 3}, {3, 4, 1}, {0, 3, 1}};
  CHECK(inspect(mesh).n_degenerate == 1);
  CHECK(inspect(mesh).n_open_edges == 4);
  mesh.triangles.pop_back();
  CHECK(inspect(mesh).n_open_edges == 7);
}

TEST_CASE("a corner that is not a number, or not there, stops the scene and says where") {
  TriangleMesh mesh = shapes::box_mesh({0, 0, 0}, {1, 1, 1});
  mesh.triangles.push_back({0, 1, 9999});
  CHECK(inspect(mesh).n_not_finite == 1);
  mesh.vertices[5].y = std::numeric_limits<double>::quiet_NaN();
  const MeshReport report = inspect(mesh);
  CHECK(report.n_not_finite > 1);
  try {
    const Walls walls(scene_with(mesh));
    FAIL("no error");
  } catch (const SceneError& error) {
    REQUIRE(error.problems.size() == 1);
    CHECK(error.problems[0].key == "wall[0].mesh");
    CHECK_THAT(error.problems[0].message,
               Contains("hopper.stl") && Contains("not a number") && Contains("the first is number 2"));
  }
}

TEST_CASE("a mesh without a usable triangle stops the scene") {
  CHECK_THROWS_AS(Walls(scene_with(TriangleMesh{})), SceneError);
  TriangleMesh line;
  line.vertices = {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}};
  line.triangles = {{0, 1, 2}};
  CHECK_THROWS_WITH(Walls(scene_with(line)), Contains("no usable triangle") && Contains("1 triangle without area"));
}
