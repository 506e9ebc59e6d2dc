// What tests have measured, for whoever reads their output.
#pragma once

#include <cstdio>

namespace moraine::testing {

/// Prints one line of measured values.
template <typename... Values>
void report(const char* format, Values... values) {
  std::printf("    ");
  std::printf(format, values...);
  std::printf("\n");
  std::fflush(stdout);
}

}  // namespace moraine::testing
