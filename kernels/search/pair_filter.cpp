#include "kernels/search/pair_filter.hpp"

#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/search/pair_filter.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include "kernels/base/simd/lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace moraine {
namespace HWY_NAMESPACE {

/// Grains j, j + 1, ... of a run.
struct Tested {
  Lanes<double> square;  // of their distances
  LaneMask<double> is_near;
};
HWY_INLINE Tested test(const Spheres& spheres, std::int64_t j, std::int64_t end, Vec3 centre, double reach) {
  const Lanes3<double> d{Lanes<double>(centre.x) - load(spheres.x + j), Lanes<double>(centre.y) - load(spheres.y + j),
                         Lanes<double>(centre.z) - load(spheres.z + j)};
  const Lanes<double> square = dot(d, d), limit = reach + load(spheres.r + j);
  return {square, (square < limit * limit) & first_lanes<double>(end - j)};
}

int filter_run(const Spheres& spheres, Range run, Vec3 centre, double reach, std::int32_t* found) {
  int n = 0;
  for (std::int64_t j = run.begin; j < run.end; j += n_lanes<double>) {
    unsigned near = bits(test(spheres, j, run.end, centre, reach).is_near);
    for (; near != 0; near &= near - 1) found[n++] = static_cast<std::int32_t>(j) + __builtin_ctz(near);
  }
  return n;
}

int filter_near(const Spheres& spheres, const GrainRun* runs, int n_runs, const Asking& asking,
                const NearGrains& near) {
  constexpr int n = n_lanes<double>, most = 64;
  alignas(64) double place[most + 2 * n], square[most + 2 * n];  // of those that are near and not yet written
  int n_found = 0, waiting = 0;
  const auto write = [&]() HWY_ATTR {
    for (int k = 0; k < waiting; k += n) {
      alignas(64) double reach[n] = {}, room[n] = {}, band[n];
      const int left = waiting - k < n ? waiting - k : n;
      for (int lane = 0; lane < left; ++lane) {
        const auto j = static_cast<std::int32_t>(place[k + lane]);
        near.grain[n_found + k + lane] = j;
        reach[lane] = spheres.r[j];
        room[lane] = spheres.room[j];
      }
      const Lanes<double> rooms = asking.room + load(room);
      const Lanes<double> radii = asking.reach + load(reach) - rooms;
      Lanes<double> last(0.0);
      for (int b = 1; b < asking.n_bands; ++b) {
        const Lanes<double> apart = fma(asking.band_share[b], rooms, radii);
        last = last + select(load(square + k) < apart * apart, 0.0, Lanes<double>(1.0));
      }
      store(band, last);
      for (int lane = 0; lane < left; ++lane) near.band[n_found + k + lane] = static_cast<std::uint8_t>(band[lane]);
    }
    n_found += waiting;
    waiting = 0;
  };
  for (int r = 0; r < n_runs; ++r) {
    const GrainRun& run = runs[r];
    const Vec3 centre = run.image ? asking.centre + asking.image_shift[run.image] : asking.centre;
    for (std::int64_t j = run.grains.begin; j < run.grains.end; j += n) {
      const auto [squared, is_near] = test(spheres, j, run.grains.end, centre, asking.reach);
      store_together(square + waiting, squared, is_near);
      const int n_near = store_together(place + waiting, counting_from<double>(static_cast<double>(j)), is_near);
      if (near.image) std::memset(near.image + n_found + waiting, run.image, static_cast<std::size_t>(n_near));
      waiting += n_near;
      if (waiting > most) write();
    }
  }
  write();
  return n_found;
}

}  // namespace HWY_NAMESPACE
}  // namespace moraine
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace moraine {
HWY_EXPORT(filter_run);
HWY_EXPORT(filter_near);
PairFilter pair_filter() {
  return [](const Spheres& spheres, Range run, Vec3 centre, double reach, std::int32_t* found) {
    return HWY_DYNAMIC_DISPATCH(filter_run)(spheres, run, centre, reach, found);
  };
}
NearFilter near_filter() {
  return [](const Spheres& spheres, const GrainRun* runs, int n_runs, const Asking& asking, const NearGrains& near) {
    return HWY_DYNAMIC_DISPATCH(filter_near)(spheres, runs, n_runs, asking, near);
  };
}
}  // namespace moraine
#endif
