#include <algorithm>
#include <numeric>

#include "engine/particles/pack.hpp"
#include "engine/particles/pack_occupied.hpp"
#include "kernels/base/random.hpp"

namespace moraine {

bool pack_sequentially(const PackProblem& problem, std::span<PackGrain> grains) {
  const Container& container = problem.container;
  std::vector<double> radii;
  for (const PackGrain& grain : problem.fixed) radii.push_back(grain.radius);
  for (const PackGrain& grain : grains) radii.push_back(grain.radius);
  OccupiedSpace occupied(container.space(), container.extent(), radii);
  for (const PackGrain& grain : problem.fixed) occupied.insert(grain);

  std::vector<std::uint32_t> order(grains.size());
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return grains[a].radius > grains[b].radius; });

  constexpr std::uint64_t attempts_each = 20000;  // a single grain that finds no place in so many will hardly find one
  std::uint64_t attempts_left = 100 * grains.size() + attempts_each;
  const Vec3 low = container.extent().low;
  const Vec3 size = container.extent().size();
  for (const std::uint32_t i : order) {
    PackGrain& grain = grains[i];
    for (std::uint64_t attempt = 0;; ++attempt) {
      if (attempt == attempts_each || attempts_left-- == 0) return false;
      const auto draw = [&](std::uint64_t k) {
        return random_uniform(problem.seed, problem.first_number + i, RandomPurpose::position, 3 * attempt + k);
      };
      grain.position = {low.x + draw(0) * size.x, low.y + draw(1) * size.y, low.z + draw(2) * size.z};
      if (container.fits(grain.position, grain.radius) && !occupied.overlaps(grain)) break;
    }
    occupied.insert(grain);
  }
  return true;
}

}  // namespace moraine
