// What a scene will be run with, decided before anything is built.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/scene/scene.hpp"

namespace moraine {

/// One thing that bounds the automatic time step.
struct StepLimit {
  std::string words;  // "steps in the shortest contact, grain (d 0.004 m) with grain (d 0.004 m)"
  double step = 0.0;  // [s] at most
};

/// What limits the time step.
struct StepChoice {
  double step = 0.0;               // [s] the step that will be used
  double automatic = 0.0;          // [s] the step that "auto" chooses
  double contact_time = 0.0;       // [s] duration of the limiting contact
  std::string limit;               // the limiting contact, in words
  std::vector<StepLimit> limits;   // all, the one that binds first
  double speed = 0.0;              // [m/s] the fastest approach that was foreseen
  double steps_per_contact = 0.0;  // [-] with `step`
};

/// What a scene will be run with; shown by `moraine check`.
struct Plan {
  StepChoice time_step;
  std::uint64_t gas_steps = 0;  // grain steps in a gas step; 0: no gas
  std::uint64_t n_steps = 0;
  std::uint64_t n_grains = 0;
  double mean_diameter = 0.0;       // [m] of the grains
  double skin = 0.0;                // [m]
  double memory = 0.0;              // [bytes] estimate
  double seconds = 0.0;             // [s] estimate of the time to run
  std::vector<std::string> chosen;  // kernels, in words
  std::vector<std::string> left_out;
  std::vector<std::string> warnings;
};

/// A fast grain may move this part of the smallest radius in an automatic step. At 0.2 a run stops.
inline constexpr double foreseen_travel = 0.05;

/// The plan of a scene for one machine, without running it.
Plan make_plan(const Scene& scene, int n_threads);
/// The time step of a scene and what limits it.
StepChoice choose_time_step(const Scene& scene);
/// The gas step: as the scene says, or so that the fastest boundary crosses a cell, and no grain has relaxed by a tenth [s].
double choose_gas_step(const Scene& scene);
/// The fastest approach to expect [m/s]: as the scene says, or from its initial velocities and the height of its domain.
double expected_speed(const Scene& scene);
/// True where all grains have one size and one material, so that a contact need not look up which they are.
bool are_grains_alike(const Scene& scene);
/// Mean diameter of the grains [m], those of the start where there are any; 0 where there are none.
double mean_diameter(const Scene& scene);

}  // namespace moraine
