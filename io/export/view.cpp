#include "io/export/view.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "io/checkpoint/durable_file.hpp"
#include "io/export/camera.hpp"
#include "io/export/colour_map.hpp"
#include "io/export/grain_values.hpp"
#include "io/export/povray.hpp"
#include "io/export/run_tables.hpp"
#include "io/export/wall_mesh.hpp"
#include "io/snapshot/snapshot.hpp"
#include "kernels/base/random.hpp"
#include "moraine_view_page.hpp"  // view_page, view_script: io/export/view, embedded at build time

namespace moraine {

namespace fs = std::filesystem;
using Json = nlohmann::json;

namespace {

constexpr std::size_t most_rows = 400;  // of a time series: more cannot be told apart on a screen

std::string base64(const std::string& bytes) {
  static constexpr char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const auto byte = [&](std::size_t k) {
      return k < bytes.size() ? static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[k])) : 0u;
    };
    const std::uint32_t word = byte(i) << 16 | byte(i + 1) << 8 | byte(i + 2);
    for (std::uint32_t k = 0; k < 4; ++k)
      text += k == 0 || i + k - 1 < bytes.size() ? digits[word >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

/// As browsers inflate it ("deflate": zlib's format).
std::string deflated(const std::string& bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::string packed(size, '\0');
  if (compress2(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()),
                static_cast<uLong>(bytes.size()), 6) != Z_OK)
    throw ExportError("the frames cannot be compressed: not enough memory");
  packed.resize(size);
  return packed;
}

template <typename T>
void append(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// A share from 0 to 1 as a whole number of that type.
template <typename T>
T quantised(double share) {
  constexpr double most = std::numeric_limits<T>::max();
  return std::isfinite(share) ? static_cast<T>(std::lround(std::clamp(share, 0.0, 1.0) * most)) : T{0};
}

/// The same grains in each frame: those whose gid, shaken, falls below a bound.
bool is_chosen(std::uint64_t gid, double share) {
  return share >= 1.0 || static_cast<double>(mix64(gid + 0x9e3779b97f4a7c15ULL) >> 11) * 0x1.0p-53 < share;
}

/// What holds for all frames.
struct Scale {
  Box box;  // [m]
  double largest_radius = 0.0;
  double low = 0.0, high = 0.0;  // of the values
  double share = 1.0;            // of the grains that are shown
};

/// x, y, z of all grains, then radii, as 16-bit shares of the box and the largest radius, then values in 8 bits.
std::string frame_bytes(const Image& image, const std::vector<double>& values, const Scale& scale, std::size_t& n) {
  const std::vector<double>& x = image.find(Field::position)->reals;
  const std::vector<double>& radius = image.find(Field::radius)->reals;
  const std::vector<std::uint64_t>& gids = image.find(Field::gid)->gids;
  std::vector<std::size_t> shown;
  for (std::size_t i = 0; i < radius.size(); ++i)
    if (is_chosen(gids[i], scale.share)) shown.push_back(i);
  n = shown.size();
  std::string bytes;
  const Vec3 size = scale.box.size();
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const std::size_t i : shown) {
      const int a = static_cast<int>(axis);
      const double extent = std::max(size[a], 1e-300);
      append(bytes, quantised<std::uint16_t>((x[3 * i + axis] - scale.box.low[a]) / extent));
    }
  for (const std::size_t i : shown) append(bytes, quantised<std::uint16_t>(radius[i] / scale.largest_radius));
  for (const std::size_t i : shown)
    append(bytes,
           quantised<std::uint8_t>(scale.high > scale.low ? (values[i] - scale.low) / (scale.high - scale.low) : 0.5));
  return bytes;
}

std::vector<fs::path> even_share(const std::vector<fs::path>& all, std::uint64_t most) {
  if (all.size() <= most || most < 2) return most < 2 ? std::vector{all.back()} : all;
  std::vector<fs::path> some;
  for (std::uint64_t k = 0; k < most; ++k) some.push_back(all[k * (all.size() - 1) / (most - 1)]);
  return some;
}

Image read_frame(const fs::path& file) {
  Image image = read_image_file(file).image;
  for (const Field field : {Field::position, Field::radius, Field::gid})
    if (image.find(field) == nullptr)
      throw ExportError(file.string() + ": a page needs the fields position, radius and gid in the snapshots");
  return image;
}

/// One pass over all frames; they may be too many to keep.
Scale scale_of(const std::vector<fs::path>& files, const Scene* scene, const ViewRequest& request) {
  Scale scale;
  scale.box = Box::empty();
  scale.low = infinity, scale.high = -infinity;
  std::uint64_t most = 0;
  for (const fs::path& file : files) {
    const Image image = read_frame(file);
    const Box box = frame_of(image, scene);
    scale.box.include(box.low);
    scale.box.include(box.high);
    for (const double radius : image.find(Field::radius)->reals)
      scale.largest_radius = std::max(scale.largest_radius, radius);
    const std::vector<double> values = grain_values(image, request.field).values;
    most = std::max<std::uint64_t>(most, values.size());
    if (values.empty()) continue;
    const auto range = usual_range(values);
    scale.low = std::min(scale.low, range.first);
    scale.high = std::max(scale.high, range.second);
  }
  if (request.range.size() == 2) scale.low = request.range[0], scale.high = request.range[1];
  if (!(scale.low <= scale.high)) scale.low = scale.high = 0.0;
  if (!(scale.largest_radius > 0.0)) scale.largest_radius = 1.0;
  if (most > request.most_grains) scale.share = static_cast<double>(request.most_grains) / static_cast<double>(most);
  return scale;
}

Json json_of(Vec3 v) { return {v.x, v.y, v.z}; }

template <std::size_t n>
std::string floats_of(const std::vector<std::array<Vec3, n>>& shapes) {
  std::string bytes;
  for (const auto& shape : shapes)
    for (const Vec3 p : shape)
      for (int axis = 0; axis < 3; ++axis) append(bytes, static_cast<float>(p[axis]));
  return base64(bytes);
}

/// East, north and up of the pictures; in two dimensions they are seen from above.
Json upright_json(const Scene* scene) {
  const Upright frame =
      scene != nullptr && scene->domain.dimensions == 3 ? upright_for(scene->time.gravity) : Upright();
  return {json_of(frame.east), json_of(frame.north), json_of(frame.up)};
}

Json json_of(const std::vector<WallMesh>& walls) {
  Json all = Json::array();
  for (const WallMesh& wall : walls) {
    Json one = {{"name", wall.name},
                {"from", wall.from},
                {"triangles", floats_of(wall.triangles)},
                {"lines", floats_of(wall.lines)}};
    if (std::isfinite(wall.until)) one["until"] = wall.until;
    all.push_back(one);
  }
  return all;
}

/// Every so many rows, so that few remain; of profiles the rows of the middle suffice for a glance, too. What never changes comes last.
Json json_of(const std::vector<RunTable>& tables) {
  Json all = Json::array(), unchanging = Json::array();
  for (const RunTable& table : tables) {
    const std::size_t stride = (table.time.size() + most_rows - 1) / most_rows;
    const auto thinned = [&](const std::vector<double>& values) {
      Json some = Json::array();
      for (std::size_t i = 0; i < values.size(); i += stride)
        some.push_back(std::isfinite(values[i]) ? Json(static_cast<double>(static_cast<float>(values[i]))) : Json());
      return some;
    };
    for (const ColumnGroup& group : column_groups(table)) {
      Json one = {{"name", table.name}, {"unit", group.unit}, {"time", thinned(table.time)}, {"lines", Json::array()}};
      if (group.is_profile()) one["name"] = table.name + ": " + group.quantity;
      for (const std::size_t k : group.columns) {
        const TableColumn& column = table.columns[k];
        const std::string label = column.place ? fmt::format("{} {:.4g} m", column.axis, *column.place) : column.name;
        one["lines"].push_back({{"name", label}, {"values", thinned(column.values)}});
      }
      const bool changes = std::any_of(group.columns.begin(), group.columns.end(), [&](std::size_t k) {
        const std::vector<double>& values = table.columns[k].values;
        return std::any_of(values.begin(), values.end(),
                           [&](double value) { return std::isfinite(value) && value != values[0]; });
      });
      (changes ? all : unchanging).push_back(one);
    }
  }
  all.insert(all.end(), unchanging.begin(), unchanging.end());
  return all;
}

std::string palette() {
  std::string bytes;
  for (int i = 0; i < 256; ++i) {
    const Colour colour = viridis(i / 255.0);
    for (const double part : {colour.red, colour.green, colour.blue, 1.0}) append(bytes, quantised<std::uint8_t>(part));
  }
  return base64(bytes);
}

std::string replaced(std::string text, const std::string& mark, const std::string& by) {
  return text.replace(text.find(mark), mark.size(), by);
}

std::string escaped_html(const std::string& text) {
  std::string out;
  for (const char c : text)
    out += c == '&'   ? std::string("&amp;")
           : c == '<' ? std::string("&lt;")
           : c == '>' ? std::string("&gt;")
                      : std::string(1, c);
  return out;
}

/// JSON inside of a script element: nothing in it may end the element.
std::string inside_script(const Json& json) {
  std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  for (std::size_t at = 0; (at = text.find('<', at)) != std::string::npos; at += 6) text.replace(at, 1, "\\u003c");
  return text;
}

}  // namespace

std::string view_run(const ViewRequest& request) {
  if (!request.range.empty() && !(request.range[0] < request.range[1]))
    throw ExportError("range: the least value of the colours must be below the greatest");
  const Frames frames = find_frames(request.run);
  std::string why_no_scene;
  const std::optional<Scene> scene = scene_of(frames, why_no_scene);
  const std::vector<fs::path> files = even_share(frames.files, request.most_frames);
  const Scale scale = scale_of(files, scene ? &*scene : nullptr, request);

  const std::string title =
      scene && !scene->title.empty() ? scene->title : fs::absolute(request.run).filename().string();
  Json page = {{"title", title},
               {"low", json_of(scale.box.low)},
               {"high", json_of(scale.box.high)},
               {"flat", scene && scene->domain.dimensions == 2},
               {"upright", upright_json(scene ? &*scene : nullptr)},
               {"radius", scale.largest_radius},
               {"range", {scale.low, scale.high}},
               {"share", scale.share},
               {"palette", palette()},
               {"walls", json_of(scene ? wall_meshes(scene->walls, scale.box) : std::vector<WallMesh>())},
               {"series", frames.is_run ? json_of(read_run_tables(frames.directory)) : Json::array()},
               {"frames", Json::array()}};
  for (const fs::path& file : files) {
    const Image image = read_frame(file);
    const GrainValues values = grain_values(image, request.field);
    page["label"] = values.label;
    std::size_t n = 0;
    const std::string bytes = frame_bytes(image, values.values, scale, n);
    page["frames"].push_back({{"time", image.time},
                              {"step", image.step},
                              {"grains", image.n_grains},
                              {"n", n},
                              {"data", base64(deflated(bytes))}});
  }

  const fs::path out = request.out ? *request.out : frames.directory / "view.html";
  std::string html = replaced(view_page, "<!-- title -->", escaped_html(title));
  html = replaced(std::move(html), "/* data */", inside_script(page));
  html = replaced(std::move(html), "/* script */", view_script);
  write_file(out, html);
  std::string text = fmt::format("{}: {} of {} frames, {:.1f} MB; open it in a browser\n", out.string(), files.size(),
                                 frames.files.size(), static_cast<double>(html.size()) / 1e6);
  if (scale.share < 1.0)
    text += fmt::format("an even {:.2g} % of the grains is shown; --grains shows more\n", 100.0 * scale.share);
  if (!scene) text += "without walls: " + why_no_scene + '\n';
  return text;
}

}  // namespace moraine
