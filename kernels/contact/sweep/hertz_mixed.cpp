// The combinations of the hertz normal law in mixed precision, for every instruction set that is dispatched to.
#include "kernels/contact/sweep/choice.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/contact/sweep/hertz_mixed.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include "kernels/contact/sweep/sweeps-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace moraine {
namespace HWY_NAMESPACE {

ContactKernels choose_hertz_mixed(const LawChoice& choice) { return choose_hertz_law<float>(choice); }

}  // namespace HWY_NAMESPACE
}  // namespace moraine
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace moraine {
HWY_EXPORT(choose_hertz_mixed);
ContactKernels hertz_mixed_kernels(const LawChoice& choice) { return HWY_DYNAMIC_DISPATCH(choose_hertz_mixed)(choice); }
}  // namespace moraine
#endif
