#include "engine/run/wall_drivers.hpp"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "comm/totals.hpp"

namespace moraine {

namespace {

/// What a checkpoint keeps of a wall under that name; `without`: how the scene differs that it is of where it holds no such thing.
const std::vector<double>& kept_of_wall(const std::map<std::string, std::vector<double>>& accumulators,
                                        const std::string& name, std::size_t size, const std::string& without) {
  const auto found = accumulators.find(name);
  if (found == accumulators.end() || found->second.size() != size)
    throw SceneError({{"wall", "the checkpoint holds no \"" + name + "\"; it is of a scene " + without, false}});
  return found->second;
}

}  // namespace

WallDrivers::WallDrivers(const Scene& scene, Walls& walls, double dt)
    : scene_(scene), walls_(walls), dt_(dt), scripts_(walls.scripted_walls().size()) {}

const WallDefinition& WallDrivers::scripted(std::size_t number) const {
  return scene_.walls[static_cast<std::size_t>(walls_.scripted_walls()[number])];
}

/// Under which a checkpoint keeps the state of a servo.
std::string WallDrivers::servo_name(std::size_t number) const {
  return "servo_" + scene_.walls[static_cast<std::size_t>(walls_.servo_walls()[number])].name;
}

std::string WallDrivers::script_name(std::size_t number) const { return "script_" + scripted(number).name; }

void WallDrivers::set_script(const std::string& wall, WallFunction function, std::uint64_t every) {
  if (!function || every == 0)
    throw std::invalid_argument("a wall's motion needs a function, and at least 1 step between its calls");
  std::string names;
  for (std::size_t k = 0; k < scripts_.size(); ++k) {
    const std::string& name = scripted(k).name;
    if (name == wall) {
      scripts_[k] = {std::move(function), every};
      return;
    }
    names += (k == 0 ? "" : ", ") + name;
  }
  throw std::invalid_argument("no wall \"" + wall + "\" is moved by a script in this scene (" +
                              (names.empty() ? "none is" : "there are: " + names) +
                              "); its motion must be { type = \"script\", max_speed = ... }");
}

/// What is wrong with the motion that a script gives a wall; empty where nothing is.
std::string WallDrivers::fault_of(std::size_t number, const WallRates& rates) const {
  const double limit = scripted(number).motion.front().max_speed, fastest = walls_.fastest_in_domain(number, rates);
  if (!std::isfinite(squared_length(rates.velocity)) || !std::isfinite(squared_length(rates.spin)))
    return "a velocity that is not finite";
  if (scene_.domain.dimensions == 2 && (rates.velocity.z != 0.0 || rates.spin.x != 0.0 || rates.spin.y != 0.0))
    return "a motion that leaves the plane of two dimensions";
  if (fastest > limit)
    return "a motion that moves a point of it in the domain with " + std::to_string(fastest) +
           " m/s, more than the max_speed = " + std::to_string(limit) + " m/s that the scene allows,";
  return {};
}

/// They are asked for the middle of the time until they are asked again, so that the path is of the second order in it.
void WallDrivers::ask_scripts(std::uint64_t step) {
  for (std::size_t k = 0; k < scripts_.size(); ++k) {
    if (!scripts_[k].function)
      throw RunError("wall \"" + scripted(k).name +
                     "\" is to be moved by a script, and none has said how: give its function before the first step "
                     "(Simulation.set_wall_motion in Python), after a restart as well");
    if (step % scripts_[k].every != 0) {
      const ScriptState& held = walls_.script_states()[k];
      walls_.give_rates(k, {held.velocity, held.spin}, false);
      continue;
    }
    const double middle = (static_cast<double>(step) + 0.5 * static_cast<double>(scripts_[k].every)) * dt_;
    const WallRates rates = scripts_[k].function(middle);
    if (const std::string fault = fault_of(k, rates); !fault.empty())
      throw RunError("wall \"" + scripted(k).name + "\" is given " + fault + " by its script at time " +
                     std::to_string(middle) + " s");
    walls_.give_rates(k, rates, step == 0);
  }
}

void WallDrivers::advance(const World& world, std::span<const ExactSum> pushes) {
  if (!walls_.servo_walls().empty()) {
    std::vector<ExactSum> all(pushes.begin(), pushes.end());
    total(world, all);
    for (std::size_t k = 0; k < all.size(); ++k) {
      ServoState& state = walls_.servo_states()[k];
      state.speed = next_speed(walls_.servo(k), state.speed, all[k].value(), dt_);
      state.place += dt_ * state.speed;
    }
  }
  walls_.advance_scripts(dt_);
}

void WallDrivers::compare_scripts(const World& world) const {
  if (scripts_.empty()) return;
  std::vector<double> most;
  for (const ScriptState& script : walls_.script_states())
    for (const double number : numbers_of(script)) most.insert(most.end(), {number, -number});
  world.max(most);
  for (std::size_t k = 0; k < most.size(); k += 2)
    if (most[k] != -most[k + 1])
      throw RunError("wall \"" + scripted(k / (2 * n_script_numbers)).name +
                     "\" is moved differently by the scripts of the ranks: its function must depend on the time alone");
}

std::vector<double> WallDrivers::hashed() const {
  std::vector<double> all;
  for (const ServoState& servo : walls_.servo_states()) all.insert(all.end(), {servo.place, servo.speed});
  for (const ScriptState& script : walls_.script_states()) {
    const std::vector<double> numbers = numbers_of(script);
    all.insert(all.end(), numbers.begin(), numbers.end());
  }
  return all;
}

void WallDrivers::keep(std::map<std::string, std::vector<double>>& accumulators) const {
  for (std::size_t k = 0; k < walls_.servo_states().size(); ++k)
    accumulators[servo_name(k)] = {walls_.servo_states()[k].place, walls_.servo_states()[k].speed};
  for (std::size_t k = 0; k < scripts_.size(); ++k)
    accumulators[script_name(k)] = numbers_of(walls_.script_states()[k]);
}

void WallDrivers::restore(const std::map<std::string, std::vector<double>>& accumulators) {
  for (std::size_t k = 0; k < walls_.servo_states().size(); ++k) {
    const std::vector<double>& kept = kept_of_wall(accumulators, servo_name(k), 2, "without this servo");
    walls_.servo_states()[k] = {kept[0], kept[1]};
  }
  for (std::size_t k = 0; k < scripts_.size(); ++k) {
    ScriptState& state = walls_.script_states()[k];
    state = script_state_of(state.origin,
                            kept_of_wall(accumulators, script_name(k), n_script_numbers, "whose wall no script moves"));
  }
}

}  // namespace moraine
