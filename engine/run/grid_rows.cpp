#include "engine/run/grid_rows.hpp"

#include <algorithm>
#include <string>

#include "engine/particles/parcel.hpp"
#include "engine/scene/scene.hpp"
#include "engine/threads.hpp"

namespace moraine {

namespace {

/// The consecutive values of an image that each rank holds.
class Rows {
 public:
  Rows(const World& world, std::array<int, 3> n)
      : n_(std::int64_t{n[0]} * n[1] * n[2]), n_ranks_(world.size()), own_(of(world.rank())) {}
  Range of(int rank) const { return share_of(n_, rank, n_ranks_); }
  Range own() const { return own_; }
  int rank_of(std::int64_t value) const {
    auto rank =
        static_cast<int>(std::min<std::int64_t>(value * n_ranks_ / std::max<std::int64_t>(n_, 1), n_ranks_ - 1));
    while (value < of(rank).begin) --rank;
    while (value >= of(rank).end) ++rank;
    return rank;
  }

 private:
  std::int64_t n_;
  int n_ranks_;
  Range own_;
};

std::vector<Parcel> parcels_of(std::vector<ParcelWriter>& writers) {
  std::vector<Parcel> parcels;
  for (std::size_t rank = 0; rank < writers.size(); ++rank)
    if (!writers[rank].empty()) parcels.push_back({static_cast<int>(rank), writers[rank].take()});
  return parcels;
}

}  // namespace

std::array<int, 3> GridPlaces::n_values() const {
  std::array<int, 3> n = share.n;
  if (face_axis >= 0 && !share.periodic[static_cast<std::size_t>(face_axis)]) ++n[static_cast<std::size_t>(face_axis)];
  return n;
}

CellBlock GridPlaces::block(int rank) const {
  CellBlock block = share.block(rank);
  if (block.is_empty() || face_axis < 0) return block;
  const auto axis = static_cast<std::size_t>(face_axis);
  if (!share.periodic[axis] && block.high[axis] == share.n[axis]) ++block.high[axis];
  return block;
}

void gather_grid(const World& world, const GridPlaces& places, const GridField<>* field, GridArray& array) {
  array.n = places.n_values();
  const Rows rows(world, array.n);
  std::vector<ParcelWriter> writers(static_cast<std::size_t>(world.size()));
  if (field) {
    const CellBlock block = places.block(world.rank());
    for (int k = 0; k < block.size(2); ++k)
      for (int j = 0; j < block.size(1); ++j) {
        const std::int64_t line = (std::int64_t{block.low[2] + k} * array.n[1] + block.low[1] + j) * array.n[0];
        for (std::int64_t first = line; first < line + array.n[0];) {  // a line may lie in the rows of several ranks
          const int rank = rows.rank_of(first);
          const std::int64_t n = std::min(rows.of(rank).end, line + array.n[0]) - first;
          ParcelWriter& writer = writers[static_cast<std::size_t>(rank)];
          writer.put(first);
          writer.put(n);
          const double* const values = field->data() + field->layout().at(static_cast<int>(first - line), j, k);
          writer.put_all(std::span(values, static_cast<std::size_t>(n)));
          first += n;
        }
      }
  }
  array.values.resize(static_cast<std::size_t>(rows.own().size()));
  for (const Parcel& parcel : world.exchange(parcels_of(writers)))
    for (ParcelReader reader(parcel.bytes); !reader.at_end();) {
      const auto first = reader.get<std::int64_t>(), n = reader.get<std::int64_t>();
      reader.get_all(std::span(array.values)
                         .subspan(static_cast<std::size_t>(first - rows.own().begin), static_cast<std::size_t>(n)));
    }
}

void put_grid(const World& world, const GridPlaces& places, const GridArray& array, GridField<>* field) {
  const std::array<int, 3> n_values = places.n_values();
  const auto numbers = [](std::array<int, 3> n) {
    return std::to_string(n[0]) + " x " + std::to_string(n[1]) + " x " + std::to_string(n[2]);
  };
  if (array.n != n_values)
    throw SceneError({{"gas.cells",
                       "are not those that the checkpoint was written with: its \"" + array.name + "\" has " +
                           numbers(array.n) + " values, expected " + numbers(n_values),
                       false}});
  std::vector<ParcelWriter> writers(static_cast<std::size_t>(world.size()));
  const auto n_own = static_cast<std::int64_t>(array.values.size());
  const std::int64_t nx = array.n[0],
                     begin = static_cast<std::int64_t>(world.sum_before(static_cast<std::uint64_t>(n_own)));
  for (std::int64_t first = begin; first < begin + n_own;) {
    const std::int64_t line = first / nx, n = std::min((line + 1) * nx, begin + n_own) - first;
    const int j = std::min(static_cast<int>(line % array.n[1]), places.share.n[1] - 1);
    const int k = std::min(static_cast<int>(line / array.n[1]), places.share.n[2] - 1);
    ParcelWriter& writer = writers[static_cast<std::size_t>(places.share.owner(j, k))];
    writer.put(first);
    writer.put(n);
    writer.put_all(
        std::span(array.values).subspan(static_cast<std::size_t>(first - begin), static_cast<std::size_t>(n)));
    first += n;
  }
  const CellBlock block = places.share.block(world.rank());
  for (const Parcel& parcel : world.exchange(parcels_of(writers)))
    for (ParcelReader reader(parcel.bytes); !reader.at_end();) {
      const auto first = reader.get<std::int64_t>(), n = reader.get<std::int64_t>();
      const std::int64_t line = first / nx;
      const int i = static_cast<int>(first % nx), j = static_cast<int>(line % array.n[1]),
                k = static_cast<int>(line / array.n[1]);
      double* const values = field->data() + field->layout().at(i, j - block.low[1], k - block.low[2]);
      reader.get_all(std::span(values, static_cast<std::size_t>(n)));
    }
}

}  // namespace moraine
