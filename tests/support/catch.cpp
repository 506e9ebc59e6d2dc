// Catch's implementation, compiled once for all tests: it takes half a minute.
#define CATCH_CONFIG_RUNNER
#include <catch2/catch.hpp>

#include "tests/support/catch.hpp"

namespace moraine {

int run_catch(int argc, char** argv) { return Catch::Session().run(argc, argv); }

}  // namespace moraine
