// Short rows put into the order of their keys.
#pragma once

#include <cstdint>

namespace moraine {

/// Writes the values of each row to the same row of `sorted`, by ascending keys; row n is [begins[n], begins[n + 1]). Keys are below 2^63,
/// and no two of a row are the same. Reads up to 7 keys past the last row. A value's place is the number of keys below its own: without branches
/// that no processor foresees, and quadratic; long rows are sorted otherwise.
using RowOrder = void (*)(const std::uint32_t* begins, std::int64_t n_rows, const std::int64_t* keys,
                          const std::uint32_t* values, std::uint32_t* sorted);
RowOrder row_order();

}  // namespace moraine
