#include "io/cli/scale_projection.hpp"

#include <fmt/format.h>

#include "engine/particles/fill.hpp"
#include "engine/run/gas_projection.hpp"
#include "io/cli/layout.hpp"
#include "io/cli/text.hpp"

namespace moraine {

namespace {
constexpr std::int64_t most_grains = 30'000'000;  // that are filled and paired for a projection
}

std::vector<ProjectedResult> project_scaling(const SceneOnCores& scene_on, const std::vector<int>& ranks,
                                             const Network& network, std::vector<std::string>& remarks) {
  const int n_cores = available_cores();
  const Scene first = scene_on(1);
  const std::vector<GrainSeed> first_grains = make_grains(first, n_cores);
  const Rates rates = measure_rates(first, first_grains, 1);
  const GasRates gas_rates = first.gas ? measure_gas_rates(first, first_grains, 1) : GasRates{};
  std::vector<ProjectedResult> results;
  for (const int n : ranks) {
    const Scene scene = scene_on(n);
    if (const std::int64_t n_grains = count_grains(scene); n_grains > most_grains) {
      remarks.push_back(fmt::format(
          "no projection for {} ranks: their scene has {} grains, and no more than {} are filled for one", n,
          count_text(static_cast<std::uint64_t>(n_grains)), count_text(static_cast<std::uint64_t>(most_grains))));
      continue;
    }
    const std::vector<GrainSeed> grains = make_grains(scene, n_cores);
    const Projection projection(scene, grains, n_cores);
    const double one_rank_work = work_of(projection.count(1)[0]);
    const Projection::Division division = projection.divide(n);
    Prediction p = predict(projection.count(division), one_rank_work, projection.bytes_per_ghost(), rates, network);
    if (scene.gas) {  // a grain step, with its share of the gas step
      const GasLayout layout = lay_out_gas(scene, projection.positions(), division.owners, n);
      const GasPrediction gas = predict_gas(scene, layout, gas_rates, rates, network, p);
      const double grain_share = gas.grain_steps * p.step / gas.whole;
      p.messages = p.messages * grain_share + gas.messages / gas.whole;
      p.waiting *= grain_share;
      p.step = gas.whole / gas.grain_steps;
      p.efficiency = gas.efficiency;
    }
    results.push_back(
        {n, projection.n_grains(), p.step, p.efficiency * n, p.efficiency, p.imbalance, p.messages, p.waiting});
  }
  return results;
}

}  // namespace moraine
