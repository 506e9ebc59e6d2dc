// Catch's main on every rank of a job: all run the same cases, the first one reports, and one failing rank fails the job.
#define CATCH_CONFIG_RUNNER
#include <catch2/catch.hpp>
#include <cstdio>

#include "tests/ranks/ranks.hpp"

namespace moraine::ranks {

namespace {
const World* all = nullptr;
}

const World& world() { return *all; }

}  // namespace moraine::ranks

int main(int argc, char** argv) {
  const moraine::World world = moraine::World::join();
  moraine::ranks::all = &world;
  if (!world.is_root() && !std::freopen("/dev/null", "w", stdout)) return 1;
  double n_failed = Catch::Session().run(argc, argv);
  const double own = n_failed;
  world.max(std::span(&n_failed, 1));
  if (own > 0 && !world.is_root()) std::fprintf(stderr, "rank %d has failures\n", world.rank());
  return n_failed > 0 ? 1 : 0;
}
