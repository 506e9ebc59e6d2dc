// The bed that the kernels are timed on: grains at rest under gravity with some 5 contacts each, the one of bench/peers, cut out
// or put side by side to get other sizes.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "bench/kernels/meter.hpp"
#include "engine/contacts/cells.hpp"
#include "engine/contacts/pair_list.hpp"
#include "engine/particles/particles.hpp"
#include "engine/scene/scene.hpp"
#include "kernels/contact/sweep.hpp"
#include "kernels/motion/motion.hpp"

namespace moraine::bench {

/// What fits in L2, in L3, and in neither, on most machines; the label of a benchmark says what holds here.
enum class Size { k1, k20, k200 };
inline constexpr std::array<Size, 3> sizes = {Size::k1, Size::k20, Size::k200};
std::string name_of(Size size);
std::string name_of(NormalLaw normal, TangentialLaw tangential);

/// The scene of a deck of bench/peers ("bed.toml"), its bed cut or repeated along x to the size.
Scene bed_scene(const std::string& deck, Size size);

/// A laid-out bed for one thread, with slots for any combination of laws. Slow random motion; so short a step that springs hardly
/// move however often a kernel runs, so that the contacts that stick go on sticking (about nine in ten).
struct Bed {
  Bed(Size size, bool has_rotation);

  static constexpr double dt = 1e-9;    // [s]
  static constexpr double skin = 4e-4;  // [m], as in bench/peers

  Particles particles;
  Box domain;
  Cells cells;
  PairList pairs;
  LawTable table;                    // parameters of all laws, for three pairs of two materials
  std::vector<std::uint8_t> images;  // no pair across a face: the question, not the answer, is what costs
  std::vector<Vec3> image_shift;
  PairNeeds needs;
  std::int64_t n_slots = 0;  // pairs with the dummies that fill groups up

  ThreadPairs& thread() { return pairs.threads()[0]; }
  double n_grains() const { return particles.size(); }
  double n_pairs() const { return static_cast<double>(pairs.size()); }

  /// Tangential displacements up to a little over what friction holds, in random directions.
  void restart(const LawChoice& choice);
  PairSweep sweep(const LawChoice& choice, bool has_images);
  GrainSums sums(const LawChoice& choice);

  /// Sweeps all pairs through the ring, whose slots have that many bytes, tile by tile, as the engine does; and after each tile calls
  /// then(tile).
  template <typename Then>
  SweepResult run(PairKernel kernel, const PairSweep& sweep, std::int64_t slot, Then then) {
    ThreadPairs& mine = thread();
    SweepResult total;
    for (const Tile& tile : mine.tiles) {
      for (std::int64_t k = tile.ring_begin; k < tile.kept_begin;) {
        const std::int64_t place = k & mine.ring_mask;
        const std::int64_t end = std::min(tile.kept_begin, k + (std::int64_t{mine.ring_mask} + 1 - place));
        total.n_touching += kernel(sweep, {k, end}, pairs.slots() + (mine.ring_slot + place) * slot).n_touching;
        k = end;
      }
      then(tile);
    }
    return total;
  }
  SweepResult run(PairKernel kernel, const PairSweep& sweep, std::int64_t slot) {
    return run(kernel, sweep, slot, [](const Tile&) {});
  }
};

/// Bytes of a pair's slot.
inline std::int64_t slot_bytes(const LawChoice& choice) {
  return slot_size(choice.has_rotation, choice.has_ledger) * static_cast<std::int64_t>(number_size(choice.is_mixed));
}

/// The beds are kept: making one takes longer than timing a kernel.
Bed& bed(Size size, bool has_rotation);

/// What a sweep of the whole bed has to do. Counted as useful: 10 flops for each pair to see whether it touches, and those of the laws
/// for each that does. Counted as moved: indices of pairs, species and images where used, history in and out, each record once. Not
/// counted: slots (the ring stays in L2) and records read again (they are still there).
Work work_of_sweep(const Bed& bed, const LawChoice& choice, bool has_images, double n_touching);
/// Flops of a contact that touches and sticks; roots and divisions are one each.
double flops_of_contact(const LawChoice& choice);
/// Summing and integrating: entries, records in and out, what was dissipated in and out; not the slots.
Work work_of_motion(const Bed& bed, const LawChoice& choice);

}  // namespace moraine::bench
