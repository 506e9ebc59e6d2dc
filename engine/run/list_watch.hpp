// How long the pair list is good: how wide its skin is, how far grains have come since it was made, and when ranks look at that
// together (README.md, "How long a list is good"). Nothing of it reaches the results.
#pragma once

#include <algorithm>
#include <cstdint>

#include "engine/contacts/contacts.hpp"
#include "engine/particles/particles.hpp"
#include "engine/run/plan.hpp"
#include "engine/run/stopwatch.hpp"
#include "engine/scene/scene.hpp"
#include "engine/walls/walls.hpp"

namespace moraine {

/// What it must see of the run in a step.
struct ListView {
  Contacts& contacts;
  const Particles& particles;
  const Walls& walls;
  Stopwatch& stopwatch;
  std::uint64_t step = 0;
  double time = 0.0;       // [s]
  double max_speed = 0.0;  // [m/s] of this rank's grains in the last step
  double used_room = 0.0;  // [-] the largest share of a grain's room (Rooms) after the last step; only alone
  int n_threads = 1;
};

/// What all ranks know when they look, the largest of each.
struct Look {
  double travelled = 0.0;       // [m] ListWatch::measure()
  double max_speed = 0.0;       // [m/s] of a grain in the last step
  double push = 0.0;            // [m/s2] of a grain, by gas and others
  double furthest_ahead = 0.0;  // [steps] they look again by then
};

/// Simulation asks it in every step whether to rebuild the list, and tells it what has become of the list and of the grains. No rank asks
/// another here: what all must know for a look, Simulation brings together.
class ListWatch {
 public:
  ListWatch() = default;
  /// A list is still to be built, in this step. `range` [m]: the gap beyond which no grains attract each other. Throws SceneError where a
  /// periodic direction leaves a grain no room beside its own image.
  ListWatch(const Scene& scene, const Plan& plan, const GrainKind& kind, double range, bool is_alone,
            std::uint64_t step);

  /// No skin becomes wider than that, but the one that it is built with [m].
  void bound_skin(double widest) { widest_ = std::max(skin_, std::min(widest_, widest)); }
  double skin() const { return skin_; }  // [m] of the list; of the next one from begin_rebuild() on
  ListWidth width() const;
  /// No two grains of this rank have come nearer to each other than by twice this since the rebuild, as Travelled::of_pairs() [m]; alone the
  /// share of its room that any has used, of half the skin.
  double travelled() const { return travelled_; }
  std::uint64_t n_rebuilds() const { return n_rebuilds_; }
  std::uint64_t n_wall_searches() const { return n_wall_searches_; }
  std::uint64_t n_looks() const { return n_looks_; }
  std::uint64_t n_early_looks() const { return n_early_looks_; }

  // Is it good still? In this order; the first says more than the others.

  /// True where a wall has appeared or vanished since the rebuild.
  bool has_wall_changed(double time) const { return time >= next_wall_change_; }
  /// True where it must be rebuilt, however little has moved.
  bool is_old(double time) const { return is_old_ || has_wall_changed(time); }
  /// Alone: true where grains may meet that are not in it.
  bool is_used_up() const { return travelled_ > allowed_travel(); }
  /// Several ranks: true in the step in which all look, and then agree().
  bool is_look_due(const ListView& now);
  /// In others: calls for an early look where there is need of one. False where grains may have met unseen.
  bool foresee(const ListView& now);
  /// Where the list is good: true where walls must be looked for anew.
  bool must_search_walls(const ListView& now);

  /// Puts the true way of this rank's grains in the place of the bounds, which add up the fastest grain of every step; travelled().
  double measure(const ListView& now);
  /// All ranks have looked, and agree: to rebuild now (true), or when to look again.
  bool agree(const ListView& now, const Look& look);
  /// All ranks look at that step, whatever they have agreed on before.
  void look_at(std::uint64_t when, const ListView& now);

  // What has become of it.

  /// It must be rebuilt.
  void set_old() { is_old_ = true; }
  /// Chooses the skin of the next one.
  void begin_rebuild();
  void note_rebuild(const ListView& now);
  void note_wall_search();
  /// Grains have been advanced by a step. False where two of different ranks may have met unseen.
  bool note_step(const ListView& now);
  /// Space has been divided such that news takes so many steps from any rank to all others.
  void set_hops(int n_hops) { n_hops_ = n_hops; }
  int n_hops() const { return n_hops_; }

 private:
  double allowed_travel() const { return 0.5 * skin_ * (1.0 - 1e-9); }  // [m]
  /// How much nearer walls may come by themselves before they must be looked for anew, and how far grains may go [m]
  /// (WallContacts has room for both).
  double allowed_wander() const { return 0.5 * width().wall_skin * (1.0 - 1e-9); }
  double allowed_travel_to_walls() const { return width().wall_skin * (1.0 - 1e-9); }
  bool is_rebuild_better(double n_steps) const;
  void tell(const ListView& now) const;
  Travelled measure_all(const ListView& now);

  // Of the scene.
  double dt_ = 0.0;             // [s]
  double mean_diameter_ = 0.0;  // [m] as the plan has it
  double widest_ = 0.0;         // [m] that a skin may become ...
  double room_ = 0.0;           // [m] ... and that keeps a grain apart from its own image
  bool is_skin_given_ = false;  // it stays as it is
  double speed_gain_ = 1.0;     // [-]
  double gravity_ = 0.0;        // [m/s2]
  double wall_speed_ = 0.0;     // [m/s] no wall ever moves faster
  bool is_alone_ = true;

  double skin_ = 0.0;                 // [m]
  double wanted_skin_ = 0.0;          // [m] of the next list, by the motion at the rebuild; zero: not known
  bool is_old_ = true;                // it must be rebuilt, however little has moved
  double travelled_ = 0.0;            // [m] since the rebuild
  double travelled_to_walls_ = 0.0;   // [m] none has come further since the last search for walls
  bool are_walls_of_rebuild_ = true;  // no search since the rebuild
  double next_wall_change_ = 0.0;     // [s]
  std::uint64_t n_rebuilds_ = 0, n_wall_searches_ = 0, steps_since_rebuild_ = 0;

  // Several ranks: when they look next at how far all have come.
  std::uint64_t next_look_ = 0, last_surprise_ = 0;  // [steps]
  std::uint64_t agreed_look_ = 0;                    // when they last looked; a rank in need calls for it earlier
  std::uint64_t n_looks_ = 0, n_early_looks_ = 0;
  int n_hops_ = 0;               // steps that news takes from any rank to all others
  double fastest_nearby_ = 0.0;  // [m/s] grain or wall of this rank and its neighbours
  double speed_gained_ = 0.0;    // [m/s] by the fastest in the last step
  double pull_ = 0.0;  // [m/s2] largest acceleration of a grain by gravity, gas and others, when they last looked
};

}  // namespace moraine
