// The ranks of the test job.
#pragma once

#include "comm/world.hpp"

namespace moraine::ranks {

const World& world();

}  // namespace moraine::ranks
