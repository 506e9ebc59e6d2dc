// State as numpy arrays.
#pragma once

#include <pybind11/numpy.h>

#include "engine/particles/particles.hpp"
#include "engine/run/image.hpp"

namespace moraine {

/// A field where it lies, without a copy: shape (n) or (n, components), with strides. The array keeps the memory there.
pybind11::array array_of(const FieldView& view, bool is_writable);

/// An image as a dict of plain values and arrays, whose memory it takes over.
pybind11::dict dict_of(Image image);

}  // namespace moraine
