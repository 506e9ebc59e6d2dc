// The drag laws over arrays of grains.
#include <vector>

#include "bench/kernels/suspension.hpp"
#include "engine/particles/aligned_array.hpp"
#include "kernels/base/random.hpp"
#include "kernels/drag/laws.hpp"

namespace moraine::bench {

namespace {

// Counted from kernels/drag/elementary.hpp and laws.cpp, both sides of every case, as they are computed in lanes; roots and divisions are
// one each.
constexpr double log_flops = 32.0, exp_flops = 35.0, pow_flops = log_flops + exp_flops + 1.0;
constexpr double lone_sphere = pow_flops + 3.0, wen_yu = lone_sphere + pow_flops + 1.0, ergun = 7.0;

struct Law {
  DragLaw law;
  const char* name;
  double flops;  // of F
};
constexpr Law laws[] = {{DragLaw::schiller_naumann, "schiller_naumann", lone_sphere + 2.0},
                        {DragLaw::wen_yu, "wen_yu", wen_yu},
                        {DragLaw::ergun, "ergun", ergun},
                        {DragLaw::gidaspow, "gidaspow", ergun + wen_yu},
                        {DragLaw::di_felice, "di_felice", 12.0 + 2.0 * (log_flops + exp_flops)},
                        {DragLaw::syamlal_obrien, "syamlal_obrien", 27.0 + log_flops + 3.0 * exp_flops},
                        {DragLaw::beetstra, "beetstra", 28.0 + log_flops + 2.0 * exp_flops},
                        {DragLaw::koch_hill, "koch_hill", 78.0 + log_flops + 2.0 * exp_flops}};
constexpr double flops_around = 6.0;  // Reynolds number, and the coefficient from F

void drag(benchmark::State& state, const Law& law, std::int32_t n) {
  AlignedArray<double> arrays[4];  // void fraction, slip, radius, coefficient
  const double low[4] = {0.4, 0.0, 0.5e-3, 0.0}, high[4] = {1.0, 2.0, 1e-3, 0.0};
  for (std::size_t a = 0; a < 4; ++a) {
    arrays[a].resize_discarding(static_cast<std::size_t>(n));
    for (std::size_t i = 0; i < arrays[a].size(); ++i)
      arrays[a][i] = low[a] + (high[a] - low[a]) * random_uniform(7, i, RandomPurpose::choice, a);
  }
  Work work;
  work.items_name = "grains/s";
  work.items = n;
  work.bytes = work.working_set = 32.0 * work.items;
  work.flops = (law.flops + flops_around) * work.items;
  const GasProperties gas{1.2, 1.8e-5};
  measure(state, work, [&] {
    drag_coefficients(law.law, GasModel::a, gas, n, arrays[0].data(), arrays[1].data(), arrays[2].data(),
                      arrays[3].data());
    benchmark::ClobberMemory();
  });
}

}  // namespace

void add_drag() {
  for (const Law& law : laws)
    for (const std::int32_t n : suspension_sizes)
      add("drag/" + std::string(law.name) + "/" + name_of(n), [=](benchmark::State& s) { drag(s, law, n); });
}

}  // namespace moraine::bench
