// How far grains have come since the pair list was made, and how much nearer to each other that can have brought them.
//
// A list is good until two grains touch that are not in it, which have come nearer to each other by the skin. That is less than they have
// come by themselves: what falls, flows or turns together stays together. So the displacements of the grains of each block of cells are put
// into a box; two grains of the same or of neighbouring blocks have come nearer by no more than their boxes are wide together.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/contacts/cells.hpp"
#include "engine/particles/particles.hpp"
#include "kernels/base/box.hpp"

namespace moraine {

/// Of this rank's grains, since the rebuild.
struct Travelled {
  double furthest = 0.0;  // [m] none has come further
  double nearer = 0.0;    // [m] no two of them that might meet have come nearer to each other by more than twice this
  double border = 0.0;    // [m] none that might meet a grain of another rank has come further

  /// Two grains that might meet have come nearer to each other by no more than this of the rank of the one and this of the rank of the
  /// other [m].
  double of_pairs() const { return nearer > border ? nearer : border; }
};

class TravelWatch {
 public:
  /// From here on. Grains outside of `inner` [m] may meet those of other ranks.
  void begin(const Particles& particles, const Box& inner, int n_threads);
  /// Gives the memory back; begin() comes next.
  void forget() { *this = TravelWatch(); }
  /// Grain i has been brought back over periodic faces by `shift` [m].
  void follow(std::int32_t i, Vec3 shift) { places_[static_cast<std::size_t>(i)] += shift; }

  /// `cells` are those of the list, whose grains are further apart than a force reaches by `skin` [m] or more where they are in no pair.
  Travelled measure(const Particles& particles, const Cells& cells, double skin, int n_threads);
  /// The same without cells: as if any two might meet.
  Travelled measure(const Particles& particles, int n_threads) const;

  std::size_t memory() const { return places_.capacity() * sizeof(Vec3) + spreads_.capacity() * sizeof(Box); }

 private:
  Vec3 displacement(const Particles& particles, std::int64_t i) const {
    return particles.position(static_cast<std::int32_t>(i)) - places_[static_cast<std::size_t>(i)];
  }

  std::vector<Vec3> places_;  // [m] of each grain at the rebuild
  Box inner_;                 // [m]
  std::vector<Box> spreads_;  // [m] least and greatest displacement of the grains of each block
};

}  // namespace moraine
