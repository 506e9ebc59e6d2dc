// Grains born while a scene runs: when, which, and where there is room for them, the same on every layout.
//
// Everything that decides about births is known to all ranks: time, what an inlet has given, and random numbers by (seed, number of the
// grain, number of the attempt). What one rank alone can see, whether a place is free, all learn by one sum in those steps in
// which grains are due. So no step without births costs a word between ranks.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "comm/subdomains.hpp"
#include "comm/world.hpp"
#include "engine/particles/pack_cells.hpp"
#include "engine/particles/particles.hpp"
#include "engine/scene/scene.hpp"
#include "engine/walls/walls.hpp"
#include "kernels/base/exact_sum.hpp"

namespace moraine {

/// A grain about to be born.
struct Newborn {
  GrainSeed seed;
  std::uint64_t gid = 0;
  std::size_t inlet = 0;
};

/// A grain that has left through an outlet and is to come back.
struct Departed {
  std::uint64_t gid = 0;
  double radius = 0.0;  // [m]
  std::uint64_t material = 0;
};

/// What inlets must see of a run.
struct Surroundings {
  const World& world;
  const Subdomains& subdomains;  // by which grains and ghosts lie where they do
  const Particles& particles;    // with fresh ghosts
  const Walls& walls;            // where they are now
  double time = 0.0;             // [s]
};

class Inlets {
 public:
  Inlets(const Scene& scene, double dt);

  bool empty() const { return inlets_.empty(); }
  /// True where grains may be born before this step. The same on all ranks.
  bool is_due(std::uint64_t step) const;
  /// Gives birth to what is owed and finds room, in order; the first gets `first_gid`. All ranks call it and get the same.
  std::vector<Newborn> bear(std::uint64_t step, const Surroundings& around, std::uint64_t first_gid);
  /// A grain of this rank has left through an outlet that brings it back.
  void take_back(std::size_t inlet, const Departed& grain) { inlets_[inlet].departed.push_back(grain); }
  /// Number of the inlet of that name, or -1.
  int find(const std::string& name) const;

  /// What each inlet has given so far, and what it owes by now without having found room: grains and mass [kg].
  struct Account {
    std::uint64_t n_born = 0;
    double mass_born = 0.0;
    std::uint64_t n_owed = 0;
    double mass_owed = 0.0;
    bool operator==(const Account&) const = default;
  };
  Account account(std::size_t inlet) const;
  /// What happened that a user should know, once each: an inlet that finds no room.
  std::vector<std::string> take_notes() { return std::exchange(notes_, {}); }

  /// All that the inlets remember, as numbers; the same on all ranks. All ranks call it: what waits to come back is gathered.
  std::map<std::string, std::vector<double>> remembered(const World& world);
  void restore(const std::map<std::string, std::vector<double>>& accumulators);
  /// The same without asking other ranks: for the state hash.
  std::vector<double> hashed() const;

 private:
  /// A grain that is owed.
  struct Owed {
    std::uint64_t number = 0;  // of all grains that the inlet has ever owed: its random numbers
    double radius = 0.0;       // [m]
    std::uint16_t material = 0;
    bool is_back = false;  // it left and comes back
  };
  struct One {
    Inlet scene;
    std::uint64_t seed = 0;
    std::uint16_t material = 0;
    std::uint64_t every = 1;  // steps between births
    bool is_recycling = false;
    // remembered
    std::uint64_t n_numbers = 0;   // grains that it has ever owed
    std::uint64_t n_drawn = 0;     // of these, those that are not back
    ExactSum mass_drawn;           // [kg] of them
    double mass_after_next = 0.0;  // [kg] the same with the next one; follows from the others
    std::uint64_t n_attempts = 0;  // places tried
    std::uint64_t n_born = 0;
    ExactSum mass_born;               // [kg]
    std::uint64_t next_try = 0;       // [steps] after no room was found
    std::vector<Owed> owed;           // in order
    std::vector<Departed> departed;   // of this rank, since all were last gathered
    std::vector<Departed> returning;  // gathered, not yet owed
    bool has_complained = false;      // not remembered
  };
  struct Candidate {
    std::size_t inlet = 0, owed = 0;
    Vec3 position;
    double radius = 0.0;
  };

  double mass_of(const Owed& grain) const;
  Owed next_grain(const One& inlet) const;
  bool has_more(const One& inlet, double time) const;
  void foresee(One& inlet) const;
  void draw(One& inlet, double time, double n_inside, double mass_inside, double volume_inside);
  void gather_departed(One& inlet, const World& world) const;
  std::vector<Candidate> candidates(std::span<const std::size_t> due, std::size_t n_each);
  std::vector<std::uint64_t> blocked(std::span<const Candidate> candidates, const Surroundings& around) const;
  Newborn clothe(const Candidate& candidate, std::uint64_t gid) const;
  void measure(std::span<const std::size_t> due, const Surroundings& around, std::vector<double>& inside) const;
  void complain(One& inlet, double time);

  std::vector<One> inlets_;
  std::vector<Material> materials_;
  PackSpace space_;
  double dt_;
  std::vector<std::string> notes_;
};

}  // namespace moraine
