// What moves walls whose motion is not a function of time that the scene has: servos, which go by what grains do to their walls, and
// scripts, which a program gives.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "comm/world.hpp"
#include "engine/run/simulation.hpp"
#include "engine/scene/scene.hpp"
#include "engine/walls/walls.hpp"
#include "kernels/base/exact_sum.hpp"

namespace moraine {

/// Simulation has one, which alone says where servos and scripts of its walls have got to; Walls::move_to() takes the walls there.
class WallDrivers {
 public:
  /// Scene and walls must be there as long as this is. `dt` [s] of a step.
  WallDrivers(const Scene& scene, Walls& walls, double dt);

  /// Simulation::set_wall_motion(), with the same errors.
  void set_script(const std::string& wall, WallFunction function, std::uint64_t every);

  /// Before a step: what scripts say of the motion of walls over the steps until they are asked again. Throws RunError where one has no
  /// function, or gives a motion that its wall may not have.
  void ask_scripts(std::uint64_t step);
  /// After it: servos and scripts go on by a step. `pushes` [N or N m]: what the grains of this rank have done to each servo in it
  /// (WallSums). All ranks.
  void advance(const World& world, std::span<const ExactSum> pushes);
  /// Where ranks were told different motions, their bits part: at rebuilds they look, and throw RunError. All ranks.
  void compare_scripts(const World& world) const;

  /// Servos, then scripts, as numbers for the state hash. The same on all ranks, as is what follows.
  std::vector<double> hashed() const;
  void keep(std::map<std::string, std::vector<double>>& accumulators) const;
  /// From what keep() has kept. Throws SceneError where that is of a scene without these servos and scripts.
  void restore(const std::map<std::string, std::vector<double>>& accumulators);

 private:
  /// What a program says of a wall that it moves, and every how many steps it is asked.
  struct Script {
    WallFunction function;
    std::uint64_t every = 1;
  };
  const WallDefinition& scripted(std::size_t number) const;
  std::string servo_name(std::size_t number) const;
  std::string script_name(std::size_t number) const;
  std::string fault_of(std::size_t number, const WallRates& rates) const;

  const Scene& scene_;
  Walls& walls_;
  double dt_;                    // [s]
  std::vector<Script> scripts_;  // of walls that they move, in the order of these
};

}  // namespace moraine
