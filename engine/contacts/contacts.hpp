// All contacts of a rank: finding them, keeping what they remember, and advancing the grains by their forces.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "comm/subdomains.hpp"
#include "comm/world.hpp"
#include "engine/contacts/cells.hpp"
#include "engine/contacts/ghosts.hpp"
#include "engine/contacts/law_table.hpp"
#include "engine/contacts/pair_list.hpp"
#include "engine/contacts/rooms.hpp"
#include "engine/contacts/size_classes.hpp"
#include "engine/contacts/travel.hpp"
#include "engine/contacts/wall_contacts.hpp"
#include "engine/particles/particles.hpp"
#include "engine/scene/scene.hpp"
#include "engine/walls/walls.hpp"
#include "kernels/contact/reference/reference.hpp"
#include "kernels/contact/sweep.hpp"
#include "kernels/motion/motion.hpp"

namespace moraine {

/// What one step found, for those who decide about the next.
struct StepResult {
  std::int64_t n_touching = 0;  // pairs and wall touches
  bool has_large_overlap = false;
  bool is_any_not_finite = false;
  double max_speed = 0.0;             // [m/s] upper bound
  double used_room = 0.0;             // [-] the largest share, see Rooms; only alone
  std::vector<std::int32_t> outside;  // grains whose centre is outside the domain, ascending
};

/// What the grains of a scene have in common.
struct GrainKind {
  bool is_uniform = true;             // one radius, one mass, one material
  double inverse_mass = 0.0;          // [1/kg] of all, where uniform
  double largest_mass = 0.0;          // [kg]
  double mass_ratio = 1.0;            // largest over smallest
  double smallest_radius = infinity;  // [m]
  double largest_radius = 0.0;        // [m]
  SizeClasses sizes;
};

/// A contact with all that the reference law makes of it, for the ledger, probes and messages.
struct ContactReport {
  std::int32_t grain = 0;       // of a pair that with the lower gid; either may be a ghost
  std::int32_t other = -1;      // the other grain, or -1
  bool is_ours = true;          // false: a border contact that another rank counts, the owner of `grain`
  std::int32_t surface = -1;    // the surface, or -1
  bool is_mirror = false;       // the surface is a mirror
  double overlap = 0.0;         // [m] below zero: a gap
  double smaller_radius = 0.0;  // [m]
  Vec3 point;                   // [m] where they touch (at `grain`'s side of periodic faces)
  Vec3 normal;                  // from the other to `grain`
  Vec3 other_point;             // [m] centre of the other grain
  Vec3 wall_velocity;           // [m/s] of a wall where it is touched, at the present positions
  double stored = 0.0;          // [J] in the tangential spring before the step
  ReferenceForce result;        // on `grain` as a
};

/// Grains that come in at a rebuild: how many on this rank, and what puts them into storage from a place on.
struct Births {
  std::int32_t n = 0;
  std::function<void(std::int32_t first)> put = {};
};

class Contacts {
 public:
  Contacts(const Scene& scene, const Walls& walls, const GrainKind& kind, const World& world);

  /// Where grains belong from the next rebuild on.
  void set_subdomains(Subdomains subdomains) { subdomains_ = std::move(subdomains); }
  const Subdomains& subdomains() const { return subdomains_; }

  /// Forgets where grains were near each other and looks again: removes grains that have left, hands over those that belong to other
  /// ranks, sorts the others, makes ghosts, finds pairs and wall candidates, and carries over what contacts remember. All ranks.
  /// Newborn grains come in, on whatever rank.
  void rebuild(Particles& particles, const ListWidth& width, double time, int n_threads, const Births& births = {});
  /// As rebuild, with the memory of a checkpoint, by place; pairs must stand at both their grains where these may part. All ranks.
  void restore(Particles& particles, PairCarry pairs, WallCarry walls, const ListWidth& width, double time,
               int n_threads);

  /// Gives the memory of the list back, to make room for something else. Until the next rebuild nothing may ask for contacts; what pairs
  /// remember must be given back before it, by present places.
  void set_aside();
  /// Gives back what only steps need; then only what pairs remember may be asked for, until the next rebuild.
  void release_index() {
    pairs_.release_index();
    cells_ = Cells();
    travel_.forget();
    rooms_.forget();
  }
  void give_back(PairCarry pairs) { set_aside_->pairs = std::move(pairs); }
  bool are_set_aside() const { return set_aside_.has_value(); }

  /// Looks anew for the walls that grains may touch, where all are now. Ranks need not do it together.
  void search_walls(const Particles& particles, double skin, double time, int n_threads) {
    wall_contacts_.search(particles, pairs_, skin, time, n_threads);
  }

  /// Makes the ghosts good for the present positions, for those who look at contacts between steps. All ranks.
  void refresh(Particles& particles);

  /// Contact forces at the present positions, then kick and drift of all grains. `result.outside` and the rest are overwritten. Ghosts
  /// are refreshed meanwhile, where they are not. `travelled` [m]: a bound of travelled().of_pairs() with several ranks, alone the share of
  /// its room that any grain has used, of half the skin.
  /// `counted`: the share of this step's work that goes to wall_sums().
  void advance(Particles& particles, const Kick& kick, double dt, double travelled, int n_threads, StepResult& result,
               double counted = 1.0);
  /// Work of moving walls since the start of this process, and pushes on servos in the last step; of this rank.
  const WallSums& wall_sums() const { return wall_sums_; }
  /// What the last advance() has done to the triangles of walls that have a force map, by thread; empty where none has.
  std::span<const std::vector<TriangleForce>> triangle_forces() const { return triangle_forces_; }

  /// Further acceleration of each grain, three doubles, in the place of what the gas gives; nullptr: what the gas gives [m/s2]. It must
  /// be there as long as it is set.
  void set_push(const double* push) { push_ = push; }
  /// Somebody has changed the state of the grains from outside: what other ranks know of them is old. All ranks.
  void grains_changed() { ghosts_.set_fresh(world_.is_alone()); }

  /// From the next step on StepResult tells of overlaps beyond this share of the smaller radius.
  void watch_overlaps_beyond(double share) { max_overlap_ = share; }

  /// Velocities at the present positions: those of the grains, half a step late, after `half_kick` (whose drift is zero) with
  /// the contact forces of now. Leaves grains and memory as they are.
  struct Velocities {
    std::vector<Vec3> linear;   // [m/s] of each grain
    std::vector<Vec3> angular;  // [rad/s]; empty without rotation
  };
  Velocities velocities_now(Particles& particles, const Kick& half_kick, double dt, int n_threads);

  /// Alone: none has come further since the rebuild [m].
  double furthest(const Particles& particles, int n_threads) const { return rooms_.furthest(particles, n_threads); }
  /// As Rooms::wanted_skin() [m].
  double wanted_skin() const { return rooms_.wanted_skin(); }
  /// Several ranks: how far this rank's grains have come since the rebuild, and how much nearer to each other.
  Travelled travelled(const Particles& particles, int n_threads) {
    return sizes_.size() > 1 ? travel_.measure(particles, n_threads)
                             : travel_.measure(particles, cells_, skin_, n_threads);
  }

  /// Grain i has crossed periodic faces (see PairList::shift_images).
  void shift_images(std::int32_t i, const std::array<int, 3>& steps) {
    pairs_.shift_images(i, steps);
    const Vec3 shift = {steps[0] * domain_.size().x, steps[1] * domain_.size().y, steps[2] * domain_.size().z};
    if (world_.is_alone())
      rooms_.follow(i, shift);
    else
      travel_.follow(i, shift);
  }
  /// Grain i has left: its contacts are forgotten, and the energy that their springs held counts as gone.
  void clear_memory(const Particles& particles, std::int32_t i) {
    pairs_.clear_memory(particles, i, energy_left_);
    wall_contacts_.clear_memory(i, energy_left_);
  }
  /// Energy [J] that springs of departed grains have held since the start of this process; the sum over the ranks counts.
  const ExactSum& energy_left() const { return energy_left_; }

  /// Calls f(ContactReport) for every contact at the present positions that has a force, in no particular order: all that touch, and
  /// those that attract each other over a gap (an overlap below zero).
  template <typename Function>
  void for_each_contact(const Particles& particles, double dt, Function f) const {
    for_each_pair_contact(particles, dt, f);
    for_each_wall_contact(particles, dt, f);
  }
  template <typename Function>
  void for_each_pair_contact(const Particles& particles, double dt, Function f) const;
  template <typename Function>
  void for_each_wall_contact(const Particles& particles, double dt, Function f) const;

  /// Calls f(a, b, image, memory) for every pair that remembers something and whose grain of lower gid, a, this rank owns, in no
  /// particular order: so once over all ranks.
  template <typename Function>
  void for_each_memory(const Particles& particles, Function f) const {
    if (!has_history()) return;
    pairs_.for_each(particles.dummy(),
                    [&](std::int32_t a, std::int32_t b, std::uint8_t image, const PairMemory* memory) {
                      if (memory && memory->is_used() && particles.is_owned(a)) f(a, b, image, *memory);
                    });
  }
  WallCarry wall_carry() const { return wall_contacts_.carry(); }
  bool has_history() const { return needs_.memory.has_history; }
  /// Gap beyond which no grains attract each other [m].
  double range() const { return range_; }
  std::int64_t n_pairs() const { return pairs_.size(); }
  const PairList& pairs() const { return pairs_; }
  const Cells& cells() const { return cells_; }
  const Ghosts& ghosts() const { return ghosts_; }
  /// What the next messages to other ranks say of this one.
  void tell(const HaloNews& own) { ghosts_.tell(own); }
  /// Grains that this rank has handed to others since the start.
  std::uint64_t n_migrated() const { return n_migrated_; }
  std::size_t memory() const {
    return pairs_.memory() + wall_contacts_.memory() + cells_.memory() + ghosts_.memory() + travel_.memory() +
           rooms_.memory();
  }
  const LawChoice& choice() const { return choice_; }
  const SceneLaws& laws() const { return laws_; }

 private:
  void build(Particles& particles, PairCarry& pairs, WallCarry& walls, std::span<const std::uint8_t> is_leaving,
             const ListWidth& width, double time, int n_threads);
  void finish_refresh(Particles& particles);
  Box where_none_meets_others(double distance) const;
  double used_room(const Particles& particles, RoomShares measured, double way, int n_threads);
  void take_in(Particles& particles, const Births& births, PairCarry& pairs, std::vector<std::uint8_t>& is_leaving,
               int n_threads) const;
  struct ThreadStep;
  /// How much nearer grains of pairs may have come since the rebuild, as shares of what both may [-].
  struct Approach {
    double own = 0.0, border = 0.0;  // of this rank; with ghosts
  };
  void advance_thread(Particles& particles, const Kick& kick, double dt, double used, const Approach& approach,
                      double counted, int thread, ThreadStep& step);
  ReferenceContact pair_contact(const Particles& particles, std::int32_t a, std::int32_t b, std::uint8_t image,
                                const PairMemory* memory) const;
  ReferenceContact wall_contact(const Particles& particles, const WallContact& contact, double mirror) const;

  Box domain_;
  std::array<bool, 3> periodic_;
  SceneLaws laws_;
  LawChoice choice_;
  ContactKernels kernels_;
  MotionKernel motion_;
  double mass_unit_;  // [kg] with mixed precision, of the tables and of what pairs give
  LawTable pair_table_, wall_table_;
  double uniform_inverse_mass_;
  double largest_radius_;
  SizeClasses sizes_;
  double max_overlap_;
  double range_;
  const Walls* walls_;
  bool measures_walls_;
  PairNeeds needs_;
  std::vector<Vec3> image_shift_;
  World world_;
  Subdomains subdomains_;
  Cells cells_;
  double skin_ = 0.0;   // [m] of the list
  TravelWatch travel_;  // several ranks
  Rooms rooms_;         // alone
  double age_ = 0.0;    // [s] of the list
  // Of the share of its room that any grain has used, in a frame at rest: a bound; where it must be measured anew; whether the next step does so.
  double used_at_rest_ = 0.0, measured_from_ = 1.0;
  bool measures_rooms_ = true;
  Ghosts ghosts_;
  PairList pairs_;
  WallContacts wall_contacts_;
  struct SetAside {
    PairCarry pairs;
    WallCarry walls;
  };
  std::optional<SetAside> set_aside_;
  Approach swept_;                      // in the last step
  std::vector<double> thread_seconds_;  // that each thread has worked on steps since the list was made ...
  std::vector<double> least_seconds_;   // ... and on the shortest of them
  ExactSum energy_left_;
  WallSums wall_sums_;
  std::vector<bool> has_map_;  // of each surface; empty: none has
  std::vector<std::vector<TriangleForce>> triangle_forces_;
  const double* push_ = nullptr;
  std::uint64_t n_migrated_ = 0;
};

template <typename Function>
void Contacts::for_each_pair_contact(const Particles& particles, double dt, Function f) const {
  pairs_.for_each(particles.dummy(), [&](std::int32_t a, std::int32_t b, std::uint8_t image, const PairMemory* memory) {
    const ReferenceContact contact = pair_contact(particles, a, b, image, memory);
    if (!(contact.overlap > -range_)) return;
    const std::size_t species = needs_.has_species
                                    ? laws_.pair_species[static_cast<std::size_t>(
                                          particles.material(a) * laws_.n_materials + particles.material(b))]
                                    : 0;
    ContactReport report;
    report.grain = a;
    report.other = b;
    report.is_ours = particles.is_owned(a);
    report.overlap = contact.overlap;
    report.smaller_radius = std::min(particles.radius(a), particles.radius(b));
    report.normal = contact.normal;
    report.point = particles.position(a) - contact.a.arm * contact.normal;
    report.other_point = particles.position(b);
    report.stored = contact.stored;
    report.result = reference_contact(choice_, laws_.pairs.at(species), contact, dt);
    if (report.result.acts) f(report);
  });
}

template <typename Function>
void Contacts::for_each_wall_contact(const Particles& particles, double dt, Function f) const {
  wall_contacts_.for_each(particles, [&](const WallContact& touch) {
    const Surface& surface = walls_->surfaces()[static_cast<std::size_t>(touch.surface)];
    const double mirror = surface.kind == SurfaceKind::mirror ? 2.0 : 1.0;
    const ReferenceContact contact = wall_contact(particles, touch, mirror);
    const std::size_t species =
        laws_.wall_species[static_cast<std::size_t>(particles.material(touch.grain) * laws_.n_walls + surface.wall)];
    ContactReport report;
    report.grain = touch.grain;
    report.surface = touch.surface;
    report.is_mirror = mirror == 2.0;
    report.overlap = particles.radius(touch.grain) - touch.touch.distance;
    report.smaller_radius = particles.radius(touch.grain);
    report.normal = touch.touch.normal;
    report.point = particles.position(touch.grain) - touch.touch.distance * touch.touch.normal;
    report.other_point = report.point;
    if (walls_->is_moving(touch.surface)) report.wall_velocity = walls_->velocity_now(touch.surface).at(report.point);
    report.stored = contact.stored;
    report.result = reference_contact(choice_, laws_.walls.at(species), contact, dt, mirror);
    if (report.result.acts) f(report);
  });
}

}  // namespace moraine
