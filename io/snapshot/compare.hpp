// Two images beside each other: equal bits, or where they differ most.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/run/image.hpp"

namespace moraine {

/// How one field differs between two images, over the grains that both have.
struct FieldDifference {
  std::string name;
  std::string unit;
  std::uint64_t n_different = 0;  // grains with any bit different
  double largest = 0.0;   // largest absolute difference of a component; infinite where one of the two is not a number
  std::uint64_t gid = 0;  // the grain of the largest difference ...
  int component = 0;      // ... and the component
  double value_a = 0.0, value_b = 0.0;
};

/// How one quantity of the gas differs.
struct GridDifference {
  std::string name;
  std::string unit;
  std::uint64_t n_different = 0;  // values with any bit different
  double largest = 0.0;           // largest absolute difference; infinite where one of the two is not a number
  std::array<int, 3> place{};     // of the largest difference, counted from 0
  double value_a = 0.0, value_b = 0.0;
};

struct Comparison {
  bool is_equal = true;
  std::uint64_t n_only_a = 0, n_only_b = 0;  // grains that only one of the two has
  std::uint64_t n_common = 0;
  std::vector<FieldDifference> fields;  // those of both images that differ
  std::vector<GridDifference> grids;    // those of both images that differ
  std::vector<std::string> notes;       // everything else that differs, in words
};

/// Compares time, domain, grains, fields and gas, and where both have them contact histories and accumulators; bits,
/// not values, so that -0 and 0 differ. Images without gids are compared row by row.
Comparison compare(const Image& a, const Image& b);

/// The comparison as text for a terminal, ending in "equal" or "not equal".
std::string comparison_text(const Comparison& comparison);

}  // namespace moraine
