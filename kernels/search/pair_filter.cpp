#include "kernels/search/pair_filter.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/search/pair_filter.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include "kernels/base/simd/lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace moraine {
namespace HWY_NAMESPACE {

int filter_run(const Spheres& spheres, Range run, Vec3 centre, double reach, std::int32_t* found) {
  const Lanes<double> x(centre.x), y(centre.y), z(centre.z), r(reach);
  int n = 0;
  for (std::int64_t j = run.begin; j < run.end; j += n_lanes<double>) {
    const Lanes3<double> d{x - load(spheres.x + j), y - load(spheres.y + j), z - load(spheres.z + j)};
    const Lanes limit = r + load(spheres.r + j);
    unsigned near = bits(dot(d, d) < limit * limit);
    const std::int64_t left = run.end - j;
    if (left < n_lanes<double>) near &= (1u << left) - 1u;
    for (; near != 0; near &= near - 1) found[n++] = static_cast<std::int32_t>(j) + __builtin_ctz(near);
  }
  return n;
}

}  // namespace HWY_NAMESPACE
}  // namespace moraine
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace moraine {
HWY_EXPORT(filter_run);
PairFilter pair_filter() {
  return [](const Spheres& spheres, Range run, Vec3 centre, double reach, std::int32_t* found) {
    return HWY_DYNAMIC_DISPATCH(filter_run)(spheres, run, centre, reach, found);
  };
}
}  // namespace moraine
#endif
