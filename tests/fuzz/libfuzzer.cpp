// One target as libFuzzer drives it.
#include "tests/fuzz/fuzz.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  moraine::fuzz::MORAINE_FUZZ_TARGET({data, size});
  return 0;
}
