// The same bits on any number of ranks: every scene gives on R ranks of T threads what it gives alone.
#include <catch2/catch.hpp>

#include "tests/invariance/trace.hpp"
#include "tests/ranks/ranks.hpp"
#include "tests/support/flow_scenes.hpp"

using namespace moraine;

namespace {

/// Ranks and threads; layouts with more ranks than the job has are left out.
struct Layout {
  int ranks, threads;
};
constexpr Layout layouts[] = {{1, 4}, {2, 1}, {2, 2}, {3, 1}, {4, 1}, {5, 1}, {8, 1}, {2, 3}};
constexpr int every = 250;

std::string name_of(const char* scene, const Layout& layout) {
  return std::string(scene) + " on " + std::to_string(layout.ranks) + "x" + std::to_string(layout.threads);
}

}  // namespace

TEST_CASE("a scene gives the same hashes, probes and energies on any ranks and threads") {
  const World& all = ranks::world();
  std::uint64_t n_migrated = 0;
  for (auto& [name, scene, n_steps] : scenes::all()) {
    scene.output.energy = true;
    // Each rank runs the reference by itself, so that each can compare.
    const std::vector<trace::Moment> alone = trace::record(scene, 1, n_steps, every);
    for (const Layout& layout : layouts) {
      if (layout.ranks > all.size()) continue;
      const std::optional<World> world = all.first(layout.ranks);
      if (!world) continue;
      INFO(name_of(name, layout));
      Simulation simulation(scene, layout.threads, *world);
      CHECK(trace::difference(alone, trace::record(simulation, n_steps, every)) == "");
      n_migrated += simulation.n_migrated();
    }
  }
  all.sum(std::span(&n_migrated, 1));
  CHECK((all.size() == 1 || n_migrated > 1000));
}
