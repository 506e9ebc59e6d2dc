#include "kernels/contact/sweep/choice.hpp"

#include <hwy/targets.h>

#include <cmath>
#include <string_view>

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
  if (choice.is_mixed) {
    if (choice.has_further()) return further_mixed_kernels(choice);
    return choice.normal == NormalLaw::linear ? linear_mixed_kernels(choice) : hertz_mixed_kernels(choice);
  }
  if (choice.has_further()) return further_kernels(choice);
  return choice.normal == NormalLaw::linear ? linear_kernels(choice) : hertz_kernels(choice);
}

LawTable in_units_of_mass(const LawTable& table, double unit) {
  using enum Parameter;
  LawTable scaled = table;
  for (const Parameter p :
       {normal_stiffness, young, shear, tangential_stiffness, viscosity, rolling_stiffness, cohesion})
    for (double& value : scaled.columns[static_cast<std::size_t>(p)]) value /= unit;
  return scaled;
}

double mass_unit_for(double mass) {
  return mass > 0.0 && std::isfinite(mass) ? std::ldexp(1.0, 2 * (std::ilogb(mass) / 2)) : 1.0;
}

const char* instruction_set() {
  const auto best = hwy::SupportedTargets() & (HWY_TARGETS);
  return hwy::TargetName(best & -best);
}

int lanes_of_instruction_set(bool is_mixed) {
  const int n_doubles = std::string_view(instruction_set()).substr(0, 4) == "AVX3" ? 8 : 4;
  return is_mixed ? 2 * n_doubles : n_doubles;
}

}  // namespace moraine
