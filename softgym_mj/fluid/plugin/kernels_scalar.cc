// Portable kernels.

#include "kernels_impl.h"

namespace softgym_mj {
const Kernels kScalarKernels = kLoops;
}  // namespace softgym_mj
