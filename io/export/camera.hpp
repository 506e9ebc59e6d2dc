// A camera that sees a whole box.
#pragma once

#include "kernels/base/box.hpp"

namespace moraine {

struct Camera {
  Vec3 place;             // [m]
  Vec3 ahead, right, up;  // unit vectors, a right-handed view: right = ahead x up
  double tan_x = 0.0;     // half the width of the picture over its distance
  double tan_y = 0.0;
  bool is_parallel = false;  // orthographic: tan_x, tan_y times `distance` are half the width and height [m]
  double distance = 0.0;     // [m] from the middle of the box

  /// Where on the picture a point appears, each from -1 to 1.
  Vec3 project(Vec3 point) const;
};

/// What is up in a scene: the axis that gravity points against most, z without gravity; and the level directions that azimuths are counted from.
/// Columns of a right-handed frame, `up` the third.
struct Upright {
  Vec3 east{1, 0, 0}, north{0, 1, 0}, up{0, 0, 1};
};
Upright upright_for(Vec3 gravity);

/// Looks at the box from a direction (azimuth from `east`, elevation above the horizon [degrees]); from `elevation` 90 straight down with `north` up. The box fills the picture but for a margin, and a share `aside` of the width on the right that
/// stays free for a legend. `aspect`: width over height.
Camera frame_box(const Box& box, const Upright& upright, double azimuth, double elevation, double aspect, double aside,
                 bool is_parallel);

/// How far right on the picture the box reaches, -1 to 1.
double right_end(const Camera& camera, const Box& box);

}  // namespace moraine
