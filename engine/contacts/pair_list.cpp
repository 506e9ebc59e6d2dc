#include "engine/contacts/pair_list.hpp"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>

#include "engine/scene/scene.hpp"
#include "engine/threads.hpp"
#include "kernels/contact/sweep.hpp"
#include "kernels/search/row_order.hpp"

namespace moraine {

namespace {

/// Grains in a tile: its pairs' slots and its records fit in the second-level cache beside the ring.
constexpr std::int32_t tile_size = 512;
/// Fewer grains than this are not worth a thread of their own.
constexpr std::int32_t min_grains_per_thread = 64;
/// Work of a grain beside its pairs, in pairs.
constexpr std::int64_t grain_work = 4;

/// The gap between grains of a band's pairs at the rebuild is at least this share of the rooms of both. Touching pairs are in the first band; where
/// grains move little, the others are never looked at.
constexpr std::array<double, n_bands> band_share = {0.0, 0.125, 0.25, 0.5, 0.75};

constexpr std::int64_t round_up(std::int64_t k) { return (k + pair_group - 1) / pair_group * pair_group; }

std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

/// Images in which a grain may meet itself: there are some where the domain is hardly wider than the largest grain.
std::vector<std::uint8_t> near_own_images(const Cells& cells, double reach, std::span<const Vec3> image_shift) {
  std::vector<std::uint8_t> codes;
  for (std::uint8_t code = 1; code < image_shift.size(); ++code) {
    const auto [x, y, z] = image::steps(code);
    const bool is_neighbour = std::max({std::abs(x), std::abs(y), std::abs(z)}) == 1;
    if (is_neighbour && image::is_positive(code) && cells.has_image(code) && length(image_shift[code]) < reach)
      codes.push_back(code);
  }
  return codes;
}

}  // namespace

void PairCarry::sort_long_rows() {
  std::vector<std::size_t> order;
  const auto put_in_order = [&order](auto& values, std::size_t first) {
    if (values.empty()) return;
    const auto row = values.begin() + static_cast<std::ptrdiff_t>(first);
    const std::vector old(row, row + static_cast<std::ptrdiff_t>(order.size()));
    for (std::size_t k = 0; k < order.size(); ++k) values[first + k] = old[order[k] - first];
  };
  for (std::size_t i = 0; i + 1 < begin.size(); ++i) {
    const std::size_t first = begin[i], size = begin[i + 1] - first;
    if (size <= long_row) continue;
    order.resize(size);
    std::iota(order.begin(), order.end(), first);
    std::sort(order.begin(), order.end(),
              [&](std::size_t x, std::size_t y) { return items[x].other_and_image < items[y].other_and_image; });
    put_in_order(items, first);
    put_in_order(energy, first);
    put_in_order(further, first);
  }
}

std::int64_t PairCarry::find_at(std::int32_t was_at, std::uint64_t wanted) const {
  std::size_t k = begin[at(was_at)];
  const std::size_t end = begin[at(was_at) + 1];
  if (end - k > long_row) {  // sorted
    const auto is_before = [](const Item& item, std::uint64_t w) { return item.other_and_image < w; };
    k = at(std::lower_bound(items.begin() + static_cast<std::ptrdiff_t>(k),
                            items.begin() + static_cast<std::ptrdiff_t>(end), wanted, is_before) -
           items.begin());
    return k < end && items[k].other_and_image == wanted ? static_cast<std::int64_t>(k) : none;
  }
  for (; k < end; ++k)
    if (items[k].other_and_image == wanted) return static_cast<std::int64_t>(k);
  return none;
}

std::int64_t PairCarry::find(End first, End second, std::uint8_t image) const {
  if (items.empty()) return none;
  if (second.was_at >= 0 && second.was_at < first.was_at) std::swap(first, second);
  std::int64_t found = first.was_at < 0 ? none : find_at(first.was_at, key(second.gid, image));
  if (found == none && second.was_at >= 0 && !is_at_first) found = find_at(second.was_at, key(first.gid, image));
  return found;
}

PairMemory PairCarry::memory(std::int64_t item) const {
  if (item == none) return {};
  const auto k = at(item);
  const double* const d = items[k].displacement;
  return {{d[0], d[1], d[2]}, energy.empty() ? 0.0 : energy[k], further.empty() ? FurtherMemory{} : further[k]};
}

/// What the search goes through.
struct PairList::SearchPlace {
  const Particles& particles;
  const Cells& cells;
  const SizeGrids& sizes;
  std::span<const GhostCopy> ghosts;
  std::span<const Vec3> image_shift;  // empty where nothing is periodic
  double skin, range;                 // [m]
  std::span<const double> rooms;      // [m] of each grain; empty: half the skin, as ghosts have
  std::vector<std::uint8_t> own_images;

  double room(std::int32_t i) const { return at(i) < rooms.size() ? rooms[at(i)] : 0.5 * skin; }
  /// The last band that begins nearer than the two are.
  std::uint8_t band_of(std::int32_t i, std::int32_t j, std::uint8_t image) const {
    Vec3 separation = particles.position(i) - particles.position(j);
    if (image) separation = separation + image_shift[image];
    const double squared = squared_length(separation), rooms_of_both = room(i) + room(j);
    const double radii = particles.radius(i) + particles.radius(j) + range;
    std::uint8_t band = n_bands - 1;
    for (; band > 0; --band) {
      const double distance = radii + band_share[band] * rooms_of_both;
      if (squared >= distance * distance) break;
    }
    return band;
  }
};

void PairList::RawChunk::make_room(std::int64_t n_more, bool has_images) {
  const std::size_t needed = at(n_pairs + n_more);
  if (needed <= j.size()) return;
  const std::size_t n = needed + needed / 2;
  j.resize_keeping(n);
  band.resize_keeping(n);
  if (has_images) image.resize_keeping(n);
}

void PairList::build(const Particles& particles, const Cells& cells, const SizeGrids& sizes,
                     std::span<const GhostCopy> ghosts, std::span<const Vec3> image_shift, double skin,
                     std::span<const double> rooms, const PairNeeds& needs, std::span<const std::int32_t> was_at,
                     PairCarry& carry, int n_threads) {
  carry.sort_long_rows();
  const std::int32_t n = particles.size();
  const int n_active = std::max(1, std::min(n_threads, n / min_grains_per_thread));
  furthest_in_ring_ = cells.furthest_in_column();
  const double reach = sizes.size() > 0 ? sizes.reach() : cells.reach();
  const SearchPlace place = {
      particles,
      cells,
      sizes,
      ghosts,
      needs.has_images ? image_shift : std::span<const Vec3>{},
      skin,
      needs.range,
      rooms,
      needs.has_images ? near_own_images(cells, reach, image_shift) : std::vector<std::uint8_t>{}};
  search(place, n_active);
  cut(n, n_active);
  is_deferred_.assign(at(n), 0);
  cross_.assign(at(n_active), {});
  kept_base_.assign(at(n_active) + 1, 0);
  parallel(n_active, [&](int thread) {
    mark_deferred(thread);
    barrier();
    lay_out(place, needs, was_at, carry, thread);
  });
  check_sizes(threads_);
  n_ring_slots_ = 0;
  for (ThreadPairs& t : threads_) {
    t.ring_slot = n_ring_slots_;
    n_ring_slots_ += t.ring_mask + 1;
  }
  kept_base_[0] = n_ring_slots_;
  for (std::size_t t = 0; t < at(n_active); ++t) kept_base_[t + 1] += kept_base_[t];
  slots_.resize_discarding(at(std::int64_t{kept_base_.back()} * needs.slot_size) * number_size(needs.is_mixed));
  n_last_ = size();
  raw_.clear();
  parallel(n_active, [&](int thread) { index_entries(particles, needs, thread); });
}

void PairList::search(const SearchPlace& place, int n_threads) {
  const Particles& particles = place.particles;
  const bool is_by_size = place.sizes.size() > 0;
  const std::int32_t n = particles.size();
  // Coordinates in arrays of their own for the filter, with radii that contain the rooms, and place for a vector behind the last.
  const std::size_t row = at(n) + 8;
  AlignedArray<double> coordinates;
  if (!is_by_size) coordinates.resize_discarding(5 * row);
  double* const values = coordinates.data();
  const Spheres spheres =
      is_by_size ? Spheres{} : Spheres{values, values + row, values + 2 * row, values + 3 * row, values + 4 * row};
  raw_.clear();
  raw_.resize(at(n_threads));
  found_.assign(at(is_by_size ? n_threads : 0), {});
  parallel(n_threads, [&](int thread) {
    const Range share = share_of(n, thread, n_threads);
    RawChunk& chunk = raw_[at(thread)];
    chunk.grain_begin = static_cast<std::int32_t>(share.begin);
    chunk.grain_end = static_cast<std::int32_t>(share.end);
    chunk.offsets.assign(at(share.size()) + 1, 0);
    if (is_by_size) {
      search_by_size(place, thread, n_threads);
      barrier();
      put_in_order(place, thread, n_threads);
      return;
    }
    for (std::int64_t i = share.begin; i < share.end; ++i) {
      for (int c = 0; c < 4; ++c) values[static_cast<std::size_t>(c) * row + at(i)] = particles.record(i)[c];
      const double room = place.room(static_cast<std::int32_t>(i));
      values[3 * row + at(i)] += room;
      values[4 * row + at(i)] = room;
    }
    if (thread == 0)
      for (std::size_t c = 0; c < 5; ++c) std::fill_n(values + c * row + at(n), 8, 0.0);
    barrier();
    search_in_order(place, spheres, thread, n_threads);
  });
  found_ = {};
  n_tested_ = 0;
  for (const RawChunk& chunk : raw_) n_tested_ += chunk.n_tested;
}

/// Grain i with those of its images that are near it.
std::vector<PairList::FoundPair> PairList::own_images_of(const SearchPlace& place, std::int32_t i) const {
  std::vector<FoundPair> found;
  const double limit = 2.0 * place.particles.radius(i) + place.skin + place.range;
  for (const std::uint8_t code : place.own_images)
    if (squared_length(place.image_shift[code]) < limit * limit)
      found.push_back({i, i, code, place.band_of(i, i, code)});
  return found;
}

/// Grains lie in memory as in the cells, and each looks for those that come after it.
void PairList::search_in_order(const SearchPlace& place, const Spheres& spheres, int thread, int n_threads) {
  const Particles& particles = place.particles;
  const NearFilter filter = near_filter();
  RawChunk& chunk = raw_[at(thread)];
  const bool has_images = !place.image_shift.empty();
  const auto asking = [&](std::int32_t i, Vec3 centre) {
    return Asking{centre,
                  particles.radius(i) + place.room(i) + place.range,
                  place.room(i),
                  place.image_shift.data(),
                  band_share.data(),
                  n_bands};
  };
  const auto n_in = [](const Cells::Run* runs, int n_runs) {
    std::int64_t n = 0;
    for (int r = 0; r < n_runs; ++r) n += runs[r].grains.size();
    return n;
  };
  chunk.make_room(n_last_ / n_threads, has_images);  // about as many as last time, and half as many more
  Cells::Walk walk(place.cells);
  for (std::int32_t i = chunk.grain_begin; i < chunk.grain_end; ++i) {
    const Vec3 centre = particles.position(i);
    Cells::Run runs[Cells::max_runs];
    const int n_runs = walk.runs_after(i, centre, runs);
    const std::int64_t n_asked = n_in(runs, n_runs);
    chunk.n_tested += n_asked;
    chunk.make_room(n_asked, has_images);
    chunk.n_pairs += filter(spheres, runs, n_runs, asking(i, centre), chunk.end());
    if (!place.own_images.empty()) {
      const std::vector<FoundPair> own = own_images_of(place, i);
      chunk.make_room(static_cast<std::int64_t>(own.size()), has_images);
      for (const FoundPair& pair : own) chunk.put(pair, chunk.n_pairs++);
    }
    chunk.offsets[at(i - chunk.grain_begin) + 1] = static_cast<std::uint32_t>(chunk.n_pairs);
  }
  std::vector<Cells::Run> runs;
  RawChunk found;  // of one ghost
  const Range ghosts = share_of(static_cast<std::int64_t>(place.ghosts.size()), thread, n_threads);
  for (std::int64_t g = ghosts.begin; g < ghosts.end; ++g) {
    const GhostCopy& copy = place.ghosts[at(g)];
    place.cells.runs_within(copy.position, place.cells.reach(), runs);
    const int n_runs = static_cast<int>(runs.size());
    const std::int64_t n_asked = n_in(runs.data(), n_runs);
    chunk.n_tested += n_asked;
    found.make_room(n_asked, has_images);
    const int n_found = filter(spheres, runs.data(), n_runs, asking(copy.ghost, copy.position), found.end());
    for (std::size_t k = 0; k < at(n_found); ++k) {
      const FoundPair seen = found.pair(copy.ghost, k);  // from the ghost
      chunk.border.push_back({seen.j, copy.ghost, image::inverse(image::sum(copy.image, seen.image)), seen.band});
    }
  }
}

/// Each class of sizes has its own cells, and the larger grain finds the smaller one, wherever in memory that lies.
void PairList::search_by_size(const SearchPlace& place, int thread, int n_threads) {
  const Particles& particles = place.particles;
  RawChunk& chunk = raw_[at(thread)];
  SizeGrids::Scratch scratch;
  std::vector<FoundPair> found;
  place.sizes.for_each_pair(particles, thread, n_threads, scratch,
                            [&](std::int32_t i, std::int32_t j, std::uint8_t code) {
                              if (j < i) {
                                std::swap(i, j);
                                code = image::inverse(code);
                              }
                              found.push_back({i, j, code, place.band_of(i, j, code)});
                            });
  for (std::int32_t i = chunk.grain_begin; i < chunk.grain_end && !place.own_images.empty(); ++i)
    for (const FoundPair& pair : own_images_of(place, i)) found.push_back(pair);
  const Range ghosts = share_of(static_cast<std::int64_t>(place.ghosts.size()), thread, n_threads);
  for (std::int64_t g = ghosts.begin; g < ghosts.end; ++g) {
    const GhostCopy& copy = place.ghosts[at(g)];
    place.sizes.for_each_near(copy.position, particles.radius(copy.ghost) + place.skin + place.range,
                              place.sizes.size(), scratch, [&](std::int32_t j, std::uint8_t code) {
                                code = image::inverse(image::sum(copy.image, code));
                                chunk.border.push_back({j, copy.ghost, code, place.band_of(j, copy.ghost, code)});
                              });
  }
  chunk.n_tested = scratch.n_tested;
  found_[at(thread)] = std::move(found);
}

/// What all threads have found, as the rows of this thread's grains.
void PairList::put_in_order(const SearchPlace& place, int thread, int n_threads) {
  RawChunk& chunk = raw_[at(thread)];
  const auto for_each_found = [&](auto f) {
    for (int from = 0; from < n_threads; ++from)
      for (const FoundPair& pair : found_[at(from)])
        if (pair.i >= chunk.grain_begin && pair.i < chunk.grain_end) f(pair);
  };
  for_each_found([&](const FoundPair& pair) { ++chunk.offsets[at(pair.i - chunk.grain_begin) + 1]; });
  for (std::size_t k = 1; k < chunk.offsets.size(); ++k) chunk.offsets[k] += chunk.offsets[k - 1];
  chunk.make_room(chunk.offsets.back(), !place.image_shift.empty());
  chunk.n_pairs = chunk.offsets.back();
  std::vector<std::uint32_t> next(chunk.offsets.begin(), chunk.offsets.end() - 1);
  for_each_found([&](const FoundPair& pair) { chunk.put(pair, next[at(pair.i - chunk.grain_begin)]++); });
}

double PairList::end_of_share(std::size_t thread) const {
  return ends_.size() == threads_.size() ? ends_[thread]
                                         : static_cast<double>(thread + 1) / static_cast<double>(threads_.size());
}

/// Within a share all counted work is taken to cost the same. Half the way, as times are noisy.
void PairList::note_times(std::span<const double> seconds) {
  const std::size_t n = threads_.size();
  const double total = std::accumulate(seconds.begin(), seconds.end(), 0.0);
  if (seconds.size() != n || n < 2 || !(total > 0.0)) return;
  std::vector<double> ends(n);
  double begin = 0.0, before = 0.0;  // of the share: in counted work, in time
  std::size_t next = 0;
  for (std::size_t t = 0; t < n; ++t) {
    const double end = end_of_share(t), after = before + seconds[t];
    for (; next + 1 < n && static_cast<double>(next + 1) * total <= after * static_cast<double>(n); ++next) {
      const double wanted = static_cast<double>(next + 1) * total / static_cast<double>(n);
      ends[next] = begin + (end - begin) * (seconds[t] > 0.0 ? (wanted - before) / seconds[t] : 1.0);
    }
    begin = end;
    before = after;
  }
  for (std::size_t t = 0; t + 1 < n; ++t) ends[t] = 0.5 * (ends[t] + end_of_share(t));
  ends[n - 1] = 1.0;
  ends_ = std::move(ends);
}

void PairList::cut(std::int32_t n_grains, int n_threads) {
  threads_.resize(at(n_threads));
  std::vector<std::uint32_t> n_border;  // pairs with ghosts, of the grains before each
  for (const RawChunk& chunk : raw_) {
    if (!chunk.border.empty() && n_border.empty()) n_border.assign(at(n_grains) + 1, 0);
    for (const FoundPair& pair : chunk.border) ++n_border[at(pair.i) + 1];
  }
  for (std::size_t i = 1; i < n_border.size(); ++i) n_border[i] += n_border[i - 1];
  std::int64_t before = 0;  // pairs of the chunks before
  std::vector<std::int64_t> pairs_before;
  for (const RawChunk& chunk : raw_) {
    pairs_before.push_back(before);
    before += chunk.n_pairs;
  }
  const auto work_before = [&](std::int32_t i) {
    const auto after = std::upper_bound(raw_.begin() + 1, raw_.end(), i,
                                        [](std::int32_t grain, const RawChunk& x) { return grain < x.grain_begin; });
    const RawChunk& chunk = *(after - 1);
    return i * grain_work + pairs_before[at(&chunk - raw_.data())] + chunk.offsets[at(i - chunk.grain_begin)] +
           (n_border.empty() ? 0 : n_border[at(i)]);
  };
  const auto total = static_cast<double>(work_before(n_grains));
  std::int32_t begin = 0;
  for (std::size_t thread = 0; thread < threads_.size(); ++thread) {
    std::int32_t end = begin, beyond = n_grains;  // the first grain before which lies the share's work
    while (end < beyond && thread + 1 < threads_.size()) {
      const std::int32_t middle = end + (beyond - end) / 2;
      if (static_cast<double>(work_before(middle)) >= total * end_of_share(thread))
        beyond = middle;
      else
        end = middle + 1;
    }
    threads_[thread].grain_begin = begin;
    threads_[thread].grain_end = begin = beyond;
  }
}

/// Calls f(pair) for the raw pairs of grains [begin, end), in order.
template <typename Function>
void PairList::for_each_raw(std::int32_t begin, std::int32_t end, Function f) const {
  for (const RawChunk& chunk : raw_)
    for (std::int32_t i = std::max(begin, chunk.grain_begin); i < std::min(end, chunk.grain_end); ++i)
      for (std::size_t k = chunk.offsets[at(i - chunk.grain_begin)]; k < chunk.offsets[at(i - chunk.grain_begin) + 1];
           ++k)
        f(chunk.pair(i, k));
}

void PairList::mark_deferred(int thread) {
  const ThreadPairs& mine = threads_[at(thread)];
  if (mine.grain_end < threads_.back().grain_end)
    for_each_raw(mine.grain_begin, mine.grain_end, [&](const FoundPair& pair) {
      if (pair.j >= mine.grain_end) std::atomic_ref(is_deferred_[at(pair.j)]).store(1, std::memory_order_relaxed);
    });
  for (std::size_t chunk = at(thread); chunk < raw_.size(); chunk += threads_.size())
    for (const FoundPair& pair : raw_[chunk].border)
      std::atomic_ref(is_deferred_[at(pair.i)]).store(1, std::memory_order_relaxed);
}

void check_sizes(std::span<const ThreadPairs> threads) {
  std::int64_t n_slots = 0;
  for (const ThreadPairs& t : threads) {
    n_slots += std::int64_t{t.ring_mask} + 1;
    for (const Tile& tile : t.tiles) n_slots += tile.pair_end - tile.kept_begin;
    constexpr std::int64_t most_words = (std::int64_t{1} << 32) / bits_of_word;
    if (t.grain_end - t.grain_begin + 2 * t.n_pairs / bits_of_word >= most_words)
      throw SceneError(
          {{"particles", "more than about 60 million grains in one thread; use more threads or ranks", false}});
  }
  if (n_slots >= std::int64_t{1} << 31)
    throw SceneError({{"particles", "more than 2^31 pairs of grains in one rank; use more ranks", false}});
}

std::int64_t PairList::far_begin(const BandBegins& bands, std::int64_t end, double used) {
  for (std::size_t band = 1; band < n_bands; ++band)
    if (used * (1.0 + 1e-9) < band_share[band] * (1.0 - 1e-9)) return std::min(round_up(bands[band - 1]), end);
  return end;
}

double PairList::next_opening(double used) {
  for (const double share : band_share)
    if (share > used) return share;
  return 1.0;
}

/// Lays the thread's pairs out, tile by tile: band behind band, first those of the ring.
void PairList::lay_out(const SearchPlace& place, const PairNeeds& needs, std::span<const std::int32_t> was_at,
                       const PairCarry& carry, int thread) {
  const Particles& particles = place.particles;
  ThreadPairs& mine = threads_[at(thread)];
  std::vector<FoundPair> border;
  std::int64_t n_raw = 0;
  for (const RawChunk& chunk : raw_) {
    const std::int32_t begin = std::max(mine.grain_begin, chunk.grain_begin),
                       end = std::min(mine.grain_end, chunk.grain_end);
    if (begin < end) n_raw += chunk.offsets[at(end - chunk.grain_begin)] - chunk.offsets[at(begin - chunk.grain_begin)];
    for (const FoundPair& pair : chunk.border)
      if (pair.i >= mine.grain_begin && pair.i < mine.grain_end) border.push_back(pair);
  }
  std::stable_sort(border.begin(), border.end(), [](const auto& x, const auto& y) { return x.i < y.i; });
  n_raw += static_cast<std::int64_t>(border.size());
  const std::int64_t n_tiles = (mine.grain_end - mine.grain_begin + tile_size - 1) / tile_size + 1;
  const std::size_t capacity = at(n_raw + n_tiles * 2 * pair_group);
  mine.n_pairs = n_raw;
  mine.a.resize_discarding(capacity);
  mine.b.resize_discarding(capacity);
  mine.image.resize_discarding(needs.has_images ? capacity : 0);
  mine.species.resize_discarding(needs.has_species ? capacity : 0);
  mine.columns = needs.memory;
  mine.is_mixed = needs.is_mixed;
  const std::size_t n_remembered = at(memory_size(needs.memory)) * capacity;
  mine.history.resize_discarding(n_remembered > 0 ? (n_remembered + beyond_memory) * number_size(needs.is_mixed) : 0);
  mine.was_near.resize_discarding(capacity / pair_group);
  std::fill(mine.was_near.begin(), mine.was_near.end(), std::uint16_t{0});
  mine.tiles.clear();
  mine.plain.clear();
  mine.deferred.clear();
  mine.offsets.resize_discarding(at(mine.grain_end - mine.grain_begin) + 1);
  std::fill(mine.offsets.begin(), mine.offsets.end(), 0u);
  std::uint32_t* const n_entries = mine.offsets.data() + 1;  // of each grain, in pairs of this thread
  std::vector<std::int64_t> earliest(at(n_tiles),
                                     std::numeric_limits<std::int64_t>::max());  // in the ring, of each tile

  const std::int32_t dummy = particles.dummy();
  const bool may_remember = needs.memory.has_history && !carry.items.empty();
  const auto is_lower = [&](std::int32_t i, std::int32_t j) { return particles.gid(i) < particles.gid(j) || i == j; };
  struct Listed {
    FoundPair pair;
    std::uint8_t is_kept, i_is_low;
    std::int64_t item;  // of `carry`
  };
  std::vector<Listed> listed;  // the tile's
  const auto list = [&](const FoundPair& pair, bool is_kept) {
    Listed one{pair, is_kept, is_lower(pair.i, pair.j), PairCarry::none};
    if (!one.i_is_low) one.pair.image = image::inverse(pair.image);  // as stored
    if (may_remember)
      one.item =
          carry.find({was_at[at(pair.i)], particles.gid(pair.i)},
                     {particles.is_owned(pair.j) ? was_at[at(pair.j)] : -1, particles.gid(pair.j)}, one.pair.image);
    // A contact that has just ended is swept once more, in the very next step, wherever its grains are: what its spring still held goes
    // to friction then, not when a band happens to open.
    if (one.item != PairCarry::none && one.pair.band > 0) {
      if (carry.memory(one.item).is_used())
        one.pair.band = 0;
      else
        one.item = PairCarry::none;
    }
    listed.push_back(one);
  };
  std::int64_t k = 0;
  std::uint32_t n_kept = 0;
  const auto put = [&](const Listed& one, std::int64_t place_in_list) {
    const auto& [i, j, stored, band] = one.pair;
    const std::size_t p = at(place_in_list);
    mine.a[p] = one.i_is_low ? i : j;
    mine.b[p] = one.i_is_low ? j : i;
    if (needs.has_images) mine.image[p] = stored;
    if (needs.has_species)
      mine.species[p] = needs.species_table[particles.material(i) * needs.n_materials + particles.material(j)];
    if (one.item != PairCarry::none) mine.set_memory(place_in_list, carry.memory(one.item));
    ++n_entries[i - mine.grain_begin];
    if (j < mine.grain_end) ++n_entries[j - mine.grain_begin];
    if (!one.is_kept) {
      std::int64_t& first = earliest[at((j - mine.grain_begin) / tile_size)];
      first = std::min(first, place_in_list);
    }
    if (j >= mine.grain_end && particles.is_owned(j))
      cross_[at(thread)].push_back({j, i,
                                    n_kept + static_cast<std::uint32_t>(place_in_list - mine.tiles.back().kept_begin),
                                    stored, !!one.i_is_low});
  };
  // The listed pairs become the last tile's, from its beginning at k on.
  const auto put_listed = [&] {
    Tile& tile = mine.tiles.back();
    std::array<std::array<std::int64_t, n_bands>, 2> next{};
    for (const Listed& one : listed) ++next[one.is_kept][one.pair.band];
    const std::int64_t begin = k;
    for (const std::size_t is_kept : {0u, 1u}) {
      (is_kept ? tile.kept_begin : tile.ring_begin) = k;
      for (std::size_t band = 0; band < n_bands; ++band) {
        if (band > 0) (is_kept ? tile.kept_bands : tile.ring_bands)[band - 1] = k;
        const std::int64_t n = next[is_kept][band];
        next[is_kept][band] = k;
        k += n;
      }
      for (; k % pair_group != 0; ++k) {
        const std::size_t p = at(k);
        mine.a[p] = mine.b[p] = dummy;
        if (needs.has_images) mine.image[p] = 0;
        if (needs.has_species) mine.species[p] = 0;
      }
    }
    tile.pair_end = k;
    tile.kept_slot = n_kept;
    mine.forget(begin, k);
    for (const Listed& one : listed) put(one, next[one.is_kept][one.pair.band]++);
    n_kept += static_cast<std::uint32_t>(k - tile.kept_begin);
    listed.clear();
  };
  for (std::int32_t begin = mine.grain_begin; begin < mine.grain_end; begin += tile_size) {
    Tile& tile = mine.tiles.emplace_back();
    tile.grain_begin = begin;
    tile.grain_end = std::min(begin + tile_size, mine.grain_end);
    for_each_raw(tile.grain_begin, tile.grain_end, [&](const FoundPair& pair) {
      const bool is_far = pair.j - pair.i > furthest_in_ring_;  // in another column, or beyond a periodic face
      list(pair, is_far || pair.j >= mine.grain_end || is_deferred_[at(pair.i)] || is_deferred_[at(pair.j)]);
    });
    put_listed();
    bool is_any_deferred = false;
    for (std::int32_t i = tile.grain_begin; i < tile.grain_end; ++i)
      is_any_deferred = is_any_deferred || is_deferred_[at(i)];
    if (is_any_deferred) {
      tile.plain_begin = static_cast<std::int64_t>(mine.plain.size());
      for (std::int32_t i = tile.grain_begin; i < tile.grain_end; ++i)
        (is_deferred_[at(i)] ? mine.deferred : mine.plain).push_back(i);
      tile.plain_end = static_cast<std::int64_t>(mine.plain.size());
    }
  }
  mine.has_border = particles.n_ghosts() > 0;
  if (mine.has_border) {
    Tile& tile = mine.tiles.emplace_back();
    tile.grain_begin = tile.grain_end = mine.grain_end;
    for (const FoundPair& pair : border) list(pair, true);
    put_listed();
  }
  kept_base_[at(thread) + 1] = n_kept;
  // The ring must hold all pairs from the earliest that a tile's grains need to the last of the tile.
  std::int64_t need = pair_group;
  for (std::size_t t = 0; t < mine.tiles.size(); ++t)
    need = std::max(need, mine.tiles[t].kept_begin - std::min(mine.tiles[t].ring_begin, earliest[t]) + pair_group);
  mine.ring_mask = static_cast<std::uint32_t>(std::bit_ceil(static_cast<std::uint64_t>(need)) - 1);
}

std::int64_t ThreadPairs::pair_in_ring(std::int32_t i, std::uint32_t place) const {
  const std::int64_t last = tiles[at((i - grain_begin) / tile_size)].kept_begin - 1;
  return last - ((last - (place - ring_slot)) & ring_mask);
}

std::int64_t ThreadPairs::pair_of_kept(std::uint32_t slot) const {
  const auto after = std::upper_bound(tiles.begin(), tiles.end(), slot,
                                      [](std::uint32_t s, const Tile& x) { return s < x.kept_slot; });
  if (after == tiles.begin()) return -1;
  const Tile& found = *(after - 1);
  const std::int64_t k = found.kept_begin + (slot - found.kept_slot);
  return k < found.pair_end ? k : -1;
}

void PairList::index_entries(const Particles& particles, const PairNeeds& needs, int thread) {
  ThreadPairs& mine = threads_[at(thread)];
  const std::int32_t first = mine.grain_begin, end = mine.grain_end, dummy = particles.dummy();
  const auto slot_bytes = static_cast<std::int64_t>(at(needs.slot_size) * number_size(needs.is_mixed));
  for (Tile& tile : mine.tiles) {
    tile.kept_slot += kept_base_[at(thread)];
    std::fill_n(slots_.data() + tile.kept_slot * slot_bytes, (tile.pair_end - tile.kept_begin) * slot_bytes,
                std::byte{});
  }
  const auto each_from_before = [&](auto f) {  // pairs of earlier threads with grains of this one
    for (int earlier = 0; earlier < thread; ++earlier)
      for (const CrossPair& pair : cross_[at(earlier)])
        if (pair.grain >= first && pair.grain < end) f(pair, kept_base_[at(earlier)] + pair.slot);
  };
  std::uint32_t* const offsets = mine.offsets.data();
  each_from_before([&](const CrossPair& pair, std::uint32_t) { ++offsets[pair.grain - first + 1]; });
  for (std::int32_t i = first; i < end; ++i) offsets[i - first + 1] += offsets[i - first];
  const std::size_t n_entries = offsets[end - first];
  std::vector<std::int64_t> keys(n_entries + 7);
  std::vector<Entry> entries(n_entries);
  std::vector<std::uint32_t> next(offsets, offsets + (end - first));
  const auto put = [&](std::int32_t grain, std::int32_t other, std::uint32_t slot, bool is_b, std::uint8_t code) {
    const std::uint32_t q = next[at(grain - first)]++;
    entries[q] = make_entry(slot, is_b);
    keys[q] = static_cast<std::int64_t>(PairCarry::key(particles.gid(other), code) << 1 | is_b);
  };
  for (const Tile& tile : mine.tiles)
    for (std::int64_t k = tile.ring_begin; k < tile.pair_end; ++k) {
      const std::int32_t a = mine.a[at(k)], b = mine.b[at(k)];
      if (a == dummy) continue;
      const std::uint32_t slot = k < tile.kept_begin ? mine.ring_slot + (static_cast<std::uint32_t>(k) & mine.ring_mask)
                                                     : tile.kept_slot + static_cast<std::uint32_t>(k - tile.kept_begin);
      const std::uint8_t code = mine.image_of(k);
      if (a < end) put(a, b, slot, false, code);
      if (b < end) put(b, a, slot, true, code);
    }
  each_from_before(
      [&](const CrossPair& pair, std::uint32_t slot) { put(pair.grain, pair.other, slot, pair.is_b, pair.image); });
  mine.entries.resize_discarding(n_entries);
  row_order()(offsets, end - first, keys.data(), entries.data(), mine.entries.data());
  give_marks(thread);
}

/// Where grains see, for each of their entries, whether there is something to sum. Deferred grains sum all.
void PairList::give_marks(int thread) {
  ThreadPairs& mine = threads_[at(thread)];
  const std::int32_t n_grains = mine.grain_end - mine.grain_begin;
  const auto n_words_of = [&](std::size_t row) {
    return std::max(1u, (mine.offsets[row + 1] - mine.offsets[row] + bits_of_word - 1) / bits_of_word);
  };
  mine.first_word.clear();
  auto n_words = static_cast<std::uint32_t>(n_grains);
  for (std::size_t row = 0; row < at(n_grains); ++row) n_words += n_words_of(row) - 1;
  if (n_words > static_cast<std::uint32_t>(n_grains)) {
    mine.first_word.push_back(0);
    for (std::size_t row = 0; row < at(n_grains); ++row)
      mine.first_word.push_back(mine.first_word.back() + n_words_of(row));
  }
  mine.acting.resize_discarding(at(n_words) + 1);
  std::fill(mine.acting.begin(), mine.acting.end(), std::uint64_t{0});
  const std::int64_t n_places = mine.tiles.empty() ? 0 : mine.tiles.back().pair_end;
  mine.marks.resize_discarding(at(2 * n_places));
  std::fill(mine.marks.begin(), mine.marks.end(), n_words * bits_of_word);
  for (const Tile& tile : mine.tiles)
    for (std::int32_t i = tile.grain_begin; i < tile.grain_end; ++i) {
      if (is_deferred_[at(i)]) continue;
      const std::size_t row = at(i - mine.grain_begin);
      std::uint32_t mark =
          (mine.first_word.empty() ? static_cast<std::uint32_t>(row) : mine.first_word[row]) * bits_of_word;
      for (std::uint32_t q = mine.offsets[row]; q < mine.offsets[row + 1]; ++q, ++mark) {
        const Entry entry = mine.entries[q];
        const std::int64_t k = is_in_ring(entry) ? mine.pair_in_ring(i, entry >> 1) : mine.pair_of_kept(entry >> 1);
        mine.marks[at(2 * k + (entry & entry_is_b))] = mark;
      }
    }
}

PairCarry PairList::carry(const Particles& particles, std::span<const std::uint8_t> is_leaving, bool has_energy,
                          int n_threads) const {
  PairCarry carry;
  if (threads_.empty() || threads_[0].history.size() == 0) return carry;
  carry.begin.assign(at(particles.size()) + 1, 0);
  carry.is_at_first = is_leaving.empty();
  // The grain that comes first in memory lies in the range of the thread that holds the pair.
  const int n_active = std::min(n_threads, static_cast<int>(threads_.size()));
  std::vector<std::vector<std::int64_t>> used(threads_.size());  // pairs
  parallel(n_active, [&](int thread) {
    for (std::size_t t = at(thread); t < threads_.size(); t += at(n_active)) {
      used[t].reserve(at(threads_[t].n_pairs / 2));
      threads_[t].for_each_used([&](std::int64_t k) {
        used[t].push_back(k);
        ++carry.begin[at(std::min(threads_[t].a[at(k)], threads_[t].b[at(k)])) + 1];
      });
    }
  });
  // Pairs that stand at their second grain too: few, and in any thread's range.
  struct Second {
    std::int32_t grain;
    PairCarry::Item item;
    PairMemory memory;
  };
  std::vector<Second> seconds;
  const auto item_of = [&](std::int32_t other, std::uint8_t image, const PairMemory& m) {
    return PairCarry::Item{{m.displacement[0], m.displacement[1], m.displacement[2]},
                           PairCarry::key(particles.gid(other), image)};
  };
  if (!is_leaving.empty())
    for_each(particles.dummy(), [&](std::int32_t a, std::int32_t b, std::uint8_t image, const PairMemory* memory) {
      const std::int32_t first = std::min(a, b), second = std::max(a, b);
      if (first == second || !memory->is_used() || !particles.is_owned(second)) return;
      if (is_leaving[at(first)] || is_leaving[at(second)])
        seconds.push_back({second, item_of(first, image, *memory), *memory});
    });
  for (const Second& second : seconds) ++carry.begin[at(second.grain) + 1];
  for (std::size_t i = 0; i < at(particles.size()); ++i) carry.begin[i + 1] += carry.begin[i];
  carry.items.resize(carry.begin.back());
  if (has_energy) carry.energy.resize(carry.begin.back());
  const bool has_further = threads_[0].columns.has_further();
  if (has_further) carry.further.resize(carry.begin.back());
  const auto keep = [&](std::uint32_t k, const PairCarry::Item& item, const PairMemory& memory) {
    carry.items[k] = item;
    if (has_energy) carry.energy[k] = memory.energy;
    if (has_further) carry.further[k] = memory.further;
  };
  std::vector<std::uint32_t> next(carry.begin.begin(), carry.begin.end() - 1);
  parallel(n_active, [&](int thread) {
    for (std::size_t t = at(thread); t < threads_.size(); t += at(n_active))
      for (const std::int64_t k : used[t]) {
        const ThreadPairs& pairs = threads_[t];
        const std::int32_t a = pairs.a[at(k)], b = pairs.b[at(k)];
        const PairMemory memory = pairs.memory(k);
        keep(next[at(std::min(a, b))]++, item_of(std::max(a, b), pairs.image_of(k), memory), memory);
      }
  });
  for (const Second& second : seconds) keep(next[at(second.grain)]++, second.item, second.memory);
  return carry;
}

void PairList::release_index() {
  slots_.release();
  for (ThreadPairs& t : threads_) t.release_index();
}

void PairList::forget() {
  for (ThreadPairs& t : threads_) {
    t.history.release();
    t.was_near.release();
    t.release_index();
  }
}

std::int64_t PairList::size() const {
  std::int64_t n = 0;
  for (const ThreadPairs& t : threads_) n += t.n_pairs;
  return n;
}

std::size_t PairList::memory() const {
  std::size_t bytes = slots_.capacity_bytes() + is_deferred_.capacity();
  for (const ThreadPairs& t : threads_)
    bytes += t.a.capacity_bytes() + t.b.capacity_bytes() + t.image.capacity_bytes() + t.species.capacity_bytes() +
             t.history.capacity_bytes() + t.was_near.capacity_bytes() + t.offsets.capacity_bytes() +
             t.entries.capacity_bytes() + t.acting.capacity_bytes() + t.marks.capacity_bytes() +
             t.first_word.capacity() * sizeof(std::uint32_t) +
             (t.plain.capacity() + t.deferred.capacity()) * sizeof(std::int32_t);
  return bytes;
}

/// Calls f(owner, k, is_b) for every pair k of grain i, in the order of its entries.
template <typename Function>
void PairList::for_each_of(std::int32_t i, Function f) {
  for (const ThreadPairs& t : threads_) {
    if (i < t.grain_begin || i >= t.grain_end) continue;
    for (std::uint32_t q = t.offsets[at(i - t.grain_begin)]; q < t.offsets[at(i - t.grain_begin) + 1]; ++q) {
      const Entry entry = t.entries[q];
      const std::uint32_t slot = entry >> 1;
      for (ThreadPairs& owner : threads_) {  // a kept slot may be another thread's
        std::int64_t k = -1;
        if (is_in_ring(entry)) {
          if (&owner == &t) k = t.pair_in_ring(i, slot);
        } else {
          k = owner.pair_of_kept(slot);
        }
        if (k >= 0) f(owner, k, (entry & entry_is_b) != 0);
      }
    }
  }
}

void PairList::shift_images(std::int32_t i, const std::array<int, 3>& steps) {
  // Separation x_a - x_b + shift must stay: where x_i grows by a period, the shift of i as a falls by one, as b grows.
  for_each_of(i, [&](ThreadPairs& owner, std::int64_t k, bool is_b) {
    owner.image[at(k)] = image::shifted(owner.image[at(k)], steps, is_b);
  });
}

void PairList::clear_memory(const Particles& particles, std::int32_t i, ExactSum& energy) {
  for_each_of(i, [&](ThreadPairs& owner, std::int64_t k, bool is_b) {
    if (owner.history.size() == 0) return;
    if (!is_b || particles.is_owned(owner.a[at(k)])) energy.add(owner.memory(k).energy);
    owner.set_memory(k, {});
  });
}

void PairList::follow_ghosts(const Particles& particles, std::span<const GhostEvent> events, ExactSum& energy) {
  if (events.empty()) return;
  const auto event_of = [&](std::int32_t ghost) -> const GhostEvent* {
    const auto found = std::lower_bound(events.begin(), events.end(), ghost,
                                        [](const GhostEvent& event, std::int32_t g) { return event.ghost < g; });
    return found != events.end() && found->ghost == ghost ? &*found : nullptr;
  };
  for (ThreadPairs& t : threads_) {
    if (!t.has_border) continue;
    for (std::int64_t k = t.tiles.back().ring_begin; k < t.tiles.back().pair_end; ++k) {
      const std::int32_t a = t.a[at(k)], b = t.b[at(k)];
      if (a == particles.dummy()) break;  // what fills up the group
      const bool ghost_is_b = !particles.is_owned(b);
      const GhostEvent* const event = event_of(ghost_is_b ? b : a);
      if (!event) continue;
      if (event->has_left && t.history.size() > 0) {
        if (ghost_is_b) energy.add(t.memory(k).energy);
        t.set_memory(k, {});
      }
      if (event->steps != std::array<int, 3>{})
        t.image[at(k)] = image::shifted(t.image[at(k)], event->steps, ghost_is_b);
    }
  }
}

std::uint32_t PairList::n_pairs_of(std::int32_t i) const {
  for (const ThreadPairs& t : threads_)
    if (i >= t.grain_begin && i < t.grain_end)
      return t.offsets[at(i - t.grain_begin) + 1] - t.offsets[at(i - t.grain_begin)];
  return 0;
}

}  // namespace moraine
