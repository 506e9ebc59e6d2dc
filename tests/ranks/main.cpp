// Every rank runs the same tests in the same order. The first one reports; a rank in which a test fails shows what it has to say and
// ends the whole job, as the others would wait for it.
#define CATCH_CONFIG_RUNNER
#include <catch2/catch.hpp>
#include <cstdio>

#include "comm/world.hpp"
#include "tests/ranks/ranks.hpp"

namespace moraine::ranks {

const World& world() {
  static const World all = World::join();
  return all;
}

}  // namespace moraine::ranks

int main(int argc, char** argv) {
  const moraine::World& world = moraine::ranks::world();
  const std::string report = "rank-report-" + std::to_string(world.rank()) + ".txt";
  Catch::Session session;
  if (const int error = session.applyCommandLine(argc, argv)) return error;
  if (!world.is_root()) session.configData().outputFilename = report;
  const int n_failed = session.run();
  if (!world.is_root()) {
    if (std::FILE* const file = n_failed > 0 ? std::fopen(report.c_str(), "r") : nullptr) {
      for (int c; (c = std::fgetc(file)) != EOF;) std::fputc(c, stderr);
      std::fclose(file);
    }
    std::remove(report.c_str());
  }
  if (n_failed > 0) world.abort(1);
  world.wait_for_all();
  return 0;
}
