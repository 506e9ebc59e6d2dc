#include <catch2/catch.hpp>

#include "io/files/files.hpp"
#include "io/snapshot/snapshot.hpp"
#include "tests/unit/io_images.hpp"

using namespace moraine;

TEST_CASE("grains of a snapshot come back as they were written") {
  const testing::TemporaryDirectory directory;
  const Image image = testing::make_image(7);
  const auto file = directory.path() / "snapshot.h5";
  write_snapshot(file, image);
  const ListedGrains listed = load_grains(file, {{"a", "b", "c"}, {}, {}, {}, {}});
  CHECK(listed.has_radius);
  CHECK(listed.has_velocity);
  CHECK(listed.has_material);
  REQUIRE(listed.grains.size() == 7);
  const auto row = [&](Field field, std::size_t i) {
    const std::vector<double>& reals = image.find(field)->reals;
    return Vec3{reals[3 * i], reals[3 * i + 1], reals[3 * i + 2]};
  };
  for (std::size_t i = 0; i < 7; ++i) {
    CHECK(listed.grains[i].position == row(Field::position, i));
    CHECK(listed.grains[i].velocity == row(Field::velocity, i));
    CHECK(listed.grains[i].angular_velocity == row(Field::angular_velocity, i));
    CHECK(listed.grains[i].radius == image.find(Field::radius)->reals[i]);
    CHECK(listed.grains[i].material == image.find(Field::material)->indices[i]);
  }
  CHECK_THROWS_WITH(
      load_grains(file, {{"a", "b"}, {}, {}, {}, {}}),
      "dataset /particles/material: grain 2 has material number 2, the scene has 2 materials: " + file.string());
}
