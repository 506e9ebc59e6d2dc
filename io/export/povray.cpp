#include "io/export/povray.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "io/export/camera.hpp"
#include "io/export/colour_map.hpp"
#include "io/export/frames.hpp"
#include "io/export/gas_slice.hpp"
#include "io/export/grain_values.hpp"
#include "io/export/povray_walls.hpp"

namespace moraine {

namespace {

constexpr int n_colours = 128;
constexpr double legend_width = 0.44;  // that what is shown leaves free on the right, in halves of the picture's height

Box intersection(const Box& a, const Box& b) {
  Box box;
  for (int axis = 0; axis < 3; ++axis) {
    box.low[axis] = std::max(a.low[axis], b.low[axis]);
    box.high[axis] = std::max(std::min(a.high[axis], b.high[axis]), box.low[axis]);
  }
  return box;
}

void include_round(Box& box, Vec3 centre, Vec3 axis, double radius) {
  const Vec3 n = normalized(axis);
  Vec3 reach;
  for (int i = 0; i < 3; ++i) reach[i] = radius * std::sqrt(std::max(0.0, 1.0 - n[i] * n[i]));
  box.include(centre - reach);
  box.include(centre + reach);
}

/// POV-Ray's tolerances are absolute: pictures are drawn in units in which what they show is about 10 across, around the origin.
class Drawing {
 public:
  explicit Drawing(const Box& frame)
      : middle_(0.5 * (frame.low + frame.high)), scale_(10.0 / std::max(length(frame.size()), 1e-300)) {}
  Vec3 point(Vec3 p) const { return scale_ * (p - middle_); }
  double length_of(double l) const { return scale_ * l; }
  Box box(const Box& b) const { return {point(b.low), point(b.high)}; }

  PlaneShape operator()(PlaneShape s) const { return s.point = point(s.point), s; }
  BoxShape operator()(BoxShape s) const { return s.box = box(s.box), s; }
  CylinderShape operator()(CylinderShape s) const {
    return s.base = point(s.base), s.radius *= scale_, s.length *= scale_, s;
  }
  ConeShape operator()(ConeShape s) const {
    return s.base = point(s.base), s.radius_base *= scale_, s.radius_top *= scale_, s.length *= scale_, s;
  }
  DiscShape operator()(DiscShape s) const {
    return s.centre = point(s.centre), s.radius *= scale_, s.hole_radius *= scale_, s;
  }
  MeshShape operator()(MeshShape s) const {
    for (Vec3& v : s.mesh.vertices) v = point(v);
    return s;
  }
  std::vector<WallDefinition> walls(std::vector<WallDefinition> drawn) const {
    for (WallDefinition& wall : drawn)
      wall.shape = std::visit([this](const auto& shape) { return decltype(wall.shape)((*this)(shape)); }, wall.shape);
    return drawn;
  }

 private:
  Vec3 middle_;
  double scale_;
};

/// Adds a wall to a box.
struct Includer {
  Box& box;
  void operator()(const PlaneShape& shape) const {
    // A floor belongs to the picture even where nothing touches it; slanted planes are shown where they cross it.
    const Vec3 n = normalized(shape.normal);
    for (int axis = 0; axis < 3; ++axis) {
      if (std::abs(n[axis]) < 0.9999 || !(box.low[axis] <= box.high[axis])) continue;
      box.low[axis] = std::min(box.low[axis], shape.point[axis]);
      box.high[axis] = std::max(box.high[axis], shape.point[axis]);
    }
  }
  void operator()(const BoxShape& shape) const {
    box.include(shape.box.low);
    box.include(shape.box.high);
  }
  void operator()(const CylinderShape& shape) const {
    if (!std::isfinite(shape.length)) return;
    include_round(box, shape.base, shape.axis, shape.radius);
    include_round(box, shape.base + shape.length * normalized(shape.axis), shape.axis, shape.radius);
  }
  void operator()(const ConeShape& shape) const {
    include_round(box, shape.base, shape.axis, shape.radius_base);
    include_round(box, shape.base + shape.length * normalized(shape.axis), shape.axis, shape.radius_top);
  }
  void operator()(const DiscShape& shape) const { include_round(box, shape.centre, shape.normal, shape.radius); }
  void operator()(const MeshShape& shape) const {
    for (const Vec3 v : shape.mesh.vertices) box.include(v);
  }
};

bool is_flat(const Image& image, const Scene* scene) {
  if (scene != nullptr) return scene->domain.dimensions == 2;
  const std::vector<double>& x = image.find(Field::position)->reals;
  for (std::size_t i = 2; i < x.size(); i += 3)
    if (x[i] != x[2]) return false;
  return x.size() > 3;
}

std::string camera_text(const Camera& camera, double aspect) {
  std::string text = "camera {\n  ";
  if (camera.is_parallel) {
    const double half = camera.distance * camera.tan_y;
    text += fmt::format("orthographic location {}\n  right {} up {} direction {}\n}}\n", povray_vector(camera.place),
                        povray_vector(2.0 * half * aspect * camera.right), povray_vector(2.0 * half * camera.up),
                        povray_vector(camera.ahead));
    return text;
  }
  text += fmt::format("perspective location {}\n  right {} up {} direction {}\n}}\n", povray_vector(camera.place),
                      povray_vector(2.0 * camera.tan_x * camera.right), povray_vector(2.0 * camera.tan_y * camera.up),
                      povray_vector(camera.ahead));
  return text;
}

/// One large soft lamp from above the viewer's left shoulder, a weak fill without shadows, and light from all around.
std::string light_text(const Camera& camera, const Box& frame) {
  const double size = length(frame.size());
  const Vec3 middle = 0.5 * (frame.low + frame.high);
  const Vec3 lamp = middle + size * (2.2 * camera.up - 1.6 * camera.right - 1.8 * camera.ahead);
  const Vec3 fill = middle + size * (0.6 * camera.up + 2.5 * camera.right - 1.5 * camera.ahead);
  return fmt::format(
      "light_source {{ {} color rgb 0.95 area_light {}, {}, 5, 5 adaptive 1 jitter circular orient }}\n"
      "light_source {{ {} color rgb 0.32 shadowless }}\n",
      povray_vector(lamp), povray_vector(0.5 * size * camera.right), povray_vector(0.5 * size * camera.up),
      povray_vector(fill));
}

std::string head_text() {
  return "#version 3.7;\n"
         "global_settings { assumed_gamma 1.0 ambient_light rgb 1 }\n"
         "background { srgb <0.97, 0.975, 0.98> }\n"
         "#declare wall = texture { pigment { srgbt <0.72, 0.76, 0.80, 0.35> } finish { ambient 0.25 diffuse 0.6 } };\n"
         "#declare glass_wall = texture { pigment { srgbt <0.55, 0.65, 0.75, 0.80> } finish { ambient 0.25 diffuse "
         "0.55 } };\n"
         "#declare edge = texture { pigment { srgb <0.42, 0.46, 0.50> } finish { ambient 0.4 diffuse 0.5 } };\n"
         "#declare grain_finish = finish { ambient 0.22 diffuse 0.68 specular 0.18 roughness 0.04 };\n"
         "#declare flat_finish = finish { ambient 0 diffuse 0 emission 1 };\n";
}

std::string colour_text(Colour colour) {
  return fmt::format("srgb <{:.4f},{:.4f},{:.4f}>", colour.red, colour.green, colour.blue);
}

std::string palette_text() {
  std::string text = fmt::format("#declare grain = array[{}];\n", n_colours);
  for (int i = 0; i < n_colours; ++i)
    text += fmt::format("#declare grain[{}] = texture {{ pigment {{ {} }} finish {{ grain_finish }} }};\n", i,
                        colour_text(viridis(static_cast<double>(i) / (n_colours - 1))));
  return text;
}

std::string grains_text(const Image& image, const Drawing& drawing, const std::vector<double>& values, double low,
                        double high, const std::function<bool(Vec3)>& is_hidden) {
  const std::vector<double>& x = image.find(Field::position)->reals;
  const std::vector<double>& radius = image.find(Field::radius)->reals;
  std::string text;
  for (std::size_t i = 0; i < radius.size(); ++i) {
    if (is_hidden({x[3 * i], x[3 * i + 1], x[3 * i + 2]})) continue;
    const double share = high > low ? std::clamp((values[i] - low) / (high - low), 0.0, 1.0) : 0.5;
    const int colour = std::isfinite(share) ? static_cast<int>(std::lround(share * (n_colours - 1))) : 0;
    text += fmt::format("sphere {{ {}, {:.9g} texture {{ grain[{}] }} }}\n",
                        povray_vector(drawing.point({x[3 * i], x[3 * i + 1], x[3 * i + 2]})),
                        drawing.length_of(radius[i]), colour);
  }
  return text;
}

/// Things drawn flat upon the picture, in a plane close to the camera; positions from -1 to 1 across the picture's height, x in
/// the same unit.
class Overlay {
 public:
  Overlay(const Camera& camera, double aspect) : camera_(camera), aspect_(aspect) {
    depth_ = 0.25 * camera.distance;
    unit_ = (camera.is_parallel ? camera.distance : depth_) * camera.tan_y;
  }

  Vec3 at(double x, double y, double nearer = 0.0) const {
    return camera_.place + (depth_ * (1.0 - nearer)) * camera_.ahead + unit_ * (x * camera_.right + y * camera_.up);
  }

  /// An upright bar from the lowest to the highest colour.
  std::string bar(double x, double low, double high, double width, Colour (*colours)(double)) const {
    std::string text;
    constexpr int n = 64;
    for (int i = 0; i < n; ++i) {
      const double a = low + (high - low) * i / n, b = low + (high - low) * (i + 1) / n;
      text += quad(x, a, x + width, b, colour_text(colours((i + 0.5) / n)));
    }
    return text;
  }

  std::string quad(double x0, double y0, double x1, double y1, const std::string& colour) const {
    return fmt::format(
        "mesh {{ triangle {{ {0}, {1}, {2} }} triangle {{ {0}, {2}, {3} }} texture {{ pigment {{ {4} }} finish {{ "
        "flat_finish }} }} no_shadow }}\n",
        povray_vector(at(x0, y0)), povray_vector(at(x1, y0)), povray_vector(at(x1, y1)), povray_vector(at(x0, y1)),
        colour);
  }

  /// Text whose left end stands at (x, y).
  std::string text(const std::string& content, double x, double y, double height) const {
    std::string escaped;
    for (const char c : content) escaped += c == '"' || c == '\\' ? std::string("\\") + c : std::string(1, c);
    const double scale = unit_ * height;
    const Vec3 r = scale * camera_.right, u = scale * camera_.up, d = scale * camera_.ahead, p = at(x, y, 0.001);
    return fmt::format(
        "text {{ internal 2 \"{}\" 0.01, 0 texture {{ pigment {{ srgb <0.15, 0.17, 0.20> }} finish {{ flat_finish }} "
        "}}\n"
        "  matrix <{:.9g},{:.9g},{:.9g}, {:.9g},{:.9g},{:.9g}, {:.9g},{:.9g},{:.9g}, {:.9g},{:.9g},{:.9g}> no_shadow "
        "}}\n",
        escaped, r.x, r.y, r.z, u.x, u.y, u.z, d.x, d.y, d.z, p.x, p.y, p.z);
  }

  double right_edge() const { return aspect_; }

 private:
  const Camera& camera_;
  double aspect_;
  double depth_ = 0.0, unit_ = 0.0;
};

/// A bar with its scale, and what it is of above it.
struct Bar {
  std::string label;
  double low = 0.0, high = 0.0;
  Colour (*colours)(double) = viridis;
};

constexpr double text_height = 0.052;

std::string bar_text(const Overlay& overlay, double x, double bottom, double top, const Bar& bar) {
  constexpr double width = 0.045;
  std::string text = overlay.bar(x, bottom, top, width, bar.colours);
  const int n_parts = top - bottom > 0.6 ? 4 : 2;
  for (int i = 0; i <= n_parts; ++i) {
    const double share = static_cast<double>(i) / n_parts, y = bottom + (top - bottom) * share;
    text += overlay.text(fmt::format("{:.3g}", bar.low + (bar.high - bar.low) * share), x + width + 0.025,
                         y - 0.3 * text_height, text_height);
  }
  return text + overlay.text(bar.label, x, top + 0.07, text_height);
}

std::string legend_text(const Overlay& overlay, double left, const Bar& grains, const Bar* gas, const Image& image) {
  const double x = std::min(left, overlay.right_edge() - 0.40), bottom = -0.45;
  std::string text;
  if (gas != nullptr)
    text = bar_text(overlay, x, 0.18, 0.68, grains) + bar_text(overlay, x, bottom, 0.02, *gas);
  else
    text = bar_text(overlay, x, bottom, 0.45, grains);
  text += overlay.text(fmt::format("t = {:.4g} s", image.time), x, bottom - 0.13, text_height);
  return text + overlay.text(fmt::format("{} grains", image.n_grains), x, bottom - 0.22, text_height);
}

/// Where the picture is seen from.
struct Viewpoint {
  Upright upright;
  double azimuth = -62.0, elevation = 18.0;  // [degrees]
  bool is_flat = false;                      // straight from above, without perspective
};
Viewpoint viewpoint_of(const Image& image, const Scene* scene, const PictureStyle& style) {
  Viewpoint from;
  from.is_flat = is_flat(image, scene) && style.view.empty();
  if (scene != nullptr && scene->domain.dimensions == 3) from.upright = upright_for(scene->time.gravity);
  if (from.is_flat) from.azimuth = -90.0, from.elevation = 90.0;
  if (style.view.size() == 2) from.azimuth = style.view[0], from.elevation = style.view[1];
  return from;
}

std::string slice_text(const GasSlice& slice, const Image& image, const Drawing& drawing, const Bar& bar) {
  const int u = slice.axis == 0 ? 1 : 0, v = slice.axis == 2 ? 1 : 2;
  const Vec3 low = image.domain.low, size = image.domain.size();
  const double du = size[u] / slice.n[0], dv = size[v] / slice.n[1];
  std::string text;
  for (int j = 0; j < slice.n[1]; ++j)
    for (int i = 0; i < slice.n[0]; ++i) {
      const auto corner = [&](int a, int b) {
        Vec3 p;
        p[slice.axis] = slice.place;
        p[u] = low[u] + (i + a) * du;
        p[v] = low[v] + (j + b) * dv;
        return povray_vector(drawing.point(p));
      };
      const double value =
          slice
              .values[static_cast<std::size_t>(j) * static_cast<std::size_t>(slice.n[0]) + static_cast<std::size_t>(i)];
      const double share = bar.high > bar.low ? (value - bar.low) / (bar.high - bar.low) : 0.5;
      text += fmt::format(
          "mesh {{ triangle {{ {0}, {1}, {2} }} triangle {{ {0}, {2}, {3} }} texture {{ pigment {{ {4} }} finish {{ "
          "flat_finish }} }} no_shadow }}\n",
          corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1), colour_text(pale_to_blue(share)));
    }
  return text;
}

}  // namespace

Box frame_of(const Image& image, const Scene* scene) {
  Box box = Box::empty();
  const FieldArray *positions = image.find(Field::position), *radii = image.find(Field::radius);
  if (positions == nullptr || radii == nullptr)
    throw ExportError("a picture needs the fields position and radius in the snapshot");
  const std::vector<double>& x = positions->reals;
  for (std::size_t i = 0; i < radii->reals.size(); ++i) {
    const Vec3 r{radii->reals[i], radii->reals[i], radii->reals[i]}, p{x[3 * i], x[3 * i + 1], x[3 * i + 2]};
    box.include(p - r);
    box.include(p + r);
  }
  if (scene != nullptr)
    for (const WallDefinition& wall : scene->walls) std::visit(Includer{box}, wall.shape);
  if (!(box.low.x <= box.high.x)) return image.domain;
  return intersection(box, image.domain);
}

int slice_axis(const Image& image, const Scene* scene, const PictureStyle& style) {
  const Viewpoint from = viewpoint_of(image, scene, style);
  const double a = from.azimuth * std::numbers::pi / 180.0;
  if (from.is_flat) return 2;
  const Vec3 across = std::abs(std::cos(a)) > std::abs(std::sin(a)) ? from.upright.east : from.upright.north;
  return across.x != 0.0 ? 0 : across.y != 0.0 ? 1 : 2;
}

std::string povray_text(const Image& image, const Scene* scene, const PictureStyle& style) {
  const Box frame = style.frame ? *style.frame : frame_of(image, scene);
  const GrainValues values = grain_values(image, style.field);
  const auto [low, high] =
      style.range.size() == 2 ? std::pair(style.range[0], style.range[1]) : usual_range(values.values);
  const Drawing drawing(frame);
  const Box box = drawing.box(frame);
  const Viewpoint from = viewpoint_of(image, scene, style);
  const double aside = std::min(0.5 * legend_width / style.aspect, 0.35);
  const Camera camera = frame_box(box, from.upright, from.azimuth, from.elevation, style.aspect, aside, from.is_flat);
  std::string text = head_text() + camera_text(camera, style.aspect) + light_text(camera, box) + palette_text();
  if (scene == nullptr || scene->walls.empty()) text += povray_edges(box, 0.01, "edge");
  if (scene != nullptr) text += povray_walls(drawing.walls(moved_walls(scene->walls, image)), box, camera, image.time);
  const Bar grain_bar{values.label, low, high, viridis};
  Bar gas_bar;
  std::function<bool(Vec3)> is_hidden = [](Vec3) { return false; };
  if (!style.gas.empty()) {
    const GasSlice slice = gas_slice(image, style.gas, slice_axis(image, scene, style));
    const auto range = usual_range(slice.values);
    gas_bar = {slice.label, range.first, range.second, pale_to_blue};
    if (style.gas_range.size() == 2) gas_bar.low = style.gas_range[0], gas_bar.high = style.gas_range[1];
    text += slice_text(slice, image, drawing, gas_bar);
    const double side = camera.ahead[slice.axis] > 0.0 ? 1.0 : -1.0;
    if (!from.is_flat) is_hidden = [slice, side](Vec3 p) { return side * (p[slice.axis] - slice.place) < 0.0; };
  }
  text += grains_text(image, drawing, values.values, low, high, is_hidden);
  const double legend_left = right_end(camera, box) * style.aspect + 0.12;
  return text + legend_text(Overlay(camera, style.aspect), legend_left, grain_bar,
                            style.gas.empty() ? nullptr : &gas_bar, image);
}

}  // namespace moraine
