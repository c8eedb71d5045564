// Portable kernels.

#include "kernels_impl.h"

namespace softgym_mj {
const Kernels kPortableKernels = kLoops;
}  // namespace softgym_mj
