// Walls of a scene: surfaces, times, areas, extents and the grains near them.
#include <catch2/catch.hpp>

#include <algorithm>

#include "engine/walls/walls.hpp"
#include "tests/support/surface_shapes.hpp"

using namespace moraine;
using shapes::Dice;

namespace {

template <class Shape>
WallDefinition& add_wall(Scene& scene, Shape shape) {
  WallDefinition wall;
  wall.name = std::to_string(scene.walls.size());
  wall.shape = std::move(shape);
  scene.walls.push_back(std::move(wall));
  return scene.walls.back();
}

/// One wall of every shape.
Scene scene_of_all_shapes() {
  Scene scene;
  add_wall(scene, PlaneShape{{0, 0, -1}, {0, 0, 2}});
  add_wall(scene, BoxShape{{{-1, -1, -1}, {1, 1, 1}}});
  add_wall(scene, MeshShape{"a.stl", shapes::cone_mesh(32, 8, 1.0, 0.3, 1.0)});
  add_wall(scene, CylinderShape{{0, 0, -1}, {0, 0, 3}, 0.8, infinity});
  add_wall(scene, ConeShape{{0, 0, 0}, {0, 0, 1}, 1.0, 0.3, 1.0});
  add_wall(scene, DiscShape{{0, 0, 0}, {1, 1, 0}, 0.5, 0.1});
  Dice dice(5);
  add_wall(scene, MeshShape{"b.stl", shapes::plane_mesh(40, 0.5, dice)});
  return scene;
}

struct Grains {
  static constexpr std::int64_t stride = 8;
  std::vector<double> records;
  std::int32_t n() const { return static_cast<std::int32_t>(static_cast<std::int64_t>(records.size()) / stride); }
  Vec3 centre(std::int32_t i) const {
    const auto at = static_cast<std::size_t>(i * stride);
    return {records[at], records[at + 1], records[at + 2]};
  }
  double radius(std::int32_t i) const { return records[static_cast<std::size_t>(i * stride + 3)]; }
};

Grains random_grains(int n, std::uint64_t seed) {
  Dice dice(seed);
  Grains grains;
  for (int i = 0; i < n; ++i) {
    const Vec3 p = dice.point({-1.5, -1.5, -1.5}, {1.5, 1.5, 1.5});
    grains.records.insert(grains.records.end(), {p.x, p.y, p.z, dice.uniform(0.01, 0.2), 0, 0, 0, 0});
  }
  return grains;
}

WallCandidates all_candidates(const Walls& walls, const Grains& grains, double reach, double time) {
  WallCandidates found;
  walls.find_candidates(grains.records.data(), Grains::stride, 0, grains.n(), reach, time, found);
  return found;
}

Box cube(double half) { return {{-half, -half, -half}, {half, half, half}}; }

}  // namespace

TEST_CASE("walls become surfaces in the order of the scene, a box six planes that face inwards") {
  const Scene scene = scene_of_all_shapes();
  const Walls walls(scene);
  const auto surfaces = walls.surfaces();
  REQUIRE(surfaces.size() == 12);
  CHECK(surfaces[0].kind == SurfaceKind::plane);
  CHECK(surfaces[0].axis == Vec3{0, 0, 1});
  for (std::size_t s = 1; s < 7; ++s) {
    CHECK(surfaces[s].kind == SurfaceKind::plane);
    CHECK(surfaces[s].wall == 1);
    Touch touch;
    CHECK(touch_analytic(surfaces[s], {}, 2.0, touch));
    CHECK(touch.distance == 1.0);
  }
  CHECK(surfaces[1].axis == Vec3{1, 0, 0});
  CHECK(surfaces[6].axis == Vec3{0, 0, -1});
  CHECK(surfaces[7].kind == SurfaceKind::mesh);
  CHECK(surfaces[7].mesh == 0);
  CHECK(surfaces[8].axis == Vec3{0, 0, 1});
  CHECK(surfaces[11].mesh == 1);
  CHECK(surfaces[11].wall == 6);
}

TEST_CASE("the candidates are those that a search through everything finds, in order") {
  const Scene scene = scene_of_all_shapes();
  const Walls walls(scene);
  const Grains grains = random_grains(1500, 3);
  const double reach = 0.07;
  const WallCandidates found = all_candidates(walls, grains, reach, 0.0);
  std::size_t n = 0, n_triangles = 0;
  for (std::int32_t grain = 0; grain < grains.n(); ++grain)
    for (std::int32_t s = 0; s < static_cast<std::int32_t>(walls.surfaces().size()); ++s) {
      const Surface& surface = walls.surfaces()[static_cast<std::size_t>(s)];
      const double near = grains.radius(grain) + reach;
      std::vector<std::int32_t> triangles;
      bool is_near = false;
      if (surface.kind == SurfaceKind::mesh) {
        const TriangleMesh& mesh = std::get<MeshShape>(scene.walls[static_cast<std::size_t>(surface.wall)].shape).mesh;
        for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
          const auto at = [&](std::size_t k) { return mesh.vertices[static_cast<std::size_t>(mesh.triangles[t][k])]; };
          const Vec3 centre = grains.centre(grain);
          if (length(centre - closest_point_on_triangle(centre, at(0), at(1), at(2))) < near)
            triangles.push_back(static_cast<std::int32_t>(t));
        }
        is_near = !triangles.empty();
      } else {
        Touch touch;
        is_near = touch_analytic(surface, grains.centre(grain), near, touch);
      }
      if (!is_near) continue;
      REQUIRE(n < found.list.size());
      const WallCandidate& candidate = found.list[n++];
      REQUIRE(candidate.grain == grain);
      REQUIRE(candidate.surface == s);
      REQUIRE(candidate.n_triangles == static_cast<std::int32_t>(triangles.size()));
      for (std::size_t k = 0; k < triangles.size(); ++k)
        REQUIRE(found.triangles[static_cast<std::size_t>(candidate.triangles) + k] == triangles[k]);
      n_triangles += triangles.size();
    }
  CHECK(n == found.list.size());
  CHECK(n_triangles == found.triangles.size());
  CHECK(n_triangles > 5000);
}

TEST_CASE("shares of the grains searched one after another give the candidates of all") {
  const Walls walls(scene_of_all_shapes());
  const Grains grains = random_grains(300, 4);
  const WallCandidates whole = all_candidates(walls, grains, 0.05, 0.0);
  WallCandidates parts;
  for (std::int32_t begin = 0; begin < 300; begin += 77)
    walls.find_candidates(grains.records.data(), Grains::stride, begin, std::min(begin + 77, 300), 0.05, 0.0, parts);
  REQUIRE(parts.list.size() == whole.list.size());
  CHECK(parts.triangles == whole.triangles);
  for (std::size_t n = 0; n < whole.list.size(); ++n) {
    CHECK(parts.list[n].grain == whole.list[n].grain);
    CHECK(parts.list[n].surface == whole.list[n].surface);
    CHECK(parts.list[n].triangles == whole.list[n].triangles);
  }
}

TEST_CASE("a wall is there from its first time until before its last") {
  Scene scene;
  add_wall(scene, PlaneShape{});
  WallDefinition& gate = add_wall(scene, DiscShape{{0, 0, 0}, {0, 0, 1}, 1.0, 0.0});
  gate.from = 1.0;
  gate.until = 3.0;
  const Walls walls(scene);
  CHECK((walls.is_active(0, -1.0) == false && walls.is_active(0, 0.0)));
  CHECK((!walls.is_active(1, 0.999) && walls.is_active(1, 1.0) && walls.is_active(1, 2.9) && !walls.is_active(1, 3.0)));
  CHECK(walls.next_change(0.0) == 1.0);
  CHECK(walls.next_change(1.0) == 3.0);
  CHECK(walls.next_change(3.0) == infinity);
  Grains grain;
  grain.records = {0, 0, 0.05, 0.1, 0, 0, 0, 0};
  CHECK(all_candidates(walls, grain, 0.0, 0.5).list.size() == 1);
  CHECK(all_candidates(walls, grain, 0.0, 2.0).list.size() == 2);
  CHECK(all_candidates(walls, grain, 0.0, 3.0).list.size() == 1);
}

TEST_CASE("a symmetry plane is a mirror, and nothing else can be one") {
  Scene scene;
  add_wall(scene, PlaneShape{}).symmetry = true;
  CHECK(Walls(scene).surfaces()[0].kind == SurfaceKind::mirror);
  add_wall(scene, DiscShape{{0, 0, 0}, {0, 0, 1}, 1.0, 0.0}).symmetry = true;
  CHECK_THROWS_AS(Walls(scene), SceneError);
}

TEST_CASE("every shape that cannot be used is named") {
  Scene scene;
  add_wall(scene, PlaneShape{{0, 0, 0}, {0, 0, 0}});
  add_wall(scene, BoxShape{{{0, 0, 0}, {1, -1, 1}}});
  add_wall(scene, CylinderShape{{0, 0, 0}, {0, 0, 1}, -1.0, 1.0});
  add_wall(scene, ConeShape{{0, 0, 0}, {0, 0, 1}, 0.0, 0.0, 1.0});
  add_wall(scene, DiscShape{{0, 0, 0}, {0, 0, 1}, 1.0, 1.0});
  add_wall(scene, MeshShape{});
  add_wall(scene, PlaneShape{});
  try {
    const Walls walls(scene);
    FAIL("no error");
  } catch (const SceneError& error) {
    std::vector<std::string> keys;
    for (const Problem& problem : error.problems) keys.push_back(problem.key);
    CHECK(keys == std::vector<std::string>{"wall[0].plane.normal", "wall[1].box", "wall[2].cylinder.radius",
                                           "wall[3].cone.radius_base", "wall[4].disc.hole_radius", "wall[5].mesh"});
  }
}

TEST_CASE("areas are those of the formulas, within a box") {
  using std::numbers::pi;
  const Walls walls(scene_of_all_shapes());
  CHECK(walls.area(0, cube(1)) == Approx(4.0));   // in a face of the domain
  CHECK(walls.area(0, cube(0.9)) == 0.0);         // outside
  CHECK(walls.area(1, cube(2)) == Approx(24.0));  // the box itself, not its planes
  CHECK(walls.area(2, cube(2)) == Approx(pi * 1.3 * std::sqrt(1.49)).epsilon(0.01));
  CHECK(walls.area(3, cube(2)) == Approx(2 * pi * 0.8 * 4).epsilon(1e-12));
  CHECK(walls.area(3, Box{{0, 0, -1}, {2, 2, 1}}) == Approx(pi * 0.8).epsilon(1e-12));  // a quarter
  CHECK(walls.area(4, cube(2)) == Approx(pi * 1.3 * std::sqrt(1.49)));
  CHECK(walls.area(5, cube(2)) == Approx(pi * 0.24));
  CHECK(walls.area(6, cube(2)) == Approx(4.0));
  // Slices of a wall add up to the whole.
  for (int wall = 0; wall < 7; ++wall)
    for (int axis = 0; axis < 3; ++axis) {
      double sum = 0.0;
      for (int slice = 0; slice < 5; ++slice) {
        Box box = cube(2);
        box.low[axis] = slice == 0 ? -2.0 : -1.03 + 0.41 * slice;  // no wall lies in a boundary
        box.high[axis] = slice == 4 ? 2.0 : -1.03 + 0.41 * (slice + 1);
        sum += walls.area(wall, box);
      }
      CHECK(sum == Approx(walls.area(wall, cube(2))).epsilon(1e-9));
    }
  Scene scene;
  add_wall(scene, PlaneShape{{0, 0, 0}, {1, 1, 1}});  // a hexagon through the middles of twelve edges
  CHECK(Walls(scene).area(0, cube(1)) == Approx(3 * std::sqrt(3.0)));
}

TEST_CASE("the extent of a wall is its bounding box within the domain") {
  const Walls walls(scene_of_all_shapes());
  const auto is_box = [](Box a, Box b) { return length(a.low - b.low) < 1e-12 && length(a.high - b.high) < 1e-12; };
  CHECK(is_box(walls.extent(0, cube(2)), {{-2, -2, -1}, {2, 2, -1}}));
  CHECK(walls.extent(0, cube(0.5)) == Box::empty());
  CHECK(is_box(walls.extent(1, cube(2)), cube(1)));
  CHECK(is_box(walls.extent(3, cube(2)), {{-0.8, -0.8, -2}, {0.8, 0.8, 2}}));
  CHECK(is_box(walls.extent(4, cube(0.5)), {{-0.5, -0.5, 0}, {0.5, 0.5, 0.5}}));
  const double half = 0.5 * std::sqrt(0.5);
  CHECK(is_box(walls.extent(5, cube(2)), {{-half, -half, -0.5}, {half, half, 0.5}}));
  CHECK(is_box(walls.extent(6, cube(2)), {{-1, -1, 0}, {1, 1, 0}}));
  CHECK(is_box(walls.extent(2, cube(2)), {{-1, -1, 0}, {1, 1, 1}}));
}
