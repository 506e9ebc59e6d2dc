#include "engine/run/force_maps.hpp"
#include "engine/scene/kept_count.hpp"

#include <algorithm>
#include <array>

namespace moraine {

namespace {

std::string kept_name(const std::string& wall) { return "force_map_" + wall; }

/// Words of sums one after the other.
std::vector<std::int64_t> words_of(const std::vector<WideSum>& sums) {
  std::vector<std::int64_t> words;
  words.reserve(sums.size() * WideSum::n_words);
  for (const WideSum& sum : sums) {
    const auto own = sum.words();
    words.insert(words.end(), own.begin(), own.end());
  }
  return words;
}

std::vector<WideSum> sums_of(std::span<const std::int64_t> words) {
  std::vector<WideSum> sums;
  for (std::size_t k = 0; k + WideSum::n_words <= words.size(); k += WideSum::n_words) {
    std::array<std::int64_t, WideSum::n_words> own;
    std::copy_n(words.begin() + static_cast<std::ptrdiff_t>(k), own.size(), own.begin());
    sums.push_back(WideSum::from_words(own));
  }
  return sums;
}

}  // namespace

ForceMaps::ForceMaps(const Scene& scene, const Walls& walls) : map_of_(walls.surfaces().size(), -1) {
  for (std::size_t s = 0; s < walls.surfaces().size(); ++s) {
    const Surface& surface = walls.surfaces()[s];
    const WallDefinition& wall = scene.walls[static_cast<std::size_t>(surface.wall)];
    if (!wall.has_force_map || surface.kind != SurfaceKind::mesh) continue;
    map_of_[s] = static_cast<int>(maps_.size());
    const std::int32_t n = walls.n_triangles(surface.mesh);
    maps_.push_back({wall.name, static_cast<std::int32_t>(s), surface.mesh, n, 0,
                     std::vector<WideSum>(static_cast<std::size_t>(n) * n_sums)});
  }
}

void ForceMaps::add(std::span<const std::vector<TriangleForce>> forces) {
  for (OfWall& wall : maps_) ++wall.n_steps;
  for (const std::vector<TriangleForce>& of_thread : forces)
    for (const TriangleForce& one : of_thread) {
      OfWall& wall = maps_[static_cast<std::size_t>(map_of_[static_cast<std::size_t>(one.surface)])];
      WideSum* const sums = &wall.sums[static_cast<std::size_t>(one.triangle) * n_sums];
      for (std::size_t axis = 0; axis < 3; ++axis) sums[force + axis].add(one.force[static_cast<int>(axis)]);
      sums[normal].add(one.normal);
      sums[tangential].add(one.tangential);
    }
}

void ForceMaps::begin() {
  for (OfWall& wall : maps_) {
    wall.n_steps = 0;
    std::fill(wall.sums.begin(), wall.sums.end(), WideSum());
  }
}

std::vector<WideSum> ForceMaps::total(const World& world, const OfWall& wall) {
  if (world.is_alone()) return wall.sums;
  std::vector<std::int64_t> words = words_of(wall.sums);
  world.sum(std::span<std::int64_t>(words));
  return sums_of(words);
}

std::vector<WallMap> ForceMaps::maps(const World& world, const Walls& walls) const {
  std::vector<WallMap> all;
  for (const OfWall& wall : maps_) {
    const double share = wall.n_steps > 0 ? 1.0 / static_cast<double>(wall.n_steps) : 0.0;
    const std::vector<WideSum> sums = total(world, wall);
    const Vec3* const corners = walls.mesh(wall.mesh).corners;
    const Pose& pose = walls.pose(wall.surface);
    WallMap map;
    map.name = wall.name;
    for (std::int32_t t = 0; t < wall.n_triangles; ++t) {
      const Vec3* const own = corners + 3 * std::ptrdiff_t{t};
      for (int k = 0; k < 3; ++k) {
        const Vec3 corner = pose.to_world(own[k]);
        map.corners.insert(map.corners.end(), {corner.x, corner.y, corner.z});
      }
      const WideSum* const sum = &sums[static_cast<std::size_t>(t) * n_sums];
      const double over_area = share / (0.5 * length(cross(own[1] - own[0], own[2] - own[0])));
      for (std::size_t axis = 0; axis < 3; ++axis) map.force.push_back(share * sum[force + axis].value());
      map.pressure.push_back(over_area * sum[normal].value());
      map.shear.push_back(over_area * sum[tangential].value());
    }
    all.push_back(std::move(map));
  }
  return all;
}

void ForceMaps::keep(const World& world, std::map<std::string, std::vector<double>>& accumulators) const {
  for (const OfWall& wall : maps_) {
    const std::vector<std::int64_t> words = words_of(total(world, wall));
    std::vector<double>& kept = accumulators[kept_name(wall.name)];
    kept = {static_cast<double>(wall.n_steps)};
    kept.insert(kept.end(), words.begin(), words.end());
  }
}

void ForceMaps::restore(const World& world, const std::map<std::string, std::vector<double>>& accumulators) {
  for (OfWall& wall : maps_) {
    const auto found = accumulators.find(kept_name(wall.name));
    if (found == accumulators.end() || found->second.size() != 1 + wall.sums.size() * WideSum::n_words) continue;
    wall.n_steps = kept_count(found->second[0], found->first);
    std::vector<std::int64_t> words;
    for (std::size_t k = 1; k < found->second.size(); ++k) words.push_back(static_cast<std::int64_t>(found->second[k]));
    if (world.is_root()) wall.sums = sums_of(words);  // once over all ranks
  }
}

std::size_t ForceMaps::memory() const {
  std::size_t bytes = 0;
  for (const OfWall& wall : maps_) bytes += wall.sums.capacity() * sizeof(WideSum);
  return bytes;
}

}  // namespace moraine
