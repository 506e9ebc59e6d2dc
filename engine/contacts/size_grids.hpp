// Cells for each class of sizes, to find pairs where grains differ widely (hierarchical cells: Ogarko & Luding 2012, Comput. Phys. Commun.
// 183, 931). Within a class a grain looks at the cells around it; a larger one looks for the smaller ones in the rows of their cells
// that its reach crosses. So what is tested grows with the pairs, not with the volume of the largest cell.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/contacts/cells.hpp"
#include "engine/contacts/size_classes.hpp"
#include "engine/particles/aligned_array.hpp"
#include "engine/particles/particles.hpp"
#include "kernels/search/pair_filter.hpp"

namespace moraine {

class SizeGrids {
 public:
  /// Puts the grains, which must have their final places, into the cells of their classes. `periodic`: directions in which they meet their
  /// own images, by `image_shift` [m].
  void build(const Particles& particles, const SizeClasses& classes, const Box& domain,
             const std::array<bool, 3>& periodic, std::span<const Vec3> image_shift, double skin, int n_threads);
  /// Classes; 0 where nothing was built, as all grains are of one.
  int size() const { return static_cast<int>(grids_.size()); }
  /// Centres of the largest grains may come nearer than this [m].
  double reach() const { return 2.0 * grids_.back().largest + skin_; }

  /// What a search needs for itself, and how many grains it has tested.
  struct Scratch {
    std::vector<Cells::Run> runs;
    std::vector<std::int32_t> found;
    std::int64_t n_tested = 0;
  };
  /// Calls f(i, j, image of j seen from i) for each pair of different grains nearer than their radii and the skin, once, in this
  /// thread's share of the search.
  template <typename Function>
  void for_each_pair(const Particles& particles, int thread, int n_threads, Scratch& scratch, Function f) const;
  /// Calls f(j, image of j seen from the point) for the grains of classes below `end_class` that are nearer to a point than
  /// `reach` [m] and their own radius.
  template <typename Function>
  void for_each_near(Vec3 point, double reach, int end_class, Scratch& scratch, Function f) const;

 private:
  struct Grid {
    double largest = 0.0;  // [m] radius
    Cells cells;
    std::vector<std::int32_t> grains;  // places in memory, in the order of the cells
    AlignedArray<double> coordinates;  // x, y, z and radius, each an array in that order
    Spheres spheres;
  };
  template <typename Function>
  void filter(const Grid& grid, const Cells::Run& run, Vec3 centre, double reach, Scratch& scratch, Function f) const;

  std::vector<Grid> grids_;
  std::vector<Vec3> image_shift_;
  double skin_ = 0.0;
  PairFilter filter_ = nullptr;
};

template <typename Function>
void SizeGrids::filter(const Grid& grid, const Cells::Run& run, Vec3 centre, double reach, Scratch& scratch,
                       Function f) const {
  const Vec3 seen = run.image ? centre + image_shift_[run.image] : centre;
  const auto n = static_cast<std::size_t>(run.grains.size());
  if (scratch.found.size() < n) scratch.found.resize(2 * n);
  scratch.n_tested += run.grains.size();
  const int n_found = filter_(grid.spheres, run.grains, seen, reach, scratch.found.data());
  for (int k = 0; k < n_found; ++k)
    f(grid.grains[static_cast<std::size_t>(scratch.found[static_cast<std::size_t>(k)])], run.image);
}

template <typename Function>
void SizeGrids::for_each_near(Vec3 point, double reach, int end_class, Scratch& scratch, Function f) const {
  for (int size_class = 0; size_class < std::min(end_class, size()); ++size_class) {
    const Grid& grid = grids_[static_cast<std::size_t>(size_class)];
    grid.cells.runs_within(point, reach + grid.largest, scratch.runs);
    for (const Cells::Run& run : scratch.runs) filter(grid, run, point, reach, scratch, f);
  }
}

template <typename Function>
void SizeGrids::for_each_pair(const Particles& particles, int thread, int n_threads, Scratch& scratch,
                              Function f) const {
  for (int size_class = 0; size_class < size(); ++size_class) {
    const Grid& grid = grids_[static_cast<std::size_t>(size_class)];
    const auto n = static_cast<std::int64_t>(grid.grains.size());
    Cells::Walk walk(grid.cells);
    for (std::int64_t q = n * thread / n_threads; q < n * (thread + 1) / n_threads; ++q) {
      const std::int32_t i = grid.grains[static_cast<std::size_t>(q)];
      const Vec3 centre = particles.position(i);
      const double reach = particles.radius(i) + skin_;
      const auto found = [&](std::int32_t j, std::uint8_t image) { f(i, j, image); };
      Cells::Run runs[Cells::max_runs];
      const int n_runs = walk.runs_after(static_cast<std::int32_t>(q), centre, runs);
      for (int r = 0; r < n_runs; ++r) filter(grid, runs[r], centre, reach, scratch, found);
      for_each_near(centre, reach, size_class, scratch, found);
    }
  }
}

}  // namespace moraine
