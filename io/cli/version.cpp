#include "io/cli/version.hpp"

#include "moraine_commit.hpp"

namespace moraine {

std::string program_version() { return MORAINE_VERSION; }
std::string program_commit() { return MORAINE_COMMIT; }
std::string program_identity() {
  return "moraine " + program_version() + " (commit " + program_commit() +
         "), " MORAINE_BUILD ", compiler " __VERSION__;
}

}  // namespace moraine
