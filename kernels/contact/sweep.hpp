// Sweeps: a contact law run over a range of pairs or wall touches, one contact a lane.
//
// Words: a pair is two grains a and b, a of the lower gid, near enough to touch before the next rebuild. A slot receives what
// a pair gives: force on a (the negative is on b), with rotation also the moment, with the ledger also the energy lost.
// Slots are summed by kernels/motion in the order of the other's gid.
//
// Most pairs do not touch. A sweep first looks which are near enough for a force, by positions alone, and then runs the law over these, one
// behind the other, and over those that were near in the step before, as what they remember is to end. The slots of the others are left as they
// are: to the two grains of each that it runs the law over it says, in a bit of each, that there is something to sum.
#pragma once

#include <cstdint>

#include "kernels/base/range.hpp"
#include "kernels/base/vec3.hpp"
#include "kernels/contact/parameters.hpp"

namespace moraine {

/// Ranges of pairs begin and end at multiples of this; they are filled up with pairs of the dummy grain.
inline constexpr std::int64_t pair_group = 16;

/// Numbers in a slot, doubles or (mixed precision) floats: F lever_a | M lever_b | rolling torque on a, - (further laws) | losses (normal dashpot, tangential dashpot,
/// friction, -).
constexpr int slot_size(bool has_rotation, bool has_ledger, bool has_further = false) {
  return 4 + (has_rotation ? (has_further ? 8 : 4) : 0) + (has_ledger ? 4 : 0);
}
/// What a pair or a touch with a wall remembers.
struct MemoryColumns {
  bool has_history = false, has_energy = false, has_rolling = false, has_bond = false;
  constexpr bool has_further() const { return has_rolling || has_bond; }
};
/// Numbers that it remembers them in: tangential displacement [m], energy stored in it [J] | rolling angle [rad], 1 where a bond is made.
inline constexpr int energy_in_memory = 3, angle_in_memory = 4, bond_in_memory = 7;
/// Of a touch with a wall.
constexpr int memory_size(bool has_further) { return has_further ? 8 : 4; }
/// Of a pair: none that are not needed, as there are many. What is read of the last pair may reach `beyond_memory` numbers further.
constexpr int memory_size(const MemoryColumns& columns) {
  if (!columns.has_history) return 0;
  return columns.has_energy || columns.has_further() ? memory_size(columns.has_further()) : 3;
}
inline constexpr int beyond_memory = 1;
constexpr MemoryColumns memory_of(const LawChoice& choice) {
  return {has_history(choice.tangential), choice.has_ledger, choice.rolling == RollingLaw::spring,
          has_bond(choice.cohesion)};
}
/// Doubles in a grain's record (see engine/particles/fields.hpp).
constexpr int record_size(bool has_rotation) { return has_rotation ? 12 : 8; }

/// Bits of a word in which a grain sees which of its pairs to sum.
inline constexpr std::uint32_t bits_of_word = 64;

struct PairSweep {
  const double* records = nullptr;        // of all grains and the dummy, which lies nowhere (NaN)
  const std::int32_t* a = nullptr;        // grain of lower gid
  const std::int32_t* b = nullptr;        // grain of higher gid
  const std::uint8_t* image = nullptr;    // periodic image code of each pair; nullptr: no periodic direction
  const Vec3* image_shift = nullptr;      // [m] by code: x_a - x_b + shift is the separation
  const std::uint8_t* species = nullptr;  // row of the law table; nullptr: row 0 for all (uniform)
  void* history =
      nullptr;  // what pairs remember, memory_size() numbers each: doubles, with mixed precision floats [SI]
  std::uint16_t* was_near = nullptr;  // a bit of each pair, a word of each group: it was near in its last sweep. Others
                                      // remember nothing
  const std::uint32_t* marks = nullptr;  // of each pair, for a and for b: bits_of_word * word + bit ...
  std::uint64_t* acting =
      nullptr;             // ... of the words in which grains see which of their pairs to sum; nullptr: no one asks
  bool takes_all = false;  // the law is run over all pairs, near or not
  const LawTable* table = nullptr;  // in units of mass
  double inverse_mass = 0.0;        // [1/kg] of every grain (uniform)
  double radius = 0.0;              // [m] of every grain (uniform)
  double dt = 0.0;                  // [s]
  double max_overlap = 1.0;         // [-] of the smaller radius: beyond it the run is to be stopped
  // the further laws
  RollingLaw rolling = RollingLaw::none;
  CohesionLaw cohesion = CohesionLaw::none;
  double range = 0.0;      // [m] no pair attracts beyond this gap
  double mass_unit = 1.0;  // [kg] mixed precision: of the table, and of what goes to the slots; a power of four
};

struct SweepResult {
  std::int64_t n_touching = 0;
  bool has_large_overlap = false;
};

/// Runs the law over those of `pairs` that are near, or were so in their last sweep, and writes their slots; that of the first of `pairs` is at
/// `slots`: doubles, with mixed precision floats. Pairs that do not touch any more give zeros (and losses) once.
using PairKernel = SweepResult (*)(const PairSweep& sweep, Range pairs, void* slots);
/// Bytes of a number of a slot, or of a pair's memory.
constexpr std::size_t number_size(bool is_mixed) { return is_mixed ? sizeof(float) : sizeof(double); }
/// A unit of mass [kg] for grains of about that mass: forces divided by it are near accelerations, and their squares far from the ends of
/// what a float can be. A power of four, so that roots, too, have the same digits in every unit.
double mass_unit_for(double mass);

/// Touches of grains with walls, in arrays; as many rows as touches, filled up to pair_group with rows of the dummy grain.
struct WallTouches {
  const std::int32_t* grain = nullptr;
  const double* normal_x = nullptr;  // unit vector from the wall to the grain
  const double* normal_y = nullptr;
  const double* normal_z = nullptr;
  const double* distance = nullptr;    // [m] from the wall to the centre
  const double* velocity_x = nullptr;  // [m/s] of the wall where it is touched
  const double* velocity_y = nullptr;
  const double* velocity_z = nullptr;
  const double* mirror = nullptr;  // 1: a wall; 2: a mirror, in which the grain meets its own image
  const std::uint8_t* species = nullptr;
  double* history = nullptr;  // memory_size() doubles a touch
  double* slots = nullptr;    // force on the grain, as for pairs with the grain as a
};

struct WallSweep {
  const double* records = nullptr;
  WallTouches touches;
  const LawTable* table = nullptr;  // of grains with walls
  double dt = 0.0;                  // [s]
  double max_overlap = 1.0;         // [-] of the radius
  RollingLaw rolling = RollingLaw::none;
  CohesionLaw cohesion = CohesionLaw::none;
  double mass_unit = 1.0;  // [kg] of the table, with mixed precision; slots are in SI
};

using WallKernel = SweepResult (*)(const WallSweep& sweep, Range touches);

struct ContactKernels {
  PairKernel pairs = nullptr;
  WallKernel walls = nullptr;
};

/// The compiled kernels of a combination, for this machine's instruction set; null where the combination is not listed.
ContactKernels contact_kernels(const LawChoice& choice);
/// True where the combination of laws has been compiled.
bool is_listed(const LawChoice& choice);
/// The instruction set that the kernels were chosen for, for example "AVX3".
const char* instruction_set();
/// Contacts that it computes at once.
int lanes_of_instruction_set(bool is_mixed);

}  // namespace moraine
