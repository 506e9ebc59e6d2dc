#include "engine/contacts/rooms.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <utility>

#include "engine/threads.hpp"
#include "kernels/base/range.hpp"

namespace moraine {

namespace {

std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

// All in steps and mean diameters. A rebuild costs about as much as this many steps ...
constexpr double cost_of_rebuild = 9.0;
// ... and each mean diameter of skin so many times what a step without one costs.
constexpr double cost_of_skin = 1.1;
/// Room that every grain has [mean diameters]: a step or more, whatever happens to it.
constexpr double least_room = 0.012;
/// A grain is given room for its own speed in its frame, or for one that the others around lend it, in root mean squares of theirs.
constexpr double of_own_speed = 1.2, of_others_speed = 2.0;
/// ... and for how frames part, a little more than by present motion.
constexpr double of_frames = 1.1;
/// Blocks are wider than two grains can be apart and still be a pair by this [mean diameters].
constexpr double beyond_pairs = 0.8;

/// Blocks over the grains, in which they share a frame.
class Blocks {
 public:
  Blocks(const Cells& cells, double width) : low_(cells.box().low) {
    const Vec3 size = cells.box().size();
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = at(axis);
      wraps_[a] = cells.is_periodic(axis);
      const double count = std::floor(size[axis] / width) + (wraps_[a] ? 0.0 : 1.0);
      counts_[a] = static_cast<int>(std::clamp(count, 1.0, 1e6));
      per_length_[axis] = wraps_[a] ? counts_[a] / size[axis] : 1.0 / width;
    }
  }
  std::int64_t size() const { return std::int64_t{counts_[0]} * counts_[1] * counts_[2]; }
  std::int32_t block_of(Vec3 p) const {
    std::array<int, 3> b{};
    for (int axis = 0; axis < 3; ++axis)
      b[at(axis)] = std::clamp(static_cast<int>((p[axis] - low_[axis]) * per_length_[axis]), 0, counts_[at(axis)] - 1);
    return (b[2] * counts_[1] + b[1]) * counts_[0] + b[0];
  }
  /// Calls f(block) for the neighbours of a block and for itself, some perhaps twice.
  template <typename Function>
  void for_each_near(std::int64_t block, Function f) const {
    const std::array<int, 3> b = place_of(block);
    for (int z = -1; z <= 1; ++z)
      for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x)
          if (const std::int64_t other = beside(b, {x, y, z}); other >= 0) f(other);
  }
  /// The block before (-1) or behind (1) along an axis; -1: none.
  std::int64_t beside(std::int64_t block, std::size_t axis, int step) const {
    std::array<int, 3> by{};
    by[axis] = step;
    return beside(place_of(block), by);
  }

 private:
  std::array<int, 3> place_of(std::int64_t block) const {
    const auto x = static_cast<int>(block % counts_[0]), yz = static_cast<int>(block / counts_[0]);
    return {x, yz % counts_[1], yz / counts_[1]};
  }
  std::int64_t beside(std::array<int, 3> b, const std::array<int, 3>& by) const {
    for (std::size_t a = 0; a < 3; ++a) {
      b[a] += by[a];
      if (b[a] >= 0 && b[a] < counts_[a]) continue;
      if (!wraps_[a]) return -1;
      b[a] += b[a] < 0 ? counts_[a] : -counts_[a];
    }
    return (std::int64_t{b[2]} * counts_[1] + b[1]) * counts_[0] + b[0];
  }

  Vec3 low_, per_length_;
  std::array<int, 3> counts_{};
  std::array<bool, 3> wraps_{};
};

/// What the grains of a block have together, in diameters and steps. Threads add to it in any order, so in whole numbers.
constexpr double velocity_unit = 0x1p-40, square_unit = 0x1p-48;
struct BlockSum {
  std::int64_t n = 0, velocity[3] = {}, square = 0;
  double count() const { return static_cast<double>(n); }
  Vec3 all_velocities() const {
    const auto number = [](std::int64_t sum) { return velocity_unit * static_cast<double>(sum); };
    return {number(velocity[0]), number(velocity[1]), number(velocity[2])};
  }
  /// Sum of |v - V|^2.
  double spread_about(Vec3 frame) const {
    const double squares = square_unit * static_cast<double>(square);
    return std::max(0.0, squares + dot(count() * frame - 2.0 * all_velocities(), frame));
  }
};
std::int64_t in_units(double value, double unit) { return static_cast<std::int64_t>(value / unit); }

/// What a thread adds to a block: grains that follow each other are mostly of the same.
class OwnSum : public BlockSum {
 public:
  explicit OwnSum(std::vector<BlockSum>& sums) : sums_(sums) {}
  OwnSum(const OwnSum&) = delete;
  ~OwnSum() { give(); }
  /// From here on it is this block's.
  void to(std::int32_t block) {
    if (block == block_) return;
    give();
    block_ = block;
  }

 private:
  void give() {
    if (block_ < 0) return;
    BlockSum& all = sums_[at(block_)];
    const auto add = [](std::int64_t& sum, std::int64_t& own) {
      if (own != 0) std::atomic_ref(sum).fetch_add(std::exchange(own, 0), std::memory_order_relaxed);
    };
    add(all.n, n);
    for (int axis = 0; axis < 3; ++axis) add(all.velocity[axis], velocity[axis]);
    add(all.square, square);
  }

  std::vector<BlockSum>& sums_;
  std::int32_t block_ = -1;
};

/// How grains move in and with their blocks, in diameters and steps; found by all threads together, step by step.
class BlockMotions {
 public:
  BlockMotions(const Particles& particles, const Blocks& blocks, double in_diameters, int n_threads, double* frames,
               std::int32_t* frame_of)
      : particles_(particles),
        blocks_(blocks),
        in_diameters_(in_diameters),
        n_threads_(n_threads),
        frames_(frames),
        frame_of_(frame_of),
        sums_(at(blocks.size())),
        around_(at(blocks.size())),
        next_(at(blocks.size())),
        own_spreads_(at(blocks.size())),
        spreads_(at(blocks.size())),
        speeds_(at(blocks.size())) {}

  /// Finds all of it; then every thread may ask for what its grains use. Returns the velocity of the fastest frame of the thread's blocks as seen
  /// from the mean of all.
  double find(int thread) {
    sum_velocities(thread);
    barrier();
    smooth(thread);
    barrier();
    if (thread == 0) mean_frame_ = mean_frame();
    barrier();
    const double fastest = compare_neighbours(thread);
    barrier();
    return fastest;
  }

  /// Room that a grain uses in a step, as seen from its frame, and from one at rest.
  double use_in_frame(std::int64_t i) const {
    const std::int64_t b = frame_of_[i];
    const double own = length(velocity(i) - frame(b));
    return std::max(of_own_speed * own, of_others_speed * spreads_[at(b)]) + of_frames * frames_[4 * b + 3];
  }
  double use_at_rest(std::int64_t i) const {
    return std::max(of_own_speed * length(velocity(i)), of_others_speed * speeds_[at(frame_of_[i])]);
  }

 private:
  struct Motion {
    double n = 0.0;
    Vec3 velocity;
  };

  Range grains_of(int thread) const { return share_of(particles_.size(), thread, n_threads_); }
  Range blocks_of(int thread) const { return share_of(blocks_.size(), thread, n_threads_); }
  Vec3 velocity(std::int64_t i) const {  // within more than a run allows a grain to come in a step
    const Vec3 v = in_diameters_ * particles_.velocity(static_cast<std::int32_t>(i));
    return {std::clamp(v.x, -1.0, 1.0), std::clamp(v.y, -1.0, 1.0), std::clamp(v.z, -1.0, 1.0)};
  }
  Vec3 frame(std::int64_t b) const { return {frames_[4 * b], frames_[4 * b + 1], frames_[4 * b + 2]}; }

  void sum_velocities(int thread) {
    const Range grains = grains_of(thread);
    OwnSum sum(sums_);
    for (std::int64_t i = grains.begin; i < grains.end; ++i) {
      const std::int32_t block = blocks_.block_of(particles_.position(static_cast<std::int32_t>(i)));
      frame_of_[i] = block;
      sum.to(block);
      ++sum.n;
      const Vec3 v = velocity(i);
      for (int axis = 0; axis < 3; ++axis) sum.velocity[axis] += in_units(v[axis], velocity_unit);
      sum.square += in_units(squared_length(v), square_unit);
    }
  }

  /// A frame is the mean over a block and, with half the weight along each axis, those beside it: so frames of neighbours part less.
  void smooth(int thread) {
    const Range share = blocks_of(thread);
    for (std::int64_t b = share.begin; b < share.end; ++b) {
      around_[at(b)] = {sums_[at(b)].count(), sums_[at(b)].all_velocities()};
    }
    barrier();
    const std::vector<Motion>* from = &around_;
    std::vector<Motion>* to = &next_;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::int64_t b = share.begin; b < share.end; ++b) {
        Motion sum = (*from)[at(b)];
        for (const int step : {-1, 1}) {
          const std::int64_t other = blocks_.beside(b, axis, step);
          if (other < 0) continue;
          sum.n += 0.5 * (*from)[at(other)].n;
          sum.velocity += 0.5 * (*from)[at(other)].velocity;
        }
        (*to)[at(b)] = sum;
      }
      barrier();
      from = to;
      to = to == &next_ ? &around_ : &next_;
    }
    for (std::int64_t b = share.begin; b < share.end; ++b) {
      const Motion& m = (*from)[at(b)];
      for (int axis = 0; axis < 3; ++axis) frames_[4 * b + axis] = sums_[at(b)].n > 0 ? m.velocity[axis] / m.n : 0.0;
      frames_[4 * b + 3] = 0.0;
      own_spreads_[at(b)] = sums_[at(b)].spread_about(frame(b));
    }
  }

  Vec3 mean_frame() const {
    Vec3 sum;
    double n = 0.0;
    for (std::int64_t b = 0; b < blocks_.size(); ++b)
      if (sums_[at(b)].n > 0) {
        sum += frame(b);
        n += 1.0;
      }
    return n > 0.0 ? sum / n : sum;
  }

  double compare_neighbours(int thread) {
    const Range share = blocks_of(thread);
    double fastest = 0.0;
    for (std::int64_t b = share.begin; b < share.end; ++b) {
      if (sums_[at(b)].n == 0) continue;
      const Vec3 own = frame(b);
      double apart = 0.0, spread = 0.0, n_near = 0.0;
      blocks_.for_each_near(b, [&](std::int64_t other) {
        const BlockSum& sum = sums_[at(other)];
        if (sum.n == 0) return;
        apart = std::max(apart, squared_length(own - frame(other)));
        spread += own_spreads_[at(other)];
        n_near += sum.count();
      });
      frames_[4 * b + 3] = 0.5 * std::sqrt(apart);
      spreads_[at(b)] = std::sqrt(spread / n_near);
      speeds_[at(b)] = std::sqrt(spread / n_near + squared_length(own));
      fastest = std::max(fastest, length(own - mean_frame_));
    }
    return fastest;
  }

  const Particles& particles_;
  const Blocks& blocks_;
  double in_diameters_;
  int n_threads_;
  double* frames_;          // four numbers of each block, as Rooms has them
  std::int32_t* frame_of_;  // block of each grain
  std::vector<BlockSum> sums_;
  std::vector<Motion> around_, next_;
  std::vector<double> own_spreads_;  // sum of the squared speeds of a block's grains in its frame
  std::vector<double>
      spreads_;  // root mean square of the speeds in their frames, of the grains of a block and its neighbours ...
  std::vector<double> speeds_;  // ... and as seen at rest, were they in this frame
  Vec3 mean_frame_;
};

}  // namespace

void Rooms::put(const Particles& particles, std::int64_t i, double room) {
  double* const place = places_.data() + 4 * i;
  const Vec3 x = particles.position(static_cast<std::int32_t>(i));
  for (int axis = 0; axis < 3; ++axis) place[axis] = x[axis];
  place[3] = 1.0 / room;
}

std::vector<double> Rooms::begin_at_rest(const Particles& particles, double skin, int n_threads) {
  const std::int32_t n = particles.size();
  places_.resize_discarding(4 * at(n));
  frames_.release();
  least_ = 0.5 * skin;
  good_for_ = infinity;
  wanted_skin_ = 0.0;
  parallel(n_threads, [&](int thread) {
    const Range share = share_of(n, thread, n_threads);
    for (std::int64_t i = share.begin; i < share.end; ++i) put(particles, i, 0.5 * skin);
  });
  return std::vector<double>(at(n), 0.5 * skin);
}

std::vector<double> Rooms::begin(const Particles& particles, const Cells& cells, const ListWidth& width, double contact,
                                 int n_threads) {
  if (width.is_even && n_at_rest_ > 0) {
    --n_at_rest_;
    return begin_at_rest(particles, width.skin, n_threads);
  }
  const std::int32_t n = particles.size();
  std::vector<double> rooms(at(n));
  places_.resize_discarding(4 * at(n));
  frame_of_.resize(at(n));
  const double in_diameters = width.step / width.grain;  // of a speed: diameters a step
  const Blocks blocks(cells, contact + width.skin + beyond_pairs * width.grain);
  frames_.resize_discarding(4 * at(blocks.size()));
  BlockMotions motions(particles, blocks, in_diameters, n_threads, frames_.data(), frame_of_.data());
  struct Use {
    double sum = 0.0, most = 0.0;
    void include(double use) {  // what is not finite the next step reports
      if (!(use >= 0.0)) return;
      sum += use;
      most = std::max(most, use);
    }
  };
  struct Found {
    Use in_frames, at_rest;
    double fastest_frame = 0.0, least = infinity;
    char padding[64] = {};  // threads write their own cache lines
  };
  std::vector<Found> found(at(n_threads));
  double n_steps = 0.0;
  bool is_at_rest = false;
  const auto decide = [&] {
    Found all;
    for (const Found& one : found) {
      for (const auto use : {&Found::in_frames, &Found::at_rest}) {
        (all.*use).sum += (one.*use).sum;
        (all.*use).most = std::max((all.*use).most, (one.*use).most);
      }
      all.fastest_frame = std::max(all.fastest_frame, one.fastest_frame);
    }
    is_at_rest = all.at_rest.sum < all.in_frames.sum;
    const Use& use = is_at_rest ? all.at_rest : all.in_frames;
    // Of the cost of a step, cost_of_rebuild / N + cost_of_skin (2 N mean use): least where N^2 is the ratio of the two.
    const double mean = use.sum / std::max(1, n), most = std::max(use.most, 1e-300);
    const double widest = 0.5 * width.skin / width.grain;
    n_steps = std::sqrt(cost_of_rebuild / (2.0 * cost_of_skin * std::max(mean, 1e-12)));
    wanted_skin_ = width.is_even ? 0.0 : 2.0 * width.grain * (n_steps * most + least_room);
    n_steps = std::min(n_steps, std::max(0.0, widest - least_room) / most);
    good_for_ = 0.5 * beyond_pairs * width.step / std::max(all.fastest_frame, 1e-300);
  };
  parallel(n_threads, [&](int thread) {
    const Range grains = share_of(n, thread, n_threads), share = share_of(blocks.size(), thread, n_threads);
    Found& mine = found[at(thread)];
    mine.fastest_frame = motions.find(thread);
    for (std::int64_t i = grains.begin; i < grains.end; ++i) {
      rooms[at(i)] = motions.use_in_frame(i);
      mine.in_frames.include(rooms[at(i)]);
      mine.at_rest.include(motions.use_at_rest(i));
    }
    barrier();
    if (thread == 0) decide();
    barrier();
    for (std::int64_t i = grains.begin; i < grains.end; ++i) {
      const double use = is_at_rest ? motions.use_at_rest(i) : rooms[at(i)];
      const double wanted = width.grain * (n_steps * use + least_room), widest = 0.5 * width.skin;
      rooms[at(i)] = !width.is_even && wanted < widest ? wanted : widest;
      put(particles, i, rooms[at(i)]);
      mine.least = std::min(mine.least, rooms[at(i)]);
    }
    for (std::int64_t k = 4 * share.begin; k < 4 * share.end; ++k) frames_[at(k)] /= in_diameters;
  });
  least_ = infinity;
  for (const Found& one : found) least_ = std::min(least_, one.least);
  if (is_at_rest) {
    frames_.release();
    n_at_rest_ = 7;
  }
  return rooms;
}

void Rooms::follow(std::int32_t i, Vec3 shift) {
  for (int axis = 0; axis < 3; ++axis) places_[4 * at(i) + at(axis)] += shift[axis];
}

RoomShares Rooms::measure(const Particles& particles, double age, const std::int32_t* list, Range range) const {
  static const RoomKernel kernel = room_kernel();
  return kernel({particles.records(), particles.stride(), places_.data(), frames_.data(), frame_of_.data(), age}, list,
                range);
}

RoomShares Rooms::measure(const Particles& particles, double age, int n_threads) const {
  struct OfThread {
    RoomShares shares;
    char padding[64] = {};  // threads write their own cache lines
  };
  std::vector<OfThread> of_threads(at(n_threads));
  parallel(n_threads, [&](int thread) {
    const Range share = share_of(particles.size(), thread, n_threads);
    if (!share.empty()) of_threads[at(thread)].shares = measure(particles, age, nullptr, share);
  });
  RoomShares all;
  for (const OfThread& one : of_threads) all.include(one.shares);
  return all;
}

double Rooms::furthest(const Particles& particles, int n_threads) const {
  std::vector<double> most(at(n_threads) * 8, 0.0);  // threads write their own cache lines
  parallel(n_threads, [&](int thread) {
    const Range share = share_of(particles.size(), thread, n_threads);
    double squared = 0.0;
    for (std::int64_t i = share.begin; i < share.end; ++i) {
      const double* const place = places_.data() + 4 * i;
      const double moved =
          squared_length(particles.position(static_cast<std::int32_t>(i)) - Vec3{place[0], place[1], place[2]});
      if (moved > squared) squared = moved;  // false for grains that have left
    }
    most[at(thread) * 8] = squared;
  });
  return std::sqrt(*std::max_element(most.begin(), most.end()));
}

}  // namespace moraine
