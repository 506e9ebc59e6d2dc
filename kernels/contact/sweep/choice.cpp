#include "kernels/contact/sweep/choice.hpp"

#include <hwy/targets.h>

namespace moraine {

bool is_listed(const LawChoice& choice) {
  if (!choice.has_further())
    return !(choice.normal == NormalLaw::linear && choice.tangential == TangentialLaw::mindlin);
  if (choice.rolling != RollingLaw::none && !choice.has_rotation) return false;
  if (choice.normal == NormalLaw::linear)
    return choice.tangential == TangentialLaw::spring && choice.cohesion != CohesionLaw::jkr;
  return choice.tangential == TangentialLaw::mindlin;
}

ContactKernels contact_kernels(const LawChoice& choice) {
  if (!is_listed(choice)) return {};
  if (choice.has_further()) return further_kernels(choice);
  return choice.normal == NormalLaw::linear ? linear_kernels(choice) : hertz_kernels(choice);
}

const char* instruction_set() {
  const auto best = hwy::SupportedTargets() & (HWY_TARGETS);
  return hwy::TargetName(best & -best);
}

}  // namespace moraine
