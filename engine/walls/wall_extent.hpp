// How much of a surface there is, and where.
#pragma once

#include <array>

#include "kernels/base/box.hpp"
#include "kernels/search/surface.hpp"

namespace moraine {

/// Area [m2] of the part of an analytic surface inside `clip`.
double area_of(const Surface& surface, const Box& clip);
/// Area [m2] of the part of a triangle inside `clip`.
double area_of(const std::array<Vec3, 3>& triangle, const Box& clip);

/// The part of the bounding box of an analytic surface inside `clip` [m]; Box::empty() where nothing of it is inside.
Box extent_of(const Surface& surface, const Box& clip);

/// What two boxes have in common, faces included; Box::empty() where they are apart.
Box common_part(const Box& a, const Box& b);

}  // namespace moraine
