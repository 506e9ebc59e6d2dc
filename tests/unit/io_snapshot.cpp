#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "io/checkpoint/image_file.hpp"
#include "io/export/vtk.hpp"
#include "io/snapshot/compare.hpp"
#include "io/snapshot/describe.hpp"
#include "io/snapshot/field_series.hpp"
#include "io/snapshot/series.hpp"
#include "io/snapshot/snapshot.hpp"
#include "tests/unit/io_images.hpp"

using namespace moraine;
using moraine::testing::add_gas;
using moraine::testing::is_same;
using moraine::testing::make_image;
using moraine::testing::TemporaryDirectory;
namespace fs = std::filesystem;

namespace {

/// What a snapshot keeps of an image: no histories.
Image grains_only(Image image) {
  image.pairs.clear();
  image.further.clear();
  image.walls.clear();
  image.accumulators.clear();
  return image;
}

FieldArray& field_of(Image& image, Field field) {
  return *std::find_if(image.fields.begin(), image.fields.end(),
                       [&](const FieldArray& array) { return array.field == field; });
}

/// A Python that has h5py; empty where there is none.
std::string python_with_h5py() {
  for (const char* python : {"/usr/bin/python3", "python3"})
    if (std::system((std::string(python) + " -c 'import h5py, numpy' >/dev/null 2>&1").c_str()) == 0) return python;
  return {};
}

/// Output of a script run in a directory.
std::string run_python(const std::string& python, const fs::path& directory, const std::string& script) {
  std::ofstream(directory / "script.py") << script;
  const std::string command = "cd '" + directory.string() + "' && " + python + " script.py 2>&1";
  FILE* pipe = popen(command.c_str(), "r");
  std::string output;
  std::array<char, 4096> buffer;
  for (std::size_t n; (n = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0;) output.append(buffer.data(), n);
  pclose(pipe);
  return output;
}

}  // namespace

TEST_CASE("a snapshot gives back every field bit for bit, with time, domain and hash") {
  const TemporaryDirectory directory;
  for (const std::uint64_t n : {0u, 1u, 700u}) {
    const Image image = grains_only(make_image(n));
    write_snapshot(directory.path() / "s.h5", image);
    CHECK(is_same(read_snapshot(directory.path() / "s.h5"), image));
  }
}

TEST_CASE("a checkpoint is not taken for a snapshot, nor the other way round") {
  const TemporaryDirectory directory;
  write_snapshot(directory.path() / "s.h5", make_image(3));
  write_checkpoint(directory.path() / "c.h5", make_image(3), {});
  CHECK_THROWS_WITH(read_checkpoint(directory.path() / "s.h5"),
                    Catch::EndsWith("is a Moraine snapshot, expected a Moraine checkpoint"));
  CHECK_THROWS_WITH(read_snapshot(directory.path() / "c.h5"),
                    Catch::EndsWith("is a Moraine checkpoint, expected a Moraine snapshot"));
  CHECK(read_image_file(directory.path() / "s.h5").kind == "snapshot");
  CHECK(is_same(read_image_file(directory.path() / "c.h5").image, make_image(3)));
}

TEST_CASE("h5py reads a snapshot: shapes, units, values and order of gid") {
  const std::string python = python_with_h5py();
  if (python.empty()) {
    WARN("skipped: no python3 with h5py");
    return;
  }
  const TemporaryDirectory directory;
  const Image image = make_image(50);
  write_snapshot(directory.path() / "s.h5", image);
  const std::string output = run_python(python, directory.path(), R"(
import h5py
f = h5py.File("s.h5", "r")
p = f["particles"]
print(p["position"].shape, p["radius"].shape, p["gid"].dtype, p["material"].dtype)
print(p["position"].attrs["unit"], p["velocity"].attrs["unit"])
print(list(p["gid"][:3]), repr(float(p["position"][7, 2])))
print(f.attrs["kind"], f.attrs["step"], repr(float(f.attrs["time"])), f.attrs["state_hash"])
print([float(x) for x in f.attrs["domain_low"]], f.attrs["grains"])
)");
  char value[64];
  std::snprintf(value, sizeof value, "%.17g", image.find(Field::position)->reals[7 * 3 + 2]);
  std::vector<std::string> lines;
  for (std::size_t at = 0, end; (end = output.find('\n', at)) != std::string::npos; at = end + 1)
    lines.push_back(output.substr(at, end - at));
  INFO(output);
  REQUIRE(lines.size() == 5);
  CHECK(lines[0] == "(50, 3) (50,) uint64 uint16");
  CHECK(lines[1] == "m m/s");
  CHECK(lines[2].find("[1, 4, 7] ") == 0);
  CHECK(std::stod(lines[2].substr(10)) == std::stod(value));
  CHECK(lines[3] == "snapshot 120 0.012 " + image.hash.text());
  CHECK(lines[4] == "[0.0, -1.0, 0.0] 50");
}

TEST_CASE("a snapshot that another tool has rewritten is read, a checkpoint is not") {
  const std::string python = python_with_h5py();
  if (python.empty()) {
    WARN("skipped: no python3 with h5py");
    return;
  }
  const TemporaryDirectory directory;
  write_snapshot(directory.path() / "s.h5", grains_only(make_image(20)));
  write_checkpoint(directory.path() / "c.h5", make_image(20), {});
  run_python(python, directory.path(), R"(
import h5py
for name in "sc":
    with h5py.File(name + ".h5", "r") as a, h5py.File(name + "2.h5", "w") as b:
        for key in a: a.copy(key, b)
        for key, value in a.attrs.items(): b.attrs.create(key, value, dtype=a.attrs.get_id(key).dtype)
        b["particles"]["colour"] = [1.0] * 20
)");
  std::vector<std::string> unknown;
  CHECK(is_same(read_snapshot(directory.path() / "s2.h5", &unknown), grains_only(make_image(20))));
  CHECK(unknown == std::vector<std::string>{"colour"});
  CHECK_THROWS_WITH(read_checkpoint(directory.path() / "c2.h5"), Catch::Contains("without Moraine's checksums"));
}

TEST_CASE("the series lists every snapshot with its time, and each dataset it names is there in the shape it says") {
  const std::string python = python_with_h5py();
  if (python.empty()) {
    WARN("skipped: no python3 with h5py");
    return;
  }
  const TemporaryDirectory run;
  SnapshotSeries series(run.path());
  for (const std::uint64_t step : {0u, 100u, 200u}) series.add(make_image(10 + step / 10, step));
  const std::string output = run_python(python, run.path(), R"(
import h5py, xml.etree.ElementTree as et
root = et.parse("snapshots.xdmf").getroot()
grids = root.findall("./Domain/Grid/Grid")
n = 0
for grid in grids:
    count = int(grid.find("Topology").get("NumberOfElements"))
    for item in grid.iter("DataItem"):
        file, dataset = item.text.split(":")
        shape = tuple(int(x) for x in item.get("Dimensions").split())
        assert h5py.File(file, "r")[dataset].shape == shape and shape[0] == count, item.text
        n += 1
print(root.find("./Domain/Grid").get("CollectionType"), [g.find("Time").get("Value") for g in grids], n)
)");
  CHECK(output == "Temporal ['0', '0.01', '0.02'] " + std::to_string(3 * n_fields) + "\n");
}

TEST_CASE("grains and gas stand side by side in the series, each dataset of the gas in the shape of its mesh") {
  const std::string python = python_with_h5py();
  if (python.empty()) {
    WARN("skipped: no python3 with h5py");
    return;
  }
  const TemporaryDirectory run;
  SnapshotSeries series(run.path());
  for (const std::uint64_t step : {0u, 100u}) {
    Image image = make_image(10, step);
    add_gas(image, {4, 5, 6});
    series.add(image);
  }
  const std::string output = run_python(python, run.path(), R"(
import h5py, numpy, xml.etree.ElementTree as et
root = et.parse("snapshots.xdmf").getroot()
steps = root.findall("./Domain/Grid/Grid")
for step in steps:
    assert step.get("CollectionType") == "Spatial" and step.find("Time") is not None
    grains, gas = step.findall("Grid")
    assert grains.get("Name") == "grains" and gas.get("Name") == "gas"
    nodes = [int(x) for x in gas.find("Topology").get("Dimensions").split()]
    low, spacing = ([float(x) for x in item.text.split()] for item in gas.find("Geometry"))
    for attribute in gas.findall("Attribute"):
        file, dataset = attribute.find("DataItem").text.split(":")
        f = h5py.File(file, "r")
        shape = tuple(int(x) for x in attribute.find("DataItem").get("Dimensions").split())
        assert f[dataset].shape == shape == tuple(n - 1 for n in nodes), dataset
        assert list(f["gas"].attrs["cells"]) == list(shape[::-1])
        assert list(f["gas"].attrs["low"]) == low[::-1] and list(f["gas"].attrs["spacing"]) == spacing[::-1]
    for item in grains.iter("DataItem"):
        file, dataset = item.text.split(":")
        assert h5py.File(file, "r")[dataset].shape[0] == 10
print(len(steps), [a.get("Name") for a in gas.findall("Attribute")], nodes, f["gas/face_z"].shape,
      f["gas/pressure"].attrs["unit"], repr(float(f["gas/pressure"][5, 4, 3])))
)");
  Image image = make_image(10, 100);
  add_gas(image, {4, 5, 6});
  const std::size_t last = 4 * 5 * 6 - 1;
  char value[64];
  std::snprintf(value, sizeof value, "%.17g", image.grids[2].values[last]);
  INFO(output);
  const std::string expected = "2 ['a/b & \"c\"', 'pressure'] [7, 6, 5] (7, 5, 4) Pa ";
  REQUIRE(output.substr(0, expected.size()) == expected);
  CHECK(std::stod(output.substr(expected.size())) == std::stod(value));
  CHECK(SnapshotSeries(run.path()).size() == 2);
}

TEST_CASE("maps of forces on walls, and what fields have added up, come back bit for bit") {
  const TemporaryDirectory directory;
  Image image = make_image(5, 200);
  WallMap map;
  map.name = "drum / <left>";
  for (int k = 0; k < 18; ++k) map.corners.push_back(0.1 * k);
  map.force = {1, 2, 3, -4, 5e-300, 6};
  map.pressure = {7.5, 0.0};
  map.shear = {0.25, 1e9};
  image.maps = {map, map};
  image.maps[1].name = "blade";
  image.sums = {{"flow.mass", "kg", {3, 1, 2}, {1, 2, 3, 4, 5, 0.1}}};
  SnapshotSeries series(directory.path());
  series.add(image);
  const fs::path file = snapshot_directory(directory.path()) / snapshot_name(200);
  const std::vector<WallMap> maps = read_snapshot(file).maps;
  REQUIRE(maps.size() == 2);
  CHECK(maps[0] == image.maps[1]);  // in order of name
  CHECK(maps[1] == image.maps[0]);
  CHECK(read_snapshot(file).sums.empty());
  const std::string text = read_file(series.file());
  CHECK(text.find("<Grid Name=\"blade\" GridType=\"Uniform\">") != std::string::npos);
  CHECK(text.find(":/walls/blade/pressure</DataItem>") != std::string::npos);
  const std::string vtp = vtp_text(map, 0.5);
  CHECK(vtp.find("NumberOfPoints=\"6\"") != std::string::npos);
  CHECK(vtp.find("NumberOfPolys=\"2\"") != std::string::npos);

  write_checkpoint(directory.path() / "c.h5", image, {});
  const Image kept = read_checkpoint(directory.path() / "c.h5").image;
  CHECK(kept.maps.empty());
  REQUIRE(kept.sums.size() == 1);
  CHECK(kept.sums[0].name == "flow.mass");
  CHECK(kept.sums[0].n == image.sums[0].n);
  CHECK(kept.sums[0].values == image.sums[0].values);
  CHECK(kept.grids.empty());
}

TEST_CASE("coarse-grained fields come back as they were written, and stand in a series that goes on after a restart") {
  const TemporaryDirectory run;
  FieldImage fields;
  fields.name = "flow";
  fields.time_step = 1e-4;
  fields.from = 0.001;
  fields.n_samples = 3;
  fields.box = {{-1, 0, 2}, {1, 1, 3}};
  fields.n = {2, 1, 3};
  fields.arrays = {{"density", "kg/m3", fields.n, {1, 2, 3, 4, 5, 6}},
                   {"glass.velocity_x", "m/s", fields.n, {0, 0, 0, 0, 0, 0.1}}};
  FieldSeries series(run.path(), "flow");
  for (const std::uint64_t step : {100u, 200u, 300u}) {
    fields.step = step;
    fields.time = 1e-4 * static_cast<double>(step);
    series.add(fields, World(), true);
  }
  const std::vector<fs::path> files = list_field_files(run.path());
  REQUIRE(files.size() == 3);
  const FieldImage back = read_field_image(files[2]);
  CHECK(back.name == "flow");
  CHECK(back.step == 300);
  CHECK(back.n_samples == 3);
  CHECK(back.from == fields.from);
  CHECK(back.box == fields.box);
  CHECK(back.n == fields.n);
  REQUIRE(back.arrays.size() == 2);
  CHECK(back.arrays[1].name == "glass.velocity_x");
  CHECK(back.arrays[1].unit == "m/s");
  CHECK(back.arrays[0].values == fields.arrays[0].values);
  CHECK(csv_of_fields(fields).substr(0, 69) ==
        "x [m],y [m],z [m],density [kg/m3],glass.velocity_x [m/s]\n-0.5,0.5,2.1");
  FieldSeries again(run.path(), "flow");
  CHECK(again.contains(300));
  again.drop_from(200);
  CHECK(list_field_files(run.path()).size() == 1);
  CHECK(!fs::exists(run.path() / "fields" / "flow_000000000200.csv"));
  CHECK(read_file(again.file()).find("step 200") == std::string::npos);
  CHECK(FieldSeries(run.path(), "other").contains(100) == false);
}

TEST_CASE("a series takes up its entries with gas as they are, and drops them whole") {
  const TemporaryDirectory run;
  std::string before;
  {
    SnapshotSeries series(run.path());
    for (const std::uint64_t step : {0u, 100u, 200u}) {
      Image image = make_image(5, step);
      if (step != 100) add_gas(image, {2, 2, 2});
      series.add(image);
      if (step == 100) before = read_file(series.file());
    }
  }
  SnapshotSeries series(run.path());
  CHECK(series.drop_from(200) == 1);
  CHECK(read_file(series.file()) == before);
}

TEST_CASE("a series that goes on from a restart drops what lies after it and takes up what a crash left unlisted") {
  const TemporaryDirectory run;
  {
    SnapshotSeries series(run.path());
    for (const std::uint64_t step : {0u, 100u, 200u, 300u}) series.add(make_image(5, step));
  }
  // A crash between the snapshot and the series: written, not listed.
  write_snapshot(snapshot_directory(run.path()) / snapshot_name(250), make_image(5, 250));
  SnapshotSeries series(run.path());
  CHECK(series.size() == 5);
  CHECK(series.contains(250));
  CHECK(series.drop_from(201) == 2);
  CHECK(list_snapshots(run.path()).size() == 3);
  const std::string text = read_file(series.file());
  CHECK(text.find("step 200\"") != std::string::npos);
  CHECK(text.find("step 250\"") == std::string::npos);
  CHECK(text.find("step 300\"") == std::string::npos);
  series.add(make_image(5, 250));
  series.add(make_image(5, 300));
  CHECK(SnapshotSeries(run.path()).size() == 5);
}

TEST_CASE("images with equal bits are equal") {
  const Comparison result = compare(make_image(100), make_image(100));
  CHECK(result.is_equal);
  CHECK(comparison_text(result) == "equal\n");
}

TEST_CASE("the largest difference of a field is found with its grain, component and values") {
  const Image a = make_image(100);
  Image b = a;
  auto& velocity = field_of(b, Field::velocity).reals;
  velocity[3 * 10 + 0] += 1e-9;
  velocity[3 * 40 + 1] -= 0.25;
  velocity[3 * 70 + 2] += 0.125;
  const Comparison result = compare(a, b);
  CHECK_FALSE(result.is_equal);
  REQUIRE(result.fields.size() == 1);
  CHECK(result.fields[0].name == "velocity");
  CHECK(result.fields[0].n_different == 3);
  CHECK(result.fields[0].largest == Approx(0.25).epsilon(1e-14));
  CHECK(result.fields[0].gid == 121);
  CHECK(result.fields[0].component == 1);
  CHECK(result.fields[0].value_a - result.fields[0].value_b == result.fields[0].largest);
  CHECK_THAT(comparison_text(result), Catch::Contains("velocity.y") && Catch::EndsWith("not equal\n"));
}

TEST_CASE("one bit, a sign of zero, or a value that is not a number makes images unequal") {
  const Image a = make_image(10);
  for (const double value : {std::nextafter(a.find(Field::radius)->reals[3], 1.0), -0.0, std::nan("")}) {
    Image c = a, d = a;
    if (value == 0.0) field_of(c, Field::radius).reals[3] = 0.0;
    field_of(d, Field::radius).reals[3] = value;
    const Comparison result = compare(c, d);
    CHECK_FALSE(result.is_equal);
    REQUIRE(result.fields.size() == 1);
    CHECK(result.fields[0].gid == 10);
    if (std::isnan(value)) CHECK(std::isinf(result.fields[0].largest));
  }
}

TEST_CASE("grains, fields, histories and counters that only one image has make them unequal") {
  const Image a = make_image(10);
  Image fewer = a;
  fewer.fields.clear();
  fewer.n_grains = 9;
  for (FieldArray array : a.fields) {
    const auto width = static_cast<std::size_t>(info(array.field).components);
    if (!array.reals.empty()) array.reals.resize(9 * width);
    if (!array.gids.empty()) array.gids.resize(9);
    if (!array.indices.empty()) array.indices.resize(9);
    fewer.fields.push_back(array);
  }
  const Comparison grains = compare(a, fewer);
  CHECK_FALSE(grains.is_equal);
  CHECK(grains.n_only_a == 1);
  CHECK(grains.n_common == 9);
  CHECK(grains.fields.empty());

  Image other = a;
  other.pairs[2].displacement[1] = 5;
  CHECK(compare(a, other).notes == std::vector<std::string>{"contact histories: 1 of 9 differ"});
  other = a;
  other.accumulators["born"][0] += 1;
  CHECK(compare(a, other).notes == std::vector<std::string>{"accumulator 'born' differs"});
  other = a;
  std::erase_if(other.fields, [](const FieldArray& array) { return array.field == Field::force; });
  CHECK(compare(a, other).notes == std::vector<std::string>{"field force is only in A"});
  CHECK(compare(a, grains_only(a)).is_equal);
}

TEST_CASE("the largest difference of a quantity of the gas is found with its cell and values") {
  Image a = make_image(10);
  add_gas(a, {4, 5, 6});
  CHECK(compare(a, a).is_equal);
  Image b = a;
  b.grids[2].values[7] += 1e-9;
  b.grids[2].values[1 + 4 * (2 + 5 * 3)] -= 0.5;
  const Comparison result = compare(a, b);
  CHECK_FALSE(result.is_equal);
  CHECK(result.fields.empty());
  REQUIRE(result.grids.size() == 1);
  CHECK(result.grids[0].name == "pressure");
  CHECK(result.grids[0].n_different == 2);
  CHECK(result.grids[0].largest == Approx(0.5).epsilon(1e-14));
  CHECK(result.grids[0].place == std::array<int, 3>{1, 2, 3});
  CHECK_THAT(comparison_text(result), Catch::Contains("pressure") && Catch::Contains("0.5 Pa") &&
                                          Catch::Contains("(1, 2, 3)") && Catch::EndsWith("not equal\n"));
}

TEST_CASE("gas that only one image has, or of another size, makes them unequal") {
  Image a = make_image(10), b = a, c = a;
  add_gas(a, {2, 3, 4});
  add_gas(c, {2, 3, 5});
  b.grids = {a.grids[2]};
  CHECK(compare(a, b).notes ==
        std::vector<std::string>{"gas quantity a/b & \"c\" is only in A", "gas quantity face_z is only in A"});
  CHECK(compare(b, a).notes ==
        std::vector<std::string>{"gas quantity a/b & \"c\" is only in B", "gas quantity face_z is only in B"});
  CHECK(compare(a, c).notes[2] == "gas quantity pressure: 2 x 3 x 4 values in A, 2 x 3 x 5 in B");
}

TEST_CASE("a description names the cells of the gas, and the range of each quantity") {
  const TemporaryDirectory directory;
  Image image = make_image(10);
  add_gas(image, {1, 2, 2});
  image.grids[2].values = {0.5, -2, std::nan(""), 8};
  write_snapshot(directory.path() / "s.h5", image);
  const std::string text = describe(directory.path() / "s.h5");
  INFO(text);
  CHECK_THAT(text, Catch::Contains("gas          1 x 2 x 2 cells\n") &&
                       Catch::Contains(
                           "pressure                          -2               8  Pa  (1 values are not numbers)\n"));
}

TEST_CASE("a description names kind, step, time, grains, ranges of the fields and the hash") {
  const TemporaryDirectory directory;
  Image image = make_image(10);
  field_of(image, Field::radius).reals = {0.5, 0.25, 0.5, 0.5, 2, 0.5, 0.5, 0.5, std::nan(""), 1};
  write_checkpoint(directory.path() / "c.h5", image, {"", "0.1.0", "abc"});
  const std::string text = describe(directory.path() / "c.h5");
  INFO(text);
  CHECK_THAT(text,
             Catch::Contains("checkpoint") && Catch::Contains("Moraine 0.1.0 (abc)") && Catch::Contains("0.012 s"));
  CHECK_THAT(text, Catch::Contains("periodic in x") && Catch::Contains("9 of pairs, 5 of walls"));
  CHECK_THAT(text, Catch::Contains("0.25               2  m  (1 values are not numbers)"));
  CHECK_THAT(text, Catch::EndsWith("state hash: " + image.hash.text() + "\n"));
}
