// What tests on several ranks share: the ranks, and images that travel between them. All ranks run every test case; a check may differ from
// rank to rank, the calls that all ranks make together may not.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "comm/world.hpp"
#include "engine/particles/parcel.hpp"
#include "engine/run/image.hpp"

namespace moraine::ranks {

const World& world();

/// Whether all ranks have the same text, at the root; true elsewhere. All ranks call it.
inline bool is_same_on_all(const World& among, const std::string& text) {
  for (const std::string& other : among.gather_at_root(text))
    if (other != text) return false;
  return true;
}

/// A directory of its own under the system's temporary one, the same for all ranks, removed when the last of them is done.
class SharedDirectory {
 public:
  explicit SharedDirectory(const World& world);
  ~SharedDirectory();
  SharedDirectory(const SharedDirectory&) = delete;
  SharedDirectory& operator=(const SharedDirectory&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  const World& world_;
  std::filesystem::path path_;
};

/// Calls f(array) for every table of an image.
template <typename Function>
void each_table(Image& image, Function f) {
  for (FieldArray& array : image.fields) {
    f(array.reals, info(array.field).components);
    f(array.gids, info(array.field).components);
    f(array.indices, info(array.field).components);
  }
  f(image.pairs, 1);
  f(image.walls, 1);
  f(image.further, 1);
  for (std::vector<GridArray>* const grids : {&image.grids, &image.sums})
    for (GridArray& array : *grids) f(array.values, 1);
}

/// The rows of all ranks, on all ranks; ranks that hold none give nothing.
inline Image whole(const std::optional<Image>& own, const World& all) {
  Image image = own.value_or(Image{});
  std::vector<Parcel> parcels;
  if (own) {
    for (int rank = 0; rank < all.size(); ++rank) {
      ParcelWriter parcel;
      each_table(image, [&](auto& values, int) {
        parcel.put(values.size());
        parcel.put_all(std::span<const typename std::decay_t<decltype(values)>::value_type>(values));
      });
      parcels.push_back({rank, parcel.take()});
    }
  }
  const std::vector<Parcel> arrived = all.exchange(std::move(parcels));
  // Fields and numbers are those of the root.
  ParcelWriter writer;
  if (all.is_root()) {
    writer.put(image.step);
    writer.put(image.time);
    writer.put(image.time_step);
    writer.put(image.domain);
    writer.put(image.periodic);
    writer.put(image.n_grains);
    writer.put(image.hash);
    writer.put(image.fields.size());
    for (const FieldArray& array : image.fields) writer.put(array.field);
    for (const std::vector<GridArray>* const grids : {&image.grids, &image.sums}) {
      writer.put(grids->size());
      for (const GridArray& array : *grids) {
        writer.put(array.name.size());
        writer.put_all(std::span<const char>(array.name));
        writer.put(array.n);
      }
    }
    writer.put(image.accumulators.size());
    for (const auto& [name, values] : image.accumulators) {
      writer.put(name.size());
      writer.put_all(std::span<const char>(name));
      writer.put(values.size());
      writer.put_all(std::span<const double>(values));
    }
  }
  std::vector<std::byte> bytes = writer.take();
  all.broadcast(bytes);
  ParcelReader reader(bytes);
  Image result;
  result.step = reader.get<std::uint64_t>();
  result.time = reader.get<double>();
  result.time_step = reader.get<double>();
  result.domain = reader.get<Box>();
  result.periodic = reader.get<std::array<bool, 3>>();
  result.n_grains = reader.get<std::uint64_t>();
  result.hash = reader.get<Hash128>();
  result.fields.resize(reader.get<std::size_t>());
  for (FieldArray& array : result.fields) array.field = reader.get<Field>();
  for (std::vector<GridArray>* const grids : {&result.grids, &result.sums}) {
    grids->resize(reader.get<std::size_t>());
    for (GridArray& array : *grids) {
      array.name.resize(reader.get<std::size_t>());
      reader.get_all(std::span<char>(array.name));
      array.n = reader.get<std::array<int, 3>>();
    }
  }
  for (auto n = reader.get<std::size_t>(); n > 0; --n) {
    std::string name(reader.get<std::size_t>(), ' ');
    reader.get_all(std::span<char>(name));
    std::vector<double> values(reader.get<std::size_t>());
    reader.get_all(std::span<double>(values));
    result.accumulators[name] = values;
  }
  for (const Parcel& parcel : arrived) {
    ParcelReader rows_of_rank(parcel.bytes);
    each_table(result, [&](auto& values, int) {
      const auto n = rows_of_rank.get<std::size_t>();
      values.resize(values.size() + n);
      rows_of_rank.get_all(std::span(values).last(n));
    });
  }
  return result;
}

/// This rank's part of the rows of an image that all ranks hold, uneven on purpose: the last rank gets none where there are three or more.
inline Image spread(const Image& image, const World& world) {
  Image part = image;
  const auto rank = static_cast<std::size_t>(world.rank());
  const auto n_ranks = static_cast<std::size_t>(world.size() > 2 ? world.size() - 1 : world.size());
  each_table(part, [&](auto& values, int components) {
    const std::size_t width = static_cast<std::size_t>(components), n = values.size() / width;
    const std::size_t begin = rank < n_ranks ? n * rank / n_ranks : n,
                      end = rank < n_ranks ? n * (rank + 1) / n_ranks : n;
    values = std::decay_t<decltype(values)>(values.begin() + static_cast<std::ptrdiff_t>(begin * width),
                                            values.begin() + static_cast<std::ptrdiff_t>(end * width));
  });
  return part;
}

}  // namespace moraine::ranks
