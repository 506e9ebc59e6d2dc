#include "engine/run/state_hash.hpp"

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <array>
#include <cstring>
#include <span>
#include <vector>

namespace moraine {

namespace {

__extension__ using Wide = unsigned __int128;

class Sum {
 public:
  void add(std::span<const std::uint64_t> words) {
    const XXH128_hash_t h = XXH3_128bits(words.data(), words.size_bytes());
    total_ += static_cast<Wide>(h.high64) << 64 | h.low64;
  }
  /// Adds up what the ranks have, in quarters, so that carries survive the sum over up to 2^32 ranks.
  void total(const World& world) {
    std::array<std::uint64_t, 4> quarters;
    for (int k = 0; k < 4; ++k) quarters[static_cast<std::size_t>(k)] = static_cast<std::uint32_t>(total_ >> (32 * k));
    world.sum(quarters);
    total_ = 0;
    for (int k = 3; k >= 0; --k) total_ = (total_ << 32) + quarters[static_cast<std::size_t>(k)];
  }
  Hash128 value() const { return {static_cast<std::uint64_t>(total_ >> 64), static_cast<std::uint64_t>(total_)}; }

 private:
  Wide total_ = 0;
};

std::uint64_t word(double value) {
  std::uint64_t bits;
  std::memcpy(&bits, &value, sizeof(bits));
  return bits;
}

enum class Kind : std::uint64_t { run = 1, grain = 2, pair = 3, wall = 4, gas = 5 };

}  // namespace

Hash128 state_hash(const World& world, const Particles& particles, const Contacts& contacts, std::uint64_t step,
                   std::span<const double> remembered, GasPhase* gas) {
  Sum sum;
  std::vector<std::uint64_t> words;
  // Scenes without further laws keep the hashes that they had.
  const bool has_further = contacts.choice().has_further();
  const auto add_further = [&](const FurtherMemory& m) {
    if (has_further) words.insert(words.end(), {word(m.angle[0]), word(m.angle[1]), word(m.angle[2]), word(m.bond)});
  };
  const auto start = [&](Kind kind) { words.assign(1, static_cast<std::uint64_t>(kind)); };
  if (world.is_root()) {
    start(Kind::run);
    words.push_back(step);
    for (const double value : remembered) words.push_back(word(value));
    sum.add(words);
  }
  for (std::int32_t i = 0; i < particles.size(); ++i) {
    if (!particles.is_here(i)) continue;
    start(Kind::grain);
    for (const FieldInfo& row : field_table) {
      if (!particles.has(row.field) || row.travel == Travel::never || row.field == Field::dissipated) continue;
      if (row.type == FieldType::gid)
        words.push_back(particles.gid(i));
      else if (row.type == FieldType::index)
        words.push_back(particles.material(i));
      else
        for (int c = 0; c < row.components; ++c) words.push_back(word(particles.real(row.field, i, c)));
    }
    sum.add(words);
  }
  contacts.for_each_memory(particles, [&](std::int32_t a, std::int32_t b, std::uint8_t image, const PairMemory& m) {
    start(Kind::pair);
    words.insert(words.end(), {particles.gid(a), particles.gid(b), image, word(m.displacement[0]),
                               word(m.displacement[1]), word(m.displacement[2])});
    add_further(m.further);
    sum.add(words);
  });
  for (const WallCarry::Item& item : contacts.wall_carry().items) {
    const PairMemory& m = item.memory.memory;
    const Vec3 n = item.memory.normal;
    start(Kind::wall);
    words.insert(words.end(),
                 {particles.gid(item.grain), static_cast<std::uint64_t>(item.surface), word(n.x), word(n.y), word(n.z),
                  word(m.displacement[0]), word(m.displacement[1]), word(m.displacement[2])});
    add_further(m.further);
    sum.add(words);
  }
  if (gas)
    gas->each_part([&](std::span<const std::uint64_t> part) {
      start(Kind::gas);
      words.insert(words.end(), part.begin(), part.end());
      sum.add(words);
    });
  sum.total(world);
  return sum.value();
}

}  // namespace moraine
