// The walls of a scene as surfaces, and which grains are near them.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/scene/scene.hpp"
#include "engine/walls/mesh_report.hpp"
#include "engine/walls/mesh_surface.hpp"
#include "engine/walls/motion.hpp"
#include "kernels/base/box.hpp"
#include "kernels/search/surface.hpp"

namespace moraine {

/// A grain near a surface: it may touch it before the next rebuild.
struct WallCandidate {
  std::int32_t grain = 0;  // local index
  std::int32_t surface = 0;
  std::int32_t triangles = 0;  // mesh: first entry in WallCandidates::triangles
  std::int32_t n_triangles = 0;
};

/// Candidates in order of (grain, surface), triangles of each in ascending order.
struct WallCandidates {
  std::vector<WallCandidate> list;
  std::vector<std::int32_t> triangles;
};

class Walls {
 public:
  /// Builds the surfaces of all walls of the scene, in its order; a box is six planes (x low, x high, y low ...). Degenerate
  /// and duplicate triangles of meshes are left out. Throws SceneError with every shape that cannot be used.
  explicit Walls(const Scene& scene);

  /// Analytic surfaces are where they are now; a mesh stays at home, and grains are seen from there (pose()).
  std::span<const Surface> surfaces() const { return surfaces_; }
  MeshView mesh(std::int32_t index) const;
  std::int32_t n_triangles(std::int32_t mesh) const { return meshes_[static_cast<std::size_t>(mesh)].n_triangles(); }
  /// What was found in the mesh of each mesh wall, in order of the walls; open edges (a hopper's two rims) are no error.
  const std::vector<MeshReport>& reports() const { return reports_; }
  /// True where the wall of the surface exists at that time [s].
  bool is_active(std::int32_t surface, double time) const;
  /// The next time after `time` at which a wall appears or vanishes [s]; infinity where there is none.
  double next_change(double time) const;
  /// Area of the part of a wall, at home, inside `clip` [m2], whose faces belong to it.
  double area(std::int32_t wall, const Box& clip) const;
  /// The part of the bounding box of a wall, at home, inside `domain` [m]; Box::empty() where nothing of it is inside.
  Box extent(std::int32_t wall, const Box& domain) const;

  // Moving walls. They begin at home; whoever runs a scene moves them to its time.

  bool is_any_moving() const { return is_any_moving_; }
  bool is_moving(std::int32_t surface) const { return movers_[wall_of(surface)].is_moving; }
  /// Moves all walls to a time; `dt` [s]: the velocities that contacts see are those half a step before, as those of the grains are
  /// (at time 0, of that time).
  void move_to(double time, double dt);
  const Pose& pose(std::int32_t surface) const { return movers_[wall_of(surface)].pose; }
  const Pose& wall_pose(std::int32_t wall) const { return movers_[static_cast<std::size_t>(wall)].pose; }
  /// As contacts see it: half a step late.
  const WallVelocity& velocity(std::int32_t surface) const { return movers_[wall_of(surface)].late; }
  /// At the time of the pose.
  const WallVelocity& velocity_now(std::int32_t surface) const { return movers_[wall_of(surface)].now; }
  /// No surface has come nearer to any place in the domain by more than this since mark() [m], as a shape: a cylinder that turns about
  /// its own axis stays where it is.
  double wander() const;
  /// The same since the last move_to().
  double last_wander() const;
  void mark();

  // Servos, in order of the walls that have one.

  std::span<const std::int32_t> servo_walls() const { return servo_walls_; }
  const WallMotion& servo(std::size_t number) const;
  std::span<ServoState> servo_states() { return servo_states_; }
  std::span<const ServoState> servo_states() const { return servo_states_; }
  /// Number of the servo of a surface's wall, or -1.
  int servo_of(std::int32_t surface) const { return movers_[wall_of(surface)].servo; }

  // Walls that a script moves, in their order.

  std::span<const std::int32_t> scripted_walls() const { return scripted_walls_; }
  std::span<ScriptState> script_states() { return script_states_; }
  std::span<const ScriptState> script_states() const { return script_states_; }
  /// What the wall does from now on; `is_start`: nothing has moved yet, and contacts see this velocity at once.
  void give_rates(std::size_t number, const WallRates& rates, bool is_start);
  /// By a step of `dt` [s]; move_to() brings the walls there.
  void advance_scripts(double dt);
  /// The speed of the wall's fastest point in the domain, at those rates [m/s].
  double fastest_in_domain(std::size_t number, const WallRates& rates) const;

  /// Appends to `found` the candidates of grains [begin, end) among active surfaces: those nearer than radius + reach.
  /// `records`: position and radius are the first four doubles of each grain's record of `stride` doubles.
  /// Thread-safe: each thread may search its own range into its own list.
  void find_candidates(const double* records, std::int64_t stride, std::int32_t begin, std::int32_t end, double reach,
                       double time, WallCandidates& found) const;

 private:
  void find_candidates_of(std::int32_t grain, const double* record, std::span<const std::int32_t> surfaces,
                          double reach, WallCandidates& found) const;

  class Builder;
  struct Mover {
    std::vector<WallMotion> motions;
    bool is_moving = false;
    int servo = -1, script = -1;  // its number among those, or none
    Pose pose, before, marked;    // now, before the last move, when marked
    WallVelocity now, late;
  };
  std::size_t wall_of(std::int32_t surface) const {
    return static_cast<std::size_t>(surfaces_[static_cast<std::size_t>(surface)].wall);
  }
  double distance_come(std::size_t surface, const Pose& from, const Pose& to) const;

  std::vector<Surface> surfaces_;  // as they are now
  std::vector<Surface> home_;      // as the scene describes them
  std::vector<Mover> movers_;      // of each wall
  bool is_any_moving_ = false;
  std::vector<std::int32_t> servo_walls_;
  std::vector<ServoState> servo_states_;
  std::vector<std::int32_t> scripted_walls_;
  std::vector<ScriptState> script_states_;
  Box domain_;
  std::vector<double> from_, until_;        // [s] of each surface
  std::vector<std::optional<Box>> bounds_;  // of each surface: that of its wall, where the shape is a box
  std::vector<MeshSurface> meshes_;
  std::vector<MeshReport> reports_;
};

}  // namespace moraine
