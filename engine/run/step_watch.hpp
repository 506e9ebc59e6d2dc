// Whether a run keeps to what its time step was chosen for.
#pragma once

#include <string>
#include <vector>

#include "engine/run/plan.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

/// Keeps the fastest that any grain has been. Where that is faster than foreseen it has something to say; the guard stops
/// what is wrong, this tells what has become less accurate than planned.
class StepWatch {
 public:
  StepWatch() = default;
  /// `smallest_radius` [m] of all grains.
  StepWatch(const Scene& scene, const StepChoice& choice, double smallest_radius);

  /// A speed that some grain has [m/s], at that time [s].
  void see(double speed, double time) {
    if (speed <= fastest_) return;
    fastest_ = speed;
    if (speed > noteworthy_) note(time);
  }
  double fastest() const { return fastest_; }  // [m/s]
  /// How many things there are to say.
  std::size_t n_warnings() const { return found_.size(); }
  /// They, in the order in which they came up, with the numbers of now.
  std::vector<std::string> warnings() const;

 private:
  enum class Kind { fast_for_hertz, far_in_a_step };
  struct Found {
    Kind kind;
    double time;  // [s] when it was first seen
  };
  void note(double time);
  void note(Kind kind, bool is_so, double time);
  std::string text(const Found& found) const;

  std::vector<Found> found_;
  bool is_hertz_ = false;
  double foreseen_ = 0.0;           // [m/s]
  double steps_per_contact_ = 0.0;  // [-] as planned
  double radii_a_step_ = 0.0;       // [s/m] dt over the smallest radius
  double step_ = 0.0;               // [s]
  double noteworthy_ = 1e300;       // [m/s]
  double fastest_ = 0.0;            // [m/s]
};

}  // namespace moraine
