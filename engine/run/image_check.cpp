#include "engine/run/image_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

namespace moraine {

namespace {

constexpr std::uint64_t most_gids = std::uint64_t{1} << 48;  // what a contact's memory has room for, and to spare
constexpr std::uint64_t n_images = 125;  // of a grain: up to two steps to either side along each axis

[[noreturn]] void fail(const std::string& what) {
  throw SceneError({{"", "the checkpoint cannot be of this scene: " + what, false}});
}

bool is_finite(std::span<const double> values) {
  return std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
}

/// The name of a row in messages.
std::string grain_text(const Image& image, std::size_t row) {
  const FieldArray* const gids = image.find(Field::gid);
  return gids && row < gids->gids.size() ? fmt::format("grain {}", gids->gids[row]) : fmt::format("row {}", row);
}

void check_gids(const std::vector<std::uint64_t>& gids) {
  for (std::size_t i = 0; i < gids.size(); ++i) {
    if (gids[i] >= most_gids) fail(fmt::format("a grain has the gid {}, more than there can be", gids[i]));
    if (i > 0 && gids[i] <= gids[i - 1])
      fail(fmt::format("grain {} comes after grain {}; each must be there once, in order", gids[i], gids[i - 1]));
  }
}

void check_positions(const Scene& scene, const Image& image, const std::vector<double>& reals) {
  const Box domain = scene.domain.box();
  for (std::size_t i = 0; i + 2 < reals.size(); i += 3)
    if (!domain.contains({reals[i], reals[i + 1], reals[i + 2]}))
      fail(fmt::format("{} is at ({:.6g}, {:.6g}, {:.6g}) m, outside the domain", grain_text(image, i / 3), reals[i],
                       reals[i + 1], reals[i + 2]));
}

void check_field(const Scene& scene, const Image& image, const FieldArray& array, std::size_t n_rows) {
  const FieldInfo& row = info(array.field);
  const auto width = static_cast<std::size_t>(row.components);
  const std::size_t n = array.reals.size() + array.gids.size() + array.indices.size();
  if (n != n_rows * width) fail(fmt::format("{} values of {} for {} grains", n, row.name, n_rows));
  if (array.field == Field::gid) check_gids(array.gids);
  if (array.field == Field::position) check_positions(scene, image, array.reals);
  const bool is_positive =
      array.field == Field::radius || array.field == Field::inverse_mass || array.field == Field::inverse_inertia;
  if (array.field == Field::velocity || array.field == Field::angular_velocity) return;  // the guard stops at those
  for (std::size_t i = 0; i < array.reals.size(); ++i)
    if (!std::isfinite(array.reals[i]) || (is_positive && !(array.reals[i] > 0.0)))
      fail(fmt::format("{} has {} = {}", grain_text(image, i / width), row.name, array.reals[i]));
  if (array.field == Field::material)
    for (std::size_t i = 0; i < array.indices.size(); ++i)
      if (array.indices[i] >= scene.materials.size())
        fail(fmt::format("{} is of material number {}; the scene has {}", grain_text(image, i), array.indices[i],
                         scene.materials.size()));
}

void check_memory(const Image& image, std::size_t n_surfaces) {
  for (const PairHistory& pair : image.pairs)
    if (pair.image >= n_images || pair.gid_low > pair.gid_high || pair.gid_high >= most_gids ||
        !is_finite(pair.displacement) || !std::isfinite(pair.energy))
      fail(fmt::format("what it remembers of the contact of grains {} and {} is not possible", pair.gid_low,
                       pair.gid_high));
  for (const WallHistory& wall : image.walls)
    if (wall.surface >= n_surfaces || !is_finite(wall.normal) || !is_finite(wall.displacement) ||
        !std::isfinite(wall.energy))
      fail(
          fmt::format("what it remembers of the contact of grain {} with surface {} is not possible; there are {} "
                      "surfaces",
                      wall.gid, wall.surface, n_surfaces));
}

}  // namespace

void expect_possible(const Scene& scene, std::size_t n_surfaces, const Image& image) {
  const FieldArray* const gids = image.find(Field::gid);
  const std::size_t n_rows = gids ? gids->gids.size() : 0;
  for (const FieldArray& array : image.fields) check_field(scene, image, array, n_rows);
  check_memory(image, n_surfaces);
  constexpr double most = 9e18;  // that a whole number holds
  for (const auto& [name, values] : image.accumulators)
    for (const double value : values)
      if (std::isnan(value) || (name.rfind("probe_", 0) != 0 && std::abs(value) > most))
        fail(fmt::format("\"{}\" holds {}", name, value));
  for (const char* name : {"born", "left"})
    if (const auto count = image.accumulators.find(name);
        count != image.accumulators.end() && !count->second.empty() && count->second[0] < 0.0)
      fail(fmt::format("\"{}\" is {}", name, count->second[0]));
}

}  // namespace moraine
