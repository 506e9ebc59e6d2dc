#include "engine/run/step_watch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace moraine {

namespace {

constexpr double surprising = 1.2;             // times the speed foreseen
constexpr double far = 2.0 * foreseen_travel;  // half of what stops a run

}  // namespace

StepWatch::StepWatch(const Scene& scene, const StepChoice& choice, double smallest_radius)
    : is_hertz_(scene.contact.normal == NormalLaw::hertz),
      foreseen_(choice.speed),
      steps_per_contact_(choice.steps_per_contact),
      step_(choice.step) {
  if (!(smallest_radius > 0.0)) return;
  radii_a_step_ = choice.step / smallest_radius;
  noteworthy_ = far / radii_a_step_;
  if (is_hertz_) noteworthy_ = std::min(noteworthy_, surprising * foreseen_);
}

void StepWatch::note(Kind kind, bool is_so, double time) {
  const bool is_known = std::any_of(found_.begin(), found_.end(), [&](const Found& f) { return f.kind == kind; });
  if (is_so && !is_known) found_.push_back({kind, time});
}

void StepWatch::note(double time) {
  note(Kind::fast_for_hertz, is_hertz_ && fastest_ > surprising * foreseen_, time);
  note(Kind::far_in_a_step, fastest_ * radii_a_step_ > far, time);
}

std::string StepWatch::text(const Found& found) const {
  if (found.kind == Kind::fast_for_hertz)
    return fmt::format(
        "grains move at up to {:.4g} m/s, faster than the {:.4g} m/s for which the time step was chosen (first at t = "
        "{:.4g} s): such a Hertz contact has {:.1f} steps instead of {:.1f}; set time.max_speed = {:.2g} to choose for "
        "it",
        fastest_, foreseen_, found.time, steps_per_contact_ * std::pow(foreseen_ / fastest_, 0.2), steps_per_contact_,
        1.1 * fastest_);
  const double travel = fastest_ * radii_a_step_;
  return fmt::format(
      "the fastest grain moves {:.3g} of the smallest radius in a step, at {:.4g} m/s (above {:g} since t = {:.4g} s): "
      "its impacts begin that deep, and at 0.2 of its own radius the run stops; time.step = {:.2g} would keep it at "
      "{:g}",
      travel, fastest_, far, found.time, step_ * foreseen_travel / travel, foreseen_travel);
}

std::vector<std::string> StepWatch::warnings() const {
  std::vector<std::string> all;
  for (const Found& found : found_) all.push_back(text(found));
  return all;
}

}  // namespace moraine
