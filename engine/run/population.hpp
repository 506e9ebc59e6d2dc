// The grains of a run as they come and go: births at the start and from inlets, ways over periodic faces and out of outlets, and the
// census of it all, so that inside + left = born.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "comm/subdomains.hpp"
#include "comm/world.hpp"
#include "engine/contacts/contacts.hpp"
#include "engine/openings/inlets.hpp"
#include "engine/openings/outlets.hpp"
#include "engine/particles/particles.hpp"
#include "engine/run/census.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

/// Simulation has one; it says when there is a rebuild, with which newborn grains come in and those that have left go.
class Population {
 public:
  /// The scene must be there as long as this is. `dt` [s] of a step.
  Population(const Scene& scene, const World& world, double dt);

  // Births.

  /// Those of the start. Each rank gives birth to its share; the first rebuild hands them over to those that they belong to. Throws
  /// SceneError where the scene cannot be filled. All ranks.
  void bear_first(Particles& particles, int n_threads);
  /// True where inlets may give birth before this step. The same on all ranks.
  bool is_birth_due(std::uint64_t step) const { return !inlets_.empty() && inlets_.is_due(step); }
  /// What inlets owe and find room for before this step, of all ranks. All ranks.
  std::vector<Newborn> bear(std::uint64_t step, const Surroundings& around);
  /// Those of them that belong to this rank, for the rebuild with which they come in; counted when they do.
  Births births_of(const std::vector<Newborn>& born, const Subdomains& subdomains, Particles& particles);
  /// Of inlets: what a user should know, once.
  std::vector<std::string> take_notes() { return inlets_.take_notes(); }

  // The ways of grains in a step.

  /// What grains have come to in the step from `begin` to `end` [s].
  struct Crossing {
    Particles& particles;
    Contacts& contacts;
    double begin = 0.0, end = 0.0;  // [s]
    int n_threads = 1;
  };
  /// Grains `outside` the domain, and those inside that an outlet takes, in order of gid: wrapped, or gone through an outlet. Whoever has left is
  /// set to NaN, loses its contacts' memory, and is removed by the next rebuild. The first that is neither, or -1: the others after it stay
  /// where they are.
  std::int32_t cross_faces(std::vector<std::int32_t> outside, const Crossing& step);
  void note_rebuild() { n_left_at_rebuild_ = census_.n_left(); }

  // Counts.

  /// Of all ranks; those that have left as they were when all last counted, or alone, now.
  std::uint64_t n_born() const { return n_born_; }
  std::uint64_t n_left() const { return n_left_; }
  /// Grains that have left this rank since the rebuild: they still have a place in the arrays.
  std::uint64_t n_away() const { return census_.n_left() - n_left_at_rebuild_; }
  /// All ranks.
  void count();
  /// What all ranks have counted, with the energy that springs took along. All ranks.
  CensusTaker total(const Contacts& contacts) const;
  const Inlets& inlets() const { return inlets_; }

  /// To and from the accumulators of a checkpoint; `particles`: those of this rank that came with it. All ranks.
  void keep(const Contacts& contacts, std::map<std::string, std::vector<double>>& accumulators);
  void restore(const std::map<std::string, std::vector<double>>& accumulators, const Particles& particles);
  /// For the state hash; the same on all ranks.
  std::vector<double> hashed() const { return inlets_.hashed(); }

 private:
  int outlet_of(const Crossing& step, std::int32_t i) const;
  std::vector<std::int32_t> leavers_inside(const Crossing& step) const;
  void wrap(const Crossing& step, std::int32_t i) const;
  void remove(const Crossing& step, std::int32_t i, std::size_t outlet);
  double energy_of(const Particles& particles, std::int32_t i) const;

  const Scene& scene_;
  World world_;
  double dt_;  // [s]
  Outlets outlets_;
  Inlets inlets_;
  CensusTaker census_;                   // of this rank
  std::uint64_t n_left_at_rebuild_ = 0;  // of this rank
  std::uint64_t n_born_ = 0;             // of all ranks, always: the next gid
  std::uint64_t n_left_ = 0;             // of all ranks, when they last counted
};

}  // namespace moraine
