#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <span>
#include <sstream>

#include "io/checkpoint/durable_file.hpp"
#include "io/export/camera.hpp"
#include "io/export/colour_map.hpp"
#include "io/export/csv.hpp"
#include "io/export/export.hpp"
#include "io/export/gas_slice.hpp"
#include "io/export/grain_values.hpp"
#include "io/export/povray.hpp"
#include "io/export/povray_walls.hpp"
#include "io/export/render.hpp"
#include "io/export/run_tables.hpp"
#include "io/export/spectrum.hpp"
#include "io/export/tecplot.hpp"
#include "io/export/view.hpp"
#include "io/export/vtk.hpp"
#include "io/export/wall_mesh.hpp"
#include "io/snapshot/series.hpp"
#include "io/snapshot/snapshot.hpp"
#include "kernels/base/random.hpp"
#include "tests/unit/io_images.hpp"

using namespace moraine;
using moraine::testing::add_gas;
using moraine::testing::make_image;
using moraine::testing::TemporaryDirectory;
namespace fs = std::filesystem;

namespace {

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, at);) parts.push_back(part);
  return parts;
}

std::size_t count(const std::string& text, const std::string& word) {
  std::size_t n = 0;
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++n;
  return n;
}

/// A run directory with a few snapshots, without a scene.
void make_run(const fs::path& run) {
  SnapshotSeries series(run);
  for (const std::uint64_t step : {0u, 100u, 200u}) series.add(make_image(30, step, step + 1));
}

}  // namespace

TEST_CASE("a CSV export has one row a grain, gid first, and numbers that read back to the same bits") {
  const Image image = make_image(25);
  const std::vector<std::string> lines = split(csv_text(image), '\n');
  REQUIRE(lines.size() == 26);
  const std::vector<std::string> header = split(lines[0], ',');
  CHECK(header[0] == "gid");
  const auto column = std::find(header.begin(), header.end(), "velocity.y [m/s]") - header.begin();
  for (std::size_t i = 0; i < 25; ++i) {
    const std::vector<std::string> cells = split(lines[i + 1], ',');
    REQUIRE(cells.size() == header.size());
    CHECK(cells[0] == std::to_string(image.find(Field::gid)->gids[i]));
    CHECK(std::stod(cells[static_cast<std::size_t>(column)]) == image.find(Field::velocity)->reals[3 * i + 1]);
  }
}

TEST_CASE("a VTK export holds positions and fields at the offsets that its header names") {
  const Image image = make_image(25);
  const std::string text = vtp_text(image);
  const std::size_t data = text.find("encoding=\"raw\">\n_") + 17;
  for (const auto& [name, expected] : {std::pair("position", &image.find(Field::position)->reals),
                                       std::pair("radius", &image.find(Field::radius)->reals)}) {
    const std::size_t row = text.find(std::string("Name=\"") + name + '"');
    REQUIRE(row != std::string::npos);
    const std::size_t offset = std::stoull(text.substr(text.find("offset=\"", row) + 8));
    std::uint64_t length = 0;
    std::memcpy(&length, text.data() + data + offset, sizeof length);
    REQUIRE(length == expected->size() * sizeof(double));
    CHECK(std::memcmp(text.data() + data + offset + sizeof length, expected->data(), length) == 0);
  }
  CHECK(text.find("NumberOfPoints=\"25\" NumberOfVerts=\"25\"") != std::string::npos);
}

TEST_CASE("a VTK export of the gas holds scalars and vectors on cells at the offsets that its header names") {
  Image image = make_image(5);
  CHECK(vti_text(image).empty());
  add_gas(image, {3, 4, 5});
  for (const char* name : {"velocity_x", "velocity_y", "velocity_z"})
    image.grids.push_back({name, "m/s", {3, 4, 5}, std::vector<double>(60, name[9])});
  const std::string text = vti_text(image);
  CHECK(text.find("WholeExtent=\"0 3 0 4 0 5\"") != std::string::npos);
  CHECK(text.find("face_z") == std::string::npos);  // VTK has no place for it
  const std::size_t data = text.find("encoding=\"raw\">\n_") + 17;
  const auto values = [&](const std::string& name) {
    const std::size_t row = text.find("Name=\"" + name + '"');
    REQUIRE(row != std::string::npos);
    const std::size_t offset = std::stoull(text.substr(text.find("offset=\"", row) + 8));
    std::uint64_t length = 0;
    std::memcpy(&length, text.data() + data + offset, sizeof length);
    std::vector<double> found(length / sizeof(double));
    std::memcpy(found.data(), text.data() + data + offset + sizeof length, length);
    return found;
  };
  CHECK(values("pressure") == image.grids[2].values);
  const std::vector<double> velocity = values("velocity");
  REQUIRE(velocity.size() == 180);
  CHECK(velocity[3 * 59 + 0] == 'x');
  CHECK(velocity[3 * 59 + 2] == 'z');
}

TEST_CASE("pictures are coloured by any field, its length or component, or by what follows from it") {
  const Image image = make_image(10);
  const std::vector<double>& v = image.find(Field::velocity)->reals;
  CHECK(grain_values(image, "speed").label == "speed [m/s]");
  CHECK(grain_values(image, "speed").values[4] == Approx(std::sqrt(v[12] * v[12] + v[13] * v[13] + v[14] * v[14])));
  CHECK(grain_values(image, "velocity").values == grain_values(image, "speed").values);
  CHECK(grain_values(image, "velocity.z").values[4] == v[14]);
  CHECK(grain_values(image, "diameter").values[3] == 2 * image.find(Field::radius)->reals[3]);
  CHECK(grain_values(image, "gid").values[3] == 10);
  CHECK(grain_values(image, "material").label == "material");
  for (const char* name : {"colour", "radius.x", "velocity.w", ""})
    CHECK_THROWS_WITH(grain_values(image, name),
                      Catch::Contains("is not in the snapshot; it has position") && Catch::Contains("speed"));
}

TEST_CASE("the range of colours leaves out the few fastest grains and whatever is not a number") {
  std::vector<double> values(1000, 0.0);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = 10.0 + static_cast<double>(i) / 1000.0;
  values[0] = 1e9;
  values[1] = std::nan("");
  const auto [low, high] = usual_range(values);
  CHECK(low == Approx(10.0).margin(0.02));
  CHECK(high == Approx(11.0).margin(0.02));
  CHECK(usual_range({}).second == 0.0);
}

TEST_CASE("the colours run from dark to light without a step back") {
  double last = 0.0;
  for (int i = 0; i <= 100; ++i) {
    const Colour c = viridis(i / 100.0);
    const double light = 0.2126 * c.red + 0.7152 * c.green + 0.0722 * c.blue;
    CHECK(light > last);
    last = light;
  }
  CHECK(viridis(-3).blue == viridis(0).blue);
  CHECK(viridis(std::nan("")).blue == viridis(0).blue);
}

TEST_CASE(
    "the camera sees the whole box and leaves the legend its place, from any side and for any shape of box and "
    "picture") {
  for (const Vec3 size : {Vec3{1, 1, 1}, Vec3{1, 1, 30}, Vec3{100, 1, 1}, Vec3{1e-3, 2e-3, 0}})
    for (const double azimuth : {-62.0, 0.0, 135.0})
      for (const double elevation : {18.0, 90.0, -30.0})
        for (const double aspect : {1.0, 1.78, 0.6})
          for (const bool is_parallel : {false, true}) {
            const Box box{{5, 6, 7}, Vec3{5, 6, 7} + size};
            const Camera camera = frame_box(box, upright_for(size), azimuth, elevation, aspect, 0.1, is_parallel);
            double left = 1e9, right = -1e9, bottom = 1e9, top = -1e9;
            for (int i = 0; i < 8; ++i) {
              const Vec3 p =
                  camera.project({(i & 1) != 0 ? box.high.x : box.low.x, (i & 2) != 0 ? box.high.y : box.low.y,
                                  (i & 4) != 0 ? box.high.z : box.low.z});
              left = std::min(left, p.x), right = std::max(right, p.x), bottom = std::min(bottom, p.y),
              top = std::max(top, p.y);
              CHECK(p.z > 0.0);
            }
            INFO("size " << size.x << ' ' << size.y << ' ' << size.z << " from " << azimuth << ' ' << elevation);
            CHECK(left > -1.0);
            CHECK(right < 0.85);
            CHECK(bottom > -1.0);
            CHECK(top < 1.0);
            CHECK(std::abs(dot(cross(camera.ahead, camera.up), camera.right) - 1.0) < 1e-12);
          }
}

TEST_CASE("a POV-Ray scene has a sphere for each grain, the walls that exist at its time, and a legend") {
  const Image image = make_image(40);
  Scene scene;
  scene.domain = {image.domain.low, image.domain.high};
  scene.walls.push_back({"floor", "", PlaneShape{{0, 0, 0}, {0, 0, 1}}});
  scene.walls.push_back({"gone", "", DiscShape{{1, 0, 1}, {0, 0, 1}, 0.5}, false, false, 0.0, 0.001});
  scene.walls.push_back({"mirror", "", PlaneShape{{0, 0, 0}, {1, 0, 0}}, true, true});
  scene.walls.push_back({"funnel", "", ConeShape{{1, 0, 0.5}, {0, 0, 1}, 0.1, 0.6, 1.0}});
  const std::string text = povray_text(image, &scene, {});
  CHECK(count(text, "sphere {") == 40);
  CHECK(text.find("// wall floor") != std::string::npos);
  CHECK(text.find("// wall funnel") != std::string::npos);
  CHECK(text.find("// wall gone") == std::string::npos);
  CHECK(text.find("// wall mirror") == std::string::npos);
  CHECK(text.find("speed [m/s]") != std::string::npos);
  CHECK(text.find("40 grains") != std::string::npos);
}

TEST_CASE("frames are counted from the first, or from the last by negative numbers") {
  const TemporaryDirectory run;
  make_run(run.path());
  const Frames frames = find_frames(run.path());
  CHECK(frame_label(frames.at(0)) == "000000000000");
  CHECK(frame_label(frames.at(-1)) == "000000000200");
  CHECK(frames.at(1) == frames.at(-2));
  CHECK_THROWS_WITH(frames.at(3), Catch::Contains("frame 3 does not exist") && Catch::Contains("frames 0 to 2"));
  CHECK_THROWS_AS(frames.at(-4), ExportError);
  CHECK_THROWS_WITH(find_frames(run.path() / "nowhere"), Catch::Contains("does not exist"));
  CHECK_THROWS_WITH(find_frames(run.path() / "snapshots"), Catch::Contains("holds no snapshots"));
}

TEST_CASE("an export writes every frame, and the file that strings them together") {
  const TemporaryDirectory run;
  make_run(run.path());
  export_run({run.path(), ExportKind::vtk, std::nullopt, "speed", std::nullopt});
  const std::string series = read_file(run.path() / "vtk" / "grains.pvd");
  CHECK(count(series, "<DataSet") == 3);
  CHECK(series.find("timestep=\"0.02\" part=\"0\" file=\"grains_000000000200.vtp\"") != std::string::npos);
  CHECK(fs::exists(run.path() / "vtk" / "grains_000000000100.vtp"));
  export_run({run.path(), ExportKind::csv, 1, "speed", run.path() / "tables"});
  CHECK(read_file(run.path() / "tables" / "times.csv") == "time [s],file\n0.01,grains_000000000100.csv\n");
  CHECK_THROWS_AS(export_run({run.path(), ExportKind::povray, 0, "colour", std::nullopt}), ExportError);
}

TEST_CASE("an export of a run with gas has a series of its own for the gas") {
  const TemporaryDirectory run;
  Image image = make_image(5, 100);
  add_gas(image, {3, 4, 5});
  SnapshotSeries(run.path()).add(image);
  const std::string said = export_run({run.path(), ExportKind::vtk, std::nullopt, "speed", std::nullopt});
  CHECK(said.ends_with("grains.pvd and " + (run.path() / "vtk" / "gas.pvd").string()));
  CHECK(read_file(run.path() / "vtk" / "gas.pvd").find("file=\"gas_000000000100.vti\"") != std::string::npos);
  CHECK(read_file(run.path() / "vtk" / "gas_000000000100.vti") ==
        vti_text(read_snapshot(list_snapshots(run.path())[0])));
}

TEST_CASE("a picture is made of a snapshot by POV-Ray") {
  if (std::system("command -v povray >/dev/null 2>&1") != 0) {
    WARN("skipped: no povray");
    return;
  }
  const TemporaryDirectory run;
  make_run(run.path());
  RenderRequest request;
  request.run = run.path();
  request.size = "64x48";
  render_run(request);
  const std::string picture = read_file(run.path() / "pictures" / "000000000200.png");
  CHECK(picture.starts_with("\x89PNG"));
  CHECK(static_cast<unsigned char>(picture[19]) == 64);  // width and height in the header of the file
  CHECK(static_cast<unsigned char>(picture[23]) == 48);
}

TEST_CASE("a missing POV-Ray, a size, a frame or a field that cannot be is named") {
  const TemporaryDirectory run;
  make_run(run.path());
  RenderRequest request;
  request.run = run.path();
  for (const char* size : {"", "100", "100x", "0x0", "100x100x100", "100000x100"}) {
    request.size = size;
    CHECK_THROWS_WITH(render_run(request), Catch::Contains("expected WIDTHxHEIGHT"));
  }
  request.size = "64x48";
  request.frame = "last";
  CHECK_THROWS_WITH(render_run(request), Catch::Contains("frame \"last\""));
  request.frame = "0";
  const std::string path = std::getenv("PATH");
  setenv("PATH", "/nowhere", 1);
  CHECK_THROWS_WITH(render_run(request),
                    Catch::Contains("povray is not installed") && Catch::Contains("apt-get install povray"));
  setenv("PATH", path.c_str(), 1);
}

TEST_CASE("walls become triangles with their area, and planes are cut by the box") {
  const auto area_of = [](const WallMesh& mesh) {
    double area = 0.0;
    for (const auto& [a, b, c] : mesh.triangles) area += 0.5 * length(cross(b - a, c - a));
    return area;
  };
  const Box box{{0, 0, 0}, {1, 2, 3}};
  std::vector<WallDefinition> walls(7);
  walls[0].shape = PlaneShape{{0, 0, 0}, {0, 0, 1}};
  walls[1].shape = BoxShape{box};
  walls[2].shape = CylinderShape{{0.5, 1, 0}, {0, 0, 1}, 0.5, 2.0};
  walls[3].shape = CylinderShape{{0.5, 1, 1}, {0, 0, 1}, 0.5, infinity};
  walls[4].shape = DiscShape{{0, 0, 0}, {0, 0, 1}, 1.0, 0.5};
  walls[5].shape = PlaneShape{{0, 0, 0}, {0, 0, 1}};
  walls[5].symmetry = true;
  walls[6].shape = MeshShape{"", {{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}}};
  const std::vector<WallMesh> meshes = wall_meshes(walls, box);
  REQUIRE(meshes.size() == 6);  // a mirror is not to be seen
  const double pi = 3.14159265358979;
  const std::vector<double> areas = {2.0, 22.0, 2.0 * pi, 2.0 * pi, 0.75 * pi, 1.0};
  for (std::size_t k = 0; k < areas.size(); ++k) CHECK(area_of(meshes[k]) == Approx(areas[k]).epsilon(0.005));
  CHECK(meshes[5].lines.size() == 4);  // its rim, not the diagonal
}

TEST_CASE("time series are read back, profiles apart from the rest") {
  const TemporaryDirectory directory;
  write_file(directory.path() / "flow.csv",
             "step,time [s],left,mass left [kg],velocity z at z 0.05 m [m/s],velocity z at z 0.15 m [m/s]\n"
             "0,0,0,0,1,2\n10,0.5,3,1e-3,nan,4\n20,1.0,5,");
  write_file(directory.path() / "hashes.csv", "step,time [s],state_hash\n0,0,zzz\n");
  write_file(directory.path() / "mine.csv", "a,b\n1,2\n");
  const std::vector<RunTable> tables = read_run_tables(directory.path());
  REQUIRE(tables.size() == 1);
  CHECK(tables[0].name == "flow");
  CHECK(tables[0].time == std::vector<double>{0.0, 0.5});  // the last row is still being written
  REQUIRE(tables[0].columns.size() == 4);
  CHECK(tables[0].columns[1].values == std::vector<double>{0.0, 1e-3});
  CHECK(tables[0].columns[3].quantity == "velocity z");
  CHECK(tables[0].columns[3].axis == "z");
  CHECK(tables[0].columns[3].place == 0.15);
  CHECK(std::isnan(tables[0].columns[2].values[1]));
  const std::vector<ColumnGroup> groups = column_groups(tables[0]);
  REQUIRE(groups.size() == 3);
  CHECK(groups[1].unit == "kg");
  CHECK(groups[2].is_profile());
  CHECK(groups[2].columns == std::vector<std::size_t>{2, 3});
}

TEST_CASE("a slice of the gas has the cells of the middle layer, and unknown quantities are named") {
  Image image = make_image(3);
  add_gas(image, {3, 4, 5});
  const GridArray& first = *std::find_if(image.grids.begin(), image.grids.end(), [](const GridArray& grid) {
    return grid.n == std::array{3, 4, 5};
  });
  const GasSlice slice = gas_slice(image, first.name, 1);
  CHECK(slice.n == std::array{3, 5});
  REQUIRE(slice.values.size() == 15);
  CHECK(slice.values[4] == first.values[(1 * 4 + 2) * 3 + 1]);
  CHECK_THROWS_WITH(gas_slice(image, "nothing", 1), Catch::Contains("\"nothing\" is no quantity of the gas"));
  CHECK_THROWS_WITH(gas_slice(make_image(3), "pressure", 1), Catch::Contains("there is no gas"));
}

TEST_CASE("a spectrum has the power of a wave at its frequency, and the variance of noise in all") {
  constexpr std::size_t n = 4096;
  constexpr double step = 0.01, pi = 3.14159265358979323846;
  std::vector<double> time, wave, noise;
  double variance = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    time.push_back(3.0 + step * static_cast<double>(k));
    wave.push_back(200.0 + 7.0 * std::sin(2.0 * pi * 6.25 * time[k]));  // 64 periods in a piece
    noise.push_back(random_normal(1, k, RandomPurpose::velocity));
    variance += noise[k] * noise[k] / static_cast<double>(n);
  }
  const auto integral = [](const Spectrum& spectrum, double low, double high) {
    double sum = 0.0;
    for (std::size_t f = 0; f < spectrum.frequency.size(); ++f)
      if (spectrum.frequency[f] > low && spectrum.frequency[f] < high)
        sum += spectrum.density[f] * spectrum.frequency[0];
    return sum;
  };
  const auto of_wave = spectrum_of(time, wave), of_noise = spectrum_of(time, noise);
  REQUIRE(of_wave);
  REQUIRE(of_noise);
  CHECK(of_wave->n_pieces == 7);
  CHECK(of_wave->frequency.front() == Approx(1.0 / (1024 * step)));
  CHECK(of_wave->frequency.back() == Approx(0.5 / step));
  CHECK(integral(*of_wave, 0.0, 1e3) == Approx(0.5 * 7.0 * 7.0).epsilon(1e-9));
  CHECK(integral(*of_wave, 6.0, 6.5) == Approx(0.5 * 7.0 * 7.0).epsilon(1e-9));
  const auto most = std::max_element(of_wave->density.begin(), of_wave->density.end()) - of_wave->density.begin();
  CHECK(of_wave->frequency[static_cast<std::size_t>(most)] == Approx(6.25));
  CHECK(integral(*of_noise, 0.0, 1e3) == Approx(variance).epsilon(0.05));
  CHECK(integral(*of_noise, 0.0, 25.0) == Approx(0.5 * variance).epsilon(0.1));
}

TEST_CASE("no spectrum is made of few values, of gaps, or of what is no number") {
  std::vector<double> time, values;
  for (int k = 0; k < 100; ++k) {
    time.push_back(0.1 * k + (k % 2 == 0 ? 0.004 : 0.0));  // as steps of a run fall
    values.push_back(k % 7);
  }
  CHECK(spectrum_of(time, values));
  CHECK_FALSE(spectrum_of(std::span(time).first(63), std::span(values).first(63)));
  values[50] = std::nan("");
  CHECK_FALSE(spectrum_of(time, values));
  values[50] = 0.0;
  for (std::size_t k = 60; k < 100; ++k) time[k] += 0.1;
  CHECK_FALSE(spectrum_of(time, values));
}

TEST_CASE("Tecplot files have a zone with every grain") {
  const std::vector<std::string> lines = split(tecplot_grains(make_image(7)), '\n');
  REQUIRE(lines.size() == 3 + 7 + 7);
  CHECK(lines[1].find("\"X\" \"Y\" \"Z\"") != std::string::npos);
  CHECK(lines[2].find("NODES=7, ELEMENTS=7, ZONETYPE=FETRIANGLE, DATAPACKING=POINT") != std::string::npos);
  CHECK(lines[3 + 7 + 6] == "7 7 7");
  CHECK(split(tecplot_grains(make_image(0)), '\n').size() == 3);
}

TEST_CASE("a page can be made of one snapshot, of no grains, and not of an unknown field") {
  const TemporaryDirectory directory;
  write_snapshot(directory.path() / "some.h5", make_image(5));
  write_snapshot(directory.path() / "none.h5", make_image(0));
  for (const char* name : {"some.h5", "none.h5"}) {
    ViewRequest request;
    request.run = directory.path() / name;
    request.out = directory.path() / "page.html";
    view_run(request);
    CHECK(read_file(*request.out).find("\"n\":") != std::string::npos);
    request.field = "colour";
    CHECK_THROWS_WITH(view_run(request), Catch::Contains("field \"colour\" is not in the snapshot"));
  }
}
