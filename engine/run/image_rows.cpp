#include "engine/run/image_rows.hpp"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "engine/particles/parcel.hpp"

namespace moraine {

namespace {

std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

/// Order of what pairs remember; for PairHistory and FurtherHistory, also of one with the other.
constexpr auto comes_before = [](const auto& x, const auto& y) {
  return std::tie(x.gid_low, x.gid_high, x.image) < std::tie(y.gid_low, y.gid_high, y.image);
};

void sort_memory(Image& image) {
  std::sort(image.pairs.begin(), image.pairs.end(), comes_before);
  std::sort(image.further.begin(), image.further.end(), comes_before);
  std::sort(image.walls.begin(), image.walls.end(), [](const WallHistory& x, const WallHistory& y) {
    return std::tuple(x.gid, x.surface, x.normal[0], x.normal[1], x.normal[2]) <
           std::tuple(y.gid, y.surface, y.normal[0], y.normal[1], y.normal[2]);
  });
}

/// Calls f(values of the field, values a grain) with the vector that the field uses.
template <typename Array, typename Function>
void with_values(Array& array, Function f) {
  const FieldInfo& row = info(array.field);
  switch (row.type) {
    case FieldType::real: f(array.reals, at(row.components)); break;
    case FieldType::gid: f(array.gids, at(row.components)); break;
    case FieldType::index: f(array.indices, at(row.components)); break;
  }
}

const std::vector<std::uint64_t>& gids_of(const Image& image) {
  const FieldArray* const array = image.find(Field::gid);
  if (!array) throw SceneError({{"", "the checkpoint holds no field \"gid\", which the scene needs", false}});
  return array->gids;
}

/// Parcels by rank, of rows in order of gid.
class RowParcels {
 public:
  explicit RowParcels(int n_ranks) : parcels_(at(n_ranks)) {}
  ParcelWriter& operator[](int rank) { return parcels_[at(rank)]; }
  std::vector<Parcel> take() {
    std::vector<Parcel> all;
    for (std::size_t rank = 0; rank < parcels_.size(); ++rank)
      if (!parcels_[rank].empty()) all.push_back({static_cast<int>(rank), parcels_[rank].take()});
    return all;
  }

 private:
  std::vector<ParcelWriter> parcels_;
};

/// Calls f(target, begin, end) for each run of rows with the same target rank; rows are in order of target.
template <typename Row, typename Target, typename Function>
void each_target(const std::vector<Row>& rows, Target target, Function f) {
  for (std::size_t begin = 0, end; begin < rows.size(); begin = end) {
    const int rank = target(rows[begin]);
    for (end = begin + 1; end < rows.size() && target(rows[end]) == rank; ++end) {}
    f(rank, begin, end);
  }
}

template <typename T>
void append(std::vector<T>& to, ParcelReader& reader, std::size_t n) {
  to.resize(to.size() + n);
  reader.get_all(std::span(to).last(n));
}

void permute(Image& image, const std::vector<std::size_t>& order) {
  for (FieldArray& array : image.fields)
    with_values(array, [&](auto& values, std::size_t width) {
      auto sorted = values;
      for (std::size_t i = 0; i < order.size(); ++i)
        std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(order[i] * width), width,
                    sorted.begin() + static_cast<std::ptrdiff_t>(i * width));
      values = std::move(sorted);
    });
}

/// Which rank holds the row of a gid, and at which place.
class RowsByGid {
 public:
  RowsByGid(const World& world, std::span<const std::uint64_t> own) : own_(own) {
    constexpr std::uint64_t none = ~std::uint64_t{0};
    const std::vector<std::uint64_t> first = world.gather(own.empty() ? none : own.front());
    for (std::size_t rank = 0; rank < first.size(); ++rank)
      if (first[rank] != none) {
        first_.push_back(first[rank]);
        rank_.push_back(static_cast<int>(rank));
      }
  }
  int rank(std::uint64_t gid) const {
    const auto after = std::upper_bound(first_.begin(), first_.end(), gid);
    return after == first_.begin() ? 0 : rank_[at(after - first_.begin()) - 1];
  }
  /// -1 where this rank does not hold it.
  std::int32_t place(std::uint64_t gid) const {
    const auto found = std::lower_bound(own_.begin(), own_.end(), gid);
    return found == own_.end() || *found != gid ? -1 : static_cast<std::int32_t>(found - own_.begin());
  }

 private:
  std::span<const std::uint64_t> own_;
  std::vector<std::uint64_t> first_;
  std::vector<int> rank_;
};

[[noreturn]] void fail_missing(std::uint64_t gid) {
  throw SceneError(
      {{"", "the checkpoint remembers a contact of grain " + std::to_string(gid) + ", which it does not hold", false}});
}

FurtherMemory find(const std::vector<FurtherHistory>& further, const PairHistory& pair) {
  const auto found = std::lower_bound(further.begin(), further.end(), pair, comes_before);
  if (found == further.end() || comes_before(pair, *found)) return {};
  return {{found->angle[0], found->angle[1], found->angle[2]}, found->bond};
}

/// `place_of`: of a gid; -1 where the grain is not here. `further` in order.
template <typename PlaceOf>
PairCarry carry_of(const std::vector<PairHistory>& pairs, const std::vector<FurtherHistory>& further, PlaceOf place_of,
                   std::size_t n, bool is_alone, bool has_energy) {
  PairCarry carry;
  carry.begin.assign(n + 1, 0);
  // Alone, a pair stands at the grain of lower gid; else at each of its grains that is here.
  const auto each_end = [&](auto f) {
    for (const PairHistory& pair : pairs) {
      const auto image = static_cast<std::uint8_t>(pair.image);
      const std::int32_t low = place_of(pair.gid_low), high = place_of(pair.gid_high);
      if (is_alone && low < 0) fail_missing(pair.gid_low);
      if (is_alone && high < 0) fail_missing(pair.gid_high);
      if (low < 0 && high < 0) fail_missing(pair.gid_low);
      if (low >= 0) f(low, PairCarry::key(pair.gid_high, image), pair);
      if (!is_alone && high >= 0 && high != low) f(high, PairCarry::key(pair.gid_low, image), pair);
    }
  };
  each_end([&](std::int32_t place, std::uint64_t, const PairHistory&) { ++carry.begin[at(place) + 1]; });
  std::partial_sum(carry.begin.begin(), carry.begin.end(), carry.begin.begin());
  carry.items.resize(carry.begin.back());
  if (has_energy) carry.energy.resize(carry.begin.back());
  if (!further.empty()) carry.further.resize(carry.begin.back());
  std::vector<std::uint32_t> next(carry.begin.begin(), carry.begin.end() - 1);
  each_end([&](std::int32_t place, std::uint64_t key, const PairHistory& pair) {
    const std::uint32_t k = next[at(place)]++;
    carry.items[k] = {{pair.displacement[0], pair.displacement[1], pair.displacement[2]}, key};
    if (has_energy) carry.energy[k] = pair.energy;
    if (!further.empty()) carry.further[k] = find(further, pair);
  });
  return carry;
}

WallCarry carry_of(const std::vector<WallHistory>& walls, const RowsByGid& rows) {
  WallCarry carry;
  for (const WallHistory& wall : walls) {
    WallCarry::Item item;
    item.grain = rows.place(wall.gid);
    if (item.grain < 0) fail_missing(wall.gid);
    item.surface = static_cast<std::int32_t>(wall.surface);
    std::copy_n(wall.displacement, 3, item.memory.memory.displacement);
    item.memory.memory.energy = wall.energy;
    item.memory.memory.further = {{wall.angle[0], wall.angle[1], wall.angle[2]}, wall.bond};
    item.memory.normal = {wall.normal[0], wall.normal[1], wall.normal[2]};
    carry.items.push_back(item);
  }
  std::stable_sort(carry.items.begin(), carry.items.end(),
                   [](const auto& x, const auto& y) { return x.grain < y.grain; });
  return carry;
}

/// Places of the grains that are here, in order of gid.
std::vector<std::int32_t> order_by_gid(const Particles& particles) {
  std::vector<std::int32_t> order;
  order.reserve(at(particles.size()));
  for (std::int32_t i = 0; i < particles.size(); ++i)
    if (particles.is_here(i)) order.push_back(i);
  std::sort(order.begin(), order.end(),
            [&](std::int32_t x, std::int32_t y) { return particles.gid(x) < particles.gid(y); });
  return order;
}

/// What the contacts of this rank's rows remember, wherever it was given. Each pair comes to the ranks of both its grains.
void bring_memory(const World& world, const RowsByGid& rows, std::vector<PairHistory>& pairs,
                  std::vector<FurtherHistory>& further, std::vector<WallHistory>& walls) {
  std::vector<std::vector<PairHistory>> pairs_to(at(world.size()));
  std::vector<std::vector<FurtherHistory>> further_to(at(world.size()));
  std::vector<std::vector<WallHistory>> walls_to(at(world.size()));
  const auto to_both = [&](const auto& entries, auto& entries_to) {
    for (const auto& pair : entries) {
      const int low = rows.rank(pair.gid_low), high = rows.rank(pair.gid_high);
      entries_to[at(low)].push_back(pair);
      if (high != low) entries_to[at(high)].push_back(pair);
    }
  };
  to_both(pairs, pairs_to);
  to_both(further, further_to);
  for (const WallHistory& wall : walls) walls_to[at(rows.rank(wall.gid))].push_back(wall);
  RowParcels parcels(world.size());
  for (int rank = 0; rank < world.size(); ++rank) {
    if (pairs_to[at(rank)].empty() && walls_to[at(rank)].empty()) continue;
    ParcelWriter& parcel = parcels[rank];
    parcel.put(pairs_to[at(rank)].size());
    parcel.put_all(std::span<const PairHistory>(pairs_to[at(rank)]));
    parcel.put(further_to[at(rank)].size());
    parcel.put_all(std::span<const FurtherHistory>(further_to[at(rank)]));
    parcel.put(walls_to[at(rank)].size());
    parcel.put_all(std::span<const WallHistory>(walls_to[at(rank)]));
  }
  pairs.clear();
  further.clear();
  walls.clear();
  for (const Parcel& parcel : world.exchange(parcels.take())) {
    ParcelReader reader(parcel.bytes);
    append(pairs, reader, reader.get<std::size_t>());
    append(further, reader, reader.get<std::size_t>());
    append(walls, reader, reader.get<std::size_t>());
  }
  std::sort(further.begin(), further.end(), comes_before);
}

}  // namespace

void gather_fields(const Particles& particles, const std::vector<Field>& fields, Image& image) {
  const std::vector<std::int32_t> order = order_by_gid(particles);
  for (const Field field : fields) {
    FieldArray array;
    array.field = field;
    with_values(array, [&](auto& values, std::size_t width) { values.reserve(order.size() * width); });
    const FieldInfo& row = info(field);
    for (const std::int32_t i : order) {
      if (row.type == FieldType::gid)
        array.gids.push_back(particles.gid(i));
      else if (row.type == FieldType::index)
        array.indices.push_back(particles.material(i));
      else
        for (int c = 0; c < row.components; ++c) array.reals.push_back(particles.real(field, i, c));
    }
    image.fields.push_back(std::move(array));
  }
}

void gather_memory(const Particles& particles, const Contacts& contacts, Image& image) {
  std::size_t n_pairs = 0;
  contacts.for_each_memory(particles, [&](auto&&...) { ++n_pairs; });
  image.pairs.reserve(n_pairs);
  contacts.for_each_memory(particles, [&](std::int32_t a, std::int32_t b, std::uint8_t code, const PairMemory& m) {
    image.pairs.push_back({particles.gid(a),
                           particles.gid(b),
                           code,
                           {m.displacement[0], m.displacement[1], m.displacement[2]},
                           m.energy});
    const FurtherMemory& f = m.further;
    if (f.is_used())
      image.further.push_back({particles.gid(a), particles.gid(b), code, {f.angle[0], f.angle[1], f.angle[2]}, f.bond});
  });
  for (const WallCarry::Item& item : contacts.wall_carry().items) {
    const PairMemory& m = item.memory.memory;
    const Vec3 n = item.memory.normal;
    image.walls.push_back({particles.gid(item.grain),
                           static_cast<std::uint64_t>(item.surface),
                           {n.x, n.y, n.z},
                           {m.displacement[0], m.displacement[1], m.displacement[2]},
                           m.energy,
                           {m.further.angle[0], m.further.angle[1], m.further.angle[2]},
                           m.further.bond});
  }
  sort_memory(image);
}

PairCarry carry_by_place(const Particles& particles, const Image& image) {
  const std::vector<std::int32_t> order = order_by_gid(particles);
  const auto place_of = [&](std::uint64_t gid) {
    const auto found = std::lower_bound(order.begin(), order.end(), gid,
                                        [&](std::int32_t i, std::uint64_t g) { return particles.gid(i) < g; });
    return found == order.end() || particles.gid(*found) != gid ? -1 : *found;
  };
  return carry_of(image.pairs, image.further, place_of, at(particles.size()), true, particles.has(Field::dissipated));
}

void share_out_rows(const World& world, std::uint64_t n_gids, Image& image) {
  std::uint64_t n_grains = gids_of(image).size();
  if (!world.is_alone()) {
    const auto n_ranks = static_cast<std::uint64_t>(world.size());
    const std::uint64_t a_rank = n_gids / n_ranks + 1;
    const auto target = [&](std::uint64_t gid) { return static_cast<int>(std::min(gid / a_rank, n_ranks - 1)); };
    RowParcels parcels(world.size());
    // Four sections, each headed by its number of rows: so all ranks that get any get all.
    std::vector<std::array<std::pair<std::size_t, std::size_t>, 4>> runs(n_ranks);
    const auto note = [&](std::size_t section) {
      return [&runs, section](int rank, std::size_t begin, std::size_t end) { runs[at(rank)][section] = {begin, end}; };
    };
    each_target(gids_of(image), target, note(0));
    each_target(
        image.pairs, [&](const PairHistory& pair) { return target(pair.gid_low); }, note(1));
    each_target(
        image.walls, [&](const WallHistory& wall) { return target(wall.gid); }, note(2));
    each_target(
        image.further, [&](const FurtherHistory& pair) { return target(pair.gid_low); }, note(3));
    for (int rank = 0; rank < world.size(); ++rank) {
      const auto size = [&](std::size_t section) {
        return runs[at(rank)][section].second - runs[at(rank)][section].first;
      };
      if (size(0) + size(1) + size(2) + size(3) == 0) continue;
      ParcelWriter& parcel = parcels[rank];
      parcel.put(size(0));
      for (const FieldArray& array : image.fields)
        with_values(array, [&](const auto& values, std::size_t width) {
          parcel.put_all(std::span(values).subspan(runs[at(rank)][0].first * width, size(0) * width));
        });
      parcel.put(size(1));
      parcel.put_all(std::span<const PairHistory>(image.pairs).subspan(runs[at(rank)][1].first, size(1)));
      parcel.put(size(2));
      parcel.put_all(std::span<const WallHistory>(image.walls).subspan(runs[at(rank)][2].first, size(2)));
      parcel.put(size(3));
      parcel.put_all(std::span<const FurtherHistory>(image.further).subspan(runs[at(rank)][3].first, size(3)));
    }
    for (FieldArray& array : image.fields) with_values(array, [](auto& values, std::size_t) { values.clear(); });
    image.pairs.clear();
    image.walls.clear();
    image.further.clear();
    for (const Parcel& parcel : world.exchange(parcels.take())) {
      ParcelReader reader(parcel.bytes);
      const auto n = reader.get<std::size_t>();
      for (FieldArray& array : image.fields)
        with_values(array, [&](auto& values, std::size_t width) { append(values, reader, n * width); });
      append(image.pairs, reader, reader.get<std::size_t>());
      append(image.walls, reader, reader.get<std::size_t>());
      append(image.further, reader, reader.get<std::size_t>());
    }
    const std::vector<std::uint64_t>& gids = gids_of(image);
    std::vector<std::size_t> order(gids.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::sort(order.begin(), order.end(), [&](std::size_t x, std::size_t y) { return gids[x] < gids[y]; });
    permute(image, order);
    sort_memory(image);
    n_grains = gids.size();
    world.sum(std::span(&n_grains, 1));
  }
  image.n_grains = n_grains;
}

void put_rows(const World& world, const Image& image, Particles& particles, PairCarry& pairs, WallCarry& walls) {
  const std::vector<std::uint64_t>& gids = gids_of(image);
  particles.resize(static_cast<std::int32_t>(gids.size()));
  for (const FieldInfo& row : field_table) {
    if (!particles.has(row.field) || row.travel == Travel::never) continue;
    const FieldArray* const array = image.find(row.field);
    if (!array)
      throw SceneError(
          {{"", "the checkpoint holds no field \"" + std::string(row.name) + "\", which the scene needs", false}});
    for (std::int32_t i = 0; i < particles.size(); ++i) {
      if (row.type == FieldType::gid)
        particles.set_gid(i, array->gids[at(i)]);
      else if (row.type == FieldType::index)
        particles.set_material(i, array->indices[at(i)]);
      else
        for (int c = 0; c < row.components; ++c)
          particles.set_real(row.field, i, c, array->reals[at(i) * at(row.components) + at(c)]);
    }
  }
  const RowsByGid rows(world, gids);
  const bool has_energy = particles.has(Field::dissipated);
  const auto place_of = [&](std::uint64_t gid) { return rows.place(gid); };
  if (world.is_alone()) {
    pairs = carry_of(image.pairs, image.further, place_of, gids.size(), true, has_energy);
    walls = carry_of(image.walls, rows);
    return;
  }
  std::vector<PairHistory> own_pairs = image.pairs;
  std::vector<FurtherHistory> own_further = image.further;
  std::vector<WallHistory> own_walls = image.walls;
  bring_memory(world, rows, own_pairs, own_further, own_walls);
  pairs = carry_of(own_pairs, own_further, place_of, gids.size(), false, has_energy);
  walls = carry_of(own_walls, rows);
}

}  // namespace moraine
