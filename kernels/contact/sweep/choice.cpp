#include "kernels/contact/sweep/choice.hpp"

#include <hwy/targets.h>

namespace moraine {

bool is_listed(NormalLaw normal, TangentialLaw tangential) {
  return !(normal == NormalLaw::linear && tangential == TangentialLaw::mindlin);
}

ContactKernels contact_kernels(const LawChoice& choice) {
  if (!is_listed(choice.normal, choice.tangential)) return {};
  return choice.normal == NormalLaw::linear ? linear_kernels(choice) : hertz_kernels(choice);
}

const char* instruction_set() {
  const auto best = hwy::SupportedTargets() & (HWY_TARGETS);
  return hwy::TargetName(best & -best);
}

}  // namespace moraine
