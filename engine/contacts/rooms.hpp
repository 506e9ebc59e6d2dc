// Room for each grain: how far it may go before it may touch one that is in no pair with it. Grains that go fast for those around them get
// much, so that the list is good for long, and grains that keep their place get little, so that it is short.
//
// How far a grain has gone is seen from a frame that moves with the grains of its block: what falls, flows or turns together stays together.
// Two grains, in blocks whose frames have velocities V and V', have come nearer to each other in the time t by no more than
//   e + e' + |V - V'| t <= (e + c t) + (e' + c' t),
// e how far each has gone in its frame, c half the largest |V - V'| between its block and neighbours of that. Grains of a pair that is not in the
// list lie further apart than their rooms together (and than a force reaches), so that the list is good while e + c t is within each one's room.
// Grains of blocks that are no neighbours lie a block apart; how long that is enough the frames say. All this holds in frames at rest as well, and is
// better in them where grains swing to and fro, or fly about each by itself: the lesser of the two shares counts.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "engine/contacts/cells.hpp"
#include "engine/particles/aligned_array.hpp"
#include "engine/particles/particles.hpp"
#include "kernels/base/range.hpp"
#include "kernels/motion/motion.hpp"

namespace moraine {

/// How wide a list is to be.
struct ListWidth {
  double skin = 0.0;       // [m] no two grains have more room together
  double wall_skin = 0.0;  // [m] room between grains and walls
  double step = 0.0;       // [s] of time
  double grain = 0.0;      // [m] mean diameter
  bool is_even = false;    // all grains get the same room, half the skin
};

class Rooms {
 public:
  /// From here on. The grains are sorted as in `cells`; centres `contact` [m] apart do not act on each other. Returns the room of each [m].
  std::vector<double> begin(const Particles& particles, const Cells& cells, const ListWidth& width, double contact,
                            int n_threads);
  /// The same where all grains have half the skin, in a frame at rest.
  std::vector<double> begin_at_rest(const Particles& particles, double skin, int n_threads);
  /// Gives the memory back; begin() comes next.
  void forget() {
    places_.release();
    frames_.release();
    frame_of_ = {};
  }
  /// Grain i has been brought back over periodic faces by `shift` [m].
  void follow(std::int32_t i, Vec3 shift);
  /// No grain has come further since then, from its place [m].
  double furthest(const Particles& particles, int n_threads) const;

  /// What the grains `list[range]`, or those of `range` itself where list is nullptr, have used at that age [s].
  RoomShares measure(const Particles& particles, double age, const std::int32_t* list, Range range) const;
  /// What all have.
  RoomShares measure(const Particles& particles, double age, int n_threads) const;
  /// No grain has less room [m].
  double least() const { return least_; }
  /// The list is good while this share, of what was measured at that age [s], is at most one.
  double used(const RoomShares& shares, double age) const {
    return age > good_for_ ? shares.at_rest : std::min(shares.in_frames, shares.at_rest);
  }
  /// [s] Beyond that age grains of blocks that are no neighbours may meet, though none has used up its room in its frame.
  double good_for() const { return good_for_; }
  /// The skin with which the fastest grain would have had room for as many steps as are best, by present motion [m]; zero where all
  /// grains have the same room.
  double wanted_skin() const { return wanted_skin_; }

  std::size_t memory() const {
    return places_.capacity_bytes() + frames_.capacity_bytes() + frame_of_.capacity() * sizeof(std::int32_t);
  }

 private:
  void put(const Particles& particles, std::int64_t i, double room);

  AlignedArray<double> places_;         // four of each grain: its place at the rebuild [m], and one over its room [1/m]
  AlignedArray<double> frames_;         // four of each block: velocity of its frame, and c [m/s]
  std::vector<std::int32_t> frame_of_;  // of each grain
  double least_ = 0.0;
  double good_for_ = 0.0;
  double wanted_skin_ = 0.0;
  int n_at_rest_ =
      0;  // lists that are yet to be made in a frame at rest, where all rooms are the same, before frames are tried again
};

}  // namespace moraine
