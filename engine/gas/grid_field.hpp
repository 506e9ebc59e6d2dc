// Values on the cells, or on the faces of one direction, of a rank's block of the gas grid, with ghost layers.
#pragma once

#include <algorithm>

#include "engine/particles/aligned_array.hpp"
#include "kernels/base/grid.hpp"

namespace moraine {

template <typename T = double>
class GridField {
 public:
  GridField() = default;
  explicit GridField(const GridLayout& layout, T value = T{}) : layout_(layout) {
    values_.resize_discarding(static_cast<std::size_t>(layout.n_values()));
    fill(value);
  }
  const GridLayout& layout() const { return layout_; }
  T* data() { return values_.data(); }
  const T* data() const { return values_.data(); }
  /// Of the cell, or of its low face; local indices as in GridLayout.
  T& operator()(int i, int j, int k) { return values_[static_cast<std::size_t>(layout_.at(i, j, k))]; }
  T operator()(int i, int j, int k) const { return values_[static_cast<std::size_t>(layout_.at(i, j, k))]; }
  void fill(T value) { std::fill(values_.begin(), values_.end(), value); }
  std::size_t bytes() const { return values_.capacity_bytes(); }

 private:
  GridLayout layout_;
  AlignedArray<T> values_;
};

}  // namespace moraine
