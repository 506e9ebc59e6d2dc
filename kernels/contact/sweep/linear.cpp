// The combinations of the linear normal law, for every instruction set that is dispatched to.
#include "kernels/contact/sweep/choice.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/contact/sweep/linear.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include "kernels/contact/sweep/sweeps-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace moraine {
namespace HWY_NAMESPACE {

ContactKernels choose_linear(const LawChoice& choice) { return choose_linear_law<double>(choice); }

}  // namespace HWY_NAMESPACE
}  // namespace moraine
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace moraine {
HWY_EXPORT(choose_linear);
ContactKernels linear_kernels(const LawChoice& choice) { return HWY_DYNAMIC_DISPATCH(choose_linear)(choice); }
}  // namespace moraine
#endif
