#include "engine/contacts/migration.hpp"

#include <algorithm>
#include <map>

#include "engine/particles/parcel.hpp"

namespace moraine {

namespace {

std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

/// The memory of one grain, as it travels.
void put_memory(const PairCarry& pairs, std::span<const WallCarry::Item> walls, std::int32_t i, ParcelWriter& parcel) {
  const std::size_t begin = pairs.begin.empty() ? 0 : pairs.begin[at(i)];
  const std::size_t end = pairs.begin.empty() ? 0 : pairs.begin[at(i) + 1];
  parcel.put(static_cast<std::uint32_t>(end - begin));
  for (std::size_t k = begin; k < end; ++k) {
    parcel.put(pairs.items[k]);
    parcel.put(pairs.energy.empty() ? 0.0 : pairs.energy[k]);
    if (!pairs.further.empty()) parcel.put(pairs.further[k]);
  }
  parcel.put(static_cast<std::uint32_t>(walls.size()));
  parcel.put_all(walls);
}

/// Memory by place, written from the first place to the last.
class MemoryWriter {
 public:
  MemoryWriter(bool has_energy, bool has_further) : has_energy_(has_energy), has_further_(has_further) {
    pairs.begin.push_back(0);
  }
  void add_pair(const PairCarry::Item& item, double energy, const FurtherMemory& further) {
    pairs.items.push_back(item);
    if (has_energy_) pairs.energy.push_back(energy);
    if (has_further_) pairs.further.push_back(further);
  }
  void add_wall(WallCarry::Item item) {
    item.grain = static_cast<std::int32_t>(pairs.begin.size()) - 1;
    walls.items.push_back(item);
  }
  void end_grain() { pairs.begin.push_back(static_cast<std::uint32_t>(pairs.items.size())); }
  PairCarry pairs;
  WallCarry walls;

 private:
  bool has_energy_, has_further_;
};

std::span<const WallCarry::Item> walls_of(const WallCarry& walls, std::int32_t i) {
  const auto range = std::equal_range(walls.items.begin(), walls.items.end(), WallCarry::Item{i, 0, {}},
                                      [](const auto& x, const auto& y) { return x.grain < y.grain; });
  return {range.first, range.second};
}

}  // namespace

std::vector<std::uint8_t> leaving_grains(const World& world, const Subdomains& subdomains, const Particles& particles) {
  std::vector<std::uint8_t> is_leaving;
  if (world.is_alone()) return is_leaving;
  const Box& own = subdomains.box(world.rank());
  for (std::int32_t i = 0; i < particles.size(); ++i) {
    if (!particles.is_here(i) || own.contains(particles.position(i))) continue;
    if (is_leaving.empty()) is_leaving.assign(at(particles.size()), 0);
    is_leaving[at(i)] = 1;
  }
  return is_leaving;
}

std::size_t migrate(const World& world, const Subdomains& subdomains, std::span<const std::uint8_t> is_leaving,
                    bool has_further, Particles& particles, PairCarry& pairs, WallCarry& walls, int n_threads) {
  std::map<int, ParcelWriter> outgoing;
  std::vector<std::int32_t> stayers;
  stayers.reserve(at(particles.size()));
  std::size_t n_gone = 0;
  for (std::int32_t i = 0; i < particles.size(); ++i) {
    if (!particles.is_here(i)) continue;
    if (is_leaving.empty() || !is_leaving[at(i)]) {
      stayers.push_back(i);
      continue;
    }
    ParcelWriter& parcel = outgoing[subdomains.owner(particles.position(i))];
    put_grain(particles, i, false, parcel);
    put_memory(pairs, walls_of(walls, i), i, parcel);
    ++n_gone;
  }
  std::vector<Parcel> parcels;
  for (auto& [rank, parcel] : outgoing) parcels.push_back({rank, parcel.take()});
  const std::vector<Parcel> arrived = world.exchange(std::move(parcels));
  if (arrived.empty() && stayers.size() == at(particles.size())) return n_gone;

  const bool has_energy = particles.has(Field::dissipated);
  MemoryWriter memory(has_energy, has_further);
  auto wall = walls.items.begin();
  for (const std::int32_t i : stayers) {
    if (!pairs.begin.empty())
      for (std::size_t k = pairs.begin[at(i)]; k < pairs.begin[at(i) + 1]; ++k)
        memory.add_pair(pairs.items[k], pairs.energy.empty() ? 0.0 : pairs.energy[k],
                        pairs.further.empty() ? FurtherMemory{} : pairs.further[k]);
    while (wall != walls.items.end() && wall->grain < i) ++wall;
    for (; wall != walls.items.end() && wall->grain == i; ++wall) memory.add_wall(*wall);
    memory.end_grain();
  }
  // How many come is known when all are read: values first, grains when there is room for them.
  Particles newcomers(particles.needs());
  std::int32_t n_new = 0;
  const auto read_all = [&](auto place_of_next) {
    for (const Parcel& parcel : arrived)
      for (ParcelReader reader(parcel.bytes); !reader.at_end();) place_of_next(reader);
  };
  const auto read_memory = [&](ParcelReader& reader, auto add_pair, auto add_wall) {
    for (auto n = reader.get<std::uint32_t>(); n > 0; --n) {
      const auto item = reader.get<PairCarry::Item>();
      const auto energy = reader.get<double>();
      add_pair(item, energy, has_further ? reader.get<FurtherMemory>() : FurtherMemory{});
    }
    for (auto n = reader.get<std::uint32_t>(); n > 0; --n) add_wall(reader.get<WallCarry::Item>());
  };
  newcomers.resize(1);
  read_all([&](ParcelReader& reader) {
    get_grain(reader, false, newcomers, 0);
    read_memory(
        reader, [](const PairCarry::Item&, double, const FurtherMemory&) {}, [](const WallCarry::Item&) {});
    ++n_new;
  });
  particles.reorder(stayers, n_threads, n_new);
  auto place = static_cast<std::int32_t>(stayers.size());
  read_all([&](ParcelReader& reader) {
    get_grain(reader, false, particles, place++);
    read_memory(
        reader,
        [&](const PairCarry::Item& item, double energy, const FurtherMemory& further) {
          memory.add_pair(item, energy, further);
        },
        [&](const WallCarry::Item& item) { memory.add_wall(item); });
    memory.end_grain();
  });
  pairs = std::move(memory.pairs);
  walls = std::move(memory.walls);
  return n_gone;
}

}  // namespace moraine
