#include <zlib.h>
#include <catch2/catch.hpp>

#include <cstdint>
#include <cstring>

#include "io/files/files.hpp"
#include "tests/unit/scene_text.hpp"

using namespace moraine;

namespace {

/// Two triangles of a square, as people's programs write them: every corner anew.
const char* const square_stl =
    "solid square\n"
    "facet normal 0 0 1\nouter loop\nvertex 0 0 0.1\nvertex 1 0 0.1\nvertex 1 1 0.1\nendloop\nendfacet\n"
    "facet normal 0 0 1\nouter loop\nvertex 0 0 0.1\nvertex 1 1 0.1\nvertex 0 1 0.1\nendloop\nendfacet\n"
    "endsolid square\n";

std::string binary_stl(const std::vector<std::array<float, 9>>& triangles) {
  std::string out(80, ' ');
  const auto put = [&](const void* data, std::size_t n) { out.append(static_cast<const char*>(data), n); };
  const auto count = static_cast<std::uint32_t>(triangles.size());
  put(&count, 4);
  for (const auto& corners : triangles) {
    const float normal[3] = {0, 0, 1};
    const std::uint16_t attribute = 0;
    put(normal, 12);
    put(corners.data(), 36);
    put(&attribute, 2);
  }
  return out;
}

std::string fails(const std::filesystem::path& file) {
  try {
    const std::string ending = file.extension().string();
    ending == ".stl" || ending == ".obj" || ending == ".ply" ? void(load_mesh(file))
                                                             : void(load_grains(file, {{"glass"}, {}, {}, {}, {}}));
  } catch (const FileError& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("an ascii STL is read with its vertices welded, scaled and moved") {
  const scene_text::Directory directory;
  const auto file = directory.write("square.stl", square_stl);
  const TriangleMesh mesh = load_mesh(file);
  CHECK(mesh.vertices.size() == 4);
  REQUIRE(mesh.triangles.size() == 2);
  CHECK(mesh.triangles[0] == std::array<std::int32_t, 3>{0, 1, 2});
  CHECK(mesh.triangles[1] == std::array<std::int32_t, 3>{0, 2, 3});
  CHECK(mesh.vertices[3].y == 1.0);
  const TriangleMesh moved = load_mesh(file, 0.5, {10, 0, -1});
  CHECK(moved.vertices[2].x == 10.5);
  CHECK(moved.vertices[2].z == Approx(-0.95));
}

TEST_CASE("a binary STL is read, and corners that differ by rounding become one") {
  const scene_text::Directory directory;
  const float third = 1.0f / 3.0f;
  const auto file = directory.write("two.stl", binary_stl({{0, 0, 0, third, 0, 0, third, 1, 0},
                                                           {0, 0, 0, std::nextafter(third, 1.0f), 1, 0, 0, 1, 0}}));
  const TriangleMesh mesh = load_mesh(file);
  CHECK(mesh.vertices.size() == 4);
  CHECK(mesh.triangles.size() == 2);
}

TEST_CASE("an OBJ with a polygon is read as triangles") {
  const scene_text::Directory directory;
  const auto file = directory.write("quad.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n");
  const TriangleMesh mesh = load_mesh(file);
  CHECK(mesh.vertices.size() == 4);
  CHECK(mesh.triangles.size() == 2);
}

TEST_CASE("meshes that cannot be read say why") {
  const scene_text::Directory directory;
  const auto path = [&](const char* name) { return (directory.path() / name).string(); };
  CHECK(fails(directory.path() / "none.stl") == "no such file: " + path("none.stl"));
  CHECK(fails(directory.write("empty.stl", "")) == "the file is empty: " + path("empty.stl"));
  CHECK(fails(directory.write("a.ply", "ply")) ==
        "\".ply\" is not a kind of mesh file that can be read; expected .stl or .obj: " + path("a.ply"));
  CHECK(fails(directory.write("short.stl", "abc")) ==
        "is not an STL file: 3 bytes, too few for any triangle: " + path("short.stl"));
  const std::string whole = binary_stl({{0, 0, 0, 1, 0, 0, 1, 1, 0}, {0, 0, 0, 1, 1, 0, 0, 1, 0}});
  CHECK(fails(directory.write("cut.stl", whole.substr(0, 150))) ==
        "the file was cut short: 2 triangles need 184 bytes, it has 150: " + path("cut.stl"));
  CHECK_FALSE(fails(directory.write("points.obj", "v 0 0 0\nv 1 0 0\n")).empty());
  CHECK_FALSE(fails(directory.write("hollow.stl", "solid a\nendsolid a\n")).empty());
  CHECK_FALSE(fails(directory.write("nan.stl", binary_stl({{0, 0, 0, std::nanf(""), 0, 0, 1, 1, 0}}))).empty());
}

TEST_CASE("a list of grains is read by the names of its columns") {
  const scene_text::Directory directory;
  const auto file = directory.write("grains.csv",
                                    "# from a measurement\nz, y, x, d, vx, wz, material\n3, 2, 1, 0.5, 7, 9, "
                                    "steel\n\n6, 5, 4, 0.25, -7, 0, glass\r\n");
  const ListedGrains listed = load_grains(file, {{"glass", "steel"}, {}, {2, 2, 2}, {1, 1, 1}, {}});
  CHECK(listed.source == "grains.csv");
  CHECK(listed.has_radius);
  CHECK(listed.has_velocity);
  CHECK(listed.has_material);
  REQUIRE(listed.grains.size() == 2);
  CHECK(listed.grains[0].position == Vec3{1, 2, 3});
  CHECK(listed.grains[0].radius == 0.25);
  CHECK(listed.grains[0].velocity == Vec3{7, 0, 0});
  CHECK(listed.grains[0].angular_velocity == Vec3{0, 0, 9});
  CHECK(listed.grains[0].material == 1);
  CHECK(listed.grains[1].position == Vec3{4, 5, 6});
  CHECK(listed.grains[1].material == 0);
}

TEST_CASE("columns that a list lacks come from the scene") {
  const scene_text::Directory directory;
  const ListedGrains listed =
      load_grains(directory.write("grains.csv", "x y\n1 2\n"), {{"a", "b"}, 1, {}, {0, 0, 5}, 0.5});
  CHECK_FALSE(listed.has_radius);
  CHECK_FALSE(listed.has_velocity);
  CHECK(listed.grains[0].position == Vec3{1, 2, 0.5});
  CHECK(listed.grains[0].material == 1);
  CHECK(listed.grains[0].angular_velocity == Vec3{0, 0, 5});
}

TEST_CASE(
    "the material of a group goes before that of the file, and a file with spins only keeps the velocity of the "
    "group") {
  const scene_text::Directory directory;
  const auto file = directory.write("grains.csv", "x,y,z,wz,material\n1,2,3,4,nonsense\n");
  const ListedGrains listed = load_grains(file, {{"a", "b"}, 1, {0, 0, -7}, {}, {}});
  CHECK(listed.grains[0].material == 1);
  CHECK(listed.has_velocity);
  CHECK(listed.grains[0].velocity == Vec3{0, 0, -7});
  CHECK(listed.grains[0].angular_velocity == Vec3{0, 0, 4});
}

TEST_CASE("separators may be commas, semicolons, tabs or blanks, and names may carry SI units") {
  const scene_text::Directory directory;
  for (const std::string content : {"x,y,z,r\n1,2,3,.5\n", "x;y;z;r\n1;2;3;0.5\n", "x\ty\tz\tr\n1\t2\t3\t5e-1\n",
                                    "x  y z   r\n1   2 3 +0.5\n", "X[m], Y [m], \"z\", Radius [m]\n1,2,3,0.5\n"}) {
    CAPTURE(content);
    const ListedGrains listed = load_grains(directory.write("grains.txt", content));
    REQUIRE(listed.grains.size() == 1);
    CHECK(listed.grains[0].position == Vec3{1, 2, 3});
    CHECK(listed.grains[0].radius == 0.5);
  }
}

TEST_CASE("a packed list is read as the plain one") {
  const scene_text::Directory directory;
  const auto file = directory.path() / "grains.csv.gz";
  const std::string content = "x,y,z\n1,2,3\n";
  gzFile out = gzopen(file.c_str(), "wb");
  gzwrite(out, content.data(), static_cast<unsigned>(content.size()));
  gzclose(out);
  CHECK(load_grains(file).grains.size() == 1);
  std::filesystem::resize_file(file, std::filesystem::file_size(file) - 10);
  CHECK(fails(file).find("cannot be unpacked") == 0);
}

TEST_CASE("a packed list that unpacks to what no list holds is refused before it fills the memory") {
  const scene_text::Directory directory;
  const auto said = [&](const std::string& content) {
    const auto file = directory.path() / "bomb.csv.gz";
    gzFile out = gzopen(file.c_str(), "wb");
    gzwrite(out, content.data(), static_cast<unsigned>(content.size()));
    gzclose(out);
    return fails(file);
  };
  CHECK(said("x,y,z\n" + std::string(std::size_t{1} << 24, ',')).find("has a line of more than 65536 characters") == 0);
  std::string rows = "x,y,z\n";
  for (int i = 0; i < 1'000'000; ++i) rows += "1,1,1\n";
  CHECK(said(rows).find("is more than 64 times as large unpacked as it is packed") == 0);
}

TEST_CASE("lists that cannot be read say where and why") {
  const scene_text::Directory directory;
  const auto said = [&](const std::string& content) {
    const auto file = directory.write("g.csv", content);
    std::string message = fails(file);
    for (std::size_t at; (at = message.find(directory.path().string() + "/")) != std::string::npos;)
      message.erase(at, directory.path().string().size() + 1);
    return message;
  };
  CHECK(said("x,y,z\n1,2,3\n1,two,3\n") == "g.csv:3: column 2 (\"y\"): \"two\" is not a number");
  CHECK(said("x,y,z\n1,2\n") == "g.csv:2: column 3 (\"z\"): the line has 2 columns, the header 3");
  CHECK(said("x,y,z,material\n1,2,3,gold\n") ==
        "g.csv:2: column 4 (\"material\"): \"gold\" is not a material of the scene");
  CHECK(said("x,y,z\n1,,3\n1,2,\n") ==
        "g.csv:2: column 2 (\"y\"): \"\" is not a number\ng.csv:3: column 3 (\"z\"): \"\" is not a number");
  CHECK(said("x,y\n1,2\n") ==
        "g.csv:1: column \"z\" is missing; the first line must name the columns: x, y, z, r or d, vx, vy, vz, wx, wy, "
        "wz, material");
  CHECK(said("1,2,3\n") ==
        "g.csv:1: column 1: \"1\" is not a known column; expected x, y, z, r or d, vx, vy, vz, wx, wy, wz, material");
  CHECK(said("x[mm],y,z\n") == "g.csv:1: column 1: \"x\" is in [mm]; expected [m]");
  CHECK(said("x,y,z,x\n") == "g.csv:1: column 4: \"x\" was there before, as column 1");
  CHECK(said("x,y,z,r,d\n") == "g.csv:1: has both a radius and a diameter; expected one of them");
  CHECK(said("x,y,z\n") == "holds a header but no grains: g.csv");
  CHECK(said("# nothing\n") ==
        "holds no header; expected the columns x, y, z, r or d, vx, vy, vz, wx, wy, wz, material: g.csv");
  const std::string many = said(
      "x,y,z\n" + std::string("a,2,3\na,2,3\na,2,3\na,2,3\na,2,3\na,2,3\na,2,3\na,2,3\na,2,3\na,2,3\na,2,3\na,2,3\n"));
  CHECK(many.find("\nand 2 more") != std::string::npos);
}

TEST_CASE("a file that says it is HDF5 and is not is refused") {
  const scene_text::Directory directory;
  const auto file = directory.write("grains.h5", "no such thing");
  CHECK(fails(file) == "is not an HDF5 file, or a damaged one: " + file.string());
}
