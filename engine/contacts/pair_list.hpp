// The pair list: who may touch whom until the next rebuild, laid out for the sweeps.
//
// A pair belongs to the grain that comes first in memory; a thread owns a range of grains and the pairs of these. Its range is
// cut into tiles. The forces of a tile's pairs go into a ring of slots that stays in the cache; when a tile is swept, its grains
// are complete and are summed and advanced at once. A grain that also has pairs in an earlier thread's range is deferred: it
// waits until all threads are through, and the slots of all its pairs are kept until the next step (as are the slots
// of pairs with a grain of another column of cells, which would stay too long for a ring).
//
// With several ranks, a pair of a grain with a ghost is a border pair. Border pairs of a thread lie in a last tile without grains, which is
// swept when the ghosts are fresh; their grains are deferred, so that everything else needs no ghosts.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "engine/contacts/cells.hpp"
#include "engine/contacts/size_grids.hpp"
#include "engine/particles/aligned_array.hpp"
#include "engine/particles/particles.hpp"
#include "kernels/base/exact_sum.hpp"
#include "kernels/base/range.hpp"
#include "kernels/contact/sweep.hpp"
#include "kernels/motion/motion.hpp"

namespace moraine {

/// What a contact remembers for rolling resistance and cohesion.
struct FurtherMemory {
  double angle[3];  // [rad] rolled: of the grain of lower gid relative to the other
  double bond;      // 1: a bond is made
  bool is_used() const { return angle[0] != 0.0 || angle[1] != 0.0 || angle[2] != 0.0 || bond != 0.0; }
};

/// What a touching pair remembers from step to step.
struct PairMemory {
  double displacement[3];  // [m] of the grain of lower gid relative to the other
  double energy;           // [J]
  FurtherMemory further;
  /// False where there is nothing to remember.
  bool is_used() const {
    return displacement[0] != 0.0 || displacement[1] != 0.0 || displacement[2] != 0.0 || further.is_used();
  }
};

/// Pairs of a tile lie in bands by how far apart their grains were at the rebuild, those that go to the ring and those whose slots are kept
/// each: of a band that is still too far apart to touch, nothing is computed.
inline constexpr int n_bands = 5;
using BandBegins = std::array<std::int64_t, n_bands - 1>;  // of all but the nearest

struct Tile {
  std::int32_t grain_begin = 0, grain_end = 0;
  std::int64_t ring_begin = 0;  // pairs of the tile: first those whose slots go to the ring ...
  BandBegins ring_bands{};      // (the nearest band begins at ring_begin)
  std::int64_t kept_begin = 0;  // ... then those whose slots are kept
  BandBegins kept_bands{};
  std::int64_t pair_end = 0;
  std::uint32_t kept_slot = 0;                    // place of the slot of the pair at kept_begin
  std::int64_t plain_begin = -1, plain_end = -1;  // grains that are not deferred, in ThreadPairs::plain; -1: all are
};

/// The share of one thread.
struct alignas(64) ThreadPairs {  // threads write their own cache lines
  std::int32_t grain_begin = 0, grain_end = 0;
  std::vector<Tile> tiles;
  AlignedArray<std::int32_t> a, b;     // lower and higher gid
  AlignedArray<std::uint8_t> image;    // only with periodic directions
  AlignedArray<std::uint8_t> species;  // only where not uniform
  AlignedArray<std::byte>
      history;            // what pairs remember, memory_size() doubles or floats each; only for laws with history
  MemoryColumns columns;  // of it
  AlignedArray<std::uint16_t> was_near;  // a bit of each pair, a word of each group: the others remember nothing
  bool is_mixed = false;                 // floats, there and in the slots
  AlignedArray<std::uint32_t> offsets;   // entries of each of the thread's grains
  AlignedArray<Entry> entries;
  // Which of its entries a grain that is not deferred has to sum in this step: a bit of each, from a word of its own on.
  AlignedArray<std::uint64_t> acting;     // and a last word that no one reads
  std::vector<std::uint32_t> first_word;  // of each grain, and the end; empty where each has one
  AlignedArray<std::uint32_t> marks;      // of each pair, for a and for b, as in PairSweep
  std::uint32_t ring_slot = 0;  // place of the ring among the slots: that of pair k's is ring_slot + (k & ring_mask)
  std::uint32_t ring_mask = 0;
  bool has_border = false;          // the last tile holds the border pairs
  std::vector<std::int32_t> plain;  // where tiles have deferred grains
  std::vector<std::int32_t> deferred;
  std::int64_t n_pairs = 0;  // without the dummies that fill groups up

  /// The pair of grain i whose slot lies there in the ring: the last one there by the end of its tile.
  std::int64_t pair_in_ring(std::int32_t i, std::uint32_t place) const;
  /// The pair whose kept slot lies there; -1: it is another thread's.
  std::int64_t pair_of_kept(std::uint32_t place) const;
  void release_index() {
    offsets.release();
    entries.release();
    acting.release();
    marks.release();
    first_word = {};
  }
  /// What pair k remembers; all zero for laws without history.
  PairMemory memory(std::int64_t k) const {
    PairMemory m{};
    if (history.size() == 0) return m;
    if (is_mixed)
      each_column(m, [&](double& value, int c) { value = numbers<float>()[place(k, c)]; });
    else
      each_column(m, [&](double& value, int c) { value = numbers<double>()[place(k, c)]; });
    return m;
  }
  /// Pairs [begin, end), which are whole groups, remember nothing.
  void forget(std::int64_t begin, std::int64_t end) {
    if (history.size() == 0) return;
    const std::size_t number = number_size(is_mixed), first = place(begin, 0) * number;
    std::memset(history.data() + first, 0, place(end, 0) * number - first);
  }
  /// Calls f(k) for the pairs that remember something.
  template <typename Function>
  void for_each_used(Function f) const {
    if (history.size() == 0 || tiles.empty()) return;
    for (std::int64_t group = 0; group < tiles.back().pair_end; group += pair_group)
      for (unsigned rest = was_near[static_cast<std::size_t>(group / pair_group)]; rest != 0; rest &= rest - 1)
        if (const std::int64_t k = group + std::countr_zero(rest); memory(k).is_used()) f(k);
  }
  std::uint8_t image_of(std::int64_t k) const {
    return image.size() ? image[static_cast<std::size_t>(k)] : std::uint8_t{0};
  }
  /// Only for laws with history.
  void set_memory(std::int64_t k, const PairMemory& m) {
    if (!columns.has_history) return;
    was_near[static_cast<std::size_t>(k / pair_group)] |= static_cast<std::uint16_t>(1u << k % pair_group);
    if (is_mixed)
      each_column(m, [&](double value, int c) { numbers<float>()[place(k, c)] = static_cast<float>(value); });
    else
      each_column(m, [&](double value, int c) { numbers<double>()[place(k, c)] = value; });
  }

 private:
  template <typename Real>
  Real* numbers() {
    return reinterpret_cast<Real*>(history.data());
  }
  template <typename Real>
  const Real* numbers() const {
    return reinterpret_cast<const Real*>(history.data());
  }
  std::size_t place(std::int64_t k, int c) const { return static_cast<std::size_t>(k * memory_size(columns) + c); }
  /// Calls f(value, column) for every column.
  template <typename Memory, typename Function>
  void each_column(Memory& m, Function f) const {
    for (int c = 0; c < 3; ++c) f(m.displacement[c], c);
    if (columns.has_energy) f(m.energy, energy_in_memory);
    for (int c = 0; columns.has_rolling && c < 3; ++c) f(m.further.angle[c], angle_in_memory + c);
    if (columns.has_bond) f(m.further.bond, bond_in_memory);
  }
};

/// Throws SceneError where the places of slots and the bits of acting entries have no room in 32 bits: with more than some 2^31 slots in a rank,
/// or some 2^26 grains in a thread.
void check_sizes(std::span<const ThreadPairs> threads);

/// What pairs remember across a rebuild: for each grain, by its place before the rebuild, touching pairs. A pair of two grains of this
/// rank stands at one of them at least.
struct PairCarry {
  struct Item {
    double displacement[3];         // as in PairMemory
    std::uint64_t other_and_image;  // gid of the other grain << 8 | image as stored: from the lower gid
  };
  static std::uint64_t key(std::uint64_t gid, std::uint8_t image) { return gid << 8 | image; }
  std::vector<std::uint32_t> begin;  // of each grain, and the end; empty where nothing is remembered
  std::vector<Item> items;
  std::vector<double> energy;          // [J] of each item; only with the energy ledger
  std::vector<FurtherMemory> further;  // of each item; only for laws that remember more

  /// One grain of a pair: its place before the rebuild (-1: a ghost) and its gid.
  struct End {
    std::int32_t was_at;
    std::uint64_t gid;
  };
  /// True where a pair stands only at the one of its grains that came first in memory.
  bool is_at_first = false;
  /// Makes long rows fit for find(): a boulder touches thousands. Before the first find().
  void sort_long_rows();
  /// The item of the pair, or `none`.
  std::int64_t find(End first, End second, std::uint8_t image) const;
  static constexpr std::int64_t none = -1;
  /// What an item says; of none that nothing is remembered.
  PairMemory memory(std::int64_t item) const;

 private:
  std::int64_t find_at(std::int32_t was_at, std::uint64_t wanted) const;
  static constexpr std::size_t long_row = 32;
};

/// A ghost as the cells of this rank's grains see it: itself, or one of its periodic images.
struct GhostCopy {
  std::int32_t ghost = 0;  // place in memory
  std::uint8_t image = 0;  // position = that of the ghost + shift(image)
  Vec3 position;           // [m]
};

/// A ghost that has moved on in the last step, as its pairs must know.
struct GhostEvent {
  std::int32_t ghost = 0;
  std::array<int, 3> steps{};  // periods that it was brought back by
  bool has_left = false;       // the scene
};

/// What the list must provide for the scene's kernels.
struct PairNeeds {
  MemoryColumns memory{true, true};  // what a pair remembers
  bool has_images = false;
  bool has_species = false;
  int slot_size = 8;                            // numbers
  bool is_mixed = false;                        // numbers of slots and memory are floats; else doubles
  const std::uint8_t* species_table = nullptr;  // by material, square
  int n_materials = 1;
  double range = 0.0;  // [m] no pair has a force beyond this gap
};

class PairList {
 public:
  /// Pairs of grains nearer than the sum of their radii and their `rooms` (and the range of their attraction), and of grains with ghosts
  /// nearer than that of their radii and the skin, or of all where `rooms` is empty. The grains must be sorted as in `cells`; `was_at` gives the
  /// place that each had before (to find its memory in `carry`, whose long rows are sorted for it). Where there are several classes of sizes, `sizes` has the cells for the
  /// search, and `cells` only the order; otherwise it is empty.
  void build(const Particles& particles, const Cells& cells, const SizeGrids& sizes, std::span<const GhostCopy> ghosts,
             std::span<const Vec3> image_shift, double skin, std::span<const double> rooms, const PairNeeds& needs,
             std::span<const std::int32_t> was_at, PairCarry& carry, int n_threads);
  /// How long each thread has taken to advance its share since the list was made [s]: the next list is cut so that all take the same time. Pairs
  /// are not alike: many touch in one place and few in another.
  void note_times(std::span<const double> seconds);
  /// Grains that the search for the present list has tested for being near one.
  std::int64_t n_tested() const { return n_tested_; }
  /// The memory of all pairs that have a force, by present places. `is_leaving` marks the grains that go to other ranks (empty: none): pairs of
  /// these stand at both grains.
  PairCarry carry(const Particles& particles, std::span<const std::uint8_t> is_leaving, bool has_energy,
                  int n_threads) const;
  /// Gives back entries and slots: all but the pairs and what they remember.
  void release_index();
  /// Gives back what a rebuild makes anew, so that old and new are never held at once. Only build() may follow.
  void forget();

  std::vector<ThreadPairs>& threads() { return threads_; }
  const std::vector<ThreadPairs>& threads() const { return threads_; }
  /// Of all pairs: the rings of the threads, then those that are kept.
  std::byte* slots() { return slots_.data(); }
  bool is_in_ring(Entry entry) const { return entry >> 1 < n_ring_slots_; }
  /// Pairs of the bands from here to `end` cannot touch as long as no two grains have come nearer by more than this share of the rooms of
  /// both since the rebuild. A kept slot of theirs is zero until they are swept for the first time.
  static std::int64_t far_begin(const BandBegins& bands, std::int64_t end, double used);
  /// The share at which the next band opens, or the list ends.
  static double next_opening(double used);
  /// Number of pairs in the list.
  std::int64_t size() const;
  std::size_t memory() const;

  /// Grain i has crossed periodic faces: x(new) = x(old) + steps * period. Its pairs now see other images.
  void shift_images(std::int32_t i, const std::array<int, 3>& steps);
  /// Grain i has left: its pairs remember nothing more. Adds up the energy that their springs held [J]; of a border pair only
  /// where i is of lower gid than the ghost, as the other rank counts it otherwise.
  void clear_memory(const Particles& particles, std::int32_t i, ExactSum& energy);
  /// The same two for ghosts, all at once.
  void follow_ghosts(const Particles& particles, std::span<const GhostEvent> events, ExactSum& energy);
  /// Pairs in which grain i of this rank is.
  std::uint32_t n_pairs_of(std::int32_t i) const;

  /// Calls f(a, b, image, memory or nullptr) for every pair.
  template <typename Function>
  void for_each(std::int32_t dummy, Function f) const {
    for (const ThreadPairs& t : threads_) for_each_in(t, dummy, f);
  }

 private:
  template <typename Function>
  static void for_each_in(const ThreadPairs& t, std::int32_t dummy, Function f) {
    for (const Tile& tile : t.tiles)
      for (std::int64_t k = tile.ring_begin; k < tile.pair_end; ++k) {
        const auto p = static_cast<std::size_t>(k);
        if (t.a[p] == dummy) continue;
        const PairMemory memory = t.memory(k);
        f(t.a[p], t.b[p], t.image_of(k), t.history.size() ? &memory : nullptr);
      }
  }
  /// A pair as it is found: i, which comes first in memory, and j, which may be a ghost.
  struct FoundPair {
    std::int32_t i, j;
    std::uint8_t image;  // of j seen from i
    std::uint8_t band;
  };
  struct SearchPlace;
  void search(const SearchPlace& place, int n_threads);
  void search_in_order(const SearchPlace& place, const Spheres& spheres, int thread, int n_threads);
  void search_by_size(const SearchPlace& place, int thread, int n_threads);
  void put_in_order(const SearchPlace& place, int thread, int n_threads);
  std::vector<FoundPair> own_images_of(const SearchPlace& place, std::int32_t i) const;
  void cut(std::int32_t n_grains, int n_threads);
  double end_of_share(std::size_t thread) const;
  void mark_deferred(int thread);
  void lay_out(const SearchPlace& place, const PairNeeds& needs, std::span<const std::int32_t> was_at,
               const PairCarry& carry, int thread);
  void index_entries(const Particles& particles, const PairNeeds& needs, int thread);
  void give_marks(int thread);
  template <typename Function>
  void for_each_raw(std::int32_t begin, std::int32_t end, Function f) const;
  template <typename Function>
  void for_each_of(std::int32_t i, Function f);

  struct alignas(64) RawChunk {  // threads write their own cache lines
    std::int32_t grain_begin = 0, grain_end = 0;
    std::vector<std::uint32_t> offsets;  // of each grain of the chunk, and the end
    std::int64_t n_pairs = 0;
    AlignedArray<std::int32_t> j;
    AlignedArray<std::uint8_t> image;  // of j seen from i; empty without periodic directions
    AlignedArray<std::uint8_t> band;
    std::vector<FoundPair> border;  // with ghosts, of any grains
    std::int64_t n_tested = 0;

    void make_room(std::int64_t n_more, bool has_images);
    NearGrains end() {
      return {j.data() + n_pairs, image.size() ? image.data() + n_pairs : nullptr, band.data() + n_pairs};
    }
    FoundPair pair(std::int32_t i, std::size_t k) const {
      return {i, j[k], image.size() ? image[k] : std::uint8_t{0}, band[k]};
    }
    void put(const FoundPair& pair, std::int64_t k) {
      const auto p = static_cast<std::size_t>(k);
      j[p] = pair.j;
      if (image.size()) image[p] = pair.image;
      band[p] = pair.band;
    }
  };
  /// A pair whose second grain belongs to a later thread.
  struct CrossPair {
    std::int32_t grain;  // the later one
    std::int32_t other;
    std::uint32_t slot;  // among the kept slots of the earlier thread
    std::uint8_t image;  // as stored
    bool is_b;           // grain is b
  };

  std::int32_t furthest_in_ring_ =
      0;  // places from the first to the second grain of a pair whose slot goes to the ring
  std::vector<RawChunk> raw_;
  std::vector<std::vector<FoundPair>> found_;  // by the thread that found them
  std::int64_t n_tested_ = 0;
  std::int64_t n_last_ = 0;                    // pairs of the last list, to expect as many
  std::vector<std::vector<CrossPair>> cross_;  // by owning thread
  std::vector<std::uint32_t> kept_base_;       // place of the first kept slot of each thread
  std::vector<std::uint8_t> is_deferred_;
  std::vector<ThreadPairs> threads_;
  std::vector<double> ends_;  // of the threads' shares, of all counted work; other than n threads: all have the same
  AlignedArray<std::byte> slots_;
  std::uint32_t n_ring_slots_ = 0;
};

}  // namespace moraine
