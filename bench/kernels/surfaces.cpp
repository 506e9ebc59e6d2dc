// Where spheres touch surfaces: analytic shapes, and meshes of few and of many triangles.
#include <cmath>
#include <numbers>
#include <vector>

#include "bench/kernels/meter.hpp"
#include "engine/walls/walls.hpp"
#include "kernels/base/random.hpp"
#include "kernels/search/surface.hpp"

namespace moraine::bench {

namespace {

constexpr double radius = 0.01;  // [m] of the spheres
constexpr int n_spheres = 1024;
constexpr double taper = 0.1;  // of the cone

double uniform(int sphere, std::uint64_t draw) {
  return random_uniform(2, static_cast<std::uint64_t>(sphere), RandomPurpose::position, draw);
}

/// Records of spheres over the unit square, up to 0.1 % deep in the plane z = 0.
std::vector<double> spheres_on_floor() {
  std::vector<double> records;
  for (int k = 0; k < n_spheres; ++k)
    records.insert(records.end(),
                   {uniform(k, 0), uniform(k, 1), radius * (1.0 - 1e-3 * uniform(k, 2)), radius, 0, 0, 0, 1});
  return records;
}

/// Records of spheres inside a drum of height 1 about z, of radius 1 at its base, less by `narrowing` at its top; half of them
/// touch its wall.
std::vector<double> spheres_in_drum(double narrowing) {
  std::vector<double> records;
  for (int k = 0; k < n_spheres; ++k) {
    const double angle = 2.0 * std::numbers::pi * uniform(k, 0);
    const double reach = radius * (1.0 - 1e-3 * uniform(k, 2)) * std::sqrt(1.0 + narrowing * narrowing);
    const double r = k % 2 ? 1.0 - narrowing * uniform(k, 1) - reach : 0.8 * uniform(k, 2);
    records.insert(records.end(), {r * std::cos(angle), r * std::sin(angle), uniform(k, 1), radius, 0, 0, 0, 1});
  }
  return records;
}

Work work_of_spheres() {
  Work work;
  work.items_name = "spheres/s";
  work.items = n_spheres;
  return work;
}

void touch_shape(benchmark::State& state, const Surface& surface, const std::vector<double>& records) {
  int n_touches = 0;
  measure(state, work_of_spheres(), [&] {
    n_touches = 0;
    Touch touch;
    for (const double* r = records.data(); r < records.data() + records.size(); r += 8)
      if (touch_analytic(surface, {r[0], r[1], r[2]}, r[3], touch)) ++n_touches;
    benchmark::DoNotOptimize(n_touches);
  });
  state.counters["touching_%"] = 100.0 * n_touches / n_spheres;
}

/// n x n squares of two triangles over the unit square and a margin; with `bump`, a landscape.
TriangleMesh sheet(int n, double bump) {
  TriangleMesh mesh;
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i) {
      const double x = 1.2 * i / n - 0.1, y = 1.2 * j / n - 0.1;
      mesh.vertices.push_back({x, y, bump * std::sin(9.0 * x) * std::sin(7.0 * y)});
    }
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const int v = j * (n + 1) + i;
      mesh.triangles.push_back({v, v + 1, v + n + 1});
      mesh.triangles.push_back({v + 1, v + n + 2, v + n + 1});
    }
  return mesh;
}

Scene mesh_scene(int n, double bump) {
  Scene scene;
  scene.domain.low = {-1, -1, -1};
  scene.domain.high = {2, 2, 2};
  scene.materials.push_back({"steel", 7800.0, 0.0, 0.3});
  WallDefinition wall;
  wall.name = "sheet";
  wall.material = "steel";
  wall.shape = MeshShape{"", sheet(n, bump)};
  scene.walls.push_back(wall);
  return scene;
}

void find_candidates(benchmark::State& state, int n) {
  const Walls walls(mesh_scene(n, 0.0));
  const std::vector<double> records = spheres_on_floor();
  WallCandidates found;
  measure(state, work_of_spheres(), [&] {
    found.list.clear();
    found.triangles.clear();
    walls.find_candidates(records.data(), 8, 0, n_spheres, 0.1 * radius, 0.0, found);
    benchmark::DoNotOptimize(found.list.data());
  });
}

void touch_triangles(benchmark::State& state, int n, double bump) {
  const Walls walls(mesh_scene(n, bump));
  std::vector<double> records = spheres_on_floor();
  for (std::size_t k = 0; k < records.size(); k += 8)
    records[k + 2] += bump * std::sin(9.0 * records[k]) * std::sin(7.0 * records[k + 1]);
  WallCandidates found;
  walls.find_candidates(records.data(), 8, 0, n_spheres, 0.1 * radius, 0.0, found);
  int n_touches = 0;
  measure(state, work_of_spheres(), [&] {
    n_touches = 0;
    Touch touches[max_touches];
    for (const WallCandidate& c : found.list) {
      const double* const r = records.data() + 8 * static_cast<std::ptrdiff_t>(c.grain);
      const std::span triangles(found.triangles.data() + c.triangles, static_cast<std::size_t>(c.n_triangles));
      n_touches += touch_mesh(walls.mesh(0), triangles, {r[0], r[1], r[2]}, r[3], touches);
    }
    benchmark::DoNotOptimize(n_touches);
  });
  state.counters["triangles"] = static_cast<double>(found.triangles.size()) / n_spheres;
  state.counters["touching_%"] = 100.0 * n_touches / n_spheres;
}

Surface shape(SurfaceKind kind) {
  Surface s;
  s.kind = kind;
  s.radius_base = 1.0;
  s.length = 1.0;
  if (kind == SurfaceKind::cone) s.radius_top = 1.0 - taper;
  if (kind == SurfaceKind::disc) {
    s.radius_base = 2.0;
    s.radius_top = 0.1;
  }
  return s;
}

}  // namespace

void add_surfaces() {
  const auto on_floor = spheres_on_floor();
  const auto add_shape = [](const char* name, SurfaceKind kind, const std::vector<double>& records) {
    add(std::string("touch/") + name, [=](benchmark::State& s) { touch_shape(s, shape(kind), records); });
  };
  add_shape("plane", SurfaceKind::plane, on_floor);
  add_shape("disc", SurfaceKind::disc, on_floor);
  add_shape("cylinder", SurfaceKind::cylinder, spheres_in_drum(0.0));
  add_shape("cone", SurfaceKind::cone, spheres_in_drum(taper));
  add("touch/mesh_flat_coarse", [](benchmark::State& s) { touch_triangles(s, 10, 0.0); });
  add("touch/mesh_flat_fine", [](benchmark::State& s) { touch_triangles(s, 200, 0.0); });
  add("touch/mesh_landscape", [](benchmark::State& s) { touch_triangles(s, 200, 0.02); });
  add("wall_candidates/mesh_200", [](benchmark::State& s) { find_candidates(s, 10); });
  add("wall_candidates/mesh_80000", [](benchmark::State& s) { find_candidates(s, 200); });
}

}  // namespace moraine::bench
