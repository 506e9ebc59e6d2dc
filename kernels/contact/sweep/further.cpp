// Rolling resistance and cohesion, for every instruction set that is dispatched to. Which of these laws a scene has is asked once a
// group of contacts: one compiled function for all of them, as they cost far more than the question.
#include "kernels/contact/sweep/choice.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/contact/sweep/further.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include "kernels/contact/sweep/sweeps-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace moraine {
namespace HWY_NAMESPACE {

ContactKernels choose_further(const LawChoice& choice) { return choose_further_law<double>(choice); }

}  // namespace HWY_NAMESPACE
}  // namespace moraine
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace moraine {
HWY_EXPORT(choose_further);
ContactKernels further_kernels(const LawChoice& choice) { return HWY_DYNAMIC_DISPATCH(choose_further)(choice); }
}  // namespace moraine
#endif
