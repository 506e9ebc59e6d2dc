// The families of compiled kernels; callers use contact_kernels() in kernels/contact/sweep.hpp.
#pragma once

#include "kernels/contact/sweep.hpp"

namespace moraine {
ContactKernels linear_kernels(const LawChoice& choice);
ContactKernels linear_mixed_kernels(const LawChoice& choice);
ContactKernels hertz_kernels(const LawChoice& choice);
ContactKernels hertz_mixed_kernels(const LawChoice& choice);
/// Rolling resistance and cohesion.
ContactKernels further_kernels(const LawChoice& choice);
ContactKernels further_mixed_kernels(const LawChoice& choice);
}  // namespace moraine
