// Spheres against analytic surfaces and single triangles.
#include <catch2/catch.hpp>

#include <array>
#include <functional>

#include "kernels/search/surface.hpp"
#include "tests/support/surface_shapes.hpp"

using namespace moraine;
using shapes::Dice;
using shapes::Frame;

namespace {

/// A surface as a function of two parameters in [0, 1], to be searched without any knowledge of geometry.
using Sheet = std::function<Vec3(double, double)>;

/// Distance from a point to a sheet: sampled, then sampled ever more finely around the best.
double searched_distance(const Sheet& sheet, Vec3 p) {
  double u = 0.5, v = 0.5, width = 0.5, best = infinity;
  for (int round = 0; round < 24; ++round) {
    const double u0 = u, v0 = v;
    const int n = round == 0 ? 120 : 8;
    for (int i = -n; i <= n; ++i)
      for (int j = -n; j <= n; ++j) {
        const double a = std::clamp(u0 + width * i / n, 0.0, 1.0), b = std::clamp(v0 + width * j / n, 0.0, 1.0);
        const double d = length(p - sheet(a, b));
        if (d < best) best = d, u = a, v = b;
      }
    width *= round == 0 ? 0.06 : 0.5;
  }
  return best;
}

void check_touches(const Surface& surface, const Sheet& sheet, Dice& dice, double size, int n) {
  int n_far = 0;
  for (int i = 0; i < n; ++i) {
    const Vec3 centre = surface.point + dice.point({-size, -size, -size}, {size, size, size});
    Touch touch;
    REQUIRE(touch_analytic(surface, centre, infinity, touch));
    const double expected = searched_distance(sheet, centre);
    CHECK(touch.distance == Approx(expected).margin(1e-6));
    CHECK(length(touch.normal) == Approx(1.0).epsilon(1e-14));
    // With the right distance, a foot on the surface says that the normal is right.
    Touch foot;
    REQUIRE(touch_analytic(surface, centre - touch.distance * touch.normal, infinity, foot));
    CHECK(foot.distance < 1e-14);
    const double reach = dice.uniform(0.0, size);
    const bool is_near = touch_analytic(surface, centre, reach, touch);
    CHECK(is_near == touch.distance < reach);
    n_far += !is_near;
  }
  CHECK((n_far > 0 && n_far < n));
}

Surface surface_of(SurfaceKind kind, const Frame& frame) {
  Surface surface;
  surface.kind = kind;
  surface.point = frame.origin;
  surface.axis = frame.z;
  return surface;
}

Sheet turned(const Frame& frame, double radius_base, double radius_top, double length) {
  return [=](double u, double v) {
    const double angle = 2 * std::numbers::pi * u, r = radius_base + v * (radius_top - radius_base);
    return frame.place({r * std::cos(angle), r * std::sin(angle), v * length});
  };
}

}  // namespace

TEST_CASE("a sphere touches a plane along its normal, from behind too") {
  Dice dice(1);
  for (const SurfaceKind kind : {SurfaceKind::plane, SurfaceKind::mirror}) {
    const Frame frame = shapes::random_frame(dice);
    const Surface plane = surface_of(kind, frame);
    for (const double height : {2.0, 0.3, 0.0, -0.3, -5.0}) {
      Touch touch;
      const Vec3 centre = frame.place({dice.uniform(-9, 9), dice.uniform(-9, 9), height});
      CHECK(touch_analytic(plane, centre, 0.5, touch) == (height < 0.5));
      CHECK(touch.distance == Approx(height).margin(1e-14));
      CHECK(touch.normal == frame.z);
    }
  }
}

TEST_CASE("a sphere touches a finite cylinder at its nearest point, inside, outside and at the rims") {
  Dice dice(2);
  for (int shape = 0; shape < 4; ++shape) {
    const Frame frame = shapes::random_frame(dice);
    Surface cylinder = surface_of(SurfaceKind::cylinder, frame);
    cylinder.radius_base = dice.uniform(0.2, 1.5);
    cylinder.length = dice.uniform(0.2, 2.0);
    check_touches(cylinder, turned(frame, cylinder.radius_base, cylinder.radius_base, cylinder.length), dice, 2.5, 60);
  }
}

TEST_CASE("a sphere touches a cylinder without ends anywhere along its axis") {
  Dice dice(3);
  const Frame frame = shapes::random_frame(dice);
  Surface cylinder = surface_of(SurfaceKind::cylinder, frame);
  cylinder.radius_base = 0.7;
  cylinder.length = infinity;
  for (const double height : {-40.0, -0.1, 0.0, 3.0, 55.0})
    for (const double radius : {0.1, 0.65, 0.75, 2.0}) {
      const double angle = dice.uniform(0, 6);
      const Vec3 outward = frame.turn({std::cos(angle), std::sin(angle), 0});
      Touch touch;
      REQUIRE(touch_analytic(cylinder, frame.origin + height * frame.z + radius * outward, 10, touch));
      CHECK(touch.distance == Approx(std::abs(radius - 0.7)).epsilon(1e-12));
      CHECK(length(touch.normal - (radius < 0.7 ? -1.0 : 1.0) * outward) < 1e-13);
    }
}

TEST_CASE("a sphere touches a cone at its nearest point, inside, outside, at the rims and at a tip") {
  Dice dice(4);
  for (const double radius_top : {0.0, 0.3, 1.0, 1.8}) {
    const Frame frame = shapes::random_frame(dice);
    Surface cone = surface_of(SurfaceKind::cone, frame);
    cone.radius_base = 1.0;
    cone.radius_top = radius_top;
    cone.length = dice.uniform(0.2, 2.0);
    check_touches(cone, turned(frame, cone.radius_base, cone.radius_top, cone.length), dice, 2.5, 60);
  }
}

TEST_CASE("a sphere touches a disc at its nearest point, from either side, at the rim and at the edge of the hole") {
  Dice dice(5);
  for (const double hole : {0.0, 0.1, 0.9}) {
    const Frame frame = shapes::random_frame(dice);
    Surface disc = surface_of(SurfaceKind::disc, frame);
    disc.radius_base = 1.0;
    disc.radius_top = hole;
    check_touches(disc, turned(frame, 1.0, hole, 0.0), dice, 1.5, 60);
  }
}

TEST_CASE("a centre on the axis or on the surface itself still has a unit normal") {
  Surface s;
  s.radius_base = 1.0;
  s.length = 2.0;
  Touch touch;
  for (const Vec3 axis : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}, normalized({1, 1, 1})}) {
    s.axis = axis;
    const Vec3 outward = normalized(cross(axis, Vec3{0.3, -0.5, 0.9}));
    for (const SurfaceKind kind : {SurfaceKind::cylinder, SurfaceKind::cone, SurfaceKind::disc}) {
      s.kind = kind;
      s.radius_top = kind == SurfaceKind::disc ? 0.5 : 1.0;
      for (const Vec3 centre :
           {Vec3{}, axis, 2.0 * axis, -1.0 * axis, outward, outward + axis, outward + 2.0 * axis, 0.7 * outward}) {
        REQUIRE(touch_analytic(s, centre, 10.0, touch));
        CHECK(length(touch.normal) == Approx(1.0).epsilon(1e-14));
        CHECK(touch.distance >= 0.0);
      }
      // On the rim: towards the axis from a wall around it, along the normal from a disc.
      REQUIRE(touch_analytic(s, outward, 10.0, touch));
      if (touch.distance == 0.0) CHECK(dot(touch.normal, kind == SurfaceKind::disc ? axis : -outward) > 0.999999);
    }
  }
}

TEST_CASE("the point of a triangle closest to a point is a point of the triangle, and none is nearer") {
  Dice dice(6);
  for (int n = 0; n < 400; ++n) {
    // Slivers of every kind down to a height of a millionth.
    const double flatness = n % 4 == 0 ? 1.0 : std::pow(10.0, -dice.uniform(0, 6));
    const Frame frame = shapes::random_frame(dice);
    const auto corner = [&] { return frame.place({dice.uniform(-1, 1), flatness * dice.uniform(-1, 1), 0.0}); };
    const Vec3 a = corner(), b = corner(), c = corner();
    const Vec3 p =
        frame.place({dice.uniform(-2, 2), dice.uniform(-2, 2) * (n % 3 ? flatness : 1.0), dice.uniform(-1, 1)});
    const Vec3 closest = closest_point_on_triangle(p, a, b, c);
    // Inside the triangle: not beyond any edge, seen from the third corner.
    const std::array<Vec3, 3> corners = {a, b, c};
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 from = corners[k], edge = normalized(corners[(k + 1) % 3] - from), third = corners[(k + 2) % 3] - from;
      const Vec3 inwards = normalized(third - dot(third, edge) * edge);
      CHECK(dot(inwards, closest - from) > -1e-9);
      // No way towards a corner leads nearer; in a convex set that makes it the closest point.
      CHECK(dot(p - closest, from - closest) < 1e-9);
    }
    CHECK(std::abs(dot(closest - frame.origin, frame.z)) < 1e-14);
    CHECK(squared_distance_to_triangle(p, std::array{a, b, c}.data(), triangle_normal(a, b, c)) ==
          Approx(squared_length(p - closest)).epsilon(1e-9));
  }
}

TEST_CASE("a triangle that is a line or a point has the closest point of its edges, and no normal") {
  const Vec3 a{0, 0, 0}, b{1, 0, 0}, c{3, 0, 0};
  CHECK(triangle_normal(a, b, c) == Vec3{});
  CHECK(triangle_normal(a, a, c) == Vec3{});
  CHECK(triangle_normal(a, b, {0.5, 1e-12, 0}) == Vec3{});
  CHECK(closest_point_on_triangle({2, 1, 0}, a, b, c) == Vec3{2, 0, 0});
  CHECK(closest_point_on_triangle({2, 1, 0}, c, a, b) == Vec3{2, 0, 0});
  CHECK(closest_point_on_triangle({9, 1, 0}, b, c, a) == c);
  CHECK(closest_point_on_triangle({9, 1, 0}, a, a, a) == a);
}
