#include "engine/walls/motion.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace moraine {

namespace {

/// A curve of straight pieces, constant beyond its ends: its value, its slope and its integral from 0 to `time`.
struct CurveValue {
  double value = 0.0, slope = 0.0, integral = 0.0;
};

CurveValue value_at(std::span<const std::array<double, 2>> curve, double time) {
  if (curve.empty()) return {};
  // Pieces in order, each by its own closed form; the first and last values hold beyond the ends.
  const auto area_until = [&](double t) {
    double area = 0.0, at = curve.front()[0];
    if (t < at) return (t - at) * curve.front()[1];
    for (std::size_t k = 0; k + 1 < curve.size(); ++k) {
      const auto [t0, y0] = curve[k];
      const auto [t1, y1] = curve[k + 1];
      if (t <= t0) break;
      const double end = std::min(t, t1);
      at = end;
      if (!(t1 > t0)) continue;
      const double y = y0 + (y1 - y0) * ((end - t0) / (t1 - t0));
      area += 0.5 * (y0 + y) * (end - t0);
    }
    if (t > curve.back()[0]) area += (t - curve.back()[0]) * curve.back()[1];
    return area;
  };
  CurveValue out;
  out.integral = area_until(time) - area_until(0.0);
  out.value = time < curve.front()[0] ? curve.front()[1] : curve.back()[1];
  for (std::size_t k = 0; k + 1 < curve.size(); ++k) {
    const auto [t0, y0] = curve[k];
    const auto [t1, y1] = curve[k + 1];
    if (!(time >= t0 && time < t1)) continue;
    out.slope = (y1 - y0) / (t1 - t0);
    out.value = y0 + (time - t0) * out.slope;
  }
  return out;
}

Advance ramped(double rate, std::span<const std::array<double, 2>> ramp, double time) {
  if (ramp.empty()) return {rate * time, rate};
  const CurveValue factor = value_at(ramp, time);
  return {rate * factor.integral, rate * factor.value};
}

Advance oscillation(const WallMotion& m, double time) {
  const double omega = 2.0 * std::numbers::pi * m.frequency, argument = omega * time + m.phase;
  return {m.amplitude * std::sin(argument), m.amplitude * omega * std::cos(argument)};
}

/// Displacement and velocity of a translation.
struct Slide {
  Vec3 place, velocity;
};

Slide slide_of(const WallMotion& m, double time, const ServoState& servo) {
  if (m.kind == WallMotion::Kind::translate && !m.places.empty()) {
    Slide slide;
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<std::array<double, 2>> curve;
      for (const auto& row : m.places) curve.push_back({row[0], row[static_cast<std::size_t>(axis + 1)]});
      const CurveValue value = value_at(curve, time);
      slide.place[axis] = value.value;
      slide.velocity[axis] = value.slope;
    }
    return slide;
  }
  if (m.kind == WallMotion::Kind::translate) {
    const Advance factor = ramped(1.0, m.ramp, time);
    return {factor.place * m.velocity, factor.speed * m.velocity};
  }
  const Vec3 axis = normalized(m.axis);
  const Advance along = advance_of(m, time, servo);
  return {along.place * axis, along.speed * axis};
}

/// The turn of one pose, and another turn after it; where that leaves the origin is not touched.
Pose then(const Pose& first, const Pose& turn) {
  Pose both = first;
  for (std::size_t k = 0; k < 3; ++k) both.rows[k] = first.turn_back(turn.rows[k]);
  both.is_turned = first.is_turned || turn.is_turned;
  return both;
}

double largest_factor(std::span<const std::array<double, 2>> ramp) {
  double most = ramp.empty() ? 1.0 : 0.0;
  for (const auto& point : ramp) most = std::max(most, std::abs(point[1]));
  return most;
}

/// The largest slope of a course of places, or of angles.
template <std::size_t n>
double steepest(std::span<const std::array<double, n>> course) {
  double most = 0.0;
  for (std::size_t k = 0; k + 1 < course.size(); ++k) {
    double square = 0.0;
    for (std::size_t c = 1; c < n; ++c) square += (course[k + 1][c] - course[k][c]) * (course[k + 1][c] - course[k][c]);
    if (course[k + 1][0] > course[k][0]) most = std::max(most, std::sqrt(square) / (course[k + 1][0] - course[k][0]));
  }
  return most;
}

/// At most, within a distance [m] of the origin [m/s].
double fastest(const WallMotion& m, double distance) {
  switch (m.kind) {
    case WallMotion::Kind::translate:
      return m.places.empty() ? length(m.velocity) * largest_factor(m.ramp) : steepest<4>(m.places);
    case WallMotion::Kind::rotate:
      return distance * (m.angles.empty() ? std::abs(m.speed) * largest_factor(m.ramp) : steepest<2>(m.angles));
    case WallMotion::Kind::vibrate: return 2.0 * std::numbers::pi * m.frequency * std::abs(m.amplitude);
    case WallMotion::Kind::swing: return 2.0 * std::numbers::pi * m.frequency * std::abs(m.amplitude) * distance;
    case WallMotion::Kind::servo: return m.max_speed * (m.torque ? distance : 1.0);
    case WallMotion::Kind::script: return m.max_speed;
  }
  return 0.0;
}

}  // namespace

Pose turn_about(Vec3 axis, double angle) {
  const double s = std::sin(angle), half = std::sin(0.5 * angle), c = 2.0 * half * half;  // c = 1 - cos
  const auto [x, y, z] = axis;
  Pose pose;
  pose.rows = {Vec3{1.0 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y},
               Vec3{c * x * y + s * z, 1.0 - c * (x * x + z * z), c * y * z - s * x},
               Vec3{c * x * z - s * y, c * y * z + s * x, 1.0 - c * (x * x + y * y)}};
  pose.is_turned = angle != 0.0;
  return pose;
}

Advance advance_of(const WallMotion& m, double time, const ServoState& servo) {
  switch (m.kind) {
    case WallMotion::Kind::translate: return {};
    case WallMotion::Kind::rotate: {
      if (m.angles.empty()) return ramped(m.speed, m.ramp, time);
      const CurveValue value = value_at(m.angles, time);
      return {value.value, value.slope};
    }
    case WallMotion::Kind::vibrate:
    case WallMotion::Kind::swing: return oscillation(m, time);
    case WallMotion::Kind::servo: return {servo.place, servo.speed};
    case WallMotion::Kind::script: return {};  // see ScriptState
  }
  return {};
}

WallState state_of(std::span<const WallMotion> motions, double time, const ServoState& servo) {
  // home: where the home's origin is now, and how fast that point of the wall moves.
  Pose pose;
  Vec3 velocity, spin;
  for (const WallMotion& m : motions) {
    if (!m.turns()) {
      const Slide slide = slide_of(m, time, servo);
      pose.shift += slide.place;
      velocity += slide.velocity;
      continue;
    }
    const Vec3 axis = normalized(m.axis);
    const Advance about = advance_of(m, time, servo);
    const Pose turn = turn_about(axis, about.place);
    const Vec3 arm = turn.turn(pose.shift - m.origin);
    pose = then(pose, turn);
    if (turn.is_turned) pose.shift = arm + m.origin;
    velocity = turn.turn(velocity) + cross(about.speed * axis, arm);
    spin = turn.turn(spin) + about.speed * axis;
  }
  return {pose, {velocity, spin, pose.shift}};
}

ScriptState advanced(const ScriptState& script, double dt) {
  ScriptState next = script;
  next.centre += dt * script.velocity;
  const double rate = length(script.spin);
  if (rate > 0.0) {
    next.pose = then(script.pose, turn_about((1.0 / rate) * script.spin, rate * dt));
    auto& rows = next.pose.rows;
    rows[0] = normalized(rows[0]);
    rows[1] = normalized(rows[1] - dot(rows[0], rows[1]) * rows[0]);
    rows[2] = cross(rows[0], rows[1]);
  }
  next.pose.shift = next.centre - next.pose.turn(next.origin);
  return next;
}

std::vector<double> numbers_of(const ScriptState& s) {
  std::vector<double> numbers;
  for (const Vec3& v : {s.pose.rows[0], s.pose.rows[1], s.pose.rows[2], s.centre, s.velocity, s.spin})
    numbers.insert(numbers.end(), {v.x, v.y, v.z});
  return numbers;
}

ScriptState script_state_of(Vec3 origin, std::span<const double> numbers) {
  const auto vector = [&](std::size_t k) { return Vec3{numbers[3 * k], numbers[3 * k + 1], numbers[3 * k + 2]}; };
  ScriptState s;
  s.origin = origin;
  s.pose.rows = {vector(0), vector(1), vector(2)};
  s.pose.is_turned = s.pose.rows != Pose().rows;
  s.centre = vector(3);
  s.velocity = vector(4);
  s.spin = vector(5);
  s.pose.shift = s.centre - s.pose.turn(origin);
  return s;
}

Vec3 corner_of(const Box& box, int k) {
  return {k & 1 ? box.high.x : box.low.x, k & 2 ? box.high.y : box.low.y, k & 4 ? box.high.z : box.low.z};
}

double fastest_wall(const Scene& scene) {
  double most = 0.0;
  for (const WallDefinition& wall : scene.walls) {
    double distance = 0.0;
    for (const WallMotion& motion : wall.motion)
      for (int k = 0; motion.turns() && k < 8; ++k)
        distance = std::max(distance, length(corner_of(scene.domain.box(), k) - motion.origin));
    double sum = 0.0;
    for (const WallMotion& motion : wall.motion) sum += fastest(motion, distance);
    most = std::max(most, sum);
  }
  return most;
}

double next_speed(const WallMotion& servo, double speed, double push, double dt) {
  // m v' = (push - wanted) - v / gain, the resistance taken at the end of the step: stable for any mass, and for none
  // speed = gain * what is missing.
  const double missing = push - servo.force.value_or(servo.torque.value_or(0.0));
  const double next = (servo.mass * speed + dt * missing) / (servo.mass + dt / servo.gain);
  return std::clamp(next, -servo.max_speed, servo.max_speed);
}

}  // namespace moraine
