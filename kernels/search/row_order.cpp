#include "kernels/search/row_order.hpp"

#include <algorithm>
#include <numeric>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/search/row_order.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include "kernels/base/simd/lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace moraine {
namespace HWY_NAMESPACE {

/// Longer rows are sorted by comparing two at a time.
constexpr std::uint32_t long_row = 64;

void order_rows(const std::uint32_t* begins, std::int64_t n_rows, const std::int64_t* keys, const std::uint32_t* values,
                std::uint32_t* sorted) {
  constexpr std::uint32_t n = n_lanes<double>;
  for (std::int64_t row = 0; row < n_rows; ++row) {
    const std::uint32_t begin = begins[row], size = begins[row + 1] - begin;
    const std::int64_t* const own = keys + begin;
    if (size <= n) {
      const unsigned in_row = (1u << size) - 1u;
      for (std::uint32_t k = 0; k < size; ++k)
        sorted[begin + static_cast<std::uint32_t>(__builtin_popcount(bits_below(own, own[k]) & in_row))] =
            values[begin + k];
    } else if (size <= long_row) {
      const std::uint32_t full = size / n * n;
      const unsigned in_rest = (1u << (size - full)) - 1u;
      for (std::uint32_t k = 0; k < size; ++k) {
        int place = in_rest ? __builtin_popcount(bits_below(own + full, own[k]) & in_rest) : 0;
        for (std::uint32_t q = 0; q < full; q += n) place += __builtin_popcount(bits_below(own + q, own[k]));
        sorted[begin + static_cast<std::uint32_t>(place)] = values[begin + k];
      }
    } else {
      std::uint32_t* const order = sorted + begin;  // first of places in the row, then what lies there
      std::iota(order, order + size, 0u);
      std::sort(order, order + size, [&](std::uint32_t x, std::uint32_t y) { return own[x] < own[y]; });
      for (std::uint32_t k = 0; k < size; ++k) order[k] = values[begin + order[k]];
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace moraine
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace moraine {
HWY_EXPORT(order_rows);
RowOrder row_order() {
  return [](const std::uint32_t* begins, std::int64_t n_rows, const std::int64_t* keys, const std::uint32_t* values,
            std::uint32_t* sorted) {
    HWY_DYNAMIC_DISPATCH(order_rows)
    (begins, n_rows, keys, values, sorted);
  };
}
}  // namespace moraine
#endif
