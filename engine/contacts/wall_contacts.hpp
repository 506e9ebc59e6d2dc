// Contacts of grains with walls: candidates, the memory of each contact, and the touches of a tile in the layout of the sweep.
//
// Memory is keyed by grain and surface. A mesh can be touched in several places at once; there a touch goes on with the
// memory of the touch of the last step whose normal is nearest to its own, so that it follows from triangle to triangle.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/contacts/pair_list.hpp"
#include "engine/particles/aligned_array.hpp"
#include "engine/particles/particles.hpp"
#include "engine/walls/walls.hpp"
#include "kernels/contact/sweep.hpp"

namespace moraine {

/// What one wall contact remembers, in the frame of the wall, so that it turns with it.
struct WallMemory {
  PairMemory memory;
  Vec3 normal;
};

/// Memory across a rebuild, in order of the grain's place before it.
struct WallCarry {
  struct Item {
    std::int32_t grain = 0;
    std::int32_t surface = 0;
    WallMemory memory;
  };
  std::vector<Item> items;
};

/// One touch, for those who want to know (ledger, probes, messages).
struct WallContact {
  std::int32_t grain = 0;
  std::int32_t surface = 0;
  Touch touch;
  Vec3 wall_velocity;  // [m/s] where it is touched
  PairMemory memory;   // before the step, in the scene's frame
};

/// What grains do to moving walls, summed exactly, so that layouts agree.
struct WallSums {
  ExactSum work;                 // [J] that moving walls have done on the grains of this rank
  std::vector<ExactSum> pushes;  // [N] or [N m] of each servo: along or about its axis, in the last step
};

/// What a touch does to a triangle of a mesh, that nearest to where it is touched, in one step.
struct TriangleForce {
  std::int32_t surface = 0;
  std::int32_t triangle = 0;
  Vec3 force;               // [N] on the wall
  double normal = 0.0;      // [N] away from the grain
  double tangential = 0.0;  // [N] size of the rest
};

class WallContacts {
 public:
  /// `reach` [m]: how far beyond contact there may be a force.
  WallContacts(const Walls& walls, const Domain& domain, const MemoryColumns& columns, bool has_further, int slot_size,
               double reach);

  /// Finds the candidates of all grains, in the shares and tiles of the pair list. `species`: row of the wall law table by
  /// (material, wall).
  void build(const Particles& particles, const PairList& pairs, double skin, double time,
             std::span<const std::int32_t> was_at, const WallCarry& carry, int n_threads);
  /// Looks anew for what the grains may touch, where they and the walls are now; pairs stay.
  void search(const Particles& particles, const PairList& pairs, double skin, double time, int n_threads);
  WallCarry carry() const;
  /// Gives all back. Only build() may follow.
  void release() { std::vector<Share>().swap(shares_); }
  /// All memory as it is, and back again, with no rebuild between.
  struct Memory {
    /// A place that is not in use has a zero normal.
    struct Place {
      double displacement[3] = {0, 0, 0};  // as in PairMemory
      double energy = 0.0;
      Vec3 normal;
      bool is_used() const { return normal.x != 0.0 || normal.y != 0.0 || normal.z != 0.0; }
    };
    std::vector<Place> places;
    std::vector<FurtherMemory> further;  // of each place; only for laws that remember more
    PairMemory at(std::size_t slot) const;
    void set(std::size_t slot, const WallMemory& memory);
    void clear(std::size_t slot) { set(slot, WallMemory{}); }
  };
  std::vector<Memory> save() const;
  void put_back(const std::vector<Memory>& saved);

  /// The candidates of one tile's plain grains, or of a thread's deferred grains.
  Range tile(int thread, std::size_t tile) const {
    return {shares_[index(thread)].tile_begin[tile], shares_[index(thread)].tile_begin[tile + 1]};
  }
  Range deferred(int thread) const {
    return {shares_[index(thread)].tile_begin.back(), static_cast<std::int64_t>(shares_[index(thread)].list.size())};
  }

  /// The touches of these candidates, with their memory, ready for the sweep; returns their number (without filling).
  /// `dissipated`: four doubles a grain [J], or nullptr; what the spring of a touch that has ended still held goes to friction.
  std::int64_t touch(const Particles& particles, int thread, Range candidates, const std::uint8_t* species, int n_walls,
                     double* dissipated);
  const WallTouches& touches(int thread) const { return shares_[index(thread)].view; }
  /// Stores what the touches remember after the sweep.
  void remember(int thread, Range candidates);

  /// Adds up what the touches of these candidates, as swept, do to moving walls; `share` of a step's work is counted.
  void measure(const Particles& particles, int thread, Range candidates, double dt, double share, bool has_work,
               WallSums& sums) const;

  /// Appends what the touches of these candidates, as swept, do to triangles of the surfaces that are wanted.
  void note_forces(const Particles& particles, int thread, Range candidates, const std::vector<bool>& is_wanted,
                   std::vector<TriangleForce>& forces) const;

  /// Grain i has left: its touches remember nothing more. Adds up the energy that their springs held [J].
  void clear_memory(std::int32_t i, ExactSum& energy);

  /// Calls f(WallContact) for every touch at the present positions, in no particular order.
  template <typename Function>
  void for_each(const Particles& particles, Function f) const;

  bool empty() const { return walls_->surfaces().empty(); }
  std::size_t memory() const;

 private:
  struct Share {
    std::vector<WallCandidate> list;  // of plain grains by tile, then of deferred ones
    std::vector<std::int32_t> triangles;
    std::vector<std::int64_t> tile_begin;  // in list, of each tile, and where the deferred begin
    std::vector<std::int64_t> slot_begin;  // in memory, of each candidate, and the end
    Memory memory;
    std::vector<std::int64_t> touch_begin;  // of each candidate of the range last touched, and the end
    // touches of the range
    AlignedArray<std::int32_t> grain;
    AlignedArray<double> columns;  // nine columns
    AlignedArray<std::uint8_t> species;
    AlignedArray<double> history;
    AlignedArray<double> slots;
    WallTouches view;
  };
  std::size_t memory_doubles() const { return static_cast<std::size_t>(memory_size(has_further_)); }
  static std::size_t index(int thread) { return static_cast<std::size_t>(thread); }
  void find_across_faces(const Particles& particles, std::int32_t begin, std::int32_t end, double skin, double time,
                         WallCandidates& found) const;
  int touch_one(const Particles& particles, const Share& share, const WallCandidate& candidate, Touch* touches) const;
  std::int32_t touched_triangle(const Share& share, const WallCandidate& candidate, Vec3 centre, double reach,
                                Vec3 point) const;
  Vec3 wall_velocity(std::int32_t surface, Vec3 centre, const Touch& touch) const;
  const Pose& pose_of(std::int32_t surface) const { return walls_->pose(surface); }
  PairMemory in_scene(std::int32_t surface, PairMemory memory) const;
  void make_room(Share& share) const;
  /// The place of the memory that a touch goes on with, or -1.
  std::int64_t match(const Share& share, std::int64_t candidate, const Touch& touch, unsigned& taken) const;
  double energy_of_ended(const Share& share, std::int64_t candidate, unsigned taken) const;

  const Walls* walls_;
  Domain domain_;
  MemoryColumns columns_;
  bool has_further_;  // the sweep has further laws
  int slot_size_;
  double reach_;
  std::vector<Share> shares_;
};

template <typename Function>
void WallContacts::for_each(const Particles& particles, Function f) const {
  for (const Share& share : shares_)
    for (std::size_t c = 0; c < share.list.size(); ++c) {
      const WallCandidate& candidate = share.list[c];
      Touch touches[max_touches];
      const int n = touch_one(particles, share, candidate, touches);
      unsigned taken = 0;
      for (int t = 0; t < n; ++t) {
        const std::int64_t place = match(share, static_cast<std::int64_t>(c), touches[t], taken);
        f(WallContact{
            candidate.grain, candidate.surface, touches[t],
            wall_velocity(candidate.surface, particles.position(candidate.grain), touches[t]),
            place < 0 ? PairMemory{} : in_scene(candidate.surface, share.memory.at(static_cast<std::size_t>(place)))});
      }
    }
}

}  // namespace moraine
