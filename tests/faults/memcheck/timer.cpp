// Stands in for Highway's function of this name, which uses an instruction that valgrind does not know on some virtual machines.
#include <cstdint>

namespace hwy::platform {

std::uint64_t TimerResolution() { return 1; }

}  // namespace hwy::platform
