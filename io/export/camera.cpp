#include "io/export/camera.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace moraine {

namespace {

constexpr double half_angle = 14.0 * std::numbers::pi / 180.0;  // of the height of the picture: little distortion
constexpr double margin = 0.94;                                 // share of the picture that the box may fill

Vec3 corner(const Box& box, int i) {
  return {(i & 1) != 0 ? box.high.x : box.low.x, (i & 2) != 0 ? box.high.y : box.low.y,
          (i & 4) != 0 ? box.high.z : box.low.z};
}

/// Extent of the box on the picture.
void picture_extent(const Camera& camera, const Box& box, double low[2], double high[2]) {
  low[0] = low[1] = 1e300, high[0] = high[1] = -1e300;
  for (int i = 0; i < 8; ++i) {
    const Vec3 p = camera.project(corner(box, i));
    low[0] = std::min(low[0], p.x), high[0] = std::max(high[0], p.x);
    low[1] = std::min(low[1], p.y), high[1] = std::max(high[1], p.y);
  }
}

/// Moves the camera sideways until the box is in the middle of its part of the picture; true where it then fits into it.
bool fits(Camera& camera, const Box& box, double aside) {
  Vec3 target = 0.5 * (box.low + box.high);
  double low[2], high[2];
  for (int round = 0; round < 12; ++round) {
    camera.place = target - camera.distance * camera.ahead;
    picture_extent(camera, box, low, high);
    const double shift_x = 0.5 * (low[0] + high[0]) + aside, shift_y = 0.5 * (low[1] + high[1]);
    target += camera.distance * (shift_x * camera.tan_x * camera.right + shift_y * camera.tan_y * camera.up);
  }
  camera.place = target - camera.distance * camera.ahead;
  picture_extent(camera, box, low, high);
  return std::max(-low[0], high[0] + 2.0 * aside) <= margin && std::max(-low[1], high[1]) <= margin;
}

}  // namespace

Vec3 Camera::project(Vec3 point) const {
  const Vec3 from = point - place;
  const double depth = is_parallel ? distance : dot(from, ahead);
  return {dot(from, right) / (depth * tan_x), dot(from, up) / (depth * tan_y), depth};
}

Upright upright_for(Vec3 gravity) {
  int axis = 2;
  for (int k = 0; k < 3; ++k)
    if (std::abs(gravity[k]) > std::abs(gravity[axis])) axis = k;
  Upright frame;
  frame.up = frame.east = {};
  frame.up[axis] = gravity[axis] > 0.0 ? -1.0 : 1.0;
  frame.east[axis == 0 ? 1 : 0] = 1.0;
  frame.north = cross(frame.up, frame.east);
  return frame;
}

Camera frame_box(const Box& box, const Upright& upright, double azimuth, double elevation, double aspect, double aside,
                 bool is_parallel) {
  const double a = azimuth * std::numbers::pi / 180.0, e = elevation * std::numbers::pi / 180.0;
  Camera camera;
  camera.is_parallel = is_parallel;
  camera.tan_y = std::tan(half_angle);
  camera.tan_x = camera.tan_y * aspect;
  const Vec3 level = std::cos(a) * upright.east + std::sin(a) * upright.north;
  camera.ahead = -std::cos(e) * level - std::sin(e) * upright.up;
  camera.up = -std::sin(e) * level + std::cos(e) * upright.up;
  camera.right = cross(camera.ahead, camera.up);
  // The least distance at which the box fits, by bisection; never so near that the camera is among the grains.
  double near = 0.55 * length(box.size()), far = 200.0 * length(box.size());
  for (int round = 0; round < 60; ++round) {
    camera.distance = 0.5 * (near + far);
    (fits(camera, box, aside) ? far : near) = camera.distance;
  }
  camera.distance = far;
  fits(camera, box, aside);
  return camera;
}

double right_end(const Camera& camera, const Box& box) {
  double low[2], high[2];
  picture_extent(camera, box, low, high);
  return high[0];
}

}  // namespace moraine
