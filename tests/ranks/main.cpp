// Every rank runs the same tests in the same order. The first one reports; a rank in which a test fails shows what it has to say and
// ends the whole job, as the others would wait for it.
#include <unistd.h>

#include <iostream>
#include <sstream>

#include "tests/ranks/ranks.hpp"
#include "tests/support/catch.hpp"

namespace moraine::ranks {

const World& world() {
  static const World all = World::join();
  return all;
}

SharedDirectory::SharedDirectory(const World& world) : world_(world) {
  std::string name = (std::filesystem::temp_directory_path() / "moraine-ranks-XXXXXX").string();
  if (world.is_root() && mkdtemp(name.data()) == nullptr) world.abort(1);
  world.broadcast(name);
  path_ = name;
}

SharedDirectory::~SharedDirectory() {
  world_.wait_for_all();
  std::error_code ignored;
  if (world_.is_root()) std::filesystem::remove_all(path_, ignored);
}

}  // namespace moraine::ranks

int main(int argc, char** argv) {
  const moraine::World& world = moraine::ranks::world();
  std::ostringstream report;
  std::streambuf* const terminal = std::cout.rdbuf();
  if (!world.is_root()) std::cout.rdbuf(report.rdbuf());
  const int n_failed = moraine::run_catch(argc, argv);
  std::cout.rdbuf(terminal);
  if (n_failed > 0) {
    if (!world.is_root()) std::cout << "on rank " << world.rank() << ":\n" << report.str() << std::flush;
    world.abort(1);
  }
  world.wait_for_all();
  return 0;
}
